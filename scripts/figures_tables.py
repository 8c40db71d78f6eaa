# SPDX-License-Identifier: GPL-3.0-or-later
"""What each figure plots, as tables of rows, and what its caption says of them. Standard library
only. tables_NAME(study) returns {suffix: rows}; the figure is drawn from these rows alone."""
import csv
import math
import re
import statistics

from figures_cells import InputError, Study, scenes_and_states
from figures_extra_tables import (cost_rows, exact_visibility, tables_bias_map,
                                  tables_grid_robustness, tables_layout_tuning)
from figures_points import (by_seed, combine, groups, mean_of, metric_rows, over_scenes, pareto,
                            point, scene_states, slope)

LEAST_LEAK = 1e-7  # smaller ones are drawn as zero
LEAKS = {"light leak": "error.light_leak", "shadow leak": "error.shadow_leak"}
NRMSE = {"nrmse": "error.nrmse"}


# Error and leaks against N.

def slopes(study, states):
    """Of log nrmse over log N stored: the fit to the points, and the least and most of the fits to
    each seed's."""
    rows = []
    for (scene, layout), cells in groups(study, ["scene", "layout"]).items():
        points, seeds = [], {}
        for probes in {c.axes["probes"] for c in cells}:
            of = [c for c in cells if c.axes["probes"] == probes]
            n = mean_of(of, "probes.stored", states[scene])
            errors = by_seed(of, "error.nrmse", states[scene])
            if errors and n:
                points.append((n, statistics.fmean(errors.values())))
            for seed, error in errors.items():
                seeds.setdefault(seed, []).append((n, error))
        fits = [s for s in map(slope, seeds.values()) if s is not None]
        if slope(points) is not None:
            rows.append({"scene": scene, "layout": layout, "metric": "slope",
                         "value": slope(points), "low": min(fits, default=None),
                         "high": max(fits, default=None), "seeds": len(fits)})
    return rows


def tables_error_vs_n(study):
    rows = metric_rows(study, ["scene", "layout", "probes"], {**NRMSE, **LEAKS},
                       {"stored": "probes.stored"})
    rows.sort(key=lambda r: (study.axis("scene").index(r["scene"]),
                             study.axis("layout").index(r["layout"]), r["metric"], r["stored"]))
    return {"": rows + slopes(study, scene_states(study))}


# Thin wall. scenes/scenelib/rooms.py: two rooms of 4 x 2.6 x 4 m, the wall of thickness t between
# them at x = 0; the grid's lattice fills the box of both and keeps 0.05 spacings off its faces.
ROOMS_M, INSET = (8.0, 2.6, 4.0), 0.05
SHUT = 0.05  # what Chebyshev's bound leaves of an occluded probe where the wall counts as shut


def lobe_width(exponent):
    """Root mean square angle in one direction across it of a lobe cos^exponent, rad."""
    angles = [(i + 0.5) * math.pi / 2 / 20000 for i in range(20000)]
    weights = [math.cos(a) ** exponent * math.sin(a) for a in angles]
    return math.sqrt(sum(w * a * a for a, w in zip(angles, weights)) / (2 * sum(weights)))


def thin_wall_law(params):
    """t / (d sin theta) from which on moments alone keep the light out; None without them. The
    lobe blurs the distances to the wall by lobe_width d tan(theta) along the ray, and the bound
    1 / (1 + x^2), to its power, is SHUT at x of these beyond it: 0.182 for cos^50 and a cube."""
    if not params.get("visibility"):
        return None
    beyond = math.sqrt(SHUT ** (-1 / params["chebyshev_power"]) - 1)
    return beyond * lobe_width(params["distance_exponent"])


def wall_geometry(thickness, count):
    """Of a receiver at the wall in the middle of a lattice cell, and the four probes of that cell
    across the wall: d, theta (of the ray to the receiver's point of the wall with the wall's
    normal), so that d sin theta is half the diagonal of the cell's face along the wall. `joins`:
    whether any cell has probes in both rooms; a lattice with an odd count has a layer of probes
    in the wall instead, which are not stored, and none does."""
    extent = (ROOMS_M[0] + thickness, ROOMS_M[1], ROOMS_M[2])
    sx, sy, sz = (e / (n - 1 + 2 * INSET) if n > 1 else e for e, n in zip(extent, count))
    along, d = math.hypot(sy, sz) / 2, math.hypot(sx, sy, sz) / 2
    return {"spacing_x": sx, "spacing_y": sy, "spacing_z": sz, "d": d,
            "theta_deg": math.degrees(math.asin(along / d)), "d_sin_theta": along,
            "ratio": thickness / along, "joins": int(count[0] % 2 == 0 and sx > thickness)}


