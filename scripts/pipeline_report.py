# SPDX-License-Identifier: GPL-3.0-or-later
"""The Markdown tables of scripts/pipeline.py: report() from its runs and their trimmed results.

Standard library only.
"""
import math

TITLES = {
    "presets": "Presets",
    "drop_one": "One part left out: factor on nrmse",
    "storage": "Storage: factor on nrmse",
    "talk": "Optimisations of the 2019 talk: factor on nrmse",
}


def number(value, digits=3):
    """Three significant digits, trailing zeros kept; '-' for what does not exist."""
    if value is None:
        return "-"
    if value == 0 or math.isinf(value):
        return "0" if value == 0 else "inf"
    power = int(f"{value:.{digits - 1}e}".split("e")[1])
    if power < -4:
        return f"{value:.{digits - 1}e}"
    return f"{round(value, digits - 1 - power):,.{max(0, digits - 1 - power)}f}"


def geometric_mean(values):
    """Of what exists and is finite. None if that is nothing, or a value is not above 0."""
    values = [v for v in values if v is not None and math.isfinite(v)]
    if not values or min(values) <= 0:
        return None
    return math.exp(sum(map(math.log, values)) / len(values))


def mean(values):
    values = [v for v in values if v is not None]
    return sum(values) / len(values) if values else None


def aligned(rows, text_columns=1):
    """A Markdown table whose columns line up as text."""
    widths = [max(3, *(len(r[i]) for r in rows)) for i in range(len(rows[0]))]
    lines = []
    for r in rows:
        cells = [c.ljust(w) if i < text_columns else c.rjust(w)
                 for i, (c, w) in enumerate(zip(r, widths))]
        lines.append("| " + " | ".join(cells) + " |")
    lines.insert(1, "|" + "|".join("-" * (w + 2) if i < text_columns else "-" * (w + 1) + ":"
                                   for i, w in enumerate(widths)) + "|")
    return "\n".join(lines)


def one_or_range(values):
    low, high = min(values), max(values)
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def provenance(results):
    """Device, tracer, seed and version of results; each once where they agree."""
    def distinct(key):
        return ", ".join(sorted({str(r["provenance"][key]) for r in results}))
    return (f"Device {distinct('device')}, tracer {distinct('tracer')}, seed {distinct('seed')}, "
            f"version {distinct('version')}.")


def command_of(results):
    """The command that makes results; SCENE where they are of several scenes."""
    commands = [list(r["arguments"]) for r in results]
    if len({c[1] for c in commands}) > 1:
        commands[0][1] = "SCENE"
    return f"`probelab {' '.join(commands[0])}`"


def by_row(results):
    """Rows of several scenes by name, in the order of first appearance: [{scene index: row}]."""
    rows = {}
    for i, result in enumerate(results):
        for row in result["ablation"]:
            rows.setdefault(row["row"], {})[i] = row
    return rows


def ratio(rows, key):
    return number(geometric_mean([r["ratios"][key] for r in rows.values()]))


def bytes_of(rows):
    return one_or_range([r["memory"]["atlas_per_probe"] for r in rows.values()])


def presets_tables(scenes, results):
    """The presets' summary, and their errors scene by scene."""
    rows = by_row(results)
    # The base row is the preset that the run starts from; its name may carry settings.
    base = results[0]["params"]["name"].split()[0]
    names = {row: base if row == "base" else row for row in rows}
    summary = [["preset", "nrmse", "light leak", "shadow leak", "B/probe", "update", "query"]]
    for name, of in rows.items():
        errors = [r["error"] for r in of.values()]
        summary.append([names[name], number(geometric_mean([e["nrmse"] for e in errors])),
                        number(mean([e["light_leak"] for e in errors])),
                        number(mean([e["shadow_leak"] for e in errors])), bytes_of(of),
                        ratio(of, "update_ms"), ratio(of, "query_ns_per_point")])
    detail = [["scene", "floor", *names.values()]]
    for i, scene in enumerate(scenes):
        floor = results[i]["ablation"][0]["error"]["floor"]
        detail.append([scene, number(floor), *(number(of[i]["error"]["nrmse"]) if i in of else "-"
                                               for of in rows.values())])
    caption = (f"nrmse: geometric mean over scenes; leaks: mean; B/probe: texels a "
               f"probe; update, query: time over that of {base} in the same run, geometric mean. "
               "floor: noise of the truth in nrmse.")
    return [aligned(summary), aligned(detail)], caption


