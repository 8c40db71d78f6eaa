#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes every shipped scene: glTF, binary, textures and scene TOML, the same bytes everywhere.

  python3 scenes/generate.py [--out DIR]     write (default: beside this file)
  python3 scenes/generate.py --check         compare; exit code 1 if a file differs or is missing
"""
import argparse
import pathlib
import sys

HERE = pathlib.Path(__file__).resolve().parent
sys.dont_write_bytecode = True
sys.path.insert(0, str(HERE))

from scenelib import analytic, halls, rooms  # noqa: E402

SCENES = {
    "cornell": analytic.cornell,
    "furnace": analytic.furnace,
    "sphere_light": analytic.sphere_light,
    "linear_sky": analytic.linear_sky,
    "sealed_room": rooms.sealed_room,
    "thin_wall": rooms.thin_wall,
    "two_rooms_door": rooms.two_rooms_door,
    "sun_room": rooms.sun_room,
    "corridor_l": rooms.corridor_l,
    "pillar_hall": halls.pillar_hall,
    "acute_corner": halls.acute_corner,
    "mixed_scale": halls.mixed_scale,
}


def generate():
    """{relative path: bytes} of all scenes."""
    return {"%s/%s" % (name, file): data
            for name, build in SCENES.items() for file, data in build().items()}


def check(files, folder):
    """The paths that are missing, differ or belong to no scene, sorted."""
    found = {str(path.relative_to(folder).as_posix()) for name in SCENES
             for path in (folder / name).glob("*") if path.is_file()}
    wrong = found - set(files)
    for path, data in files.items():
        if path not in found or (folder / path).read_bytes() != data:
            wrong.add(path)
    return sorted(wrong)


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=pathlib.Path, default=HERE, metavar="DIR",
                        help="folder to write to or to compare with (default: %(default)s)")
    parser.add_argument("--check", action="store_true", help="compare, write nothing")
    options = parser.parse_args()
    files = generate()
    if options.check:
        wrong = check(files, options.out)
        for path in wrong:
            print("%s: not what scenes/generate.py writes; run it" % path, file=sys.stderr)
        return 1 if wrong else 0
    for path, data in files.items():
        target = options.out / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(data)
    print("%d files, %d bytes" % (len(files), sum(len(data) for data in files.values())))
    return 0


if __name__ == "__main__":
    sys.exit(main())
