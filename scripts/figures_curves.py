# SPDX-License-Identifier: GPL-3.0-or-later
"""Drawings of the figures whose panels hold curves: error and leaks against N, the thin wall, rays
and hysteresis, speed against error. draw_NAME(pyplot, study, tables) returns {suffix: figure}.
Needs matplotlib."""
import math

from figures_panels import (MARKERS, PAGE, Sheet, bounds_of, color_bar, colour, count_axis,
                            draw_points, end_labels, grid_of, pretty, ratio_axis, shades,
                            stored_axis)
from figures_tables import LEAST_LEAK


def pick(rows, **where):
    return [r for r in rows if all(r.get(k) == v for k, v in where.items())]


def draw_floor(panel, rows, x="stored"):
    """The noise floor as a dotted line, where it is not zero; returns whether it was drawn."""
    points = sorted({(r[x], r["floor"]) for r in rows if r.get("floor")})
    if not points:
        return False
    mean = math.exp(sum(math.log(f) for _, f in points) / len(points))
    panel.axhline(mean, color="black", linewidth=0.9, linestyle=":")
    return True


def floor_handle(pyplot):
    return pyplot.Line2D([], [], color="black", linewidth=0.9, linestyle=":")


# Error against N.

def draw_layout_curves(panel, rows, layouts):
    """Curves of one scene and metric; returns {layout: handle}."""
    handles = {}
    for i, layout in enumerate(layouts):
        points = sorted(pick(rows, layout=layout), key=lambda r: r["stored"])
        if points:
            handles[layout] = draw_points(panel, [p["stored"] for p in points], points,
                                          color=colour(i), marker=MARKERS[i % len(MARKERS)])
    panel.grid(True, which="major")
    return handles


def values_with_floors(rows):
    return bounds_of(rows) + [r["floor"] for r in rows if r.get("floor")]


def draw_errors(pyplot, study, rows):
    scenes, layouts = study.axis("scene"), study.axis("layout")
    sheet = Sheet(pyplot, *grid_of(len(scenes)), 2.0, [*layouts, "noise floor"], sharey=True)
    errors, handles, floor = pick(rows, metric="nrmse"), {}, False
    for panel, scene in zip(sheet.flat(len(scenes)), scenes):
        of = pick(errors, scene=scene)
        handles.update(draw_layout_curves(panel, of, layouts))
        stored_axis(panel.xaxis, errors, 4)
        ratio_axis(panel.yaxis, values_with_floors(errors))
        floor = draw_floor(panel, of) or floor
        panel.set_title(pretty(scene))
        panel.set_xlabel("probes stored")
        slopes = {r["layout"]: r["value"] for r in pick(rows, scene=scene, metric="slope")}
        ends = {l: max(pick(of, layout=l), key=lambda r: r["stored"]) for l in layouts
                if pick(of, layout=l)}
        end_labels(panel, [(ends[l]["value"], f"{slopes[l]:+.2f}".replace("-", "\N{MINUS SIGN}"),
                            colour(layouts.index(l))) for l in ends if l in slopes])
        if panel.get_subplotspec().is_first_col():
            panel.set_ylabel("nrmse")
    names = [l for l in layouts if l in handles]
    sheet.legend([handles[l] for l in names] + [floor_handle(pyplot)] * floor,
                 [pretty(l) for l in names] + ["noise floor"] * floor)
    return sheet.figure


def draw_leaks(pyplot, study, rows):
    scenes, layouts = study.axis("scene"), study.axis("layout")
    metrics = ["light leak", "shadow leak"]
    sheet = Sheet(pyplot, 2, len(scenes), 1.75, [*layouts, "noise floor"], sharex=True,
                  sharey="row")
    handles, floor = {}, False
    for metric, line in zip(metrics, sheet.panels):
        of_metric = pick(rows, metric=metric)
        for scene, panel in zip(scenes, line):
            of = pick(of_metric, scene=scene)
            handles.update(draw_layout_curves(panel, of, layouts))
            stored_axis(panel.xaxis, of_metric, 3 if len(scenes) > 2 else 4)
            ratio_axis(panel.yaxis, values_with_floors(of_metric), smallest=LEAST_LEAK)
            floor = draw_floor(panel, of) or floor
            if metric == metrics[0]:
                panel.set_title(pretty(scene))
            else:
                panel.set_xlabel("probes stored")
        line[0].set_ylabel(metric)
    names = [l for l in layouts if l in handles]
    sheet.legend([handles[l] for l in names] + [floor_handle(pyplot)] * floor,
                 [pretty(l) for l in names] + ["noise floor"] * floor)
    return sheet.figure


