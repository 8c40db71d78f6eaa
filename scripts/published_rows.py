# SPDX-License-Identifier: GPL-3.0-or-later
"""What results/published keeps of a study's cells: rows.csv, the numbers that figures and README
are made of, one line a cell (a rung of `probelab budget`; a setting under one light of `probelab
tune`), and manifest.json, where they come from. Standard library only."""
import csv
import json

ERRORS = ("nrmse", "bias", "relmse", "smape", "p95", "p99", "light_leak", "shadow_leak",
          "dark_leak", "leak_area")
NUMBERS = tuple(f"error.{e}" for e in ERRORS) + tuple(f"error.noise_floor.{e}" for e in ERRORS) + (
    "probes.stored", "probes.active", "speed.update_ms", "speed.trace_ms", "speed.resolve_ms",
    "speed.blend_ms", "speed.query_ns_per_point", "speed.frame_ms", "speed.rays_per_s",
    "work.rays", "memory_bytes", "memory.atlas_per_probe", "layout_build_s", "updates",
    "receivers.count", "receivers.seconds", "temporal.flicker", "temporal.updates_to_90",
    "temporal.updates_to_95", "temporal.updates_to_99")
RUNG = ("nrmse", "bias", "light_leak", "shadow_leak", "smape", "share", "mean_square", "noise")


def rows_of(study):
    rows = []
    for cell in [*study.cells, *study.numberless]:
        head = {"id": cell.id, **cell.axes}
        of = {"tune": tune_rows, "budget": budget_rows}.get(cell.command, evaluate_rows)(cell)
        rows += [{**head, **row} for row in of]
    return rows


def evaluate_rows(cell):
    found = {name: cell.value(name) for name in NUMBERS}
    return [{k: v for k, v in found.items() if v is not None}]


def budget_rows(cell):
    rows = []
    for i, rung in enumerate(cell.result.get("rungs") or []):
        rows.append({"rung": i, "name": rung["name"], "about": rung.get("about", ""),
                     **{f"error.{k}": rung.get(k) for k in RUNG},
                     **{f"error.noise_floor.{k}": cell.value(f"error.noise_floor.{k}")
                        for k in ("nrmse", "light_leak", "shadow_leak")},
                     "probes.stored": cell.value("probes.stored")})
    return rows


def tune_rows(cell):
    rows = []
    for score in cell.result.get("scores") or []:
        for setting in score["settings"]:
            row = {"light": score["state"], "lights": score["lights"],
                   "setting": setting["setting"]}
            for error in ("nrmse", "bias", "light_leak", "shadow_leak"):
                row[f"error.{error}"] = setting["heldout"].get(error)
            if setting["setting"] == "tuned":
                row.update({f"tuned.{p['key']}": p["tuned"]
                            for p in cell.result.get("parameters") or []})
            rows.append(row)
    return rows


def write_rows(path, rows):
    columns = list(dict.fromkeys(c for row in rows for c in row))
    with open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        for row in rows:
            writer.writerow({k: "" if v is None else f"{v:.9g}" if isinstance(v, float) else v
                             for k, v in row.items()})


def read_rows(path):
    """Rows as texts; numbers() reads one."""
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def numbers(rows, column):
    return [float(r[column]) for r in rows if r.get(column)]


def provenance_of(cell, name):
    provenance = cell.found("provenance")
    return provenance[name] if isinstance(provenance, dict) and name in provenance \
        else cell.text(name)


def manifest(study, size, command, completeness):
    """Where the rows come from: what all cells have in common, and what not."""
    def distinct(name):
        return sorted({str(f) for f in (provenance_of(c, name) for c in study.cells)
                       if f not in (None, "")})
    receivers = study.distinct(lambda c: c.receivers())
    return {"study": study.name, "size": size, "command": command, "cells": completeness,
            "seeds": study.distinct(lambda c: c.seed), "scenes": study.axis("scene"),
            "receivers": [int(n) for n in receivers if n],
            **{name: distinct(name) for name in ("device", "driver", "tracer", "version",
                                                 "compiler", "build_type")},
            "seconds": round(sum(c.value("cell.seconds") or 0 for c in study.cells), 1)}


def write_manifest(path, found):
    path.write_text(json.dumps(found, indent=1) + "\n")
