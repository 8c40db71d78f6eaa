# SPDX-License-Identifier: GPL-3.0-or-later
"""What the figures of grid robustness, bias maps and layout x tuning plot, and tables of cost, as
rows. Standard library only."""
import csv
import math
import re
import statistics

from figures_points import combine, groups, metric_rows, scene_states

ERRORS = {"nrmse": "error.nrmse", "light leak": "error.light_leak",
          "shadow leak": "error.shadow_leak"}


# Grid offset and rotation.

def turned(scene):
    """('two_rooms_door', 30) of two_rooms_door/scene_turned_30; 0 of a scene that is not turned."""
    found = re.fullmatch(r"(.*?)(?:/scene_turned|_turned)_(\d+)", scene)
    return (found.group(1), int(found.group(2))) if found else (scene, 0)


def tables_grid_robustness(study):
    """A row for every room, angle, offset and metric; and how far each room's errors lie apart."""
    rows = []
    for row in metric_rows(study, ["scene", "offset"], ERRORS, {"stored": "probes.stored"}):
        room, angle = turned(row["scene"])
        rows.append({"room": room, "turn_deg": angle, **row})
    rows.sort(key=lambda r: (r["room"], r["metric"], r["turn_deg"], float(r["offset"])))
    return {"": rows, "spread": spread(rows)}


def spread(rows):
    """Least, median and most of a metric over offsets and angles, and the lattice's own value."""
    out = []
    for room in dict.fromkeys(r["room"] for r in rows):
        for metric in ERRORS:
            of = [r for r in rows if r["room"] == room and r["metric"] == metric]
            plain = [r["value"] for r in of if r["turn_deg"] == 0 and float(r["offset"]) == 0]
            values = [r["value"] for r in of]
            if values:
                out.append({"room": room, "metric": metric, "least": min(values),
                            "median": statistics.median(values), "most": max(values),
                            "unmoved": plain[0] if plain else None, "places": len(values)})
    return out


# Results of `probelab tune`.

def report_file(study, cell, name):
    """A file that the cell's run wrote into its report."""
    folder = (cell.options.get("report") or ["report"])[0]
    return study.folder / "files" / cell.id / folder / name


MAPS = {"nrmse": "nrmse", "light leak": "light_leak"}


def tables_bias_map(study):
    """The maps, means over seeds; and the places of presets and optima."""
    grids, places = {}, []
    for cell in study.cells:
        path = report_file(study, cell, "bias_map.csv")
        if not cell.result.get("bias_map") or not path.is_file():
            continue
        with open(path, newline="") as file:
            for row in csv.DictReader(file):
                key = (cell.scene, float(row["normal_bias"]), float(row["view_bias"]))
                for metric, column in MAPS.items():
                    grids.setdefault((*key, metric), []).append(float(row[column]))
        found = cell.result["bias_map"]["places"]
        start = " ".join(cell.options.get("from", []))
        for place in found:
            if place["name"] == "from" and any(p["name"] == start for p in found):
                continue  # that preset is among them
            places.append({"scene": cell.scene, "seed": cell.seed, "name": place["name"],
                           "normal_bias": place["normal_bias"], "view_bias": place["view_bias"]})
    rows = [{"scene": scene, "normal_bias": normal, "view_bias": view, "metric": metric,
             "value": statistics.fmean(values), "low": min(values), "high": max(values),
             "seeds": len(values)} for (scene, normal, view, metric), values in grids.items()]
    return {"": rows, "places": places}


LIGHTS = {"train": "lights tuned on", "heldout": "lights held out"}


def tables_layout_tuning(study):
    """A row for every scene, layout, setting, lights and metric; and the tuned parameters."""
    found = {}
    for cell in study.cells:
        for score in cell.result.get("scores") or []:
            for setting in score["settings"]:
                for metric, name in ERRORS.items():
                    value = setting["heldout"].get(name.split(".")[1])
                    if value is not None and math.isfinite(value):
                        key = (cell.scene, cell.axes["layout"], setting["setting"],
                               score["lights"], metric)
                        found.setdefault(key, {}).setdefault(cell.seed, []).append(value)
    rows = []
    for (scene, layout, setting, lights, metric), seeds in found.items():
        values = [combine(ERRORS[metric], of) for of in seeds.values()]
        rows.append({"scene": scene, "layout": layout, "setting": setting, "lights": lights,
                     "metric": metric, "value": statistics.fmean(values), "low": min(values),
                     "high": max(values), "seeds": len(values)})
    return {"": rows, "parameters": tuned_parameters(study)}


def tuned_parameters(study):
    """Tuned values by scene and layout: mean, least and most of the seeds."""
    rows = []
    for (scene, layout), cells in groups(study, ["scene", "layout"]).items():
        by_key = {}
        for cell in cells:
            for parameter in cell.result.get("parameters") or []:
                by_key.setdefault(parameter["key"], []).append(parameter)
        for key, of in by_key.items():
            values = [p["tuned"] for p in of]
            rows.append({"scene": scene, "layout": layout, "parameter": key, "unit": of[0]["unit"],
                         "preset": of[0]["from"], "tuned": statistics.fmean(values),
                         "least": min(values), "most": max(values), "seeds": len(values)})
    return rows


# Cost and memory.

COSTS = {"update_ms": "speed.update_ms", "query_ns": "speed.query_ns_per_point",
         "frame_ms": "speed.frame_ms", "rays": "work.rays", "bytes": "memory_bytes",
         "bytes_a_probe": "memory.atlas_per_probe"}


def cost_rows(study, keys):
    """Times, work and memory of every setting: means over scenes, states and seeds."""
    rows = []
    for values, cells in groups(study, keys).items():
        row = dict(zip(keys, values))
        for column, name in {"stored": "probes.stored", **COSTS}.items():
            of = [v for v in (c.value(name) for c in cells) if v is not None]
            row[column if column != "rays" else "rays_an_update"] = \
                statistics.fmean(of) if of else None
        rows.append(row)
    return rows


def exact_visibility(study):
    """The study with the cells of `probelab budget` as their first rung scores them: light by path
    tracing, visibility by rays."""
    from figures_cells import Cell, Study
    cells = []
    for cell in study.cells:
        if cell.command == "budget":
            error = {"noise_floor": cell.result["error"]["noise_floor"], **cell.result["rungs"][0]}
            cell = Cell(cell.path, {**cell.result, "error": error})
        cells.append(cell)
    return Study(study.folder, study.name, cells, study.left_out)