def draw_error_vs_n(pyplot, study, tables):
    rows = tables[""]
    return {"": draw_errors(pyplot, study, rows), "leaks": draw_leaks(pyplot, study, rows)}


# Thin wall.

def draw_heat(figure, panels, rows, presets):
    """Light leak over thickness and N, a panel a preset, one scale for all; white: none at all."""
    from matplotlib.colors import LogNorm
    positive = [r["value"] for r in rows if r["value"] > LEAST_LEAK] or [LEAST_LEAK, 1]
    norm = LogNorm(min(positive), max(positive) * 1.001)
    thick = sorted({r["thickness_m"] for r in rows})
    counts = sorted({float(r["probes"]) for r in rows})
    step = 3 if len(counts) > 4 else 1
    image = None
    for panel, preset in zip(panels, presets):
        found = {(r["thickness_m"], float(r["probes"])): r for r in pick(rows, params=preset)}
        shown = {k for k, r in found.items() if r["value"] > LEAST_LEAK}
        grid = [[found[t, n]["value"] if (t, n) in shown else math.nan for n in counts]
                for t in thick]
        image = panel.imshow(grid, norm=norm, aspect="auto", origin="lower", interpolation="none")
        for (t, n), row in found.items():
            text = ("" if row["joins"] else "\N{BULLET}") + "0" * ((t, n) not in shown)
            dark = (t, n) in shown and norm(row["value"]) < 0.55
            panel.text(counts.index(n), thick.index(t), text, ha="center", va="center", fontsize=7,
                       color="white" if dark else "black")
        panel.grid(False)
        wide = [math.hypot(r["spacing_y"], r["spacing_z"]) / math.sqrt(2)
                for n in counts[::step] for r in [next(r for r in rows if float(r["probes"]) == n)]]
        panel.set_xticks(range(0, len(counts), step),
                         [f"{n:,.0f}\n{w:.2f} m" for n, w in zip(counts[::step], wide)])
        panel.set_yticks(range(len(thick)), [f"{100 * t:g}" for t in thick])
        panel.set_title(preset)
        panel.set_xlabel("probes asked, spacing")
    panels[0].set_ylabel("wall thickness, cm")
    bar = color_bar(figure, image, list(panels))
    bar.set_label("light leak")


def draw_collapse(pyplot, panels, rows, presets, everything):
    """Light leak against t / (d sin theta), a panel a preset. Returns handles and labels."""
    thick = sorted({r["thickness_m"] for r in rows})
    shade = shades(pyplot, len(thick))
    laws = {p: pick(rows, params=p)[0]["law"] for p in presets}
    shown = [law for law in laws.values() if law]
    for panel, preset in zip(panels, presets):
        for i, t in enumerate(thick):
            for joins in (1, 0):
                points = pick(rows, params=preset, thickness_m=t, joins=joins)
                if points:
                    draw_points(panel, [p["ratio"] for p in points], points, line=False,
                                color=shade[i], marker=MARKERS[i % len(MARKERS)], markersize=4.2,
                                markerfacecolor=shade[i] if joins else "white")
        ratio_axis(panel.xaxis, [r["ratio"] for r in everything] + shown, margin=1.4)
        ratio_axis(panel.yaxis, bounds_of(everything), smallest=LEAST_LEAK)
        if laws[preset]:
            panel.axvline(laws[preset], color="black", linewidth=0.9, linestyle="--")
            panel.text(laws[preset], 0.97, f" {laws[preset]:.2g}", fontsize=7, va="top",
                       transform=panel.get_xaxis_transform())
        panel.set_xlabel(r"$t\,/\,(d\,\sin\theta)$")
    panels[0].set_ylabel("light leak")
    handles = [pyplot.Line2D([], [], linestyle="", marker=MARKERS[i % len(MARKERS)], color=shade[i],
                             markersize=4.2) for i in range(len(thick))]
    handles += [pyplot.Line2D([], [], linestyle="", marker="o", color="grey", markersize=4.2,
                              markerfacecolor="white")]
    names = [f"{100 * t:g} cm" for t in thick] + ["no cell in both rooms"]
    if shown:
        handles.append(pyplot.Line2D([], [], color="black", linewidth=0.9, linestyle="--"))
        names.append("law")
    return handles, names


