# SPDX-License-Identifier: GPL-3.0-or-later
"""Drawings of the figures whose panels compare named settings: visibility terms, texels,
interpolants, formats, error budget. draw_NAME(pyplot, study, tables) returns {suffix: figure}.
Needs matplotlib."""
from figures_curves import floor_handle, pick
from figures_panels import (COLUMN, MARKERS, PAGE, Sheet, bounds_of, colour, count_axis,
                            draw_points, floor_lines, name_places, pretty, ratio_axis,
                            room_for_places, shades)
from figures_tables import LEAST_LEAK

UNITS = {"query ns": "query, ns a point"}


def offset(i, n, width=0.7):
    """Of the i-th of n marks that share a place."""
    return width * ((i + 0.5) / n - 0.5)


def smallest(metric):
    return LEAST_LEAK if metric.endswith("leak") else 0.0


def values_of(rows):
    return bounds_of(rows) + [r["floor"] for r in rows if r.get("floor")]


# Visibility terms.

def draw_visibility_terms(pyplot, study, tables):
    rows, scenes, terms = tables[""], study.axis("scene"), study.axis("terms")
    metrics = ["nrmse", "light leak", "shadow leak"]
    labels, width = [pretty(s) for s in scenes], PAGE if len(scenes) > 1 else COLUMN
    sheet = Sheet(pyplot, len(metrics), 1, 1.35, [*terms, "noise floor"], sharex=True,
                  width=width, more=room_for_places(labels, width))
    floor = None
    for metric, (panel,) in zip(metrics, sheet.panels):
        of = pick(rows, metric=metric)
        ratio_axis(panel.yaxis, values_of(of), smallest=smallest(metric))
        for i, term in enumerate(terms):
            points = [r for s in scenes for r in pick(of, scene=s, terms=term)]
            draw_bars(panel, [scenes.index(r["scene"]) + offset(i, len(terms), 0.84)
                              for r in points], points, 0.84 / len(terms), colour(i))
        for j, scene in enumerate(scenes):
            floor = floor_lines(panel, [(j - 0.45, j + 0.45)], pick(of, scene=scene)[:1]) or floor
        panel.set_ylabel(metric)
        panel.grid(False, axis="x")
        panel.tick_params(axis="x", length=0)
    name_places(panel, labels, sheet.width)
    handles = [pyplot.Rectangle((0, 0), 1, 1, color=colour(i)) for i in range(len(terms))]
    sheet.legend(handles + [floor_handle(pyplot)] * bool(floor),
                 [*terms] + ["noise floor"] * bool(floor))
    return {"": sheet.figure}


def draw_bars(panel, xs, points, width, tone, start=None):
    """Bars from `start`, or the axis' lower end, with their intervals; after the axis' scale is
    set."""
    bottom = panel.get_ylim()[0] if start is None else start
    panel.bar(xs, [p["value"] - bottom for p in points], 0.9 * width, bottom=bottom, color=tone)
    several = [(x, p) for x, p in zip(xs, points) if p["seeds"] > 1]
    if several:
        draw_points(panel, [x for x, _ in several], [p for _, p in several], line=False,
                    color="black", marker="")
    if start is None:
        panel.set_ylim(bottom, None)


# Texels.

