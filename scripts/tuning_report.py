# SPDX-License-Identifier: GPL-3.0-or-later
"""The tables of scripts/tuning.py, from the rows that its runs left. Standard library only.

A setting stands where scripts/placement.py has a layout, so that errors, intervals and comparisons
with the best of the others are computed by the same code.
"""
import math
import statistics

from pipeline_report import aligned, geometric_mean, mean, number
from placement_report import LIGHTS, Tables, error_ratio, interval, provenance
from placement_rows import paired_ratios, percentiles

FROM, TUNED = "from", "tuned"
LEFT_OUT = "left_out"  # tuned on the other scenes
SHARED = "shared"      # tuned on all scenes at once

ABOUT = {TUNED: "tuned on the scene", LEFT_OUT: "tuned on the other scenes",
         SHARED: "tuned on all scenes", FROM: "before tuning"}


def tables_of(study, rows):
    """Our settings against the published presets."""
    layouts = [{"name": name} for name in study["published"]]
    ours = [TUNED, LEFT_OUT, SHARED, FROM] + ([study["params"]] if study.get("set") else [])
    layouts += [{"name": name, "ours": True} for name in ours]
    return Tables({**study, "layout": layouts, "against": []}, rows)


class Pairs:
    """Ratios of one setting's errors to another's, over scenes."""

    def __init__(self, tables, probes, lights):
        self.tables, self.results = tables, tables.results
        self.probes, self.lights = probes, lights

    def key(self, scene, name):
        return scene, name, self.probes, self.lights

    def seeds(self, scene, *names):
        return set.intersection(*(self.results.seeds(*self.key(scene, n)) for n in names))

    def ratios(self, other, ours):
        """{scene: (ratio, replicates)} of nrmse, other over ours."""
        found = {}
        for scene in self.tables.scenes:
            seeds = self.seeds(scene, other, ours)
            if seeds and scene not in self.tables.null:
                found[scene] = paired_ratios(self.results.squares(self.key(scene, other), seeds),
                                             self.results.squares(self.key(scene, ours), seeds))
        return found

    def leak(self, other, ours, error):
        """Geometric mean over scenes of a leak's ratio, other over ours, where either is above
        the floor of its truth."""
        values = []
        for scene in self.tables.scenes:
            seeds = self.seeds(scene, other, ours)
            if not seeds or scene in self.tables.null:
                continue
            rows = [self.results.of(self.key(scene, n), seeds) for n in (other, ours)]
            means = [mean([r[error] for r in of]) for of in rows]
            values.append(error_ratio(*means, mean([r["floors"][error] for r in rows[1]])))
        return geometric_mean(values)


def against_each(tables, study, probes, lights):
    table = [["setting", "over", "scenes", "nrmse", "95 %", "least", "light leak", "shadow leak"]]
    pairs = Pairs(tables, probes, lights)
    changed = study.get("set", [])
    start = " ".join([study["params"], *changed, f"({FROM})"])
    others = [*study["published"], *([study["params"]] if changed else []), FROM]
    for ours in (TUNED, LEFT_OUT, SHARED):
        for other in others:
            found = pairs.ratios(other, ours)
            if not found:
                continue
            drawn = [geometric_mean(list(of)) or 0.0 for of in zip(*(d for _, d in found.values()))]
            least = min(found, key=lambda s: found[s][0])
            table.append([ours, start if other == FROM else other,
                          str(len(found)),
                          number(geometric_mean([r for r, _ in found.values()])),
                          interval(percentiles(drawn)), f"{number(found[least][0])} {least}",
                          *(number(pairs.leak(other, ours, e))
                            for e in ("light_leak", "shadow_leak"))])
    return table if len(table) > 1 else None


