#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs the tuning study: parameters tuned per scene and on all scenes but one, against presets.

Each run of `probelab tune` leaves lines in rows.jsonl, one a scene, state and setting, so that a
study that was killed goes on where it was. --report prints the tables from these rows alone.
Progress goes to stderr; the tables to stdout, and last the report's path. Standard library; the
figures need matplotlib.
"""
import json
import os
import sys
from types import SimpleNamespace

import row_study
from overview import Progress, scene_name
from row_study import ERRORS, Failed, Interrupted, Runner, arguments, narrow, settings_of
from tuning_figure import draw
from tuning_report import FROM, LEFT_OUT, SHARED, TUNED, report
from whole_output import InputError, no_matplotlib, of_system

PARTS = ["scenes", "leave_one_out"]
ALL = "all"  # the scenes of leave-one-out, in place of one's name


def folds_of(study):
    """The study as its leave-one-out runs it: from another start, and without cross-validation,
    where its section says so."""
    own = study.get("leave_one_out", {})
    return {**study, **{key: own[key] for key in ("set", "folds") if key in own}}


def rows_that_count(study, rows):
    """Those of the settings of now, which are of the folds' start for what the folds gave."""
    own, folds = identity(study), identity(folds_of(study))
    return [row for row in rows
            if row["settings"] == (folds if row["layout"] in (LEFT_OUT, SHARED) else own)]


def units_done(study, rows):
    return {row["unit"] for row in rows_that_count(study, rows)}


def identity(study):
    """What runs of a part share, as one text: rows of other settings do not mix."""
    text = f"{settings_of(study)} strategy={study['strategy']}"
    for name in ("set", "vary"):
        if study.get(name):
            text += f" {name}={','.join(study[name])}"
    if "leak_weight" in study:
        text += f" leak_weight={study['leak_weight']}"
    if study.get("folds"):
        text += f" folds={study['folds']}"
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
    words += ["--folds", study.get("folds", 0)]
    return [*words, "--against", ",".join(against)]


class TuningStudy(Runner):
    """Runs `probelab tune`."""

    def __init__(self, study, options, folder):
        super().__init__(study, options, folder)
        self.done = units_done(study, self.rows)

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
                    self.keep_unit(self.tune(*unit))
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
        study = folds_of(self.study) if len(scenes) > 1 else self.study
        searches = study.get("searches", {})
        if seed != self.study["seeds"][0] or len(scenes) > 1 or (
                scenes[0] not in searches.get("scenes", scenes)):
            searches = {}
        words = ["--bias-map-size", searches.get("bias_map_size", 0)]
        if searches.get("evaluations"):
            words += ["--compare-searches", searches["evaluations"]]
        if len(scenes) > 1:
            words.append("--leave-one-out")
        elif study.get("fit_values"):
            words += ["--fit-values", os.path.relpath(folder / "values.json")]
        self.run("tune", *scenes, "-o", os.path.relpath(folder / "tuned.toml"),
                 "--strategy", study["strategy"], "--probes", probes,
                 *start_words(study), "--rays", study["rays"], "--updates", study["updates"],
                 "--count", study["receivers"], "--rel-error", study["rel_error"],
                 "--seed", seed, "--report", os.path.relpath(folder), *words)
        result = json.loads((folder / "tune.json").read_text())
        # Scores are named by scenes' names; rows by those of the study.
        names = {s["scene"]: scene_name(path) for s, path in zip(result["scenes"], scenes)}
        common = {"unit": unit, "probes": probes, "layout_seed": seed, "seed": seed,
                  "settings": identity(study), "jobs": 1, "device": result["device"],
                  "tracer": result["tracer"], "version": result["version"]}
        return rows_of(common, result, names)

    def keep_unit(self, rows):
        self.keep(*rows)
        self.done.update(row["unit"] for row in rows)


def share_of(result):
    """Of the step to the solution that cross-validation took; all of it without."""
    return result["step_check"]["share"] if result["step_check"] else 1


def fitted_values(found):
    """Of a fit of texels to a light: held-out nrmse before and after, a state each."""
    return [{"state": s["state"], "fitted": s["fitted"], **{
        when: s["heldout"][when]["nrmse"] for when in ("before", "after")}}
        for s in found["scores"]] if found else None


def rows_of(common, result, names):
    values = {p["key"]: p["tuned"] for p in result["parameters"]}
    run = {"values": values, "parameters": result["parameters"], "rounds": len(result["rounds"]),
           "settled": result["settled"], "evaluations": result["evaluations"],
           "fields": result["fields"], "seconds": result["seconds"], "cost": result["cost"],
           "share": share_of(result), "fitted": fitted_values(result["values"])}
    if not result["leave_one_out"]:
        return [row for score in result["scores"]
                for row in score_rows(common, names, score, {FROM: FROM, TUNED: TUNED}, run)]
    rows = [row for score in result["scores"]
            for row in score_rows(common, names, score, {TUNED: SHARED}, run, False)]
    for fold in result["leave_one_out"]["folds"]:
        of_fold = {"values": fold["values"], "rounds": len(fold["rounds"]),
                   "cost": fold["cost"], "share": share_of(fold)}
        rows += [row for score in fold["scores"]
                 for row in score_rows(common, names, score, {TUNED: LEFT_OUT}, of_fold, False)]
    return rows


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


FILES = ("tuned.toml", *(f"{name}{ending}" for name in ("bias_map", "searches", "errors")
                         for ending in (".pdf", ".png")))  # of a report; published


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


def first_units(study):
    """Those that have figures."""
    return [f"{scene_name(s)}_{n}_{study['seeds'][0]}" for s in study["scenes"]
            for n in study["probes"]]


def parse():
    """(options, study)."""
    def narrowed(study, options, parser):
        identity(study), study["published"]
        return narrow(study, options, parser)

    return row_study.parse(arguments("tuning", __doc__, PARTS), PARTS, narrowed)


def main():
    options, study = parse()

    def run(folder):
        runner = TuningStudy(options.narrowed, options, folder)
        return runner.everything(options.parts), runner

    return row_study.run_study("tuning", options, study, SimpleNamespace(
        run=run, report=report, counted=rows_that_count,
        draw=lambda study, rows, folder: draw_figures(folder, first_units(study)),
        published=lambda study: {f"{unit}/{name}": f"reports/{unit}/{name}"
                                 for unit in first_units(study) for name in FILES}))


if __name__ == "__main__":
    sys.exit(main())
