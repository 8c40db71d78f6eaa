# SPDX-License-Identifier: GPL-3.0-or-later
"""The tables of scripts/placement.py, from the rows that its runs left. Standard library only."""
import math
import statistics

from pipeline_report import aligned, geometric_mean, mean, number
from placement_rows import Results, paired_ratios, percentiles

LIGHTS = {"heldout": "held-out lights", "drawn": "drawn lights", "same": "same lights"}


def interval(low_high):
    return f"[{number(low_high[0])}, {number(low_high[1])}]"


def error_ratio(base, ours, floor):
    """Of a leak; values below the floor of the truth's noise count as that. None: both are;
    infinite: ours has none, under a truth without noise."""
    if base <= floor and ours <= floor:
        return None
    least = max(ours, floor)
    return max(base, floor) / least if least > 0 else math.inf


class Tables:
    def __init__(self, study, rows):
        self.study, self.results = study, Results(rows)
        self.ours = [row["name"] for row in study["layout"] if row.get("ours")]
        self.names = [row["name"] for row in study["layout"]]
        self.scenes = list(dict.fromkeys(row["scene"] for row in rows))
        self.null = study.get("null_scenes", [])
        self.against = [n for n in study.get("against", []) if n in self.names]

    def budgets(self):
        return sorted({key[2] for key in self.results.found
                       if key[1] in self.ours and key[2] in self.study["probes"]})

    def best_baseline(self, scene, probes, lights, seeds):
        """The baseline with the least error over these seeds, and that error."""
        errors = {name: self.results.nrmse((scene, name, probes, lights), seeds)
                  for name in self.names if name not in self.ours
                  and seeds and seeds <= self.results.seeds(scene, name, probes, lights)}
        return min(errors.items(), key=lambda item: item[1]) if errors else (None, None)

    def against_best(self, ours, scene, probes, lights):
        """A scene's part of a comparison; None without a baseline of the same seeds."""
        key = (scene, ours, probes, lights)
        seeds = self.results.seeds(*key)
        name, error = self.best_baseline(scene, probes, lights, seeds)
        if name is None:
            return None
        base, own = (scene, name, probes, lights), self.results.nrmse(key, seeds)
        ratio, drawn = paired_ratios(self.results.squares(base, seeds),
                                     self.results.squares(key, seeds))
        base_rows, rows = self.results.of(base, seeds), self.results.of(key, seeds)
        leak = error_ratio(mean([r["light_leak"] for r in base_rows]),
                           mean([r["light_leak"] for r in rows]),
                           mean([r["floors"]["light_leak"] for r in rows]))
        smape = mean([r["smape"] for r in base_rows]) / mean([r["smape"] for r in rows])
        others = [(scene, n, probes, lights) for n in self.against]
        return {"cells": [scene, str(len(seeds)), name, number(error), number(own)],
                "ratio": ratio, "drawn": drawn, "leak": leak, "smape": smape,
                "over": [self.results.nrmse(other, seeds) / own
                         if seeds <= self.results.seeds(*other) else None for other in others]}

    def comparison(self, ours, probes, lights):
        """A row a scene: ours against its best baseline; and the row of the summary."""
        table = [["scene", "seeds", "best baseline", "nrmse", ours, "ratio", "95 %", "light leak",
                  "smape", *(f"over {n}" for n in self.against)]]
        counted = {}
        for scene in self.scenes:
            found = self.against_best(ours, scene, probes, lights)
            if not found:
                continue
            table.append([*found["cells"], number(found["ratio"]),
                          interval(percentiles(found["drawn"])), number(found["leak"]),
                          number(found["smape"]), *map(number, found["over"])])
            if scene not in self.null:
                counted[scene] = found
        if not counted:
            return None, None

        def middle_of(name):
            return number(geometric_mean([f[name] for f in counted.values()]))

        def least(name):
            scene = min(counted, key=lambda s: counted[s][name])
            return f"{number(counted[scene][name])} {scene}"

        drawn = [geometric_mean(list(of)) or 0.0
                 for of in zip(*(f["drawn"] for f in counted.values()))]
        middle = [middle_of("ratio"), interval(percentiles(drawn)), middle_of("leak"),
                  middle_of("smape")]
        table.append(["geometric mean", "", "", "", "", *middle,
                      *(number(geometric_mean(list(of)))
                        for of in zip(*(f["over"] for f in counted.values())))])
        return table, [ours, LIGHTS[lights], str(probes), str(len(counted)), *middle,
                       least("ratio"), least("smape")]

    def light_by_light(self):
        """Best baseline over ours under each drawn light by itself, a row a layout, scene and N."""
        table = [["layout", "scene", "N", "lights", "typical ratio", "better under",
                  "worst light"]]
        for ours in self.ours:
            for probes in self.budgets():
                typical = []
                for scene in self.scenes:
                    key = (scene, ours, probes, "drawn")
                    seeds = self.results.seeds(*key)
                    name, _ = self.best_baseline(scene, probes, "drawn", seeds)
                    if name is None:
                        continue
                    pairs = [(base.get(light, 0.0), error) for base, own in zip(
                        self.results.squares((scene, name, probes, "drawn"), seeds),
                        self.results.squares(key, seeds)) for light, error in own.items()]
                    ratios = [math.sqrt(base / own) for base, own in pairs if base > 0 and own > 0]
                    if not ratios:
                        continue
                    errors = [own for _, own in pairs]
                    table.append([ours, scene, str(probes), str(len(ratios)),
                                  number(geometric_mean(ratios)),
                                  f"{100 * mean([r > 1 for r in ratios]):.0f} %",
                                  f"{100 * max(errors) / sum(errors):.0f} %"])
                    if scene not in self.null:
                        typical.append(geometric_mean(ratios))
                if typical:
                    table.append([ours, "geometric mean", str(probes), "",
                                  number(geometric_mean(typical)), "", ""])
        return table if len(table) > 1 else None

    def errors(self, probes, lights):
        """nrmse of every layout, a row a scene."""
        table = [["scene", *self.names]]
        for scene in self.scenes:
            cells = []
            for name in self.names:
                key = (scene, name, probes, lights)
                seeds = self.results.seeds(*key)
                cells.append(number(self.results.nrmse(key, seeds)) if seeds else "-")
            if any(c != "-" for c in cells):
                table.append([scene, *cells])
        return table if len(table) > 1 else None

    def curve(self, scene, name, lights):
        """[(N, nrmse)] by N."""
        points = []
        for n in sorted({key[2] for key in self.results.found if key[:2] == (scene, name)}):
            seeds = self.results.seeds(scene, name, n, lights)
            if seeds:
                points.append((n, self.results.nrmse((scene, name, n, lights), seeds)))
        return points

    def curves(self, lights):
        """nrmse against N, a row a scene and layout, with the fitted slope."""
        wanted = self.study.get("curves", {})
        budgets = wanted.get("probes", [])
        table = [["scene", "layout", *(f"N = {n}" for n in budgets), "slope"]]
        for scene in self.scenes:
            for name in wanted.get("layouts", []):
                points = dict(self.curve(scene, name, lights))
                if len([n for n in budgets if n in points]) >= 3:
                    table.append([scene, name, *(number(points.get(n)) for n in budgets),
                                  number(slope([(n, points[n]) for n in budgets if n in points]),
                                         2)])
        return table if len(table) > 1 else None

    def meeting(self, ours, lights):
        """The budget at which ours meets the best baseline's error at N, over N."""
        budgets = sorted({key[2] for key in self.results.found})
        table = [["scene", *(f"N = {n}" for n in budgets)]]
        shares = {n: [] for n in budgets}
        for scene in self.scenes:
            points = self.curve(scene, ours, lights)
            if len(points) < 3:
                continue
            row = [scene]
            for n in budgets:
                at_n = {k[1]: self.results.nrmse(k, self.results.found[k])
                        for k in self.results.found
                        if k[0] == scene and k[2] == n and k[3] == lights
                        and k[1] not in self.ours and self.results.found[k]}
                found, sign = meets(points, min(at_n.values())) if at_n else (None, "-")
                row.append(sign if found is None else sign + number(found / n, 2))
                if found is not None and scene not in self.null:
                    shares[n].append(found / n)
            table.append(row)
        if len(table) == 1:
            return None
        table.append(["geometric mean", *(number(geometric_mean(shares[n]), 2) for n in budgets)])
        return table

    def costs(self):
        """Build time, evaluations, index and query time of every layout. Times of queries that
        other commands ran beside say nothing."""
        table = [["layout", "N", "interpolant", "build s", "most", "evaluations", "index KiB",
                  "query x grid"]]
        by = {}
        for row in self.results.rows:
            by.setdefault((row["layout"], row["probes"]), []).append(row)
        grid = {(r["scene"], r["probes"], r["state"], r["seed"]): r["query_ns"]
                for r in self.results.rows if r["layout"] == "grid" and is_timed(r)}
        shown = [k for k in by if k[1] in self.study["probes"] or k[0] in self.ours]
        for name, n in sorted(shown, key=lambda k: (k[1], self.names.index(k[0])
                                                 if k[0] in self.names else 99)):
            rows = by[name, n]
            ratios = [r["query_ns"] / grid[key] for r in rows if is_timed(r)
                      if (key := (r["scene"], r["probes"], r["state"], r["seed"])) in grid]
            table.append([name, str(n), "/".join(sorted({r["interpolant"] for r in rows})),
                          number(statistics.median(r["build_s"] for r in rows)),
                          number(max(r["build_s"] for r in rows)),
                          number(statistics.median(r["evaluations"] for r in rows)),
                          number(statistics.median(r["index_bytes"] for r in rows) / 1024),
                          number(statistics.median(ratios)) if ratios else "-"])
        return table if len(table) > 1 else None

    def readings(self):
        """What each receiver's best weights could do with ours' probes under the drawn lights: a
        row a layout, budget and scene, gains over the layout's own reading."""
        table = [["layout", "scene", "N", "seeds", "nrmse", "unseen lights", "seen lights"]]
        by, gains = {}, {}
        for row in self.results.rows:
            if row["layout"] in self.ours and row.get("reading"):
                key = (row["layout"], row["probes"], row["scene"])
                by.setdefault(key, []).append(row["reading"])
        order = [(name, n, scene) for name in self.ours for n in sorted({k[1] for k in by})
                 for scene in self.scenes]
        for name, n, scene in (key for key in order if key in by):
            readings = by[name, n, scene]
            own, unseen, seen = (math.sqrt(statistics.fmean(r[k] ** 2 for r in readings))
                                 for k in ("nrmse", "unseen", "seen"))
            if not unseen > 0 or not seen > 0:
                continue
            table.append([name, scene, str(n), str(len(readings)), number(own),
                          number(own / unseen), number(own / seen)])
            if scene not in self.null:
                gains.setdefault((name, n), []).append((own / unseen, own / seen))
        for (name, n), of in gains.items():
            table.append([name, "geometric mean", str(n), "", "",
                          *(number(geometric_mean(list(v))) for v in zip(*of))])
        return table if len(table) > 1 else None

    def retraining(self):
        """Layouts of several seeds at the receivers of one: how far nrmse moves from its mean."""
        by = {}
        for row in self.results.rows:
            key = (row["layout"], row["probes"], row["scene"], row["lights"], row["seed"])
            by.setdefault(key, {}).setdefault(row["layout_seed"], []).append(row["nrmse"])
        table = [["layout", "N", "scene", "lights", "seeds", "nrmse", "deviation", "largest"]]
        deviations = {}
        for (name, n, scene, lights, _), seeds in sorted(by.items()):
            if len(seeds) < 2:
                continue
            errors = [math.sqrt(statistics.fmean(e * e for e in of)) for of in seeds.values()]
            middle = statistics.fmean(errors)
            moved = (statistics.stdev(errors) / middle,
                     max(abs(e - middle) for e in errors) / middle)
            deviations.setdefault((name, n, lights), []).append(moved)
            table.append([name, str(n), scene, LIGHTS[lights], str(len(seeds)), number(middle),
                          *map(percent, moved)])
        for (name, n, lights), of in deviations.items():
            table.append([name, str(n), "mean", LIGHTS[lights], "", "",
                          *(percent(statistics.fmean(values)) for values in zip(*of))])
        return table if len(table) > 1 else None