def tables_thin_wall(study):
    counts, laws = {}, {}
    for cell in study.cells:
        if cell.axes["params"] not in laws and "params" in cell.result:
            laws[cell.axes["params"]] = thin_wall_law(cell.result["params"])
        if cell.result.get("lattice") and cell.result.get("strategy") == "grid":
            counts[cell.scene, cell.axes["probes"]] = cell.result["lattice"]
    rows = []
    light = {"light leak": LEAKS["light leak"]}
    for row in metric_rows(study, ["scene", "probes", "params"], light,
                           {"stored": "probes.stored"}):
        thickness = re.search(r"(\d+)cm$", row["scene"])
        if thickness and (row["scene"], row["probes"]) in counts:
            t = int(thickness.group(1)) / 100
            rows.append({**row, "thickness_m": t, "law": laws.get(row["params"]),
                         **wall_geometry(t, counts[row["scene"], row["probes"]])})
    return {"": sorted(rows, key=lambda r: (study.axis("params").index(r["params"]),
                                            r["thickness_m"], float(r["probes"])))}


# Tables that are one row a setting and number.

def tables_visibility_terms(study):
    return {"": metric_rows(exact_visibility(study), ["scene", "terms"], {**NRMSE, **LEAKS})}


def tables_rays_hysteresis(study):
    """Without updates to a level where one of the seeds did not settle within its run."""
    keys = ["scene", "rays", "hysteresis", "warm-up"]
    rows = metric_rows(study, keys, {**NRMSE, "flicker": "temporal.flicker",
                                     "updates to 95 %": "temporal.updates_to_95",
                                     "updates to 99 %": "temporal.updates_to_99"})
    ran = {tuple(r[k] for k in keys): r["seeds"] for r in rows if r["metric"] == "nrmse"}
    return {"": [r for r in rows if r["metric"] not in ("updates to 95 %", "updates to 99 %")
                 or r["seeds"] >= ran.get(tuple(r[k] for k in keys), 0)]}


def tables_texels(study):
    """`fixed`: probes, or the bytes of all texels, so that finer maps leave fewer probes."""
    keys = ["irradiance texels", "moment texels"]
    rows = metric_rows(study, ["scene", *keys, "fixed"],
                       {**NRMSE, "light leak": LEAKS["light leak"]},
                       {"stored": "probes.stored", "bytes_a_probe": "memory.atlas_per_probe"})
    for row in rows:
        row["fixed"] = row["fixed"].split(":")[0]
    return {"": rows}


def tables_interpolants(study):
    metrics = {**NRMSE, "light leak": LEAKS["light leak"], "query ns": "speed.query_ns_per_point"}
    rows = metric_rows(study, ["scene", "layout", "interpolant"], metrics)
    for label, name in metrics.items():
        rows += over_scenes(study, ["layout", "interpolant"], label, name)
    return {"": rows}


def tables_formats(study):
    return {"": metric_rows(study, ["scene", "format", "gamma", "hysteresis", "rounding"],
                            {"bias": "error.bias"})}


# Speed against error.

WANTED = (0.5, 0.3, 0.2, 0.1, 0.05, 0.03, 0.02, 0.01)  # nrmse
SETTING = ["params", "probes", "rays", "layout", "texels"]


def first_update_within(cell, wanted):
    """The first recorded update after which nrmse is within `wanted`, or None."""
    after = dict((cell.result.get("temporal") or {}).get("nrmse_after") or {})
    record = {int(k): v for k, v in after.items() if v is not None}
    if cell.value("updates") and cell.value("error.nrmse") is not None:
        record[int(cell.value("updates"))] = cell.value("error.nrmse")
    return min((k for k, v in record.items() if v <= wanted), default=None)


def time_to_error(cells, wanted, states):
    """Mean over seeds and states of the time of the updates until nrmse is within `wanted`; None
    where one of the runs does not get there."""
    times, updates, runs = [], [], set()
    for cell in cells:
        first, update_ms = first_update_within(cell, wanted), cell.value("speed.update_ms")
        if first is None or update_ms is None:
            return None
        times.append(first * update_ms)
        updates.append(first)
        runs.add(cell.state)
    if runs != set(states):
        return None
    return {"time_ms": statistics.fmean(times), "low": min(times), "high": max(times),
            "updates": statistics.fmean(updates), "runs": len(times)}


