#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Small renders of the study visibility_terms: for two scenes one row of pictures, the path-traced
reference, one picture a set of terms, and where the last of them is too bright (red) or too dark
(blue). What has been rendered by the same program is kept. Standard library only."""
import argparse
import json
import pathlib
import subprocess
import sys
import tomllib

from overview import ROOT, scene_name

STUDY = ROOT / "experiments/studies/visibility_terms.toml"
# Scene and the camera that looks at its dark side.
VIEWS = (("scenes/two_rooms_door/scene.toml", "unlit room"),
         ("scenes/thin_wall/scene_05cm.toml", "east"))
WIDTH, HEIGHT = 224, 126
SAMPLES = {"smoke": (16, 4), "quick": (64, 16), "published": (256, 16)}  # reference, render


def terms(study):
    """[(name, --set values)] of the axis; what another command computes is no picture."""
    axis, = (a for a in study["axis"] if a["name"] == "terms")
    return [(v["name"], v.get("options", {}).get("set", [])) for v in axis["value"]
            if "command" not in v]


class Pictures:
    def __init__(self, options):
        self.options, self.study = options, tomllib.loads(STUDY.read_text())
        self.version = self.run("info")["version"]

    def run(self, *arguments):
        command = [str(self.options.program), *map(str, arguments), "--json", "--quiet"]
        if arguments[0] != "info":
            command += ["--cache", str(self.options.runs / "cache")]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            sys.stderr.write(done.stderr)
            sys.exit(done.returncode if done.returncode > 0 else 1)
        return json.loads(done.stdout)

    def kept(self, path, *arguments):
        """Runs what writes `path`, unless the same was done before."""
        note = path.with_suffix(".json")
        words = [str(a) for a in arguments]
        try:
            before = json.loads(note.read_text())
            if path.exists() and before == {"version": self.version, "arguments": words}:
                return
        except (OSError, ValueError):
            pass
        self.run(*arguments, "-o", path)
        note.write_text(json.dumps({"version": self.version, "arguments": words}) + "\n")

    def view(self, scene, camera):
        name, options = scene_name(scene), self.study["options"]
        folder = self.options.runs / name
        folder.mkdir(parents=True, exist_ok=True)
        look = [scene, "--camera", camera, "--width", WIDTH, "--height", HEIGHT]
        spp, render_spp = SAMPLES[self.options.size]
        self.kept(folder / "reference.exr", "reference", *look, "--spp", spp)
        images = []
        for term, settings in terms(self.study):
            images.append(folder / f"{term}.exr")
            self.kept(images[-1], "render", *look, "--spp", render_spp, "--params",
                      options["params"], "--probes", self.options.probes, "--rays",
                      options["rays"], "--updates", options["updates"],
                      *(w for s in settings for w in ("--set", s)))
        target = self.options.output / f"images_{name}.png"
        self.run("compare", images[-1], folder / "reference.exr", "--picture", target,
                 *(w for i in images[:-1] for w in ("--beside", i)))
        caption = (f"{name}, camera '{camera}', {WIDTH} x {HEIGHT}: path-traced reference ({spp} "
                   f"samples), then by the terms of the visibility test: "
                   f"{', '.join(t for t, _ in terms(self.study))}; last where that is too bright "
                   f"(red) or too dark (blue). At most {self.options.probes} probes, preset "
                   f"{options['params']}, {options['rays']} rays, {options['updates']} updates, "
                   f"seed 1, version {self.version}.\n")
        target.with_suffix(".txt").write_text(caption)
        print(target)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", type=pathlib.Path, default=ROOT / "build/release/probelab")
    parser.add_argument("--size", choices=sorted(SAMPLES), default="published")
    parser.add_argument("--probes", type=int, default=256)
    parser.add_argument("--runs", type=pathlib.Path, default=ROOT / "results/runs/images",
                        help="folder of the single pictures (default: results/runs/images)")
    parser.add_argument("-o", "--output", type=pathlib.Path,
                        default=ROOT / "results/published/visibility_terms")
    options = parser.parse_args()
    options.program, options.runs = options.program.resolve(), options.runs.resolve()
    options.output = options.output.resolve()
    options.output.mkdir(parents=True, exist_ok=True)
    pictures = Pictures(options)
    for scene, camera in VIEWS:
        pictures.view(scene, camera)
    return 0


if __name__ == "__main__":
    sys.exit(main())
