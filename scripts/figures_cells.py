# SPDX-License-Identifier: GPL-3.0-or-later
"""The cells of a results folder of `probelab run`, and how many its study file asks for. Standard
library only."""
import csv
import itertools
import json
import math
import pathlib
import re
import tomllib

from whole_output import InputError

STUDIES = pathlib.Path(__file__).resolve().parent.parent / "experiments" / "studies"
EVERYWHERE = ("scene", "state", "seed")  # axes that every study has
TUNED_STATES = "train"  # the state of `tune` where none is named: all that are not held out
KINDS = {str: "text", list: "list", dict: "table"}


def member(table, name, kind):
    """What a table has of this name and kind; in a damaged file anything may stand there."""
    found = table.get(name) if isinstance(table, dict) else None
    if not isinstance(found, kind):
        raise TypeError(f"it has no {KINDS[kind]} '{name}'")
    return found


def settings_of(options):
    """{option: value}; the lists `set` and `option` key by key. Of a file only the name counts:
    its way depends on where the study was started from."""
    found = {}
    for name in options:
        values = [re.sub(r"[^,=]*/", "", str(value)) for value in member(options, name, list)]
        if name in ("set", "option"):
            found.update((f"{name} {key}", value)
                         for key, _, value in (text.partition("=") for text in values))
        elif name not in EVERYWHERE:
            found[name] = " ".join(values)
    return found


class Cell:
    """One result: `axes` as texts, `options` as they stand in it, `settings` to compare them,
    `result` as the command printed it."""

    def __init__(self, path, result):
        about = member(result, "cell", dict)
        self.path, self.result = path, result
        self.id, self.study, self.command = (member(about, name, str)
                                             for name in ("id", "study", "command"))
        if self.study != pathlib.PurePath(self.study).name:
            raise TypeError(f"its study '{self.study}' is no file's name")
        self.axes = {name: str(value) for name, value in member(about, "axes", dict).items()}
        self.options = member({"options": {}, **about}, "options", dict)
        self.settings = settings_of(self.options)
        if self.command == "tune" and "state" not in self.options and "state" in self.axes:
            self.axes["state"] = TUNED_STATES  # older programs named the scene's first state
        self.scene, self.state = member(self.axes, "scene", str), self.axes.get("state", "")
        self.seed = self.axes.get("seed", "")

    def found(self, name):
        """What has this dotted name, or None. A number in it is the place in a list."""
        found = self.result
        for part in name.split("."):
            if isinstance(found, list) and part.isdigit():
                found = found[int(part)] if int(part) < len(found) else None
            else:
                found = found.get(part) if isinstance(found, dict) else None
        return found

    def value(self, name):
        """The finite number of this dotted name, or None."""
        found = self.found(name)
        if isinstance(found, bool) or not isinstance(found, (int, float)):
            return None
        try:
            return float(found) if math.isfinite(found) else None
        except OverflowError:  # a whole number of more than 308 digits
            return None

    def text(self, name, default=""):
        found = self.found(name)
        return found if isinstance(found, str) else default

    def of_scene(self, name):
        """The number of this name, which `tune` has by scene (a cell has one), or None."""
        return self.value(f"scenes.0.{name}" if self.command == "tune" else name)

    def receivers(self):
        return self.of_scene("receivers" if self.command == "tune" else "receivers.count")


class Study:
    """The cells of one study of a folder, one for every setting. `left_out`: texts, for what the
    others were. `numberless`: whole cells, not among `cells`, whose scenes have nothing to draw."""

    def __init__(self, folder, name, cells, left_out, numberless=()):
        self.folder, self.name, self.cells, self.left_out = folder, name, cells, left_out
        self.numberless = list(numberless)
        self.command = cells[0].command
        self.axis_names = [a for a in cells[0].axes if a not in EVERYWHERE]

    def distinct(self, of):
        """Values of of(cell), in order: numbers by size, else as they first come."""
        return ordered(of(cell) for cell in self.cells)

    def axis(self, name):
        return self.distinct(lambda cell: cell.axes.get(name, ""))


def scenes_and_states(cells):
    """'cornell (panel); two_rooms_door (day, night)'."""
    states = {}
    for cell in cells:
        states.setdefault(cell.scene, {})[cell.state] = None
    return "; ".join(f"{scene} ({', '.join(of)})" for scene, of in states.items())


def count(number, noun):
    return f"{number} {noun}" + "s" * (number != 1)


def is_number(text):
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def ordered(values):
    found = list(dict.fromkeys(values))
    try:
        return sorted(found, key=float)
    except (TypeError, ValueError):
        return found


def read_cell(path):
    try:
        result = json.loads(path.read_text())
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: not a whole result: {error}") from error
    try:
        return Cell(path, result)
    except TypeError as error:
        raise InputError(f"{path}: not a cell of 'probelab run': {error}") from error


