# SPDX-License-Identifier: GPL-3.0-or-later
"""The cells of a results folder of `probelab run`, and how many its study file asks for. Standard
library only."""
import csv
import itertools
import json
import pathlib
import tomllib

STUDIES = pathlib.Path(__file__).resolve().parent.parent / "experiments" / "studies"


class InputError(Exception):
    """What is wrong with which file, in one line."""


class Cell:
    """One result: `axes` as texts, `result` as the command printed it."""

    def __init__(self, path, result):
        about = result["cell"]
        self.path, self.result = path, result
        self.id, self.study, self.command = about["id"], about["study"], about["command"]
        self.axes = {name: str(value) for name, value in about["axes"].items()}
        self.scene, self.state = self.axes["scene"], self.axes.get("state", "")
        self.seed = self.axes.get("seed", "")

    def value(self, name):
        """The number of this dotted name, or None."""
        found = self.result
        for part in name.split("."):
            found = found.get(part) if isinstance(found, dict) else None
        if isinstance(found, bool) or not isinstance(found, (int, float)):
            return None
        return float(found)

    def text(self, name, default=""):
        found = self.result.get(name)
        return found if isinstance(found, str) else default


class Study:
    """The cells of one study of a folder, one for every setting. `left_out`: texts, for what the
    others were."""

    def __init__(self, folder, name, cells, left_out):
        self.folder, self.name, self.cells, self.left_out = folder, name, cells, left_out
        self.command = cells[0].command
        self.axis_names = [a for a in cells[0].axes if a not in ("scene", "state", "seed")]

    def distinct(self, of):
        """Values of of(cell), in order: numbers by size, else as they first come."""
        return ordered(of(cell) for cell in self.cells)

    def axis(self, name):
        return self.distinct(lambda cell: cell.axes.get(name, ""))


def count(number, noun):
    return f"{number} {noun}" + "s" * (number != 1)


def ordered(values):
    found = list(dict.fromkeys(values))
    try:
        return sorted(found, key=float)
    except (TypeError, ValueError):
        return found


def read_cell(path):
    try:
        result = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: not a whole result: {error}") from error
    try:
        return Cell(path, result)
    except (KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{path}: not a cell of 'probelab run': no {error}") from error


def listed_ids(path):
    """The ids in the table that the last run wrote; none where there is no table."""
    if not path.is_file():
        return set()
    with open(path, newline="") as file:
        return {row.get("id") for row in csv.DictReader(file)}


def common_options(path):
    """The options that a study file sets for all cells and no axis changes."""
    with open(path, "rb") as file:
        plan = tomllib.load(file)
    varied = set()
    for axis in plan.get("axis", []):
        varied.add(axis.get("option"))
        for value in axis.get("value", []):
            varied.update(value.get("options", {}))
    return sorted(set(plan.get("options", {})) - varied)


def of_one_kind(name, cells):
    """Of cells whose common options differ (sizes of a study that set their own) those of the
    commonest kind, which alone can be compared; and a text for the rest."""
    path, kinds = study_file(name), {}
    names = common_options(path) if path else []
    for cell in cells:
        options = cell.result["cell"].get("options", {})
        kinds.setdefault(tuple(" ".join(options.get(n, [])) for n in names), []).append(cell)
    best = max(kinds, key=lambda kind: len(kinds[kind]))
    if len(kinds) == 1:
        return cells, []
    differing = [n for i, n in enumerate(names) if len({kind[i] for kind in kinds}) > 1]
    return kinds[best], [f"{count(len(cells) - len(kinds[best]), 'cell')} with another "
                         f"{' or '.join(differing)} left out"]


def one_for_each_setting(folder, name, cells):
    """Of cells with the same axes (another version of the program, say) the one that the study's
    table lists, else the newest; and a text for the rest."""
    listed = listed_ids(folder / f"{name}.csv")
    best = {}
    for cell in cells:
        key = tuple(cell.axes.items())
        rank = (cell.id in listed, cell.path.stat().st_mtime_ns, cell.id)
        if key not in best or rank > best[key][0]:
            best[key] = (rank, cell)
    kept = [cell for _, cell in best.values()]
    rest = len(cells) - len(kept)
    return kept, [f"{count(rest, 'cell')} of the same settings but other versions left out"] \
        * (rest > 0)


def load_folder(folder):
    """The studies of a folder, and a line for every damaged cell."""
    paths = sorted(p for p in (folder / "cells").glob("*.json") if not p.name.startswith("."))
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
        alike, others = of_one_kind(name, cells)
        kept, older = one_for_each_setting(folder, name, alike)
        studies.append(Study(folder, name, in_study_order(name, kept), others + older))
    return studies, damaged


# What a study file asks for.

def scene_name(path):
    """As in the cells: the folder, with the file where that is not scene.toml."""
    path = pathlib.PurePath(path)
    return path.parent.name if path.name == "scene.toml" else f"{path.parent.name}/{path.stem}"


def states_of(scene_path, wanted):
    with open(scene_path, "rb") as file:
        states = tomllib.load(file).get("state", [])
    if wanted is None or not states:
        return [states[0]["name"] if states else "default"]
    if isinstance(wanted, list):
        return [s["name"] for s in states if s["name"] in wanted]
    return [s["name"] for s in states if wanted in ("all", s.get("split", "train"))]


def axis_values(axis):
    return [str(v) for v in axis.get("values", [])] or [v["name"] for v in axis.get("value", [])]


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
        for state in states_of(path.parent / scene, wanted):
            for values in itertools.product(*[[(n, v) for v in vs] for n, vs in axes]):
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
    have = {tuple(cell.axes.items()) for cell in study.cells}
    path = study_file(study.name)
    try:
        wanted = set(expand(path)) if path else set()
        sizes = {size: set(expand(path, size)) for size in load_sizes(path)} if path else {}
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: not a study: {error}") from error
    if not wanted:
        settings = itertools.product(*[set(cell.axes[a] for cell in study.cells)
                                       for a in study.cells[0].axes])
        return f"{len(have)} of {len(list(settings))} cells (the product of the axes that occur)"
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
