#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs the study of the DDGI pipeline: stage times, and what presets, parts and storage cost.

Standard library only. Progress goes to stderr; the tables to stdout, and last the report's path.
Each run leaves a JSON; one that fails, and an interrupt, leave the others, and the report says so.
"""
import argparse
import json
import os
import pathlib
import subprocess
import sys
import tomllib

from children import terminate_as_interrupt
from overview import ROOT, Progress, scene_name
from pipeline_report import report
from whole_output import InputError, object_of, of_system

# Rows of the built-in ablations, for the time left; another counts as 10.
ABLATION_ROWS = {"presets": 5, "drop_one": 10, "storage": 26, "talk": 11}

ERRORS = ["nrmse", "bias", "light_leak", "shadow_leak", "dark_leak", "mean_reference"]


def flags(settings):
    """The options of a command from a TOML table: true is a bare flag, false none."""
    words = []
    for key, value in settings.items():
        if value is not False:
            words.append("--" + key.replace("_", "-"))
            if value is not True:
                words.append(str(value))
    return words


def plan(study):
    """The runs of a study: kind, table, scene, file name, arguments and cost in rough seconds."""
    runs = []
    for bench in study.get("bench", []):
        settings = {k: v for k, v in bench.items() if k not in ("name", "scene")}
        runs.append({"kind": "bench", "table": bench["name"], "scene": scene_name(bench["scene"]),
                     "file": f"bench_{bench['name']}.json",
                     "arguments": ["bench", bench["scene"], *flags(settings)],
                     "cost": 150 if bench.get("sweep") else 40})
    truth = ["--count", str(study["receivers"]), "--rel-error", str(study["rel_error"])]
    for table in study.get("ablation", []):
        name = table["name"]
        settings = {k: v for k, v in table.items() if k not in ("name", "scenes")}
        work = table["probes"] * table["rays"] * table["updates"] / (384 * 128 * 16)
        for scene in table["scenes"]:
            runs.append({"kind": "ablation", "table": name, "scene": scene_name(scene),
                         "file": f"{name}_{scene_name(scene)}.json",
                         "arguments": ["evaluate", scene, "--ablation", name, *flags(settings),
                                       *truth],
                         "cost": 1 + 3 * ABLATION_ROWS.get(name, 10) * work})
    return runs


def trim(run, result):
    """What the tables need and where it comes from."""
    if run["kind"] == "bench":
        return {"arguments": run["arguments"], **result}
    kept = {k: result[k] for k in ("scene", "state", "strategy", "mode", "params", "receivers",
                                   "about", "rounds", "ablation_skipped", "device", "tracer",
                                   "seed", "version", "provenance")}
    rows = []
    for row in result["ablation"]:
        slim = {k: row[k] for k in ("row", "about", "set", "vertical", "probes", "rays_per_probe",
                                    "memory", "ray_proxy", "updates", "speed", "ratios",
                                    "stability", "same_estimates", "params")}
        slim["error"] = {k: row["error"][k] for k in ERRORS}
        slim["error"]["floor"] = row["error"]["noise_floor"]["nrmse"]
        rows.append(slim)
    return {"arguments": run["arguments"], **kept, "ablation": rows}


class Study:
    def __init__(self, runs, program, folder, options):
        self.runs, self.program, self.folder = runs, program, folder
        cache = options.cache or folder.parent / "cache"
        self.common = ["--json", "--quiet", "--cache", os.path.relpath(cache)]
        if options.device:
            self.common += ["--device", options.device]
        self.resume = options.resume
        self.failures, self.interrupted = {}, False
        self.progress = Progress(sum(run["cost"] for run in runs))

    def all(self):
        """Runs what is planned; the results by file name, as many as there are."""
        results = {}
        try:
            for run in self.runs:
                result = self.earlier(run) if self.resume else None
                if result:
                    self.progress.total -= run["cost"]
                else:
                    result = self.one(run)
                    self.progress.done += run["cost"]
                if result:
                    results[run["file"]] = result
        except KeyboardInterrupt:
            self.interrupted = True
        self.progress.finish()
        return results

    def earlier(self, run):
        """The result that the folder holds, if it is of the same arguments."""
        try:
            result = json.loads((self.folder / run["file"]).read_text())
        except (OSError, ValueError):
            return None
        same = isinstance(result, dict) and result.get("arguments") == run["arguments"]
        return result if same else None

    def one(self, run):
        """Runs a command and writes its trimmed JSON; None, and a message kept, if it fails."""
        self.progress.show(f"{run['table']}: {run['scene']}")
        command = [str(self.program), *run["arguments"], *self.common]
        try:
            done = subprocess.run(command, capture_output=True, text=True, check=False)
        except OSError as error:  # the program is gone, or being linked at this moment
            self.failures[run["file"]] = of_system(error)
            return None
        if done.returncode == 130:
            raise KeyboardInterrupt
        if done.returncode != 0:
            lines = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
            self.failures[run["file"]] = lines[-1]
            return None
        try:
            result = trim(run, object_of(done.stdout, f"{self.program} {run['arguments'][0]}"))
        except InputError as error:
            self.failures[run["file"]] = str(error)
            return None
        whole = self.folder / (run["file"] + ".part")
        whole.write_text(json.dumps(result, indent=1) + "\n")
        whole.replace(self.folder / run["file"])
        return result


def parse():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--study", type=pathlib.Path,
                        default=ROOT / "experiments/studies/pipeline.toml")
    parser.add_argument("--program", type=pathlib.Path, default=ROOT / "build/release/probelab")
    parser.add_argument("--results", type=pathlib.Path, default=ROOT / "results/runs/pipeline",
                        help="folder for the results (default: results/runs/pipeline)")
    parser.add_argument("--cache", type=pathlib.Path,
                        help="folder of the truth (default: cache, beside the results)")
    parser.add_argument("--scenes", help="ablations of only these scenes, by a part of their "
                        "path, a,b,c")
    parser.add_argument("--resume", action="store_true",
                        help="keep the runs that the results' folder holds with the same options")
    parser.add_argument("--device", help="Vulkan device, see 'probelab info'")
    options = parser.parse_args()
    if not options.program.exists():
        parser.error(f"{options.program}: not built yet; scripts/run builds it")
    try:
        study = tomllib.loads(options.study.read_text())
        if options.scenes:
            for table in study.get("ablation", []):
                table["scenes"] = [s for s in table["scenes"]
                                   if any(w in s for w in options.scenes.split(","))]
            if not any(table["scenes"] for table in study.get("ablation", [])):
                raise ValueError(f"no scene matches {options.scenes}")
        runs = plan(study)
    except (OSError, ValueError) as error:
        parser.error(f"{options.study}: {error}")
    except KeyError as error:
        parser.error(f"{options.study}: {error} is missing; see experiments/studies/pipeline.toml")
    if not runs:
        parser.error(f"{options.study}: nothing to run")
    return options, runs


def main():
    terminate_as_interrupt()
    options, runs = parse()
    program, folder = options.program.resolve(), options.results.resolve()
    options.cache = options.cache and options.cache.resolve()
    os.chdir(ROOT)
    folder.mkdir(parents=True, exist_ok=True)
    study = Study(runs, program, folder, options)
    results = study.all()
    text = report(runs, results, study.failures, study.interrupted)
    (folder / "pipeline.md").write_text(text)
    print(text)
    for file, why in study.failures.items():
        print(f"pipeline: failed: {file.removesuffix('.json')}: {why}", file=sys.stderr)
    if study.interrupted:
        print("pipeline: interrupted; finished runs are kept, --resume goes on", file=sys.stderr)
    print(folder / "pipeline.md")
    return 130 if study.interrupted else 1 if study.failures else 0


if __name__ == "__main__":
    sys.exit(main())