def draw_texels(pyplot, study, tables):
    rows, scenes = tables[""], study.axis("scene")
    irradiance, moments = (study.axis(a) for a in ("irradiance texels", "moment texels"))
    shade = shades(pyplot, len(irradiance))
    styles = [{"color": shade[i], "marker": MARKERS[i % len(MARKERS)]}
              for i in range(len(irradiance))]
    names = [f"irradiance {i} x {i}" for i in irradiance]
    kinds = [k for k in (("probes", "nrmse"), ("probes", "light leak"), ("bytes", "nrmse"),
                         ("bytes", "light leak")) if pick(rows, fixed=k[0])]
    sheet = Sheet(pyplot, len(kinds), len(scenes), 1.75, [*names, "noise floor"],
                  sharey="row", width=PAGE if len(scenes) > 1 else None)
    for (fixed, metric), line in zip(kinds, sheet.panels):
        of = pick(rows, fixed=fixed, metric=metric)
        for scene, panel in zip(scenes, line):
            for i, texels in enumerate(irradiance):
                points = pick(of, scene=scene, **{"irradiance texels": texels})
                # Side by side: many are the same.
                draw_points(panel, [float(p["moment texels"]) * 1.06 ** (i - (len(irradiance) - 1)
                                                                         / 2) for p in points],
                            points, **styles[i])
            count_axis(panel.xaxis, [float(m) for m in moments])
            ratio_axis(panel.yaxis, values_of(pick(rows, metric=metric)),
                       smallest=smallest(metric))
            floor_lines(panel, [panel.get_xlim()], pick(of, scene=scene)[:1])
            panel.set_xlabel("moment texels, an edge")
        line[0].set_ylabel(f"{metric}\n" + ("same probes" if fixed == "probes" else "same bytes"))
    for scene, panel in zip(scenes, sheet.panels[0]):
        panel.set_title(pretty(scene))
    sheet.legend([pyplot.Line2D([], [], **style) for style in styles] + [floor_handle(pyplot)],
                 [*names, "noise floor"])
    return {"": sheet.figure}


# Interpolants.

def draw_interpolants(pyplot, study, tables):
    rows, layouts = tables[""], study.axis("layout")
    scenes = study.axis("scene") + ["all scenes"] * bool(pick(rows, scene="all scenes"))
    names = study.axis("interpolant")
    metrics = [m for m in ("nrmse", "light leak", "query ns") if pick(rows, metric=m)]
    sheet = Sheet(pyplot, len(metrics), len(scenes), 1.3, [*layouts, "noise floor"], more=0.5,
                  sharex=True, sharey="row", width=PAGE if len(scenes) > 1 else None)
    floor = None
    for metric, line in zip(metrics, sheet.panels):
        of_metric = pick(rows, metric=metric)
        ratio_axis(line[0].yaxis, values_of(of_metric), smallest=smallest(metric))
        for scene, panel in zip(scenes, line):
            of = pick(of_metric, scene=scene)
            if not of:  # no mean over scenes of what is 0 in some
                panel.set_axis_off()
            for i, layout in enumerate(layouts):
                points = pick(of, layout=layout)
                draw_points(panel, [names.index(p["interpolant"]) + offset(i, len(layouts), 0.4)
                                    for p in points], points, line=False, color=colour(i),
                            marker=MARKERS[i % len(MARKERS)], markersize=4.5)
            floor = floor_lines(panel, [(-0.6, len(names) - 0.4)], of[:1]) or floor
            panel.set_xlim(-0.6, len(names) - 0.4)
            panel.set_xticks(range(len(names)), names, rotation=45, ha="right",
                             rotation_mode="anchor")
            if metric == metrics[0]:
                panel.set_title(pretty(scene))
        line[0].set_ylabel(UNITS.get(metric, metric))
    handles = [pyplot.Line2D([], [], linestyle="", color=colour(i), markersize=4.5,
                             marker=MARKERS[i % len(MARKERS)]) for i in range(len(layouts))]
    sheet.legend(handles + [floor_handle(pyplot)] * bool(floor),
                 [*layouts] + ["noise floor"] * bool(floor))
    return {"": sheet.figure}


# Formats.

