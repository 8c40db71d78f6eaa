#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs the default study: truth, probe fields and pictures of the shipped scenes, and a table.

Standard library only. Progress goes to stderr; the table to stdout, and last the report's path.
"""
import argparse
import html
import json
import os
import pathlib
import subprocess
import sys
import time
import tomllib

from children import terminate_as_interrupt
from whole_output import InputError, object_of, of_system

ROOT = pathlib.Path(__file__).resolve().parent.parent

# Share of a scene's time that each step takes, for the time left.
STEP_WEIGHTS = {"receivers": 8, "evaluate": 3, "reference": 6, "render": 3, "picture": 0.5}

COLUMNS = ["scene", "preset", "nrmse", "floor", "bias", "light leak", "shadow leak", "dark leak",
           "update ms", "frame ms", "KiB"]


class Progress:
    """One line on stderr: rewritten on a terminal, else at most every 10 seconds."""

    def __init__(self, total):
        self.total, self.done, self.start = total, 0.0, time.monotonic()
        self.terminal, self.last = sys.stderr.isatty(), -10.0

    def show(self, what):
        elapsed = time.monotonic() - self.start
        if not self.terminal and elapsed - self.last < 10:
            return
        self.last = elapsed
        left = ""
        if self.done > 0:
            seconds = elapsed * (self.total - self.done) / self.done
            left = f", {int(seconds // 60)} min {int(seconds % 60):02} s left"
        line = f"{100 * self.done / self.total:3.0f} %{left}: {what}"
        end = "\x1b[K" if self.terminal else "\n"
        print(("\r" if self.terminal else "") + line, end=end, file=sys.stderr, flush=True)

    def finish(self):
        if self.terminal:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)


def scene_name(scene):
    """scenes/thin_wall/scene_05cm.toml is thin_wall_05cm."""
    path = pathlib.Path(scene)
    return path.parent.name + (path.stem.removeprefix("scene") if path.stem != "scene" else "")


class Study:
    def __init__(self, study, program, folder, device):
        self.study, self.program, self.folder = study, program, folder
        self.common = ["--quiet", "--cache", os.path.relpath(folder.parent / "cache")]
        if device:
            self.common += ["--device", device]
        steps = {"receivers": 1, "evaluate": len(study["presets"]), "reference": 1,
                 "render": len(study["presets"]), "picture": 1}
        self.progress = Progress(len(study["scenes"]) *
                                 sum(STEP_WEIGHTS[name] * n for name, n in steps.items()))

    def run(self, step, what, *arguments):
        """Runs a command; returns its JSON. A failure ends the study with the command's message."""
        self.progress.show(f"{what}: {step}")
        command = [str(self.program), *map(str, arguments), "--json", *self.common]
        result = subprocess.run(command, capture_output=True, text=True, check=False)
        if result.returncode != 0:
            self.progress.finish()
            sys.stderr.write(result.stderr)
            print(f"overview: failed: {' '.join(command)}", file=sys.stderr)
            sys.exit(result.returncode if result.returncode > 0 else 1)
        self.progress.done += STEP_WEIGHTS[step]
        return object_of(result.stdout, f"{self.program} {arguments[0]}")

    def scene(self, scene):
        """All steps of one scene; returns the evaluations, one a preset."""
        s = self.study
        name = scene_name(scene)
        folder = pathlib.Path(os.path.relpath(self.folder)) / name
        folder.mkdir(parents=True, exist_ok=True)
        toml = scene
        truth = ["--count", s["receivers"], "--rel-error", s["rel_error"]]
        field = ["--probes", s["probes"], "--rays", s["rays"], "--updates", s["updates"]]
        size = ["--width", s["picture_size"][0], "--height", s["picture_size"][1]]
        self.run("receivers", name, "receivers", toml, "-o", folder / "receivers.json", *truth)
        rows = []
        for preset in s["presets"]:
            row = self.run("evaluate", name, "evaluate", toml, *field, "--params", preset,
                           "--receivers", folder / "receivers.json")
            (folder / f"{preset}.json").write_text(json.dumps(row, indent=1) + "\n")
            rows.append({**row, "name": name, "preset": preset})
        reference = folder / "reference.exr"
        self.run("reference", name, "reference", toml, "-o", reference, *size,
                 "--spp", s["reference_spp"])
        images = []
        for preset in s["presets"]:
            images.append(folder / f"{preset}.exr")
            self.run("render", name, "render", toml, "-o", images[-1], *field, "--params", preset,
                     *size, "--spp", s["render_spp"])
        beside = [word for image in images[:-1] for word in ("--beside", image)]
        self.run("picture", name, "compare", images[-1], reference, *beside,
                 "--picture", folder / "picture.png")
        return rows