def fastest(study, states):
    """The setting that first gets within each error, by the time of its updates."""
    rows = []
    for scene in study.axis("scene"):
        for wanted in WANTED:
            best = None
            for values, cells in groups(study, ["scene", *SETTING]).items():
                found = time_to_error(cells, wanted, states[scene]) if values[0] == scene else None
                if found and (best is None or found["time_ms"] < best["time_ms"]):
                    best = {"scene": scene, "nrmse": wanted, **dict(zip(SETTING, values[1:])),
                            **found}
            rows.append(best or {"scene": scene, "nrmse": wanted})
    return rows


PIXELS = 1920 * 1080


def path_tracing(study, states):
    """nrmse of path tracing the pixels of a 1080p frame in one second: `receivers.count` points
    took `receivers.seconds` to reach the noise floor, and the noise falls with the root of the
    time."""
    found = {}
    for cell in study.cells:
        floor, count, seconds = (cell.value(n) for n in (
            "error.noise_floor.nrmse", "receivers.count", "receivers.seconds"))
        if floor and count and seconds:
            found.setdefault(cell.scene, {}).setdefault(cell.seed, {})[cell.state] = \
                floor * math.sqrt(seconds * PIXELS / count)
    rows = []
    for scene, seeds in found.items():
        values = [combine("nrmse", list(of.values())) for of in seeds.values()
                  if set(of) == states[scene]]
        if values:
            rows.append({"scene": scene, "metric": "nrmse of path tracing a frame in 1 s",
                         "value": statistics.fmean(values), "low": min(values),
                         "high": max(values), "seeds": len(values)})
    return rows


def tables_speed_error(study):
    states = scene_states(study)
    rows = metric_rows(study, ["scene", *SETTING], NRMSE,
                       {"stored": "probes.stored", "work_rays": "work.rays",
                        "bytes": "memory_bytes"})
    cells = groups(study, ["scene", *SETTING])
    for row in rows:
        of = cells[tuple(row[k] for k in ("scene", *SETTING))]
        time = point(of, "speed.frame_ms", states[row["scene"]]) or {}
        row.update(frame_ms=time.get("value"), frame_ms_low=time.get("low"),
                   frame_ms_high=time.get("high"))
    for scene in study.axis("scene"):
        for cost in ("frame_ms", "work_rays"):
            of = [r for r in rows if r["scene"] == scene and r[cost]]
            front = pareto([(r[cost], r["value"]) for r in of])
            for i, row in enumerate(of):
                row["front_" + cost] = int(i in front)
    return {"": rows, "time_to_error": fastest(study, states),
            "path_tracing": path_tracing(study, states), "cost": cost_rows(study, SETTING)}


# Error budget.

RUNG_METRICS = ("nrmse", "light_leak", "share")


def rung_values(study):
    """{(scene, other axes, rung, its name, metric): {seed: {state: value}}}"""
    found = {}
    for cell in study.cells:
        setting = ", ".join(cell.axes[a] for a in study.axis_names)
        for i, rung in enumerate(cell.result.get("rungs") or []):
            if not isinstance(rung["name"], str):
                raise TypeError(f"rung {i} has no name")
            for metric in RUNG_METRICS:
                if isinstance(rung.get(metric), (int, float)):
                    key = (cell.scene, setting, i, rung["name"], metric)
                    found.setdefault(key, {}).setdefault(cell.seed, {})[cell.state] = rung[metric]
    return found


def tables_budget(study):
    """A row for every scene, setting, rung and metric."""
    states, rows = scene_states(study), []
    for (scene, setting, i, name, metric), seeds in rung_values(study).items():
        values = [combine(metric, list(of.values())) for of in seeds.values()
                  if set(of) == states[scene]]
        floor = mean_of([c for c in study.cells if c.scene == scene],
                        f"error.noise_floor.{metric}", states[scene])
        if values:
            rows.append({"scene": scene, "setting": setting, "rung": i, "name": name,
                         "metric": metric.replace("_", " "), "value": statistics.fmean(values),
                         "low": min(values), "high": max(values), "seeds": len(values),
                         "floor": floor})
    return {"": rows}


