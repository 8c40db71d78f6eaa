#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs the placement study: every strategy at equal budgets, under lights seen and unseen.

Each run, one layout under one lighting state, leaves a line in rows.jsonl, so that a study that was
killed goes on where it was. --report prints the tables from these rows alone. Progress goes to
stderr; the tables to stdout, and last the report's path. Standard library; the figure needs
matplotlib.
"""
import concurrent.futures
import csv
import json
import os
import sys
import threading
import tomllib
from types import SimpleNamespace

import row_study
from overview import ROOT, Progress, scene_name
from placement_figure import write_figure
from placement_report import report
from placement_rows import load_rows
from row_study import (ERRORS, Failed, Interrupted, Runner, arguments, chosen, lines_of, narrow,
                       settings_of)

PARTS = ["main", "curves", "retraining"]
KEY = ["scene", "layout", "probes", "layout_seed", "state", "seed", "settings"]
DRAWN = "drawn"  # lights drawn from the scene: one run of `place` scores a layout under them all
LUMINANCE = (0.2126, 0.7152, 0.0722)
BLOCKS_PER_DIAGONAL = 16  # as the train and held-out blocks


def lighting_states(scene):
    """{state: "same" or "heldout"} of a scene TOML; one without states has its one as "same"."""
    states = tomllib.loads((ROOT / scene).read_text()).get("state", [])
    return {s["name"]: "heldout" if s.get("split") == "heldout" else "same"
            for s in states} or {"": "same"}


def block_errors(dump, bounds):
    """Held-out receivers by block: {"i,j,k": sum a (E-A)(E-B)} over sum a A B of all, of luminance.
    They sum to nrmse^2."""
    low, high = bounds["min"], bounds["max"]
    edge = sum((high[i] - low[i]) ** 2 for i in range(3)) ** 0.5 / BLOCKS_PER_DIAGONAL
    blocks, product = {}, 0.0
    with open(dump, newline="") as file:
        for row in csv.DictReader(file):
            if row["split"] != "heldout":
                continue
            key = ",".join(str(int((float(row[c]) - low[i]) // edge)) for i, c in enumerate("xyz"))
            e, a, b = (sum(w * float(row[f"{name}_{c}"]) for w, c in zip(LUMINANCE, "rgb"))
                       for name in ("est", "a", "b"))
            blocks[key] = blocks.get(key, 0.0) + float(row["area"]) * (e - a) * (e - b)
            product += float(row["area"]) * a * b
    if not product > 0:
        raise Failed("no held-out receiver gets light")
    return {k: float(f"{v / product:.4g}") for k, v in sorted(blocks.items())}


def plan(study, parts):
    """Groups of runs that share a layout, those of the first seeds first: scene, layout (its row
    in the study), probes, layout_seed and the runs as (state, lights, receiver seed)."""
    by_name = {row["name"]: row for row in study["layout"]}
    cells = {}

    def add_run(scene, name, probes, layout_seed, run):
        runs = cells.setdefault((layout_seed, probes, scene, name), [])
        if run not in runs:
            runs.append(run)

    def add(scene, name, probes, layout_seed, seed):
        if name not in by_name:
            return
        for state, lights in lighting_states(scene).items():
            add_run(scene, name, probes, layout_seed, (state, lights, seed))
        if study.get("drawn_lights") and seed == layout_seed:
            add_run(scene, name, probes, layout_seed, (DRAWN, DRAWN, seed))

    if "main" in parts:
        for seed in study["seeds"]:
            for probes in study["probes"]:
                for scene in study["scenes"]:
                    for name in by_name:
                        add(scene, name, probes, seed, seed)
    curves = study.get("curves")
    if curves and "curves" in parts:
        for seed in curves["seeds"]:
            for probes in curves["probes"]:
                for scene in curves["scenes"]:
                    for name in curves["layouts"]:
                        add(scene, name, probes, seed, seed)
    retraining = study.get("retraining")
    if retraining and "retraining" in parts:
        for seed in study["seeds"]:
            for probes in study["probes"]:
                for scene in study["scenes"]:
                    for name in retraining["layouts"]:
                        add(scene, name, probes, seed, study["seeds"][0])
    return [{"scene": scene, "layout": by_name[name], "probes": probes, "layout_seed": seed,
             "runs": runs} for (seed, probes, scene, name), runs in cells.items()]


def squares_of(drawn):
    """The drawn lights' part of the mean squared error, by light; they sum to nrmse^2."""
    each = drawn["each"]
    return {f"{i} {light['kind']}": float(f"{light['nrmse'] ** 2 / len(each):.4g}")
            for i, light in enumerate(each)}


