# SPDX-License-Identifier: GPL-3.0-or-later
"""The figure of scripts/placement.py: error against N. Needs matplotlib."""
import math

from placement_report import LIGHTS, Tables
from placement_rows import bootstrap_sums, percentiles
from whole_output import no_matplotlib, whole_folder


def curve_interval(results, key, seeds):
    squares = results.squares(key, seeds)
    names = sorted({name for blocks in squares for name in blocks})
    return percentiles([math.sqrt(max(0.0, s) / len(squares))
                        for s in bootstrap_sums(squares, names)])


def points_of(tables, scene, lights, name):
    """A curve's points with their 95 % intervals."""
    found = []
    for n, error in tables.curve(scene, name, lights):
        seeds = tables.results.seeds(scene, name, n, lights)
        low, high = curve_interval(tables.results, (scene, name, n, lights), seeds)
        found.append({"n": n, "value": error, "low": low, "high": high})
    return found


def draw_panel(panel, curves):
    """Curves {layout: points} with their intervals; returns handles for a legend."""
    from figures_panels import MARKERS, bounds_of, colour, count_axis, ratio_axis
    points = [p for of in curves.values() for p in of]
    count_axis(panel.xaxis, [p["n"] for p in points])
    ratio_axis(panel.yaxis, [v for v in bounds_of(points) if v > 0])
    handles = []
    for i, of in enumerate(curves.values()):
        xs, tone = [p["n"] for p in of], colour(i)
        handles += panel.plot(xs, [p["value"] for p in of], color=tone,
                              marker=MARKERS[i % len(MARKERS)])
        panel.fill_between(xs, [p["low"] for p in of], [p["high"] for p in of], color=tone,
                           alpha=0.15, linewidth=0)
    return handles


def write_figure(study, rows, folder):
    """curves.pdf and curves.png: nrmse against N, a panel a scene and kind of light. Returns why
    there is none, where there could be one."""
    tables = Tables(study, rows)
    names = study.get("curves", {}).get("layouts", [])
    panels = {(lights, s): {n: points_of(tables, s, lights, n) for n in names}
              for s in tables.scenes for lights in LIGHTS
              if any(len(tables.curve(s, n, lights)) >= 3 for n in names)}
    if not panels:
        return []
    try:
        from figures_panels import PAGE, Sheet, load_pyplot, pretty, save
        pyplot = load_pyplot()
    except ImportError as error:
        return [f"no figure: {no_matplotlib(error)}"]
    shown = [lights for lights in LIGHTS if any(lights == of for of, _ in panels)]
    scenes = [s for s in tables.scenes if any(s == of for _, of in panels)]
    sheet = Sheet(pyplot, len(shown), len(scenes), 1.7, names, width=PAGE, sharex=True)
    for lights, line in zip(shown, sheet.panels):
        for scene, panel in zip(scenes, line):
            if (lights, scene) not in panels:
                panel.set_axis_off()
                continue
            handles = draw_panel(panel, panels[lights, scene])
            panel.set_title(f"{pretty(scene)}\n{LIGHTS[lights]}")
        line[0].set_ylabel("nrmse")
    for panel in sheet.panels[-1]:
        panel.set_xlabel("probes")
    sheet.legend(handles, names)
    with whole_folder(folder) as part:
        save(sheet.figure, part, "curves")
    return []