def listed_ids(path):
    """The ids in the table that the last run wrote; none where there is no table."""
    try:
        with open(path, newline="") as file:
            return {row.get("id") for row in csv.DictReader(file)}
    except (OSError, ValueError, csv.Error):
        return set()


def options_of_axes(path):
    """The options that the axes of a study file set."""
    with open(path, "rb") as file:
        plan = tomllib.load(file)
    varied = set()
    for axis in plan.get("axis", []):
        varied.add(axis.get("option"))
        for value in axis.get("value", []):
            varied.update(value.get("options", {}))
    return varied


def follows(cells, axis, name):
    """Whether an option is the same wherever the axis is."""
    pairs = {(cell.axes[axis], cell.settings.get(name)) for cell in cells}
    return len(pairs) == len({value for value, _ in pairs})


def set_by_axes(cells, listed, names):
    """Those of these options that an axis sets, as the cells show it: they differ within one run,
    whose other options are the same for all of its cells, or have one value for every value of an
    axis. But an axis whose values are an option's numbers (of probes, say) is taken to set that
    one alone: sizes of a study that share no value of it would look the same."""
    one_run = [cell.settings for cell in cells if cell.id in listed]
    found = {name for name in names if len({of.get(name) for of in one_run}) > 1}
    for axis in (a for a in cells[0].axes if a not in EVERYWHERE):
        plain = {name for name in names
                 if all(cell.settings.get(name) == cell.axes[axis] and is_number(cell.axes[axis])
                        for cell in cells)}
        found |= plain or {name for name in names if follows(cells, axis, name)}
    return found


def differing(cells):
    """The options that are not the same in all of these cells."""
    names = sorted({name for cell in cells for name in cell.settings})
    return [n for n in names if len({cell.settings.get(n) for cell in cells}) > 1]


def of_one_kind(folder, name, cells):
    """Of cells whose common options differ (sizes of a study that set their own), or their axes
    (the study was another one), those of one kind, which alone can be compared: the commonest, but
    of axes those of the last run; and a text for the rest."""
    by_axes, listed = {}, listed_ids(folder / f"{name}.csv")
    for cell in cells:
        by_axes.setdefault(tuple(cell.axes), []).append(cell)
    best = max(by_axes.values(), key=lambda of: (sum(c.id in listed for c in of), len(of)))
    others = [f"{count(len(cells) - len(best), 'cell')} with other axes left out"] \
        * (len(by_axes) > 1)
    path, names = study_file(name), differing(best)
    if path:
        varied = options_of_axes(path)
        names = [n for n in names if n.split(" ")[0] not in varied]
    else:
        varied = set_by_axes(best, listed, names)
        names = [n for n in names if n not in varied]
    kinds = {}
    for cell in best:
        kinds.setdefault(tuple(cell.settings.get(n) for n in names), []).append(cell)
    kept = max(kinds.values(), key=lambda kind: (len(kind), sum(c.id in listed for c in kind)))
    if len(kinds) > 1:
        others.append(f"{count(len(best) - len(kept), 'cell')} with another "
                      f"{' or '.join(names)} left out")
    return kept, others


def of_one_version(folder, name, cells):
    """Cells of one version of the program, of the last run's or else the commonest, for a point's
    seeds are no repetitions where the program changed between them; and a text for the rest."""
    listed, by_version = listed_ids(folder / f"{name}.csv"), {}
    for cell in cells:
        by_version.setdefault(cell.text("version"), []).append(cell)
    kept = max(by_version.values(), key=lambda of: (
        sum(c.id in listed for c in of), len(of), max(c.path.stat().st_mtime_ns for c in of)))
    rest = len(cells) - len(kept)
    return kept, [f"{count(rest, 'cell')} of another version left out"] * bool(rest)


def differences(cell, other):
    """What of two cells with the same axes is not the same."""
    names = {"device": "device", "provenance.scene_hash": "scene",
             "scenes.0.hash": "scene"}
    found = [says for name, says in names.items() if cell.found(name) != other.found(name)]
    return [*found, *differing([cell, other])] or ["input file"]  # of their bytes is but the id


def one_for_each_setting(folder, name, cells):
    """Of cells with the same axes (of another device, say) the one that the study's table lists,
    else the newest; and a text for the rest."""
    listed = listed_ids(folder / f"{name}.csv")
    best, rest = {}, []
    for cell in sorted(cells, key=lambda c: (c.id in listed, c.path.stat().st_mtime_ns, c.id)):
        key = tuple(cell.axes.items())
        rest += [best[key]] if key in best else []
        best[key] = cell
    kept = [best[key] for key in dict.fromkeys(tuple(cell.axes.items()) for cell in cells)]
    what = dict.fromkeys(d for cell in rest
                         for d in differences(cell, best[tuple(cell.axes.items())]))
    return kept, [f"{count(len(rest), 'cell')} of the same axes but another {' or '.join(what)} "
                  "left out"] * bool(rest)


