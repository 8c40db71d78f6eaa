# SPDX-License-Identifier: GPL-3.0-or-later
"""The tables and the figure of scripts/placement.py, from the rows that its runs left.

A row's `blocks` hold, by block of held-out receivers, the sums of a (E-A)(E-B) and a A B; all
errors and intervals come from them. Standard library; the figure needs matplotlib.
"""
import gzip
import json
import math
import random
import statistics

from pipeline_report import aligned, geometric_mean, mean, number

LIGHTS = {"heldout": "held-out lights", "same": "same lights"}
REPLICATES = 2000


def load_rows(folder):
    """The rows of rows.jsonl, or of rows.jsonl.gz; the last of a key counts. A line that a kill cut
    short is left out."""
    rows = {}
    packed, plain = folder / "rows.jsonl.gz", folder / "rows.jsonl"
    if plain.exists():
        text = plain.read_text()
    elif packed.exists():
        text = gzip.decompress(packed.read_bytes()).decode()
    else:
        return []
    for line in text.splitlines():
        try:
            row = json.loads(line)
        except ValueError:
            continue
        rows[tuple(row[k] for k in ("scene", "layout", "probes", "layout_seed", "state", "seed",
                                    "settings"))] = row
    return list(rows.values())


class Results:
    """Rows of layouts that were made and scored with the same seed, by what the tables ask for."""

    def __init__(self, rows):
        self.rows, self.found = rows, {}
        for row in rows:
            if row["seed"] == row["layout_seed"]:
                key = (row["scene"], row["layout"], row["probes"], row["lights"])
                self.found.setdefault(key, {}).setdefault(row["seed"], []).append(row)
        states = {}
        for row in rows:
            states.setdefault((row["scene"], row["lights"]), set()).add(row["state"])
        for (scene, _, _, lights), seeds in self.found.items():
            for seed in [s for s, of in seeds.items() if len(of) < len(states[scene, lights])]:
                del seeds[seed]  # not all of its states are done

    def seeds(self, *key):
        return set(self.found.get(key, {}))

    def of(self, key, seeds):
        return [row for seed in sorted(seeds) for row in self.found[key][seed]]

    def squares(self, key, seeds):
        """[seed] of {block: squared error relative to the truth, mean over states}."""
        result = []
        for seed in sorted(seeds):
            blocks, rows = {}, self.found[key][seed]
            for row in rows:
                product = sum(p for _, p in row["blocks"].values())
                for block, (error, _) in row["blocks"].items():
                    blocks[block] = blocks.get(block, 0) + error / product / len(rows)
            result.append(blocks)
        return result

    def nrmse(self, key, seeds):
        """Root of the mean over seeds and states of nrmse^2."""
        squares = [sum(blocks.values()) for blocks in self.squares(key, seeds)]
        return math.sqrt(max(0.0, statistics.fmean(squares)))


def dense(squares, names):
    return [[blocks.get(name, 0.0) for name in names] for blocks in squares]


def draws(seeds, blocks):
    """REPLICATES times: how often each seed and which blocks are drawn, with replacement."""
    generator = random.Random(1)
    for _ in range(REPLICATES):
        yield ([generator.randrange(seeds) for _ in range(seeds)],
               generator.choices(range(blocks), k=blocks))


def percentiles(values):
    values = sorted(values)
    return values[int(0.025 * (len(values) - 1))], values[math.ceil(0.975 * (len(values) - 1))]


def bootstrap_sums(squares, names):
    """[replicate] sums of [seed][block] under the same draws for everything of the same shape."""
    table = dense(squares, names)
    sums = []
    for drawn_seeds, drawn_blocks in draws(len(table), len(names)):
        per_seed = {s: sum(map(table[s].__getitem__, drawn_blocks)) for s in set(drawn_seeds)}
        sums.append(sum(per_seed[s] for s in drawn_seeds))
    return sums


def paired_ratios(first, second):
    """Ratio of nrmse, and its replicates by a paired bootstrap over blocks and seeds; undefined
    replicates are infinite."""
    names = sorted({name for blocks in first + second for name in blocks})
    totals = [sum(sum(b.values()) for b in squares) for squares in (first, second)]
    ratio = math.sqrt(max(0.0, totals[0]) / totals[1]) if totals[1] > 0 else math.inf
    return ratio, [math.sqrt(max(0.0, a) / b) if b > 0 else math.inf
                   for a, b in zip(bootstrap_sums(first, names), bootstrap_sums(second, names))]