def is_timed(row):
    return "query_ns" in row and row.get("jobs") == 1


def percent(value):
    return f"{100 * value:.1f} %"


def slope(points):
    """Of log error over log N, least squares; None where an error is not positive."""
    if min(e for _, e in points) <= 0:
        return None
    x, y = [math.log(n) for n, _ in points], [math.log(e) for _, e in points]
    mx, my = statistics.fmean(x), statistics.fmean(y)
    return sum((a - mx) * (b - my) for a, b in zip(x, y)) / sum((a - mx) ** 2 for a in x)


def meets(points, error):
    """The least budget at which a curve is down to an error, linear in logarithms, and "<=" where
    that is the curve's first. (None, ">N") where it never is."""
    previous = None
    for n, e in points:
        if e <= error:
            if previous is None:
                return n, "<="
            n0, e0 = previous
            if e <= 0 or error <= 0 or e0 == e:
                return n, ""
            share = math.log(e0 / error) / math.log(e0 / e)
            return math.exp(math.log(n0) + share * math.log(n / n0)), ""
        previous = (n, e)
    return None, f">{points[-1][0]}"


def provenance(study, rows):
    def distinct(key):
        return ", ".join(sorted({str(r[key]) for r in rows if key in r}))
    settings = "; or ".join(sorted({r["settings"] for r in rows}))
    seeds = f"receiver and layout seeds {distinct('seed')}"
    if distinct("layout_seed") != distinct("seed"):
        seeds = f"receiver seeds {distinct('seed')}, layout seeds {distinct('layout_seed')}"
    return (f"Device {distinct('device')}, tracer {distinct('tracer')}, version "
            f"{distinct('version')}; {settings}; {distinct('jobs')} commands at a time; {seeds}.")