def factor_tables(scenes, results):
    """Rows with their factor on the base's nrmse, scene by scene, and what they save."""
    bases = [r["ablation"][0] for r in results]
    table = [["row", *scenes, "mean", "probes", "rays", "B/probe", "update", "trace", "query"]]
    for name, of in by_row(results).items():
        cells = []
        for i in range(len(scenes)):
            row = of.get(i)
            same = row and name != "base" and row["same_estimates"]
            cells.append("-" if not row else "=" if same else number(row["ratios"]["nrmse"]))
        shares = [(r["probes"]["stored"] / bases[i]["probes"]["stored"],
                   r["rays_per_probe"] / bases[i]["rays_per_probe"]) for i, r in of.items()]
        table.append([name, *cells, ratio(of, "nrmse"), *(number(mean(s)) for s in zip(*shares)),
                      bytes_of(of), ratio(of, "update_ms"), ratio(of, "trace_ms"),
                      ratio(of, "query_ns_per_point")])
    base = ["base nrmse"] + [number(b["error"]["nrmse"]) for b in bases]
    table.insert(1, base + ["-"] * (len(table[0]) - len(base)))
    # Probes and rays tell nothing where no row changes them.
    told = [i for i, title in enumerate(table[0])
            if title not in ("probes", "rays") or any(r[i] != "1.00" for r in table[2:])]
    table = [[r[i] for i in told] for r in table]
    counts = "".join(f"{title}, " for title in ("probes", "rays") if title in table[0])
    caption = (f"Over the base's in the same run: nrmse by scene and its geometric mean; {counts}"
               "times of an update, its tracing and a query, geometric means. "
               "B/probe: texels a probe. =: the same estimates bit for bit; -: the row changes "
               "nothing in that scene or does not apply.")
    skipped = [{s["row"]: s["why"] for s in r["ablation_skipped"]} for r in results]
    nowhere = [f"{row} ({why})" for row, why in skipped[0].items()
               if all(row in s for s in skipped)]
    if nowhere:
        caption += f" Left out in every scene: {', '.join(nowhere)}."
    return [aligned(table)], caption


def ablation_section(name, scenes, results):
    tables, caption = (presets_tables if name == "presets" else factor_tables)(scenes, results)
    stored = [r["ablation"][0]["probes"]["stored"] for r in results]
    rays = [r["ablation"][0]["rays_per_probe"] for r in results]
    truth, words = results[0]["receivers"], results[0]["arguments"]
    updates = words[words.index("--updates") + 1]
    caption += (f" N = {one_or_range(stored)} probes, {one_or_range(rays)} rays, "
                f"{updates} updates averaged; {truth['count']} receivers, {truth['split']} half "
                f"scored. {provenance(results)} {command_of(results)}")
    return [f"## {TITLES.get(name, name + ': factor on nrmse')}", *tables, caption]