def interval(low_high):
    return f"[{number(low_high[0])}, {number(low_high[1])}]"


def error_ratio(base, ours, floor):
    """Of a leak; values below the floor of the truth's noise count as that. None: both are."""
    if base <= floor and ours <= floor:
        return None
    return max(base, floor) / max(ours, floor)


class Tables:
    def __init__(self, study, rows):
        self.study, self.results = study, Results(rows)
        self.ours = [row["name"] for row in study["layout"] if row.get("ours")]
        self.names = [row["name"] for row in study["layout"]]
        self.scenes = list(dict.fromkeys(row["scene"] for row in rows))
        self.null = study.get("null_scenes", [])

    def budgets(self):
        return sorted({key[2] for key in self.results.found
                       if key[1] in self.ours and key[2] in self.study["probes"]})

    def best_baseline(self, scene, probes, lights, seeds):
        """The baseline with the least error over these seeds, and that error."""
        errors = {name: self.results.nrmse((scene, name, probes, lights), seeds)
                  for name in self.names if name not in self.ours
                  and seeds and seeds <= self.results.seeds(scene, name, probes, lights)}
        return min(errors.items(), key=lambda item: item[1]) if errors else (None, None)

    def comparison(self, ours, probes, lights):
        """A row a scene: ours against its best baseline; and the row of the summary."""
        against = [n for n in ("grid", "relocated_enclosing") if n in self.names]
        table = [["scene", "seeds", "best baseline", "nrmse", ours, "ratio", "95 %", "light leak",
                  "smape", *(f"over {n}" for n in against)]]
        ratios, replicates, leaks, smapes = {}, [], [], {}
        others = {n: [] for n in against}
        for scene in self.scenes:
            key = (scene, ours, probes, lights)
            seeds = self.results.seeds(*key)
            name, error = self.best_baseline(scene, probes, lights, seeds)
            if name is None:
                continue
            base = (scene, name, probes, lights)
            ratio, drawn = paired_ratios(self.results.squares(base, seeds),
                                         self.results.squares(key, seeds))
            base_rows, our_rows = self.results.of(base, seeds), self.results.of(key, seeds)
            average = {k: [mean([r[k] for r in rows]) for rows in (base_rows, our_rows)]
                       for k in ("light_leak", "smape")}
            leak = error_ratio(*average["light_leak"],
                               mean([r["floors"]["light_leak"] for r in our_rows]))
            smape = average["smape"][0] / average["smape"][1]
            row = [scene, str(len(seeds)), name, number(error),
                   number(self.results.nrmse(key, seeds)), number(ratio),
                   interval(percentiles(drawn)), number(leak), number(smape)]
            for n in against:
                other = (scene, n, probes, lights)
                value = (self.results.nrmse(other, seeds) / self.results.nrmse(key, seeds)
                         if seeds <= self.results.seeds(*other) else None)
                row.append(number(value))
                if scene not in self.null:
                    others[n].append(value)
            table.append(row)
            if scene not in self.null:
                ratios[scene], smapes[scene] = ratio, smape
                replicates.append(drawn)
                leaks.append(leak)
        if not ratios:
            return None, None
        means = [geometric_mean(list(of)) or 0.0 for of in zip(*replicates)]
        middle = [number(geometric_mean(ratios.values())), interval(percentiles(means)),
                  number(geometric_mean(leaks)), number(geometric_mean(smapes.values()))]
        table.append(["geometric mean", "", "", "", "", *middle,
                      *(number(geometric_mean(others[n])) for n in against)])
        worst = [f"{number(of[s])} {s}" for of in (ratios, smapes) for s in [min(of, key=of.get)]]
        return table, [ours, LIGHTS[lights], str(probes), str(len(ratios)), *middle, *worst]

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
        """Build time, evaluations, index and query time of every layout."""
        table = [["layout", "N", "interpolant", "build s", "most", "evaluations", "index KiB",
                  "query x grid"]]
        by = {}
        for row in self.results.rows:
            by.setdefault((row["layout"], row["probes"]), []).append(row)
        grid = {(r["scene"], r["probes"], r["state"], r["seed"]): r["query_ns"]
                for r in self.results.rows if r["layout"] == "grid"}
        shown = [k for k in by if k[1] in self.study["probes"] or k[0] in self.ours]
        for name, n in sorted(shown, key=lambda k: (k[1], self.names.index(k[0])
                                                 if k[0] in self.names else 99)):
            rows = by[name, n]
            ratios = [r["query_ns"] / grid[key] for r in rows
                      if (key := (r["scene"], r["probes"], r["state"], r["seed"])) in grid]
            table.append([name, str(n), "/".join(sorted({r["interpolant"] for r in rows})),
                          number(statistics.median(r["build_s"] for r in rows)),
                          number(max(r["build_s"] for r in rows)),
                          number(statistics.median(r["evaluations"] for r in rows)),
                          number(statistics.median(r["index_bytes"] for r in rows) / 1024),
                          number(statistics.median(ratios)) if ratios else "-"])
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
        return ", ".join(sorted({str(r[key]) for r in rows}))
    return (f"Device {distinct('device')}, tracer {distinct('tracer')}, version "
            f"{distinct('version')}; {rows[0]['settings']}; {distinct('jobs')} commands at a time; "
            f"receiver and layout seeds {distinct('seed')}.")


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
            "Held-out receivers. nrmse: root of the mean over seeds and lighting states of nrmse^2; "
            "best baseline: the one with the least of it in this very column. Ratios are baseline "
            "over ours, above 1 where ours is better; 95 %: paired bootstrap over blocks and seeds. "
            "light leak, smape: means, a leak below the truth's noise counts as that noise, - where "
            f"both are.{without}")
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
    for title, table in (("Cost of layouts", tables.costs()),
                         ("Retraining: layouts of other seeds at the same receivers",
                          tables.retraining())):
        if table:
            parts += [f"## {title}", aligned(table)]
    parts.append(provenance(study, rows))
    return "\n\n".join(parts) + "\n"