def cell_files(folder):
    return sorted(p for p in (folder / "cells").glob("*.json") if not p.name.startswith("."))


def load_folder(folder):
    """The studies of a folder, and a line for every damaged cell."""
    paths = cell_files(folder)
    if not paths:
        raise InputError(f"{folder}: no cells; 'probelab run STUDY --results {folder}' makes them")
    by_study, damaged = {}, []
    for path in paths:
        try:
            cell = read_cell(path)
            by_study.setdefault(cell.study, []).append(cell)
        except InputError as error:
            damaged.append(str(error))
    studies = []
    for name, cells in sorted(by_study.items()):
        alike, others = of_one_kind(folder, name, cells)
        of_version, older = of_one_version(folder, name, alike)
        kept, repeated = one_for_each_setting(folder, name, of_version)
        studies.append(Study(folder, name, in_study_order(name, kept), others + older + repeated))
    return studies, damaged


# What a study file asks for.

def scene_name(path):
    """As in the cells: the folder, with the file where that is not scene.toml."""
    path = pathlib.PurePath(path)
    return path.parent.name if path.name == "scene.toml" else f"{path.parent.name}/{path.stem}"


def states_of(scene_path, wanted, command):
    with open(scene_path, "rb") as file:
        states = tomllib.load(file).get("state", [])
    if wanted is None or not states:
        first = states[0]["name"] if states else "default"
        return [TUNED_STATES if command == "tune" else first]
    if isinstance(wanted, list):
        return [s["name"] for s in states if s["name"] in wanted]
    return [s["name"] for s in states if wanted in ("all", s.get("split", "train"))]


def axis_values(axis):
    return [str(v) for v in axis.get("values", [])] or [v["name"] for v in axis.get("value", [])]


def stands_beside(plan, values):
    """Whether each value is for cells with the others: 'with' of [[axis.value]]."""
    chosen = dict(values)
    return all(chosen[other] in map(str, names)
               for axis in plan.get("axis", []) for value in axis.get("value", [])
               if chosen[axis["name"]] == value["name"]
               for other, names in value.get("with", {}).items())


def expand(path, size=None):
    """The axes of every cell of a study file, as tuples of (name, value), in its order."""
    with open(path, "rb") as file:
        plan = tomllib.load(file)
    part = plan.get("size", {})[size] if size else {}
    scenes = [s for s in plan["scenes"]
              if "scenes" not in part or any(word in s for word in part["scenes"])]
    axes = [(a["name"], [v for v in axis_values(a) if a["name"] not in part.get("axes", {})
                         or v in map(str, part["axes"][a["name"]])])
            for a in plan.get("axis", [])]
    seeds = [str(s) for s in part.get("seeds", plan.get("seeds", [1]))]
    wanted = part.get("states", plan.get("states"))
    cells = []
    for scene in scenes:
        for state in states_of(path.parent / scene, wanted, plan["command"]):
            for values in itertools.product(*[[(n, v) for v in vs] for n, vs in axes]):
                if not stands_beside(plan, values):
                    continue
                cells += [(("scene", scene_name(scene)), ("state", state), *values, ("seed", seed))
                          for seed in seeds]
    return cells


def study_file(name):
    path = STUDIES / f"{name}.toml"
    return path if path.is_file() else None


def in_study_order(name, cells):
    """In the order of the study file, others last; without a file by their axes."""
    path = study_file(name)
    try:
        order = {key: i for i, key in enumerate(expand(path))} if path else {}
    except (OSError, KeyError, TypeError, ValueError):
        order = {}
    return sorted(cells, key=lambda c: (order.get(tuple(c.axes.items()), len(order)),
                                        list(c.axes.values())))


def completeness(study):
    """'4 of 378 cells of the study (all 4 of its size smoke)', for the caption."""
    cells = [*study.cells, *study.numberless]
    have = {tuple(cell.axes.items()) for cell in cells}
    path = study_file(study.name)
    try:
        wanted = set(expand(path)) if path else set()
        sizes = {size: set(expand(path, size)) for size in load_sizes(path)} if path else {}
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: not a study: {error}") from error
    if not wanted:
        # A scene has states of its own: these two are one axis.
        places = {(cell.scene, cell.state) for cell in cells}
        product = math.prod((len({cell.axes[a] for cell in cells})
                             for a in cells[0].axes if a not in ("scene", "state")),
                            start=len(places))
        return f"{len(have)} of {product} cells (the product of the axes that occur)"
    text = f"{len(have & wanted)} of {len(wanted)} cells of the study"
    for size, part in sorted(sizes.items(), key=lambda item: len(item[1])):
        if have <= part and len(part) < len(wanted):
            text += f" ({len(have)} of {len(part)} of its size {size})"
            break
    if have - wanted:
        text += f", and {len(have - wanted)} that its file does not name"
    return text


def load_sizes(path):
    with open(path, "rb") as file:
        return list(tomllib.load(file).get("size", {}))
