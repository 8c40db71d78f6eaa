#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs the tuning study: parameters tuned per scene and on all scenes but one, against presets.

Each run of `probelab tune` leaves lines in rows.jsonl, one a scene, state and setting, so that a
study that was killed goes on where it was. --report prints the tables from these rows alone.
Progress goes to stderr; the tables to stdout, and last the report's path. Standard library; the
figures need matplotlib.
"""
import argparse
import json
import lzma
import os
import pathlib
import shutil
import sys
import tomllib

from children import Children, terminate_as_interrupt
from overview import ROOT, Progress, scene_name
from placement import Failed, Interrupted, Study as Runner, chosen, settings_of
from placement_rows import load_rows
from tuning_figure import draw
from tuning_report import FROM, LEFT_OUT, SHARED, TUNED, report
from whole_output import InputError, no_matplotlib, of_system

PARTS = ["scenes", "leave_one_out"]
ERRORS = ["nrmse", "smape", "bias", "light_leak", "shadow_leak", "dark_leak"]
ALL = "all"  # the scenes of leave-one-out, in place of one's name


def identity(study):
    """What all runs share, as one text: rows of other settings do not mix."""
    text = f"{settings_of(study)} strategy={study['strategy']}"
    for name in ("set", "vary"):
        if study.get(name):
            text += f" {name}={','.join(study[name])}"
    if "leak_weight" in study:
        text += f" leak_weight={study['leak_weight']}"
    return text


def start_words(study):
    """What a tuning starts from, what it varies, and the presets that are scored beside it."""
    against = list(study["published"])
    words = ["--from", study["params"]]
    for one in study.get("set", []):
        words += ["--set", one]
    if study.get("set"):  # the preset itself is another setting then
        against.append(study["params"])
    if study.get("vary"):
        words += ["--vary", ",".join(study["vary"])]
    if "leak_weight" in study:
        words += ["--leak-weight", study["leak_weight"]]
    return [*words, "--against", ",".join(against)]


class TuningStudy(Runner):
    """Runs `probelab tune`; how a command is called is the placement study's."""

    def __init__(self, study, options, folder):
        self.study, self.folder, self.jobs = study, folder, 1
        self.program, self.settings = options.program.resolve(), identity(study)
        cache = options.cache or folder.parent / "cache"
        self.common = ["--json", "--quiet", "--cache", os.path.relpath(cache)]
        if options.device:
            self.common += ["--device", options.device]
        self.environment = dict(os.environ)
        self.children = Children()
        self.rows, self.failures = load_rows(folder), {}
        self.done = {row["unit"] for row in self.rows if row["settings"] == self.settings}
        plain = folder / "rows.jsonl"
        if plain.exists() and not plain.read_bytes().endswith(b"\n"):
            with open(plain, "a") as file:  # a kill cut the last line short
                file.write("\n")

    def plan(self, parts):
        """(name, scenes, probes, seed) of what is missing."""
        units = []
        for seed in self.study["seeds"]:
            for probes in self.study["probes"]:
                if "scenes" in parts:
                    units += [(f"{scene_name(s)}_{probes}_{seed}", [s], probes, seed)
                              for s in self.study["scenes"]]
                left_out = self.study.get("leave_one_out", {}).get("seeds", [])
                if "leave_one_out" in parts and seed in left_out and len(self.study["scenes"]) > 1:
                    units.append((f"{ALL}_{probes}_{seed}", self.study["scenes"], probes, seed))
        return [unit for unit in units if unit[0] not in self.done]

    def everything(self, parts):
        """Runs what is missing; True unless it was interrupted."""
        units = self.plan(parts)
        # A fold of n scenes runs n - 1 of them.
        costs = [len(scenes) * max(1, len(scenes) - 1) for _, scenes, _, _ in units]
        progress = Progress(sum(costs) or 1)
        try:
            for unit, cost in zip(units, costs):
                progress.show(unit[0])
                try:
                    self.keep(self.tune(*unit))
                except Failed as failure:
                    self.failures[unit[0]] = str(failure)
                progress.done += cost
        except (KeyboardInterrupt, Interrupted):
            return False
        finally:
            progress.finish()
        return True

    def tune(self, unit, scenes, probes, seed):
        """The rows of a run, with its report kept under reports/."""
        folder = self.folder / "reports" / unit
        folder.mkdir(parents=True, exist_ok=True)
        searches = self.study.get("searches", {})
        if seed != self.study["seeds"][0] or len(scenes) > 1 or (
                scenes[0] not in searches.get("scenes", scenes)):
            searches = {}
        words = ["--bias-map-size", searches.get("bias_map_size", 0)]
        if searches.get("evaluations"):
            words += ["--compare-searches", searches["evaluations"]]
        if len(scenes) > 1:
            words.append("--leave-one-out")
        self.run("tune", *scenes, "-o", os.path.relpath(folder / "tuned.toml"),
                 "--strategy", self.study["strategy"], "--probes", probes,
                 *start_words(self.study), "--rays", self.study["rays"],
                 "--updates", self.study["updates"],
                 "--count", self.study["receivers"], "--rel-error", self.study["rel_error"],
                 "--seed", seed, "--report", os.path.relpath(folder), *words)
        result = json.loads((folder / "tune.json").read_text())
        # Scores are named by scenes' names; rows by those of the study.
        names = {s["scene"]: scene_name(path) for s, path in zip(result["scenes"], scenes)}
        return self.rows_of(unit, result, names, probes, seed)

    def rows_of(self, unit, result, names, probes, seed):
        common = {"unit": unit, "probes": probes, "layout_seed": seed, "seed": seed,
                  "settings": self.settings, "jobs": 1, "device": result["device"],
                  "tracer": result["tracer"], "version": result["version"]}
        values = {p["key"]: p["tuned"] for p in result["parameters"]}
        run = {"values": values, "parameters": result["parameters"], "rounds": len(result["rounds"]),
               "settled": result["settled"], "evaluations": result["evaluations"],
               "fields": result["fields"], "seconds": result["seconds"], "cost": result["cost"]}
        if not result["leave_one_out"]:
            return [row for score in result["scores"]
                    for row in score_rows(common, names, score, {FROM: FROM, TUNED: TUNED}, run)]
        rows = [row for score in result["scores"]
                for row in score_rows(common, names, score, {TUNED: SHARED}, run, False)]
        for fold in result["leave_one_out"]["folds"]:
            of_fold = {"values": fold["values"], "rounds": len(fold["rounds"]),
                       "cost": fold["cost"]}
            rows += [row for score in fold["scores"]
                     for row in score_rows(common, names, score, {TUNED: LEFT_OUT}, of_fold, False)]
        return rows

    def keep(self, rows):
        with open(self.folder / "rows.jsonl", "a") as file:
            file.write("".join(json.dumps(r, separators=(",", ":")) + "\n" for r in rows))
        self.rows += rows
        self.done.update(row["unit"] for row in rows)