class Study(Runner):
    def __init__(self, study, options, folder):
        super().__init__(study, options, folder)
        self.settings, self.stopping, self.truth_locks = settings_of(study), False, {}
        self.done = {self.key(row) for row in self.rows}
        for name in ("layouts", "truth", "dumps"):
            (folder / name).mkdir(parents=True, exist_ok=True)

    @staticmethod
    def key(row):
        return tuple(row[k] for k in KEY)

    def all(self, groups):
        """Runs what is missing of the groups; True unless it was interrupted."""
        left = []
        for group in groups:
            runs = [r for r in group["runs"] if self.key(self.cell(group, *r)) not in self.done]
            if runs:
                left.append({**group, "runs": runs})
        self.progress = Progress(sum(self.cost(g) for g in left) or 1)
        with concurrent.futures.ThreadPoolExecutor(self.jobs) as pool:
            futures = [pool.submit(self.group, g) for g in left]
            try:
                for future in concurrent.futures.as_completed(futures):
                    future.result()
            except BaseException as error:
                self.stopping = True
                self.children.interrupt()
                pool.shutdown(cancel_futures=True)
                if not isinstance(error, (KeyboardInterrupt, Interrupted)):
                    raise  # a defect here
        self.progress.finish()
        return not self.stopping

    @staticmethod
    def cost(group):
        """Rough seconds: the place command and an evaluation a state."""
        n, strategy = group["probes"], group["layout"]["strategy"]
        instant = strategy in ("grid", "relocated", "jittered", "poisson")
        place = 1 if instant else 20 + n / 2 if group["layout"].get("ours") else 15 + n / 20
        return place + len(group["runs"]) * (3 + n / 100)

    def cell(self, group, state, lights, seed):
        return {"scene": scene_name(group["scene"]), "layout": group["layout"]["name"],
                "probes": group["probes"], "layout_seed": group["layout_seed"], "state": state,
                "lights": lights, "seed": seed, "settings": self.settings}

    def group(self, group):
        if self.stopping:
            return
        name = (f"{scene_name(group['scene'])}_{group['layout']['name']}_{group['probes']}"
                f"_{group['layout_seed']}")
        with self.lock:
            self.progress.show(name)
        try:
            layout = self.folder / "layouts" / f"{name}.json"
            options = [w for o in group["layout"].get("options", []) for w in ("--option", o)]
            placed = self.run("place", group["scene"], "--strategy", group["layout"]["strategy"],
                              "--probes", group["probes"], *options, "-o",
                              os.path.relpath(layout), "--params", self.study["params"],
                              "--rays", self.study["rays"], "--seed", group["layout_seed"],
                              *self.drawn_options(group))
            bounds = json.loads(layout.read_text())["bounds"]
            for state, lights, seed in group["runs"]:
                if self.stopping:
                    return
                if lights == DRAWN:
                    self.keep(self.drawn_row(group, placed, seed))
                else:
                    self.evaluate(group, name, layout, bounds, placed, state, lights, seed)
        except Failed as failure:
            self.failures[name] = str(failure)
        with self.lock:
            self.progress.done += self.cost(group)

    def evaluate(self, group, name, layout, bounds, placed, state, lights, seed):
        cell = self.cell(group, state, lights, seed)
        dump = self.folder / "dumps" / f"{name}_{state}_{seed}.csv"
        words = ["--state", state] if state else []
        result = self.run("evaluate", group["scene"], *words, "--layout", os.path.relpath(layout),
                          "--params", self.study["params"], "--rays", self.study["rays"],
                          "--updates", self.study["updates"], "--seed", seed,
                          "--receivers", self.truth(group["scene"], state, seed),
                          "--dump", os.path.relpath(dump))
        error = result["error"]
        self.keep({**cell, **self.layout_part(group, placed),
                   **{k: error[k] for k in ERRORS},
                   "floors": {k: error["noise_floor"][k] for k in ERRORS},
                   "active": result["probes"]["active"],
                   "query_ns": result["speed"]["query_ns_per_point"],
                   "update_ms": result["speed"]["update_ms"], "memory": result["memory"],
                   "device": result["device"], "tracer": result["tracer"],
                   "version": result["version"], "blocks": block_errors(dump, bounds)})
        dump.unlink()

    def layout_part(self, group, placed):
        """What all rows of a layout say of it."""
        layout = placed["layout"]
        return {"strategy": placed["strategy"], "options": group["layout"].get("options", []),
                "stored": placed["probes"]["stored"], "jobs": self.jobs,
                **{k: layout[k] for k in ("interpolant", "index_bytes", "evaluations", "build_s")}}

    def drawn_options(self, group):
        """Nothing that takes time for runs that do not ask for it."""
        wanted = any(lights == DRAWN for _, lights, _ in group["runs"])
        return ["--drawn-lights", self.study["drawn_lights"]] if wanted else []

    def drawn_row(self, group, placed, seed):
        """The row of a layout under drawn lights, which `place` scores without a device."""
        drawn = placed["drawn_lights"]
        return {**self.cell(group, DRAWN, DRAWN, seed), **self.layout_part(group, placed),
                **{k: drawn.get(k) for k in ERRORS}, "floors": {k: 0.0 for k in ERRORS},
                "version": placed["version"], "blocks": squares_of(drawn),
                "reading": drawn["reading"]}

    def truth(self, scene, state, seed):
        """The receivers' file of a scene under a state, made once."""
        path = self.folder / "truth" / f"{scene_name(scene)}_{state}_{seed}.json"
        with self.lock:
            lock = self.truth_locks.setdefault(path, [threading.Lock(), False])
        with lock[0]:
            if not lock[1]:  # always through the program, whose cache knows what is still true
                words = ["--state", state] if state else []
                self.run("receivers", scene, *words, "-o", os.path.relpath(path), "--count",
                         self.study["receivers"], "--rel-error", self.study["rel_error"],
                         "--seed", seed)
                lock[1] = True
        return os.path.relpath(path)

