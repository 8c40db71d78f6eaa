# SPDX-License-Identifier: GPL-3.0-or-later
"""The figure of scripts/placement.py: error against N. Needs matplotlib."""
import math

from placement_report import LIGHTS, Tables
from placement_rows import bootstrap_sums, percentiles
from whole_output import no_matplotlib


def curve_interval(results, key, seeds):
    squares = results.squares(key, seeds)
    names = sorted({name for blocks in squares for name in blocks})
    return percentiles([math.sqrt(max(0.0, s) / len(squares))
                        for s in bootstrap_sums(squares, names)])


def draw_panel(panel, tables, scene, lights, names):
    """The curves of the layouts with their 95 % intervals."""
    for name in names:
        points = tables.curve(scene, name, lights)
        if not points:
            continue
        bounds = [curve_interval(tables.results, (scene, name, n, lights),
                                 tables.results.seeds(scene, name, n, lights)) for n, _ in points]
        counts = [n for n, _ in points]
        line, = panel.plot(counts, [e for _, e in points], marker="o", markersize=3,
                           linewidth=2 if name in tables.ours else 1, label=name)
        panel.fill_between(counts, [b[0] for b in bounds], [b[1] for b in bounds],
                           color=line.get_color(), alpha=0.15, linewidth=0)
    panel.set_xscale("log", base=2)
    panel.xaxis.set_major_formatter("{x:g}")
    panel.set_yscale("log")
    panel.set_title(f"{scene}, {LIGHTS[lights]}", fontsize=9)
    panel.grid(True, which="both", linewidth=0.3)


def write_figure(study, rows, folder):
    """curves.svg and curves.png: nrmse against N, a panel a scene and kind of light. Returns why
    there is none, where there could be one."""
    tables = Tables(study, rows)
    names = study.get("curves", {}).get("layouts", [])
    curves = [(s, lights) for s in tables.scenes for lights in LIGHTS
              if any(len(tables.curve(s, n, lights)) >= 3 for n in names)]
    scenes = [s for s in tables.scenes if any(s == scene for scene, _ in curves)]
    shown = [lights for lights in LIGHTS if any(lights == of for _, of in curves)]
    if not scenes:
        return []
    try:
        import matplotlib
        matplotlib.use("Agg")
        from matplotlib import pyplot
    except ImportError as error:
        return [f"no figure: {no_matplotlib(error)}"]
    matplotlib.rcParams["svg.hashsalt"] = "probelab"
    figure, axes = pyplot.subplots(len(shown), len(scenes), squeeze=False, sharex=True,
                                   figsize=(3.4 * len(scenes), 3.0 * len(shown)))
    for i, lights in enumerate(shown):
        for j, scene in enumerate(scenes):
            draw_panel(axes[i][j], tables, scene, lights, names)
        axes[i][0].set_ylabel("nrmse")
    for panel in axes[-1]:
        panel.set_xlabel("probes")
    axes[0][0].legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(folder / "curves.svg", metadata={"Date": None})
    figure.savefig(folder / "curves.png", dpi=110)
    pyplot.close(figure)
    return []