def score_rows(common, names, score, renamed, run, others=True):
    """The rows of one scene and state: settings of `renamed` and, with `others`, the presets."""
    rows = []
    for setting in score["settings"]:
        name = setting["setting"]
        if name not in renamed and not (others and name not in (FROM, TUNED)):
            continue
        error = setting["heldout"]
        row = {**common, "scene": names[score["scene"]], "layout": renamed.get(name, name),
               "state": score["state"],
               "lights": "same" if score["lights"] == "train" else "heldout",
               **{k: error[k] for k in ERRORS},
               "floors": {k: error["noise_floor"][k] for k in ERRORS},
               "train_nrmse": setting["train"]["nrmse"],
               "blocks": {k: float(f"{v:.4g}") for k, v in sorted(setting["blocks"].items())}}
        if name == TUNED:
            row.update(exact_visibility=score["exact_visibility"], gap_closed=score["gap_closed"],
                       run=run)
        rows.append(row)
    return rows


def draw_figures(folder, units):
    """Pictures beside each report of the first seed. Returns a line for each that there is not."""
    notes = []
    for report_folder in (folder / "reports" / unit for unit in units):
        try:
            if (report_folder / "tune.json").exists():
                draw(report_folder, report_folder)
        except ImportError as error:
            return [f"no figures: {no_matplotlib(error)}"]
        except InputError as error:
            notes.append(f"no figure: {error}")
        except OSError as error:
            notes.append(f"no figure: {of_system(error)}")
    return notes