def errors_table(tables, error, probes, lights):
    """Means over seeds and states, a row a scene, and the truth's floor."""
    results = tables.results
    table = [["scene", *tables.names, "floor"]]
    for scene in tables.scenes:
        cells, floors = [], []
        for name in tables.names:
            key = (scene, name, probes, lights)
            rows = results.of(key, results.seeds(*key)) if key in results.found else []
            cells.append(number(mean([r[error] for r in rows])) if rows else "-")
            floors += [r["floors"][error] for r in rows if r["floors"][error] is not None]
        if floors:
            table.append([scene, *cells, number(mean(floors))])
    return table if len(table) > 1 else None


def runs_of(rows, name, probes):
    """{scene: [row]} of one state a scene and seed: what is said of a run once."""
    found = {}
    for row in rows:
        if row["layout"] == name and row["probes"] == probes:
            found.setdefault((row["scene"], row["seed"]), row)
    by_scene = {}
    for (scene, _), row in sorted(found.items()):
        by_scene.setdefault(scene, []).append(row)
    return by_scene


def values_table(rows, name, probes):
    """Medians of the tuned values over seeds, with least and most."""
    by_scene = runs_of(rows, name, probes)
    if not by_scene:
        return None
    keys = list(next(iter(by_scene.values()))[0]["run"]["values"])
    table = [["scene", "seeds", *keys]]
    for scene, of in by_scene.items():
        values = {k: [r["run"]["values"][k] for r in of] for k in keys}
        table.append([scene, str(len(of)),
                      *(f"{number(statistics.median(v))} [{number(min(v))}, {number(max(v))}]"
                        for v in values.values())])
    return table


def rms(values):
    """None where one is missing, or all."""
    if not values or None in values:
        return None
    return math.sqrt(statistics.fmean(v * v for v in values))


def limits_table(tables, probes, lights):
    """What is left after tuning, and with traced visibility in place of the moments'."""
    results = tables.results
    table = [["scene", "from", "from, traced visibility", "tuned", "tuned, traced visibility",
              "share of the gap closed"]]
    for scene in tables.scenes:
        key = (scene, TUNED, probes, lights)
        seeds = results.seeds(*key) & results.seeds(scene, FROM, probes, lights)
        if not seeds:
            continue
        rows = results.of(key, seeds)

        def exact(which):
            return rms([r["exact_visibility"][which] for r in rows])

        before = results.nrmse((scene, FROM, probes, lights), seeds)
        after = results.nrmse(key, seeds)
        gap = before - exact("from")
        closed = f"{100 * (before - after) / gap:.0f} %" if gap > 0.05 * before else "-"
        table.append([scene, *map(number, (before, exact("from"), after, exact("tuned"))), closed])
    return table if len(table) > 1 else None


def fitted_table(tables, study, rows, probes):
    """Texels fitted to one light after tuning: held-out nrmse under it, and under the others."""
    table = [["scene", "seeds", "fitted to", "best preset", "tuned", "fitted",
              "best preset over fitted", "tuned over fitted", "others: tuned", "others: fitted"]]
    over_best, over_tuned = [], []
    for scene, of in runs_of(rows, TUNED, probes).items():
        runs = [r for r in of if r["run"].get("fitted")]
        scores = [s for r in runs for s in r["run"]["fitted"]]
        if not scores:
            continue
        state = next(s["state"] for s in scores if s["fitted"])
        seeds = {r["seed"] for r in runs}

        def error(when, own):
            return rms([s[when] for s in scores if s["fitted"] == own])

        def preset(name):
            return rms([r["nrmse"] for r in rows if r["seed"] in seeds and (
                r["scene"], r["layout"], r["state"], r["probes"]) == (scene, name, state, probes)])

        presets = {name: preset(name) for name in study["published"]}
        known = {name: value for name, value in presets.items() if value is not None}
        best = min(known, key=known.get, default=None)
        before, after = error("before", True), error("after", True)
        ratios = [value / after if value is not None and after else None
                  for value in (known.get(best), before)]
        if scene not in tables.null:
            over_best.append(ratios[0])
            over_tuned.append(ratios[1])
        table.append([scene, str(len(seeds)), state, f"{number(known.get(best))} {best or ''}",
                      *map(number, (before, after, *ratios)),
                      *(number(error(when, False)) for when in ("before", "after"))])
    if len(table) == 1:
        return None
    table.append(["geometric mean", *[""] * 5,
                  *(number(geometric_mean(of)) for of in (over_best, over_tuned)), "", ""])
    return table