def curve_interval(results, key, seeds):
    squares = results.squares(key, seeds)
    names = sorted({name for blocks in squares for name in blocks})
    return percentiles([math.sqrt(max(0.0, s) / len(squares))
                        for s in bootstrap_sums(squares, names)])


def write_figure(study, rows, folder):
    """curves.svg and curves.png: nrmse against N, a panel a scene and kind of light. Returns why
    there is none."""
    tables = Tables(study, rows)
    names = study.get("curves", {}).get("layouts", [])
    scenes = [s for s in tables.scenes
              if any(len(tables.curve(s, name, lights)) >= 3 for name in names for lights in LIGHTS)]
    if not scenes:
        return ""
    try:
        import matplotlib
        matplotlib.use("Agg")
        from matplotlib import pyplot
    except ImportError:
        return "no figure: matplotlib is not installed (Debian: python3-matplotlib)"
    matplotlib.rcParams["svg.hashsalt"] = "probelab"
    figure, axes = pyplot.subplots(len(LIGHTS), len(scenes), squeeze=False, sharex=True,
                                   figsize=(3.4 * len(scenes), 3.0 * len(LIGHTS)))
    for i, (lights, title) in enumerate(LIGHTS.items()):
        for j, scene in enumerate(scenes):
            panel = axes[i][j]
            for name in names:
                points = tables.curve(scene, name, lights)
                if not points:
                    continue
                bounds = [curve_interval(tables.results, (scene, name, n, lights),
                                         tables.results.seeds(scene, name, n, lights))
                          for n, _ in points]
                counts = [n for n, _ in points]
                line, = panel.plot(counts, [e for _, e in points], marker="o", markersize=3,
                                   linewidth=2 if name in tables.ours else 1, label=name)
                panel.fill_between(counts, [b[0] for b in bounds], [b[1] for b in bounds],
                                   color=line.get_color(), alpha=0.15, linewidth=0)
            panel.set_xscale("log", base=2)
            panel.set_yscale("log")
            panel.set_title(f"{scene}, {title}", fontsize=9)
            panel.grid(True, which="both", linewidth=0.3)
            if i == len(LIGHTS) - 1:
                panel.set_xlabel("probes")
            if j == 0:
                panel.set_ylabel("nrmse")
    axes[0][0].legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(folder / "curves.svg", metadata={"Date": None})
    figure.savefig(folder / "curves.png", dpi=110)
    pyplot.close(figure)
    return ""