def publish(folder, target, units):
    target.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(folder / "tuning.md", target / "tuning.md")
    if (folder / "rows.jsonl").exists():
        (target / "rows.jsonl.xz").write_bytes(lzma.compress((folder / "rows.jsonl").read_bytes()))
    for unit in units:
        for name in ("bias_map.png", "searches.png", "errors.png", "tuned.toml"):
            source = folder / "reports" / unit / name
            if source.exists():
                (target / unit).mkdir(exist_ok=True)
                shutil.copyfile(source, target / unit / name)


def narrow(study, options, parser):
    """The study without what the options leave out."""
    study = dict(study)
    study["scenes"] = chosen(options.scenes, study["scenes"], "scenes", parser)
    if options.seeds:
        study["seeds"] = [int(s) for s in options.seeds.split(",")]
    if options.probes:
        study["probes"] = [int(n) for n in options.probes.split(",")]
    return study


def parse():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--study", type=pathlib.Path,
                        default=ROOT / "experiments/studies/tuning.toml")
    parser.add_argument("--program", type=pathlib.Path, default=ROOT / "build/release/probelab")
    parser.add_argument("--results", type=pathlib.Path, default=ROOT / "results/runs/tuning",
                        help="folder for the results (default: results/runs/tuning)")
    parser.add_argument("--cache", type=pathlib.Path,
                        help="folder of truth and layouts (default: cache, beside the results)")
    parser.add_argument("--parts", default=",".join(PARTS),
                        help="of scenes, leave_one_out (default: all)")
    parser.add_argument("--scenes", help="only these scenes, by a part of their path, a,b,c")
    parser.add_argument("--seeds", help="only these seeds, 1,2")
    parser.add_argument("--probes", help="these budgets, 128,512")
    parser.add_argument("--report", action="store_true",
                        help="run nothing: the tables from the results that are there")
    parser.add_argument("--publish", type=pathlib.Path, nargs="?", metavar="DIR",
                        const=ROOT / "results/published/tuning",
                        help="copy report, figures and rows (default: results/published/tuning)")
    parser.add_argument("--device", help="Vulkan device, see 'probelab info'")
    options = parser.parse_args()
    options.parts = options.parts.split(",")
    for part in options.parts:
        if part not in PARTS:
            parser.error(f"--parts: '{part}' is none of {', '.join(PARTS)}")
    if not options.report and not options.program.exists():
        parser.error(f"{options.program}: not built yet; scripts/run builds it")
    try:
        study = tomllib.loads(options.study.read_text())
        options.narrowed = narrow(study, options, parser)
        identity(study), study["published"], study["seeds"], study["probes"]
    except (OSError, ValueError) as error:
        parser.error(f"{options.study}: {error}")
    except KeyError as error:
        parser.error(f"{options.study}: {error} is missing; see experiments/studies/tuning.toml")
    return options, study


def main():
    terminate_as_interrupt()
    options, study = parse()
    options.cache = options.cache and options.cache.resolve()
    folder = options.results.resolve()
    options.publish = options.publish and options.publish.resolve()
    os.chdir(ROOT)
    folder.mkdir(parents=True, exist_ok=True)
    failures, finished = {}, True
    if options.report:
        rows = load_rows(folder)
        if not rows:
            print(f"tuning: {folder}: no results there", file=sys.stderr)
            return 2
    else:
        runner = TuningStudy(options.narrowed, options, folder)
        finished = runner.everything(options.parts)
        rows, failures = runner.rows, runner.failures
    settings = identity(study)
    others = [r for r in rows if r["settings"] != settings]
    if others:
        print(f"tuning: {len(others)} rows were made with other settings and do not count",
              file=sys.stderr)
    rows = [r for r in rows if r["settings"] == settings]
    if not options.report:  # budgets that were asked for count though the study has others
        study = study | {"probes": sorted({*study["probes"], *options.narrowed["probes"]})}
    text = report(study, rows, failures)
    (folder / "tuning.md").write_text(text)
    first = [f"{scene_name(s)}_{n}_{study['seeds'][0]}" for s in study["scenes"]
             for n in study["probes"]]
    notes = draw_figures(folder, first)
    print(text)
    for note in notes:
        print(f"tuning: {note}", file=sys.stderr)
    for name, why in failures.items():
        print(f"tuning: failed: {name}: {why}", file=sys.stderr)
    if not finished:
        print("tuning: interrupted; finished runs are kept, the same command goes on",
              file=sys.stderr)
    if options.publish:
        publish(folder, options.publish, first)
    print(folder / "tuning.md")
    return 130 if not finished else 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