def costs_table(rows, probes):
    table = [["scene", "rounds", "settled", "step taken", "evaluations", "fields", "solve s",
              "most", "fields s"]]
    for scene, of in runs_of(rows, TUNED, probes).items():
        runs = [r["run"] for r in of]
        table.append([scene, number(mean([r["rounds"] for r in runs])),
                      f"{sum(r['settled'] for r in runs)} of {len(runs)}",
                      number(mean([r.get("share", 1) for r in runs])),
                      number(statistics.median(r["evaluations"] for r in runs)),
                      number(statistics.median(r["fields"] for r in runs)),
                      number(statistics.median(r["seconds"]["solve"] for r in runs)),
                      number(max(r["seconds"]["solve"] for r in runs)),
                      number(statistics.median(r["seconds"]["fields"] for r in runs))])
    return table if len(table) > 1 else None


def best_sections(tables):
    parts = []
    summary = [["setting", "lights", "N", "scenes", "ratio", "95 %", "light leak", "smape",
                "least ratio", "least smape"]]
    for ours in tables.ours:
        for probes in tables.budgets():
            for lights, title in LIGHTS.items():
                table, row = tables.comparison(ours, probes, lights)
                if table:
                    summary.append(row)
                    about = ABOUT.get(ours, "as shipped")
                    parts += [f"## {ours} ({about}) against the best published preset: {title}, "
                              f"N = {probes}", aligned(table, 1)]
    if not parts:
        return []
    without = f" Left out of the means: {', '.join(tables.null)}." if tables.null else ""
    return ["## Against the best published preset of each scene: geometric means over scenes",
            aligned(summary, 2),
            "Held-out receivers. nrmse: root of the mean over seeds and lighting states of nrmse^2; "
            "best: the preset with the least of it in this very scene. Ratios are the preset's over "
            "ours, above 1 where ours is better; 95 %: paired bootstrap over blocks and seeds. "
            "light leak, shadow leak, smape: of means, a leak below the truth's noise counts as "
            f"that noise, - where both are, inf (left out of the means) where ours has none.{without}",
            *parts]


def report(study, rows, failures=()):
    """The Markdown of what there is."""
    parts = ["# Tuning"]
    if failures:
        parts.append(f"**Incomplete: {len(failures)} runs failed.**")
        parts.append("\n".join(f"- {name}: {why}" for name, why in failures.items()))
    if not rows:
        return "\n\n".join(parts + ["No results."]) + "\n"
    tables = tables_of(study, rows)
    parts += best_sections(tables)

    def add(title, table, *columns):
        if table:
            parts.extend([f"## {title}", aligned(table, *columns)])

    for probes in tables.budgets():
        for lights, title in LIGHTS.items():
            at = f"{title}, N = {probes}"
            add(f"Against each preset: {at}", against_each(tables, study, probes, lights), 2)
            add(f"nrmse: {at}", tables.errors(probes, lights))
            for error in ("light_leak", "shadow_leak", "smape"):
                add(f"{error.replace('_', ' ')}: {at}", errors_table(tables, error, probes, lights))
            add(f"What visibility bounds: {at}", limits_table(tables, probes, lights))
        for name in (TUNED, LEFT_OUT):
            add(f"Values, {ABOUT[name]}, N = {probes}: medians [least, most] over seeds",
                values_table(rows, name, probes))
        add(f"Texels fitted to one light after tuning, for static lighting, N = {probes}: nrmse",
            fitted_table(tables, study, rows, probes), 3)
        add(f"Cost of a tuning, N = {probes}", costs_table(rows, probes))
    parts.append(provenance(study, rows))
    return "\n\n".join(parts) + "\n"