def comparison_sections(tables):
    parts = []
    summary = [["layout", "lights", "N", "scenes", "ratio", "95 %", "light leak", "smape",
                "least ratio", "least smape"]]
    for ours in tables.ours:
        for probes in tables.budgets():
            for lights, title in LIGHTS.items():
                table, row = tables.comparison(ours, probes, lights)
                if table:
                    summary.append(row)
                    parts += [f"## {ours} against the best baseline: {title}, N = {probes}",
                              aligned(table, 1)]
    if parts:
        parts = ["## Against the best baseline: geometric means over scenes", aligned(summary, 2),
                 *parts]
        without = (f" {', '.join(tables.null)} is left out of the geometric means."
                   if tables.null else "")
        parts.append(
            "Held-out receivers. nrmse: root of the mean over seeds and lighting states of "
            "nrmse^2; best baseline: the one with the least of it in this very column. Ratios are "
            "baseline over ours, above 1 where ours is better; 95 %: paired bootstrap over blocks "
            "and seeds. light leak, smape: means, a leak below the truth's noise counts as that "
            f"noise, - where both are, inf (left out of the means) where ours has none.{without} "
            "same and held-out lights: the scene's own states, path-traced, against the whole "
            "pipeline. drawn lights: dozens drawn from the scene that no layout was made for "
            "(`place --drawn-lights`: the query on traced probes, at other held-out receivers); "
            "there the bootstrap is over lights and seeds.")
    return parts