def draw_thin_wall(pyplot, study, tables):
    rows, presets = tables[""], [p for p in study.axis("params")
                                 if pick(tables[""], params=p)]
    if not rows:
        return {}
    sheet = Sheet(pyplot, 2, len(presets), 1.9, [""], width=PAGE, sharey="row")
    draw_heat(sheet.figure, sheet.panels[0], rows, presets)
    handles, names = draw_collapse(pyplot, sheet.panels[1], rows, presets, rows)
    sheet.legend_columns = len(names)
    sheet.legend(handles, names)
    return {"": sheet.figure}


# Rays and hysteresis.

def draw_rays_hysteresis(pyplot, study, tables):
    rows, scenes = tables[""], study.axis("scene")
    metrics = [m for m in ("nrmse", "flicker", "updates to 95 %", "updates to 99 %")
               if pick(rows, metric=m)]
    hysteresis = study.axis("hysteresis")
    series = [{"hysteresis": h, "warm-up": w} for h in hysteresis for w in study.axis("warm-up")
              if pick(rows, **{"hysteresis": h, "warm-up": w})]
    names = [f"hysteresis {s['hysteresis']}" + f", warm-up {s['warm-up']}" * (s["warm-up"] != "0")
             for s in series]
    shade = dict(zip(hysteresis, shades(pyplot, len(hysteresis))))
    styles = [{"color": shade[s["hysteresis"]], "marker": MARKERS[i % len(MARKERS)],
               "linestyle": "-" if s["warm-up"] == "0" else "--",
               "markerfacecolor": shade[s["hysteresis"]] if s["warm-up"] == "0" else "white"}
              for i, s in enumerate(series)]
    sheet = Sheet(pyplot, len(scenes), len(metrics), 1.7, [*names, "noise floor"], sharex=True,
                  sharey="col", width=PAGE)
    floor = False
    for scene, line in zip(scenes, sheet.panels):
        for metric, panel in zip(metrics, line):
            of = pick(rows, scene=scene, metric=metric)
            for one, style in zip(series, styles):
                points = sorted(pick(of, **one), key=lambda r: float(r["rays"]))
                if points:
                    draw_points(panel, [float(p["rays"]) for p in points], points, **style)
            count_axis(panel.xaxis, [float(r) for r in study.axis("rays")])
            ratio_axis(panel.yaxis, values_with_floors(pick(rows, metric=metric)))
            floor = (metric == "nrmse" and draw_floor(panel, of, "metric")) or floor
            if scene == scenes[0]:
                panel.set_title(metric)
            if scene == scenes[-1]:
                panel.set_xlabel("rays a probe")
        line[0].set_ylabel(pretty(scene))
    handles = [pyplot.Line2D([], [], **style) for style in styles]
    sheet.legend(handles + [floor_handle(pyplot)] * floor, names + ["noise floor"] * floor)
    return {"": sheet.figure}


# Speed against error.

def area_of(size, sizes):
    """Marker area, pt^2, by the logarithm of the bytes."""
    low, high = math.log(min(sizes)), math.log(max(sizes))
    return 9 + 70 * ((math.log(size) - low) / (high - low) if high > low else 0)


def series_of(study, rows):
    """[(preset, layout, its name)]: the first layout goes without saying."""
    found = [(p, layout) for p in study.axis("params") for layout in study.axis("layout")
             if pick(rows, params=p, layout=layout)]
    plain = study.axis("layout")[0]
    return [(p, layout, p if layout == plain else f"{p}, {layout}") for p, layout in found]


def mark_handles(pyplot, sizes, texels):
    """Handles and labels of what shape and area of a mark say."""
    def handle(marker, size):
        return pyplot.Line2D([], [], linestyle="", marker=marker, color="grey", markersize=size,
                             markeredgecolor="white", markeredgewidth=0.4)

    shapes = [(handle(MARKERS[i % len(MARKERS)], 4.5), f"texels {t}")
              for i, t in enumerate(texels)] if len(texels) > 1 else []
    areas = [(handle("o", math.sqrt(area_of(b, sizes))), bytes_text(b))
             for b in sorted({min(sizes), max(sizes)})]
    return zip(*shapes, *areas)


