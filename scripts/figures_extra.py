# SPDX-License-Identifier: GPL-3.0-or-later
"""Drawings of grid robustness, bias maps and layout x tuning. draw_NAME(pyplot, study, tables)
returns {suffix: figure}. Needs matplotlib."""
from figures_curves import pick, values_with_floors
from figures_extra_tables import ERRORS, LIGHTS, MAPS
from figures_panels import (MARKERS, PAGE, Sheet, bounds_of, color_bar, colour, draw_points,
                            floor_lines, pretty, ratio_axis, shades)
from figures_tables import LEAST_LEAK


def smallest(metric):
    return LEAST_LEAK if metric.endswith("leak") else 0.0


# Grid offset and rotation.

def draw_grid_robustness(pyplot, study, tables):
    rows = tables[""]
    rooms = list(dict.fromkeys(r["room"] for r in rows))
    angles = sorted({r["turn_deg"] for r in rows})
    offsets = sorted({float(r["offset"]) for r in rows})
    shade = shades(pyplot, len(angles))
    names = [f"turned by {a} deg" if a else "along the axes" for a in angles]
    sheet = Sheet(pyplot, len(ERRORS), len(rooms), 1.6, [*names, "noise floor"], sharex=True,
                  sharey="row", width=PAGE if len(rooms) > 1 else None)
    floor = None
    for metric, line in zip(ERRORS, sheet.panels):
        of_metric = pick(rows, metric=metric)
        for room, panel in zip(rooms, line):
            of = pick(of_metric, room=room)
            for i, angle in enumerate(angles):
                points = pick(of, turn_deg=angle)
                if points:
                    draw_points(panel, [float(p["offset"]) + 0.012 * (i - len(angles) / 2)
                                        for p in points], points, color=shade[i],
                                marker=MARKERS[i % len(MARKERS)])
            ratio_axis(panel.yaxis, values_with_floors(of_metric), smallest=smallest(metric))
            panel.set_xlim(offsets[0] - 0.06, offsets[-1] + 0.06)
            floor = floor_lines(panel, [panel.get_xlim()], [r for r in of if r["floor"]][:1]) \
                or floor
            if metric == "nrmse":
                panel.set_title(pretty(room))
        line[0].set_ylabel(metric)
    for panel in sheet.panels[-1]:
        panel.set_xlabel("offset, spacings")
        panel.set_xticks(offsets)
    handles = [pyplot.Line2D([], [], color=shade[i], marker=MARKERS[i % len(MARKERS)])
               for i in range(len(angles))]
    handles += [pyplot.Line2D([], [], color="black", linewidth=0.9, linestyle=":")] * bool(floor)
    sheet.legend(handles, names + ["noise floor"] * bool(floor))
    return {"": sheet.figure}


# Bias maps.

def draw_places(panel, places, names):
    """Presets by mark, white; the optimum of every seed as a red star."""
    for place in places:
        tuned = place["name"] == "tuned"
        panel.plot(place["normal_bias"], place["view_bias"], linestyle="", clip_on=False, zorder=3,
                   marker="*" if tuned else MARKERS[names.index(place["name"]) % len(MARKERS)],
                   markersize=9 if tuned else 5, color="red" if tuned else "white",
                   markeredgecolor="black", markeredgewidth=0.7)


def place_handles(pyplot, names):
    handles = []
    for name in names:
        tuned = name == "tuned"
        handles.append(pyplot.Line2D(
            [], [], linestyle="", color="red" if tuned else "white", markeredgecolor="black",
            marker="*" if tuned else MARKERS[names.index(name) % len(MARKERS)],
            markersize=9 if tuned else 5, markeredgewidth=0.7))
    return handles