def draw_formats(pyplot, study, tables):
    rows, scenes, formats = tables[""], study.axis("scene"), study.axis("format")
    columns = [(g, h) for g in study.axis("gamma") for h in study.axis("hysteresis")
               if pick(rows, gamma=g, hysteresis=h)]
    roundings = study.axis("rounding")
    sheet = Sheet(pyplot, len(scenes), len(columns), 1.6, [*roundings, "bias of rgba32f"],
                  more=0.8, sharex=True, sharey="row", width=PAGE if len(columns) > 1 else None)
    exact = False
    for scene, line in zip(scenes, sheet.panels):
        for (gamma, hysteresis), panel in zip(columns, line):
            of = pick(rows, scene=scene, gamma=gamma, hysteresis=hysteresis)
            for i, rounding in enumerate(roundings):
                points = [{**r, **{k: 100 * r[k] for k in ("value", "low", "high")}}
                          for r in pick(of, rounding=rounding)]
                draw_points(panel, [formats.index(p["format"]) + offset(i, len(roundings), 0.4)
                                    for p in points], points, line=False, color=colour(i),
                            marker=MARKERS[i % len(MARKERS)], markersize=4.5)
            for row in pick(of, format="rgba32f")[:1]:
                panel.axhline(100 * row["value"], color="grey", linewidth=0.8, linestyle="--")
                exact = True
            panel.axhline(0, color="black", linewidth=0.6)
            panel.set_xlim(-0.6, len(formats) - 0.4)
            panel.set_xticks(range(len(formats)), formats, rotation=45, ha="right",
                             rotation_mode="anchor")
            if scene == scenes[0]:
                panel.set_title(f"gamma {gamma},\nhysteresis {hysteresis}")
        values = [100 * v for v in bounds_of(pick(rows, scene=scene))] + [0]
        room = max(0.1 * (max(values) - min(values)), 0.5)
        line[0].set_ylim(min(values) - room, max(values) + room)
        line[0].set_ylabel(f"{pretty(scene)}\nbias, %")
    handles = [pyplot.Line2D([], [], linestyle="", color=colour(i), markersize=4.5,
                             marker=MARKERS[i % len(MARKERS)]) for i in range(len(roundings))]
    handles += [pyplot.Line2D([], [], color="grey", linewidth=0.8, linestyle="--")] * exact
    sheet.legend(handles, [f"rounding {r}" for r in roundings] + ["bias of rgba32f"] * exact)
    return {"": sheet.figure}


# Error budget.

def draw_budget(pyplot, study, tables):
    rows = tables[""]
    places = list(dict.fromkeys((r["scene"], r["setting"]) for r in rows))
    metrics = [m for m in ("nrmse", "share", "light leak") if pick(rows, metric=m)]
    rungs = list(dict.fromkeys(r["name"] for r in sorted(rows, key=lambda r: r["rung"])))
    shade = shades(pyplot, len(rungs))
    labels = ["\n".join(filter(None, (pretty(s), t))) for s, t in places]
    width = PAGE if len(places) > 1 else COLUMN
    sheet = Sheet(pyplot, len(metrics), 1, 1.45, [*rungs, "noise floor"], sharex=True,
                  width=width, more=room_for_places(labels, width))
    floor = None
    for metric, (panel,) in zip(metrics, sheet.panels):
        of = pick(rows, metric=metric)
        if metric == "share":
            panel.axhline(0, color="black", linewidth=0.6)
        else:
            ratio_axis(panel.yaxis, values_of(of), smallest=smallest(metric))
        for i, name in enumerate(rungs):
            points = pick(of, name=name)
            draw_bars(panel, [places.index((r["scene"], r["setting"]))
                              + offset(i, len(rungs), 0.84) for r in points],
                      points, 0.84 / len(rungs), shade[i], 0 if metric == "share" else None)
        for j, (scene, setting) in enumerate(places):
            floor = floor_lines(panel, [(j - 0.45, j + 0.45)],
                                pick(of, scene=scene, setting=setting)[:1]) or floor
        panel.set_ylabel("share of nrmse$^2$" if metric == "share" else metric)
        panel.grid(False, axis="x")
        panel.tick_params(axis="x", length=0)
    name_places(panel, labels, sheet.width)
    sheet.legend([pyplot.Rectangle((0, 0), 1, 1, color=c) for c in shade]
                 + [floor_handle(pyplot)] * bool(floor), rungs + ["noise floor"] * bool(floor))
    return {"": sheet.figure}