def draw_speed_error(pyplot, study, tables):
    rows, scenes, texels = tables[""], study.axis("scene"), study.axis("texels")
    costs = {"frame_ms": "frame, ms", "work_rays": "rays an update"}
    sizes, series = [r["bytes"] for r in rows], series_of(study, rows)
    # So far up that the path tracer's curve is in sight at the slowest frames.
    slowest = max(r["frame_ms"] for r in rows if r["frame_ms"]) / 1000
    visible = [r["value"] / math.sqrt(slowest) for r in tables["path_tracing"]]
    marks, mark_labels = mark_handles(pyplot, sizes, texels)
    labels = [*(name for *_, name in series), "Pareto front", "path tracing", "noise floor",
              *mark_labels]
    sheet = Sheet(pyplot, 2, len(scenes), 2.3, labels, sharey=True, sharex="row")
    for (cost, label), line in zip(costs.items(), sheet.panels):
        for scene, panel in zip(scenes, line):
            of = [r for r in pick(rows, scene=scene) if r[cost]]
            for i, (preset, layout, _) in enumerate(series):
                for marker, t in zip(MARKERS, texels):
                    draw_cloud(panel, pick(of, params=preset, layout=layout, texels=t), cost,
                               sizes, colour(i), marker)
            draw_front(panel, sorted((r[cost], r["value"]) for r in of if r["front_" + cost]))
            draw_floor(panel, of, "metric")
            ratio_axis(panel.xaxis, [r[cost] for r in rows if r[cost]], margin=1.5)
            ratio_axis(panel.yaxis, values_with_floors(rows) + visible, margin=1.35)
            if cost == "frame_ms":
                draw_path_tracing(panel, pick(tables["path_tracing"], scene=scene))
                panel.set_title(pretty(scene))
            panel.set_xlabel(label)
        line[0].set_ylabel("nrmse")
    handles = [pyplot.Line2D([], [], linestyle="", marker="o", color=colour(i), markersize=5,
                             markeredgecolor="white", markeredgewidth=0.4)
               for i in range(len(series))]
    handles += [pyplot.Line2D([], [], color="black", linewidth=0.9),
                pyplot.Line2D([], [], color="dimgrey", linestyle="-."), floor_handle(pyplot)]
    sheet.legend([*handles, *marks], labels)
    return {"": sheet.figure}


def draw_front(panel, points):
    """Above the marks, with a rim of white, or a dense cloud hides it."""
    for width, tone in ((2.1, "white"), (0.9, "black")):
        panel.plot(*zip(*points), color=tone, linewidth=width, drawstyle="steps-post", zorder=4)


def draw_path_tracing(panel, rows):
    """The path tracer's error over the panel's times, with its band; limits are set."""
    ends = panel.get_xlim()
    for row in rows:
        lines = [[row[k] / math.sqrt(ms / 1000) for ms in ends] for k in ("value", "low", "high")]
        panel.plot(ends, lines[0], color="dimgrey", linestyle="-.", zorder=1)
        panel.fill_between(ends, lines[1], lines[2], color="dimgrey", alpha=0.2, linewidth=0)


def bytes_text(size):
    for unit, factor in (("MB", 1e6), ("kB", 1e3)):
        if size >= factor:
            return f"{size / factor:.{1 if size < 10 * factor else 0}f} {unit}"
    return f"{size:.0f} B"


def draw_cloud(panel, points, cost, sizes, tone, marker):
    """Small marks last."""
    points = sorted(points, key=lambda p: -p["bytes"])
    if not points:
        return
    if any(p["seeds"] > 1 for p in points):
        across = None
        if cost == "frame_ms":
            across = [[max(0, p["frame_ms"] - p["frame_ms_low"]) for p in points],
                      [max(0, p["frame_ms_high"] - p["frame_ms"]) for p in points]]
        panel.errorbar([p[cost] for p in points], [p["value"] for p in points], xerr=across,
                       yerr=[[max(0, p["value"] - p["low"]) for p in points],
                             [max(0, p["high"] - p["value"]) for p in points]],
                       linestyle="", color=tone, elinewidth=0.6, capsize=0, zorder=2)
    panel.scatter([p[cost] for p in points], [p["value"] for p in points], color=tone,
                  s=[area_of(p["bytes"], sizes) for p in points], marker=marker, edgecolors="white",
                  linewidths=0.4, zorder=3)
