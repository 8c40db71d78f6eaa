#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Small renders of the study visibility_terms: for two scenes the path-traced reference, a picture
a set of terms, all at one exposure, and where the whole test is too bright (red) or too dark
(blue). What has been rendered by the same program is kept. Needs matplotlib."""
import argparse
import functools
import hashlib
import json
import pathlib
import subprocess
import sys
import tomllib

from overview import ROOT, scene_name
from whole_output import InputError, first_paragraph, no_matplotlib, object_of, of_system

STUDY = ROOT / "experiments/studies/visibility_terms.toml"
# Scene, camera that looks at its dark side, and exposure in stops: what leaks is seen only where it
# is not taken from a reference that is black.
VIEWS = (("scenes/two_rooms_door/scene.toml", "unlit room", 3),
         ("scenes/thin_wall/scene_05cm.toml", "east", 3))
COLUMNS = 3
WIDTH, HEIGHT = 224, 126
SAMPLES = {"smoke": (16, 4), "quick": (64, 16), "published": (256, 16)}  # reference, render


def terms(study):
    """[(name, options of `render`)] of the axis. What `budget` computes is pictured by rays in place
    of the moments."""
    axis, = (a for a in study["axis"] if a["name"] == "terms")
    return [(v["name"], ["--traced-visibility"] if v.get("command") == "budget" else
             [w for s in v.get("options", {}).get("set", []) for w in ("--set", s)])
            for v in axis["value"]]


def last_of(names):
    """The whole test: the last of the terms that is one."""
    return [n for n, options in names if "--traced-visibility" not in options][-1]


def draw(target, pictures):
    """Rows of pictures with their names above, as PNG and PDF."""
    from figures_panels import PAGE, load_pyplot, save
    pyplot = load_pyplot()
    rows = -(-len(pictures) // COLUMNS)
    figure, panels = pyplot.subplots(rows, COLUMNS, squeeze=False, figsize=(
        PAGE, rows * (PAGE / COLUMNS * HEIGHT / WIDTH + 0.22)))
    for panel in (p for row in panels for p in row):
        panel.set_axis_off()
    for (name, path), panel in zip(pictures, (p for row in panels for p in row)):
        panel.imshow(pyplot.imread(path), interpolation="none")
        panel.set_title(name, fontsize=8, pad=2)
    save(figure, target.parent, target.stem)


@functools.lru_cache
def hash_of(scene):
    """Of all files beside a scene's, which hold its geometry and pictures."""
    content = hashlib.sha256()
    for path in sorted(p for p in scene.parent.rglob("*") if p.is_file()):
        content.update(path.read_bytes())
    return content.hexdigest()


class Pictures:
    def __init__(self, options):
        self.options, self.study = options, tomllib.loads(STUDY.read_text())
        self.version = self.run("info")["version"]

    def run(self, *arguments):
        command = [str(self.options.program), *map(str, arguments), "--json", "--quiet"]
        if arguments[0] != "info":
            command += ["--cache", str(self.options.runs / "cache")]
        if arguments[0] == "render" and self.options.device:
            command += ["--device", self.options.device]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            sys.stderr.write(done.stderr)
            sys.exit(done.returncode if done.returncode > 0 else 1)
        return object_of(done.stdout, f"{self.options.program} {arguments[0]}")

    def kept(self, path, *arguments):
        """Runs what writes `path` and its PNG, unless the same was done before. Returns the device
        that it was done on."""
        note = path.with_suffix(".json")
        what = {"version": self.version, "arguments": [str(a) for a in arguments],
                "scene": hash_of(ROOT / arguments[1]), "asked_device": self.options.device}
        try:
            known = json.loads(note.read_text())
            if path.exists() and path.with_suffix(".png").exists() and (
                    {k: known[k] for k in what} == what):
                return known["device"]
        except (KeyError, OSError, TypeError, ValueError):
            pass
        device = self.run(*arguments, "-o", path)["provenance"].get("device")
        note.write_text(json.dumps({**what, "device": device}) + "\n")
        return device

    def view(self, scene, camera, exposure):
        name, options = scene_name(scene), self.study["options"]
        folder = self.options.runs / name
        folder.mkdir(parents=True, exist_ok=True)
        look = [scene, "--camera", camera, "--width", WIDTH, "--height", HEIGHT, "--exposure",
                exposure]
        spp, render_spp = SAMPLES[self.options.size]
        self.kept(folder / "reference.exr", "reference", *look, "--spp", spp)
        images, names = [], terms(self.study)
        for term, more in names:
            images.append(folder / f"{term}.exr")
            device = self.kept(images[-1], "render", *look, "--spp", render_spp, "--params",
                               options["params"], "--probes", self.options.probes, "--rays",
                               options["rays"], "--updates", options["updates"], *more)
        last = last_of(names)
        self.run("compare", folder / f"{last}.exr", folder / "reference.exr", "-o",
                 folder / "error.png")
        target = self.options.output / f"images_{name}.png"
        draw(target, [("reference", folder / "reference.png"),
                      *((i.stem, i.with_suffix(".png")) for i in images),
                      (f"error of '{last}'", folder / "error.png")])
        caption = (f"{name}, camera '{camera}', {WIDTH} x {HEIGHT}, exposure {exposure} stops: "
                   f"path-traced reference ({spp} samples), then by the terms of the visibility "
                   f"test: {', '.join(t for t, _ in names)} (exact: rays to the probes in place of "
                   f"their moments, for the camera alone); last where '{last}' is too bright (red) "
                   f"or too dark (blue). At most {self.options.probes} probes, preset "
                   f"{options['params']}, {options['rays']} rays, {options['updates']} updates, "
                   f"seed 1, device: {device}, version {self.version}.\n")
        target.with_suffix(".txt").write_text(caption)
        print(target)


def main():
    parser = argparse.ArgumentParser(description=first_paragraph(__doc__))
    parser.add_argument("--program", type=pathlib.Path, default=ROOT / "build/release/probelab")
    parser.add_argument("--size", choices=sorted(SAMPLES), default="published")
    parser.add_argument("--probes", type=int, default=512)
    parser.add_argument("--runs", type=pathlib.Path, default=ROOT / "results/runs/images",
                        help="folder of the single pictures (default: results/runs/images)")
    parser.add_argument("-o", "--output", type=pathlib.Path,
                        default=ROOT / "results/published/visibility_terms")
    parser.add_argument("--device", help="Vulkan device, see 'probelab info'")
    options = parser.parse_args()
    import matplotlib  # noqa: F401: before the minutes that the renders take
    options.program, options.runs = options.program.resolve(), options.runs.resolve()
    options.output = options.output.resolve()
    options.output.mkdir(parents=True, exist_ok=True)
    pictures = Pictures(options)
    for view in VIEWS:
        pictures.view(*view)
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except InputError as error:
        text = error
    except ImportError as error:
        text = no_matplotlib(error)
    except OSError as error:
        text = of_system(error)
    print(f"visibility_images.py: {text}", file=sys.stderr)
    sys.exit(2)
