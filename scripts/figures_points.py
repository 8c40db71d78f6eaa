# SPDX-License-Identifier: GPL-3.0-or-later
"""From cells to points with intervals. Standard library only.

A point's value in a seed combines the lighting states of its scene (root of the mean square for
nrmse, else the mean); the point is the mean over seeds, and its interval the least and the most of
them. A seed that lacks one of the states is left out.
"""
import math
import random
import statistics

REPLICATES = 2000


def combine(name, values):
    if name.split(".")[-1] == "nrmse":
        return math.sqrt(statistics.fmean(v * v for v in values))
    return statistics.fmean(values)


def by_seed(cells, name, states):
    """{seed: value} of the seeds that have all these states."""
    found = {}
    for cell in cells:
        value = cell.value(name)
        if value is not None and math.isfinite(value):
            found.setdefault(cell.seed, {})[cell.state] = value
    return {seed: combine(name, list(of.values())) for seed, of in sorted(found.items())
            if set(of) == set(states)}


def groups(study, keys):
    """{values of the keys: cells}; a key is an axis' name."""
    found = {}
    for cell in study.cells:
        found.setdefault(tuple(cell.axes.get(k, "") for k in keys), []).append(cell)
    return found


def scene_states(study):
    found = {}
    for cell in study.cells:
        found.setdefault(cell.scene, set()).add(cell.state)
    return found


def point(cells, name, states):
    """{value, low, high, seeds} or None where no seed is complete."""
    values = list(by_seed(cells, name, states).values())
    if not values:
        return None
    return {"value": statistics.fmean(values), "low": min(values), "high": max(values),
            "seeds": len(values)}


def mean_of(cells, name, states):
    """The mean over seeds alone, or None."""
    found = point(cells, name, states)
    return found and found["value"]


def metric_rows(study, keys, metrics, also=None):
    """A row for every group and metric {label: dotted name}: the keys, metric, value, low, high,
    seeds, floor (the reference's own noise in it; empty where it has none). `also` names further
    columns {column: dotted name}, each a mean over seeds."""
    states, rows = scene_states(study), []
    for values, cells in groups(study, keys).items():
        of = states[cells[0].scene]
        for label, name in metrics.items():
            found = point(cells, name, of)
            if found is None:
                continue
            floor = mean_of(cells, name.replace("error.", "error.noise_floor.", 1), of) \
                if name.startswith("error.") else None
            row = dict(zip(keys, values), metric=label, **found, floor=floor)
            row.update({column: mean_of(cells, other, of)
                        for column, other in (also or {}).items()})
            rows.append(row)
    return rows


def slope(points):
    """Of the straight line through (log x, log y) by least squares; None below two abscissas."""
    logs = [(math.log(x), math.log(y)) for x, y in points if x > 0 and y > 0]
    if len({x for x, _ in logs}) < 2:
        return None
    mx, my = (statistics.fmean(c) for c in zip(*logs))
    return sum((x - mx) * (y - my) for x, y in logs) / sum((x - mx) ** 2 for x, _ in logs)


def geometric_mean(values):
    return math.exp(statistics.fmean(map(math.log, values)))


def geometric_interval(table):
    """Of [scene][seed] values the geometric mean over scenes of the means over seeds, and its 95 %
    interval from 2,000 bootstrap replicates that draw seeds within scenes. None where a value is
    not positive."""
    if not table or any(v <= 0 for seeds in table for v in seeds):
        return None
    generator = random.Random(1)
    drawn = sorted(geometric_mean([statistics.fmean(generator.choices(seeds, k=len(seeds)))
                                   for seeds in table]) for _ in range(REPLICATES))
    return {"value": geometric_mean([statistics.fmean(seeds) for seeds in table]),
            "low": drawn[int(0.025 * (REPLICATES - 1))],
            "high": drawn[math.ceil(0.975 * (REPLICATES - 1))],
            "seeds": min(map(len, table))}


def over_scenes(study, keys, label, name):
    """Rows with scene = 'all scenes' (see geometric_interval) of the settings that every scene
    has; none for a single scene."""
    states, found = scene_states(study), {}
    for values, cells in groups(study, ["scene", *keys]).items():
        seeds = by_seed(cells, name, states[values[0]])
        if seeds:
            found.setdefault(values[1:], []).append(list(seeds.values()))
    rows = []
    for values, table in found.items():
        mean = geometric_interval(table) if len(table) == len(states) > 1 else None
        if mean:
            rows.append(dict(zip(keys, values), scene="all scenes", metric=label, **mean,
                             floor=None))
    return rows


def pareto(points):
    """Which of (cost, error) no other beats in both: indices, by cost."""
    front, least = [], math.inf
    for i in sorted(range(len(points)), key=lambda i: points[i]):
        if points[i][1] < least:
            front.append(i)
            least = points[i][1]
    return front