def bench_section(names, results):
    """Stages and baselines with their spread, and the ratios; a group of columns a bench."""
    stages = [["stage", *(f"{n} {c}" for n in names for c in ("median", "p5", "p95"))]]
    for group in ("stages", "baselines"):
        rows = dict.fromkeys(k for r in results for k in r[group])
        for stage in rows:
            unit = next((u for r in results for u in ("ms", "ns")
                         if f"median_{u}" in r[group].get(stage, {})), None)
            if unit:
                stages.append([f"{stage.replace('_', ' ')}, {unit}", *(
                    number(r[group].get(stage, {}).get(f"{c}_{unit}"))
                    for r in results for c in ("median", "p5", "p95"))])
    ratios = [["", *names]]
    for key in dict.fromkeys(k for r in results for k in r["ratios"]):
        ratios.append([key.replace("_", " "), *(number(r["ratios"].get(key)) for r in results)])
    for label, get in (("stages' share of the update", lambda r: r["stage_sum_share"]),
                       ("rays traced, M/s", lambda r: r["rays_per_s"]["trace"] / 1e6),
                       ("frame, ms", lambda r: r["frame_ms"])):
        ratios.append([label, *(number(get(r)) for r in results)])
    ratios.append(["bytes a probe", *(f"{r['memory']['atlas_per_probe']:g}" for r in results)])
    return stages, ratios


def bench_sections(names, results):
    """One section for all plain benches, one for every sweep."""
    sections = []
    plain = [(n, r) for n, r in zip(names, results) if not r.get("sweep")]
    if plain:
        labels, rows = zip(*plain)
        stages, ratios = bench_section(labels, rows)
        commands = ", ".join(dict.fromkeys(command_of([r]) for r in rows))
        caption = (f"Times of {one_or_range([r['updates'] for r in rows])} updates, baselines in "
                   "the same run; a query's time is a point's; ratios above 1: faster than the "
                   f"baseline. {rows[0]['scene'].split('/')[0]}, "
                   f"N = {one_or_range([r['probes'] for r in rows])} probes, "
                   f"{one_or_range([r['rays'] for r in rows])} rays. {provenance(rows)} {commands}")
        sections += ["## Stages", aligned(stages), aligned(ratios), caption]
    for name, result in zip(names, results):
        if result.get("sweep"):
            sections += sweep_section(name, result)
    return sections


def sweep_section(name, result):
    """Lines through the times over probes and over rays, and the points they go through."""
    fits = [["line", "a, ms", "b, us", "R^2", "largest residual"]]
    points = [["over", "probes", "rays", "update, ms"]]
    for over, sweep in result["sweep"].items():
        for stage, fit in sweep["fits"].items():
            fits.append([f"{stage} over {over}", number(fit["a_ms"]), number(fit["b_us"]),
                         number(fit["r2"], 4), number(fit["largest_residual"])])
        for point in sweep["points"]:
            points.append([over, str(point["probes"]), str(point["rays"]),
                           number(point["update_ms"])])
    of = [p for sweep in result["sweep"].values() for p in sweep["points"]]
    caption = (f"time = a + b n, n the probes or the rays a probe; residual: share of the time. "
               f"{result['scene'].split('/')[0]}, N = {one_or_range([p['probes'] for p in of])} "
               f"probes, {one_or_range([p['rays'] for p in of])} rays. {provenance([result])} "
               f"{command_of([result])}")
    return [f"## Is the cost linear? ({name})", aligned(fits), aligned(points), caption]


def report(runs, results, failures, interrupted):
    """The Markdown of what there is, and a line on what is missing."""
    parts = ["# The DDGI pipeline"]
    missing = [run["file"] for run in runs if run["file"] not in results]
    if missing:
        why = "interrupted" if interrupted else "failed"
        parts.append(f"**Incomplete ({why}): {len(missing)} of {len(runs)} runs are missing.**")
        parts.append("\n".join(f"- {f.removesuffix('.json')}: {failures.get(f, 'not run')}"
                               for f in missing))
    for table in dict.fromkeys(r["table"] for r in runs if r["kind"] == "ablation"):
        of = [r for r in runs if r["kind"] == "ablation" and r["table"] == table
              and r["file"] in results]
        if of:
            parts += ablation_section(table, [r["scene"] for r in of],
                                      [results[r["file"]] for r in of])
    of = [r for r in runs if r["kind"] == "bench" and r["file"] in results]
    if of:
        parts += bench_sections([r["table"] for r in of], [results[r["file"]] for r in of])
    return "\n\n".join(parts) + "\n"