def number(value, digits=3):
    return "-" if value is None else f"{value:.{digits}g}"


def table_row(row):
    error, speed = row["error"], row["speed"]
    return [row["name"], row["preset"], number(error["nrmse"]),
            number(error["noise_floor"]["nrmse"], 2), number(error["bias"], 2),
            number(error["light_leak"], 2), number(error["shadow_leak"], 2),
            number(error["dark_leak"], 2), number(speed["update_ms"]), number(speed["frame_ms"]),
            number(row["memory_bytes"] / 1024)]


def text_table(rows):
    widths = [max(len(r[i]) for r in rows) for i in range(len(rows[0]))]
    lines = []
    for r in rows:
        cells = [c.ljust(w) if i < 2 else c.rjust(w) for i, (c, w) in enumerate(zip(r, widths))]
        lines.append("  ".join(cells).rstrip())
    lines.insert(1, "  ".join("-" * w for w in widths))
    return "\n".join(lines)


def markdown_table(rows):
    lines = ["| " + " | ".join(r) + " |" for r in rows]
    lines.insert(1, "|" + "|".join("---" if i < 2 else "--:" for i in range(len(rows[0]))) + "|")
    return "\n".join(lines) + "\n"


def write_report(path, rows, names, about):
    cells = "\n".join("<tr>" + "".join(f"<{tag}>{html.escape(c)}</{tag}>" for c in r) + "</tr>"
                      for tag, r in [("th", rows[0])] + [("td", r) for r in rows[1:]])
    figures = "\n".join(f'<figure><img src="{n}/picture.png" alt="{n}"><figcaption>{n}'
                        "</figcaption></figure>" for n in names)
    style = ("body{font:15px/1.5 sans-serif;margin:2em auto;max-width:1400px;padding:0 1em}"
             "table{border-collapse:collapse;margin:1.5em 0}"
             "td,th{padding:.25em .8em;text-align:right;border-bottom:1px solid #ddd}"
             "td:nth-child(-n+2),th:nth-child(-n+2){text-align:left}"
             "img{max-width:100%}figure{margin:2em 0}figcaption{color:#555}")
    path.write_text(f"<!doctype html>\n<html lang=en><meta charset=utf-8>\n<title>Probelab: "
                    f"overview</title>\n<style>{style}</style>\n<h1>Probelab: overview</h1>\n"
                    f"<p>{html.escape(about)}</p>\n<table>\n{cells}\n</table>\n{figures}\n")


def describe(study, row):
    return (f"{study['receivers']} receivers at {study['rel_error']:g} relative error, held-out "
            f"half scored; grid of at most {study['probes']} probes, {study['rays']} rays, "
            f"{study['updates']} updates averaged. Device {row['device']}, tracer {row['tracer']}, "
            f"version {row['version']}, seed {row['seed']}. floor: noise of the truth in nrmse.")


def main():
    terminate_as_interrupt()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--study", type=pathlib.Path,
                        default=ROOT / "experiments/studies/overview.toml")
    parser.add_argument("--program", type=pathlib.Path, default=ROOT / "build/release/probelab")
    parser.add_argument("--results", type=pathlib.Path, default=ROOT / "results/runs/overview",
                        help="folder for the results (default: results/runs/overview)")
    parser.add_argument("--scenes", help="only these scenes, by a part of their path, a,b,c")
    parser.add_argument("--device", help="Vulkan device, see 'probelab info'")
    options = parser.parse_args()
    study = tomllib.loads(options.study.read_text())
    if options.scenes:
        wanted = options.scenes.split(",")
        study["scenes"] = [s for s in study["scenes"] if any(w in s for w in wanted)]
        if not study["scenes"]:
            parser.error(f"no scene of {options.study} matches {options.scenes}")
    if not options.program.exists():
        parser.error(f"{options.program}: not built yet; scripts/run builds it")
    os.chdir(ROOT)
    folder = options.results.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    runner = Study(study, options.program.resolve(), folder, options.device)
    rows = []
    for scene in study["scenes"]:
        rows += runner.scene(scene)
    runner.progress.finish()
    table = [COLUMNS] + [table_row(r) for r in rows]
    about = describe(study, rows[0])
    (folder / "table.md").write_text(markdown_table(table) + "\n" + about + "\n")
    names = list(dict.fromkeys(r["name"] for r in rows))
    write_report(folder / "index.html", table, names, about)
    print(text_table(table))
    print(folder / "index.html")


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        print("overview: interrupted; finished cells are kept", file=sys.stderr)
        sys.exit(130)
    except InputError as error:
        print(f"overview: {error}", file=sys.stderr)
        sys.exit(2)
    except OSError as error:
        print(f"overview: {of_system(error)}", file=sys.stderr)
        sys.exit(2)