def narrow_layouts(study, options, parser):
    """The study without what the options leave out."""
    study = narrow(study, options, parser)
    names = chosen(options.strategies, [row["name"] for row in study["layout"]], "strategies",
                   parser)
    study["layout"] = [row for row in study["layout"] if row["name"] in names]
    if "curves" in study:
        curves = dict(study["curves"])
        if options.scenes:
            curves["scenes"] = [s for s in curves["scenes"]
                                if any(w in s for w in options.scenes.split(","))]
        if options.probes:
            curves["probes"] = study["probes"]
        if options.seeds:
            curves["seeds"] = study["seeds"]
        study["curves"] = curves
    return study


def parse():
    """(options, study, groups of runs)."""
    parser = arguments("placement", __doc__, PARTS)
    parser.add_argument("--strategies", help="only these rows of the study, by name")
    parser.add_argument("--jobs", type=int, default=1,
                        help="commands at a time; times mean little beyond one (default: 1)")
    parser.add_argument("--redo", help="forget the results of these rows of the study first, a,b")
    groups = []

    def narrowed(study, options, parser):
        if options.jobs < 1:
            parser.error("--jobs must be 1 or more")
        settings_of(study)
        result = narrow_layouts(study, options, parser)
        groups.extend([] if options.report else plan(result, options.parts))
        return result

    options, study = row_study.parse(parser, PARTS, narrowed)
    return options, study, groups


def forget(folder, names):
    """Drops the rows of these layouts."""
    part = folder / "rows.jsonl.part"
    part.write_text(lines_of(row for row in load_rows(folder) if row["layout"] not in names))
    part.replace(folder / "rows.jsonl")


def main():
    options, study, groups = parse()

    def run(folder):
        if options.redo:
            forget(folder, options.redo.split(","))
        runner = Study(options.narrowed, options, folder)
        return runner.all(groups), runner

    return row_study.run_study("placement", options, study, SimpleNamespace(
        run=run, report=report, draw=write_figure,
        counted=lambda study, rows: [r for r in rows if r["settings"] == settings_of(study)],
        published=lambda _: {name: name for name in ("curves.pdf", "curves.png")}))


if __name__ == "__main__":
    sys.exit(main())
