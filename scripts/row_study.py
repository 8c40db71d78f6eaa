# SPDX-License-Identifier: GPL-3.0-or-later
"""What scripts/placement.py and scripts/tuning.py share: studies whose commands leave rows in
rows.jsonl, that go on where they were killed, and are reported from these rows alone. Standard
library only.
"""
import argparse
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
from overview import ROOT
from placement_rows import load_rows
from whole_output import InputError, object_of

BY_STUDY = object()  # a folder named after the study; no path is equal to it
ERRORS = ["nrmse", "smape", "bias", "light_leak", "shadow_leak", "dark_leak"]


class Failed(Exception):
    """A command failed; its message."""


class Interrupted(Exception):
    """A command was interrupted."""


class Runner:
    """Runs commands of the program and keeps the rows that come of them."""

    def __init__(self, study, options, folder):
        self.study, self.folder, self.jobs = study, folder, getattr(options, "jobs", 1)
        self.program = options.program.resolve()
        cache = options.cache or folder.parent / "cache"
        self.common = ["--json", "--quiet", "--cache", os.path.relpath(cache)]
        if options.device:
            self.common += ["--device", options.device]
        self.environment = dict(os.environ)
        if self.jobs > 1:
            threads = str(max(1, (os.cpu_count() or 1) // self.jobs))
            self.common += ["--threads", threads]
            self.environment["LP_NUM_THREADS"] = threads
        self.lock, self.children, self.failures = threading.Lock(), Children(), {}
        self.rows = load_rows(folder)
        plain = folder / "rows.jsonl"
        if plain.exists() and not plain.read_bytes().endswith(b"\n"):
            with open(plain, "a") as file:  # a kill cut the last line short
                file.write("\n")

    def keep(self, *rows):
        with self.lock:
            with open(self.folder / "rows.jsonl", "a") as file:
                file.write(lines_of(rows))
            self.rows += rows

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


def lines_of(rows):
    return "".join(json.dumps(row, separators=(",", ":")) + "\n" for row in rows)


def arguments(name, about, parts):
    """The options of both scripts."""
    parser = argparse.ArgumentParser(description=about.splitlines()[0])
    parser.add_argument("--study", type=pathlib.Path,
                        default=ROOT / f"experiments/studies/{name}.toml")
    parser.add_argument("--program", type=pathlib.Path, default=ROOT / "build/release/probelab")
    parser.add_argument("--results", type=pathlib.Path,
                        help="folder for the results (default: results/runs/<name of the study>)")
    parser.add_argument("--cache", type=pathlib.Path,
                        help="folder of truth and layouts (default: cache, beside the results)")
    parser.add_argument("--parts", default=",".join(parts),
                        help=f"of {', '.join(parts)} (default: all)")
    parser.add_argument("--scenes", help="only these scenes, by a part of their path, a,b,c")
    parser.add_argument("--seeds", help="only these seeds, 1,2")
    parser.add_argument("--probes", help="these budgets, 128,512")
    parser.add_argument("--report", action="store_true",
                        help="run nothing: the tables from all results that are there")
    parser.add_argument("--publish", type=pathlib.Path, nargs="?", metavar="DIR", const=BY_STUDY,
                        help="copy report, figures, rows (default: results/published/<name of the "
                        "study>)")
    parser.add_argument("--device", help="Vulkan device, see 'probelab info'")
    return parser


def load(path):
    """A study; keys and tables of its own stand, whole, in place of those of the file beside it
    that `base` names."""
    study = tomllib.loads(path.read_text())
    if "base" not in study:
        return study
    name = study.pop("base")
    if not isinstance(name, str):
        raise ValueError(f"base = {name!r}: a file's name is needed")
    file = path.parent / name
    try:
        base = tomllib.loads(file.read_text())
    except (OSError, ValueError) as error:
        raise ValueError(f"base '{file.name}': {error}") from error
    if "base" in base:
        raise ValueError(f"base '{file.name}' has a base itself")
    return {**base, **study}


def parse(parser, parts, narrowed):
    """(options, study), with options.narrowed as `narrowed(study, options, parser)` says, which
    raises KeyError for what the study lacks."""
    options = parser.parse_args()
    if options.results is None:
        options.results = ROOT / "results/runs" / options.study.stem
    if options.publish == BY_STUDY:
        options.publish = ROOT / "results/published" / options.study.stem
    options.parts = options.parts.split(",")
    for part in options.parts:
        if part not in parts:
            parser.error(f"--parts: '{part}' is none of {', '.join(parts)}")
    if not options.report and not options.program.exists():
        parser.error(f"{options.program}: not built yet; scripts/run builds it")
    try:
        study = load(options.study)
        options.narrowed = narrowed(study, options, parser)
    except (OSError, ValueError) as error:
        parser.error(f"{options.study}: {error}")
    except KeyError as error:
        default = os.path.relpath(parser.get_default("study"), ROOT)
        parser.error(f"{options.study}: {error} is missing; see {default}")
    except TypeError as error:
        default = os.path.relpath(parser.get_default("study"), ROOT)
        parser.error(f"{options.study}: a value of the wrong kind ({error}); see {default}")
    return options, study


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
        if missing:
            parser.error(f"--{what}: the study has no {', '.join(missing)}")
    if not found:
        parser.error(f"--{what}: nothing of the study matches {text}")
    return found


def narrow(study, options, parser):
    """The study without the scenes, seeds and budgets that the options leave out."""
    study = dict(study)
    for name in ("scenes", "seeds", "probes"):
        if not isinstance(study[name], list):
            raise ValueError(f"{name} = {study[name]!r}: a list is needed")
    study["scenes"] = chosen(options.scenes, study["scenes"], "scenes", parser)
    for name in ("seeds", "probes"):
        if text := getattr(options, name):
            study[name] = whole_numbers(text, name, parser)
    return study


def whole_numbers(text, what, parser):
    words = text.split(",")
    for word in words:
        if not (word.isascii() and word.isdigit() and int(word) > 0):
            parser.error(f"--{what}: '{word}' is no whole number above 0")
    return [int(word) for word in words]


def publish(folder, target, files, rows):
    """Copies files, {name: where it lies in the folder}, those that there are, beside the rows."""
    target.mkdir(parents=True, exist_ok=True)
    for name, source in files.items():
        if (folder / source).exists():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(folder / source, target / name)
    (target / "rows.jsonl.xz").write_bytes(lzma.compress(lines_of(rows).encode()))


def run_study(name, options, study, steps):
    """The whole of a script, by its `steps`: run(folder) -> (finished, runner), counted(study,
    rows), report(study, rows, failures), draw(study, rows, folder) -> notes, and published(study)
    -> what publish() copies beside report and rows. Returns the exit code."""
    terminate_as_interrupt()
    options.cache = options.cache and options.cache.resolve()
    folder = options.results.resolve()
    options.publish = options.publish and options.publish.resolve()
    os.chdir(ROOT)
    failures, finished = {}, True
    if options.report:
        rows = load_rows(folder) if folder.is_dir() else []
        if not rows:
            say(name, f"{folder}: no results there")
            return 2
    else:
        folder.mkdir(parents=True, exist_ok=True)
        finished, runner = steps.run(folder)
        rows, failures = runner.rows, runner.failures
        # Budgets that were asked for count though the study has others.
        study = study | {"probes": sorted({*study["probes"], *options.narrowed["probes"]})}
    counted = steps.counted(study, rows)
    if len(counted) < len(rows):
        say(name, f"{len(rows) - len(counted)} rows were made with other settings and do not count")
    text = steps.report(study, counted, failures)
    (folder / f"{name}.md").write_text(text)
    notes = steps.draw(study, counted, folder)
    print(text)
    for note in notes:
        say(name, note)
    for unit, why in failures.items():
        say(name, f"failed: {unit}: {why}")
    if not finished:
        say(name, "interrupted; finished runs are kept, the same command goes on")
    if options.publish and counted:
        publish(folder, options.publish, {f"{name}.md": f"{name}.md", **steps.published(study)},
                counted)
    elif options.publish:
        say(name, "nothing is published: there are no rows")
    print(folder / f"{name}.md")
    return 130 if not finished else 1 if failures else 0


def say(name, text):
    print(f"{name}: {text}", file=sys.stderr)