TABLES = {"error_vs_n": tables_error_vs_n, "thin_wall": tables_thin_wall,
          "visibility_terms": tables_visibility_terms, "rays_hysteresis": tables_rays_hysteresis,
          "texels": tables_texels, "interpolants": tables_interpolants, "formats": tables_formats,
          "speed_error": tables_speed_error, "budget": tables_budget,
          "grid_robustness": tables_grid_robustness, "bias_map": tables_bias_map,
          "layout_tuning": tables_layout_tuning}

READABLE = ("cost", "time_to_error", "spread", "parameters")  # tables that are Markdown as well

# The axes that each one needs; a study of another name with the same axes gets the same figure.
AXES = {"error_vs_n": {"probes", "layout"}, "thin_wall": {"probes", "params"},
        "visibility_terms": {"terms"}, "rays_hysteresis": {"rays", "hysteresis", "warm-up"},
        "texels": {"irradiance texels", "moment texels", "fixed"},
        "interpolants": {"layout", "interpolant"},
        "formats": {"format", "gamma", "hysteresis", "rounding"},
        "speed_error": set(SETTING), "grid_robustness": {"offset"},
        "bias_map": set(), "layout_tuning": {"layout"}}
TUNED = ("bias_map", "layout_tuning")  # of `probelab tune`


def kind_of(study):
    """Which of the figures a study has, or None."""
    if study.command == "budget" and study.name not in AXES:
        return "budget"
    kinds = {kind: axes for kind, axes in AXES.items()
             if (kind in TUNED) == (study.command == "tune")}
    if study.name in kinds and kinds[study.name] <= set(study.axis_names):
        return study.name
    return next((kind for kind, axes in kinds.items() if axes == set(study.axis_names)
                 and (axes or any(c.result.get("bias_map") for c in study.cells))), None)


# Which cells can be drawn.

# The numbers without which a cell is no point of a figure; where none is named, it has rows or not.
NEEDS = {"error_vs_n": ("error.nrmse", "probes.stored"), "thin_wall": ("error.light_leak",),
         "visibility_terms": ("error.nrmse",), "rays_hysteresis": ("error.nrmse",),
         "texels": ("error.nrmse", "memory.atlas_per_probe"), "interpolants": ("error.nrmse",),
         "formats": ("error.bias",), "speed_error": ("error.nrmse", "memory_bytes"),
         "grid_robustness": ("error.nrmse",)}
# What reading a result raises that has something else in the place of a table or a number.
DAMAGE = (ArithmeticError, AttributeError, LookupError, TypeError, ValueError, csv.Error)


def lacks(study, kind, cell):
    """What a figure needs and a cell has not, or ""; raises one of DAMAGE."""
    one = Study(study.folder, study.name, [cell], [])
    seen, = (exact_visibility(one) if kind == "visibility_terms" else one).cells
    for name in NEEDS.get(kind, ()):
        if seen.value(name) is None:
            return f"number '{name}'"
    rows = TABLES[kind](one)[""]
    return "" if rows or kind in NEEDS else "number of its figure"


def drawable(study, kind):
    """The study without the cells that cannot be drawn, and a line for each that is damaged. A
    state of a scene in which no cell has its numbers is not: it gets no light, say."""
    whole, lacking, damaged = [], [], []
    for cell in study.cells:
        try:
            missing = lacks(study, kind, cell)
        except (*DAMAGE, OSError) as error:
            damaged.append(f"{cell.path}: not a whole result: {type(error).__name__}: {error}")
            continue
        if missing:
            lacking.append((cell, missing))
        else:
            whole.append(cell)
    if not whole and damaged:
        return study, []  # it is the study that is not what its figure wants; drawing says why
    if not whole:
        raise InputError(f"{study.folder}: none of the {len(lacking)} cells of '{study.name}' "
                         "has the numbers that its figure shows")
    places = {(cell.scene, cell.state) for cell in whole}
    numberless = [cell for cell, _ in lacking if (cell.scene, cell.state) not in places]
    damaged += [f"{cell.path}: not a whole result: no {missing}"
                for cell, missing in lacking if (cell.scene, cell.state) in places]
    left_out = [f"{scenes_and_states(numberless)} left out for lack of a number"] \
        if numberless else []
    return Study(study.folder, study.name, whole, study.left_out + left_out, numberless), damaged