def draw_map(figure, panel, rows, metric, shared):
    from matplotlib.colors import LogNorm, Normalize
    normal = sorted({r["normal_bias"] for r in rows})
    view = sorted({r["view_bias"] for r in rows})
    value = {(r["normal_bias"], r["view_bias"]): r["value"] for r in rows}
    positive = [v for v in shared if v > smallest(metric)]
    wide = positive and max(positive) > 2 * min(positive)
    norm = (LogNorm if wide else Normalize)(min(positive, default=0), max(positive, default=1))
    least = min(positive, default=0)
    if not positive:
        panel.text(0.5, 0.5, "0 everywhere", ha="center", va="center", transform=panel.transAxes,
                   color="white")
    image = panel.pcolormesh(normal, view, [[max(value[n, v], least) for n in normal]
                                            for v in view],
                             norm=norm, cmap="cividis", shading="nearest", rasterized=True)
    if positive:
        color_bar(figure, image, panel)
    panel.set_xlim(min(normal), max(normal))
    panel.set_ylim(min(view), max(view))
    panel.grid(False)


def preset_of(study):
    return " ".join(study.cells[0].options.get("from", ["preset"]))


def draw_bias_map(pyplot, study, tables):
    rows = tables[""]
    scenes = [s for s in study.axis("scene") if pick(rows, scene=s)]
    if not scenes:
        return {}
    found = list(dict.fromkeys(p["name"] for p in tables["places"]))
    names = [n for n in found if n != "tuned"] + ["tuned"]
    labels = [preset_of(study) if n == "from" else n for n in names]
    sheet = Sheet(pyplot, len(MAPS), len(scenes), 1.9, labels, sharex=True, sharey=True,
                  width=PAGE if len(scenes) > 1 else None)
    for metric, line in zip(MAPS, sheet.panels):
        for scene, panel in zip(scenes, line):
            of = pick(rows, scene=scene, metric=metric)
            draw_map(sheet.figure, panel, of, metric, [r["value"] for r in of])
            draw_places(panel, pick(tables["places"], scene=scene), names)
            panel.set_title(f"{pretty(scene)}: {metric}", fontsize=8)
        line[0].set_ylabel("view bias, spacings")
    for panel in sheet.panels[-1]:
        panel.set_xlabel("normal bias, spacings")
    sheet.legend(place_handles(pyplot, names), labels)
    return {"": sheet.figure}


# Layout x tuning.

def draw_layout_tuning(pyplot, study, tables):
    rows = [r for r in tables[""] if r["setting"] in ("from", "tuned")]
    scenes, layouts = study.axis("scene"), study.axis("layout")
    lines = [(metric, lights) for metric in ("nrmse", "light leak") for lights in LIGHTS
             if pick(rows, metric=metric, lights=lights)]
    labels = [f"parameters of {preset_of(study)}", "tuned parameters"]
    sheet = Sheet(pyplot, len(lines), len(scenes), 1.35, labels, more=0.4, sharex=True,
                  sharey="row", width=PAGE if len(scenes) > 1 else None)
    for (metric, lights), line in zip(lines, sheet.panels):
        of_line = pick(rows, metric=metric, lights=lights)
        for scene, panel in zip(scenes, line):
            for i, setting in enumerate(("from", "tuned")):
                points = pick(of_line, scene=scene, setting=setting)
                draw_points(panel, [layouts.index(p["layout"]) + 0.2 * (i - 0.5) for p in points],
                            points, line=False, color=colour(i), marker=MARKERS[i], markersize=4.5)
            panel.set_xlim(-0.6, len(layouts) - 0.4)
            panel.set_xticks(range(len(layouts)), [pretty(l) for l in layouts], rotation=30,
                             ha="right", rotation_mode="anchor")
            if (metric, lights) == lines[0]:
                panel.set_title(pretty(scene))
        ratio_axis(line[0].yaxis, bounds_of(of_line), smallest=smallest(metric))
        line[0].set_ylabel(f"{metric},\n{LIGHTS[lights]}", fontsize=8)
    handles = [pyplot.Line2D([], [], linestyle="", color=colour(i), marker=MARKERS[i],
                             markersize=4.5) for i in range(2)]
    sheet.legend(handles, labels)
    return {"": sheet.figure}
