#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs the placement study: every strategy at equal budgets, under lights seen and unseen.

Each run, one layout under one lighting state, leaves a line in rows.jsonl, so that a study that was
killed goes on where it was. --report prints the tables from these rows alone. Progress goes to
stderr; the tables to stdout, and last the report's path. Standard library; the figure needs
matplotlib.
"""
import argparse
import concurrent.futures
import csv
import hashlib
import json
import lzma
import os
import pathlib
import shutil
import sys
import threading
import tomllib

from children import Children, terminate_as_interrupt
from overview import ROOT, Progress, scene_name
from placement_figure import write_figure
from placement_report import report
from placement_rows import load_rows
from whole_output import InputError, object_of

PARTS = ["main", "curves", "retraining"]
KEY = ["scene", "layout", "probes", "layout_seed", "state", "seed", "settings"]
DRAWN = "drawn"  # lights drawn from the scene: one run of `place` scores a layout under them all
ERRORS = ["nrmse", "smape", "bias", "light_leak", "shadow_leak", "dark_leak"]
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


def params_name(params):
    """A preset's name and a hash of its values, which may be others one day; or a file's."""
    path = ROOT / "core/ddgi/presets" / f"{params}.toml"
    path = path if path.is_file() else ROOT / params
    values = json.dumps(tomllib.loads(path.read_text()), sort_keys=True)
    return f"{params}:{hashlib.sha256(values.encode()).hexdigest()[:8]}"


def settings_of(study):
    """What all runs share, as one text: rows of other settings do not mix."""
    others = " ".join(f"{k}={study[k]}" for k in ("rays", "updates", "receivers", "rel_error"))
    return f"params={params_name(study['params'])} {others}"


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


class Failed(Exception):
    """A command failed; its message."""


class Interrupted(Exception):
    """A command was interrupted."""


class Study:
    def __init__(self, study, options, folder):
        self.study, self.folder, self.jobs = study, folder, options.jobs
        self.program, self.settings = options.program.resolve(), settings_of(study)
        cache = options.cache or folder.parent / "cache"
        self.common = ["--json", "--quiet", "--cache", os.path.relpath(cache)]
        if options.device:
            self.common += ["--device", options.device]
        self.environment = dict(os.environ)
        if self.jobs > 1:
            threads = str(max(1, (os.cpu_count() or 1) // self.jobs))
            self.common += ["--threads", threads]
            self.environment["LP_NUM_THREADS"] = threads
        self.lock = threading.Lock()
        self.truth_locks, self.children = {}, Children()
        self.failures, self.stopping = {}, False
        self.rows = load_rows(folder)
        self.done = {self.key(row) for row in self.rows}
        plain = folder / "rows.jsonl"
        if plain.exists() and not plain.read_bytes().endswith(b"\n"):
            with open(plain, "a") as file:  # a kill cut the last line short
                file.write("\n")
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
                "version": placed["version"], "blocks": squares_of(drawn)}

    def keep(self, row):
        with self.lock:
            with open(self.folder / "rows.jsonl", "a") as file:
                file.write(json.dumps(row, separators=(",", ":")) + "\n")
            self.rows.append(row)

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

    def run(self, *arguments):
        """Runs a command; its JSON."""
        command = [str(self.program), *map(str, arguments), *self.common]
        try:
            done = self.children.run(command, env=self.environment)
        except OSError as error:  # the program is gone, or being linked at this moment
            raise Failed(str(error)) from error
        if done is None or done.returncode in (130, -2):
            raise Interrupted
        if done.returncode != 0:
            lines = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
            raise Failed(lines[-1])
        try:
            return object_of(done.stdout, f"{self.program} {arguments[0]}")
        except InputError as error:
            raise Failed(str(error)) from error


def chosen(text, of, what, parser):
    """The part of `of` that a comma-separated option names, by a part of the name for scenes."""
    if not text:
        return of
    words = text.split(",")
    if what == "scenes":
        found = [s for s in of if any(w in s for w in words)]
    else:
        found = [v for v in of if str(v) in words]
        missing = [w for w in words if w not in map(str, of)]
        if what != "probes" and missing:
            parser.error(f"--{what}: the study has no {', '.join(missing)}")
    if not found:
        parser.error(f"--{what}: nothing of the study matches {text}")
    return found


def narrow(study, options, parser):
    """The study without what the options leave out."""
    study = dict(study)
    study["scenes"] = chosen(options.scenes, study["scenes"], "scenes", parser)
    if options.seeds:
        study["seeds"] = [int(s) for s in options.seeds.split(",")]
    if options.probes:
        study["probes"] = [int(n) for n in options.probes.split(",")]
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


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--study", type=pathlib.Path,
                        default=ROOT / "experiments/studies/placement.toml")
    parser.add_argument("--program", type=pathlib.Path, default=ROOT / "build/release/probelab")
    parser.add_argument("--results", type=pathlib.Path, default=ROOT / "results/runs/placement",
                        help="folder for the results (default: results/runs/placement)")
    parser.add_argument("--cache", type=pathlib.Path,
                        help="folder of truth and layouts (default: cache, beside the results)")
    parser.add_argument("--parts", default=",".join(PARTS),
                        help="of main, curves, retraining (default: all)")
    parser.add_argument("--scenes", help="only these scenes, by a part of their path, a,b,c")
    parser.add_argument("--seeds", help="only these seeds, 1,2")
    parser.add_argument("--probes", help="these budgets, 128,512")
    parser.add_argument("--strategies", help="only these rows of the study, by name")
    parser.add_argument("--jobs", type=int, default=1,
                        help="commands at a time; times mean little beyond one (default: 1)")
    parser.add_argument("--redo", help="forget the results of these rows of the study first, a,b")
    parser.add_argument("--report", action="store_true",
                        help="run nothing: the tables from the results that are there")
    parser.add_argument("--publish", type=pathlib.Path, nargs="?", metavar="DIR",
                        const=ROOT / "results/published/placement",
                        help="copy report, figure and rows (default: results/published/placement)")
    parser.add_argument("--device", help="Vulkan device, see 'probelab info'")
    return parser


def parse():
    parser = arguments()
    options = parser.parse_args()
    if options.jobs < 1:
        parser.error("--jobs must be 1 or more")
    options.parts = options.parts.split(",")
    for part in options.parts:
        if part not in PARTS:
            parser.error(f"--parts: '{part}' is none of {', '.join(PARTS)}")
    if not options.report and not options.program.exists():
        parser.error(f"{options.program}: not built yet; scripts/run builds it")
    try:
        study = tomllib.loads(options.study.read_text())
        options.narrowed = narrow(study, options, parser)
        groups = [] if options.report else plan(options.narrowed, options.parts)
        settings_of(study)
    except (OSError, ValueError) as error:
        parser.error(f"{options.study}: {error}")
    except KeyError as error:
        parser.error(f"{options.study}: {error} is missing; see experiments/studies/placement.toml")
    return options, study, groups


def forget(folder, names):
    """Drops the rows of these layouts."""
    rows = [row for row in load_rows(folder) if row["layout"] not in names]
    part = folder / "rows.jsonl.part"
    part.write_text("".join(json.dumps(r, separators=(",", ":")) + "\n" for r in rows))
    part.replace(folder / "rows.jsonl")


def publish(folder, target):
    target.mkdir(parents=True, exist_ok=True)
    for name in ("placement.md", "curves.svg", "curves.png"):
        if (folder / name).exists():
            shutil.copyfile(folder / name, target / name)
    if (folder / "rows.jsonl").exists():
        (target / "rows.jsonl.xz").write_bytes(lzma.compress((folder / "rows.jsonl").read_bytes()))


def main():
    terminate_as_interrupt()
    options, study, groups = parse()
    options.cache = options.cache and options.cache.resolve()
    folder = options.results.resolve()
    options.publish = options.publish and options.publish.resolve()
    os.chdir(ROOT)
    folder.mkdir(parents=True, exist_ok=True)
    failures, finished = {}, True
    if options.report:
        rows = load_rows(folder)
        if not rows:
            print(f"placement: {folder}: no results there", file=sys.stderr)
            return 2
    else:
        if options.redo:
            forget(folder, options.redo.split(","))
        runner = Study(options.narrowed, options, folder)
        finished = runner.all(groups)
        rows, failures = runner.rows, runner.failures
    settings = settings_of(study)
    others = [r for r in rows if r["settings"] != settings]
    if others:
        print(f"placement: {len(others)} rows were made with other settings and do not count",
              file=sys.stderr)
    rows = [r for r in rows if r["settings"] == settings]
    if not options.report:  # budgets that were asked for count though the study has others
        study = study | {"probes": sorted({*study["probes"], *options.narrowed["probes"]})}
    text = report(study, rows, failures)
    (folder / "placement.md").write_text(text)
    note = write_figure(study, rows, folder)
    print(text)
    if note:
        print(f"placement: {note}", file=sys.stderr)
    for name, why in failures.items():
        print(f"placement: failed: {name}: {why}", file=sys.stderr)
    if not finished:
        print("placement: interrupted; finished runs are kept, the same command goes on",
              file=sys.stderr)
    if options.publish:
        publish(folder, options.publish)
    print(folder / "placement.md")
    return 130 if not finished else 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