def report(study, rows, failures=()):
    """The Markdown of what there is."""
    parts = ["# Placement"]
    if failures:
        parts.append(f"**Incomplete: {len(failures)} layouts failed.**")
        parts.append("\n".join(f"- {name}: {why}" for name, why in failures.items()))
    if not rows:
        return "\n\n".join(parts + ["No results."]) + "\n"
    tables = Tables(study, rows)
    parts += comparison_sections(tables)
    for lights, title in LIGHTS.items():
        for probes in sorted({key[2] for key in tables.results.found}):
            table = tables.errors(probes, lights)
            if table and probes in study["probes"]:
                parts += [f"## nrmse of every layout: {title}, N = {probes}", aligned(table)]
    for lights, title in LIGHTS.items():
        table = tables.curves(lights)
        if table:
            parts += [f"## Error against N: {title}", aligned(table, 2)]
    for ours in tables.ours:
        for lights, title in LIGHTS.items():
            table = tables.meeting(ours, lights)
            if table:
                parts += [f"## Budget at which {ours} meets the best baseline's error, over N: "
                          f"{title}", aligned(table)]
    each = tables.light_by_light()
    if each:
        parts += ["## Light by light: drawn lights", aligned(each, 2),
                  "The best baseline's nrmse over ours under one light at a time: *typical ratio*, "
                  "the geometric mean of these; under how many of them ours is better; the share "
                  "of the worst light in ours' squared error. The tables above have root mean "
                  "squares over lights, in which a lamp beside a wall may outweigh all others."]
    readings = tables.readings()
    if readings:
        parts += ["## What reading bounds: gains over a layout's own reading, drawn lights",
                  aligned(readings, 2),
                  "At each receiver the best non-negative weights of the 20 nearest probes that it "
                  "sees, fitted to its own truth under every other drawn light: *unseen lights* "
                  "are scored under the rest of the lights, *seen lights* under those of the fit "
                  "(which are then the rest). nrmse: the layout's own, under the rest."]
    for title, table in (("Cost of layouts", tables.costs()),
                         ("Retraining: layouts of other seeds at the same receivers",
                          tables.retraining())):
        if table:
            parts += [f"## {title}", aligned(table)]
    parts.append(provenance(study, rows))
    return "\n\n".join(parts) + "\n"
