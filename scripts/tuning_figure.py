#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws what `probelab tune --report DIR` wrote: bias_map.png (cost, nrmse and light leak over both
biases, with the presets and the optimum), searches.png (cost against evaluations, with
--compare-searches) and errors.png (held-out errors of all settings). Needs matplotlib.
"""
import argparse
import csv
import pathlib
import sys

from figures_panels import colour
from whole_output import InputError, first_paragraph, no_matplotlib, of_system, read_object

MAPS = {"cost": "cost", "nrmse": "nrmse", "light_leak": "light leak"}
SEARCHES = {"levenberg_marquardt": "Levenberg-Marquardt from the preset",
            "multi_start": "Levenberg-Marquardt, multi-start",
            "nelder_mead": "Nelder-Mead from the preset", "random": "random search"}
MARKS = "osD^vPX"
SETTINGS = ["from", "tuned"]  # have the first colours of the figures, presets the others
ERRORS = {"nrmse": "nrmse", "light_leak": "light leak", "shadow_leak": "shadow leak"}
# What reading a report raises that has something else in the place of a table or a number.
DAMAGE = (ArithmeticError, AttributeError, LookupError, TypeError, ValueError)


def read_map(path, size):
    """{column: [view][normal]} with the values of both axes, of which there are `size` each."""
    try:
        with open(path, newline="") as file:
            rows = [{c: float(row[c]) for c in ("normal_bias", "view_bias", *MAPS)}
                    for row in csv.DictReader(file)]
    except (*DAMAGE, csv.Error) as error:
        raise InputError(f"{path}: damaged, or it ends too early: not the map of 'probelab tune "
                         "--report'; run it again") from error
    normal = sorted({r["normal_bias"] for r in rows})
    view = sorted({r["view_bias"] for r in rows})
    if not len(normal) == len(view) == size or len(rows) != size * size:
        raise InputError(f"{path}: {len(rows)} values, but the map has {size} x {size}; run "
                         "'probelab tune --report' again")
    grids = {c: [[rows[v * size + n][c] for n in range(size)] for v in range(size)] for c in MAPS}
    return normal, view, grids


def legend_below(figure, handles, labels, fontsize):
    """A legend below the panels in as few rows as its width takes. Returns where the panels may
    begin, as a share of the figure's height."""
    for rows in range(1, len(labels) + 1):
        legend = figure.legend(handles, labels, loc="lower center", fontsize=fontsize,
                               ncol=-(-len(labels) // rows))
        box = legend.get_window_extent(figure.canvas.get_renderer())
        if box.width <= 0.98 * figure.bbox.width or rows == len(labels):
            return (box.height + 4) / figure.bbox.height
        legend.remove()
    return 0.0


def mark_places(panel, places, labels):
    """Marks settings; those at one place share a mark. Returns the marks for a legend."""
    at = {}
    for place in places:
        at.setdefault((place["normal_bias"], place["view_bias"]), []).append(labels[place["name"]])
    handles = []
    for i, ((x, y), names) in enumerate(at.items()):
        tuned = "tuned" in names
        handles += panel.plot(x, y, marker="*" if tuned else MARKS[i % len(MARKS)],
                              markersize=15 if tuned else 8, color="red" if tuned else "white",
                              markeredgecolor="black", linestyle="", clip_on=False, zorder=3,
                              label=", ".join(dict.fromkeys(names)))
    return handles


def labels_of(result, names):
    """{setting: its label}: a preset's name; a file's without its folders where no other has it."""
    start = result["from"].split(" ")[0]
    short = {name: pathlib.PurePath(start if name == "from" else name).name for name in names}
    return {name: short[name] if [*short.values()].count(short[name]) == 1
            else start if name == "from" else name for name in names}


def draw_map(pyplot, result, folder, target):
    from matplotlib.colors import LogNorm, Normalize
    normal, view, grids = read_map(folder / "bias_map.csv", result["bias_map"]["size"])
    places = result["bias_map"]["places"]
    labels = labels_of(result, [place["name"] for place in places])
    figure, panels = pyplot.subplots(1, len(MAPS), figsize=(5 * len(MAPS), 4.4))
    for panel, (column, title) in zip(panels, MAPS.items()):
        values = [v for row in grids[column] for v in row]
        logarithmic = min(values) > 0 and max(values) > 3 * min(values)
        norm = (LogNorm if logarithmic else Normalize)(min(values), max(values))
        image = panel.pcolormesh(normal, view, grids[column], norm=norm, cmap="cividis",
                                 shading="nearest", rasterized=True)
        figure.colorbar(image, ax=panel)
        handles = mark_places(panel, places, labels)
        panel.set_title(f"{title}, train receivers", fontsize=10)
        panel.set_xlabel("normal bias, x probe spacing")
        panel.set_xlim(min(normal), max(normal))
        panel.set_ylim(min(view), max(view))
    panels[0].set_ylabel("view bias, x probe spacing")
    figure.suptitle(", ".join(s["scene"] for s in result["scenes"]), fontsize=11)
    bottom = legend_below(figure, handles, [h.get_label() for h in handles], 9)
    figure.tight_layout(rect=(0, bottom, 1, 1))
    figure.savefig(target / "bias_map.png", dpi=110)
    pyplot.close(figure)


def draw_searches(pyplot, result, target):
    searches = result["searches"]
    floor = min(steps[-1][1] for steps in searches.values())
    figure, panel = pyplot.subplots(figsize=(6.4, 4.2))
    for name, title in SEARCHES.items():
        x, y = zip(*searches[name])
        panel.step(x, [c / floor - 1 + 1e-4 for c in y], where="post", label=title,
                   linewidth=2 if name == "levenberg_marquardt" else 1.2)
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.set_xlabel("evaluations of the cost (one with derivatives: 1 + parameters)")
    panel.set_ylabel("cost over the least found, minus 1 (+ 0.0001)")
    panel.grid(True, which="both", linewidth=0.3)
    panel.legend(fontsize=9)
    figure.tight_layout()
    figure.savefig(target / "searches.png", dpi=110)
    pyplot.close(figure)


def draw_errors(pyplot, result, target):
    scores = result["scores"]
    names = [s["setting"] for s in scores[0]["settings"]]
    titles = labels_of(result, names)
    labels = [f"{s['scene'].split('/')[0]}\n{s['state']}" + ("" if s["lights"] == "train" else " *")
              for s in scores]
    figure, panels = pyplot.subplots(len(ERRORS), 1, sharex=True,
                                     figsize=(max(6.4, 1.3 * len(scores) + 2), 7.2))
    width = 0.84 / len(names)
    in_order = SETTINGS + [name for name in names if name not in SETTINGS]
    colours = {name: colour(i) for i, name in enumerate(in_order)}
    for panel, (error, title) in zip(panels, ERRORS.items()):
        for i, name in enumerate(names):
            heights = [s["settings"][i]["heldout"][error] or 0 for s in scores]
            panel.bar([j + (i - (len(names) - 1) / 2) * width for j in range(len(scores))], heights,
                      width, color=colours[name], zorder=2,
                      label=titles[name] + " (from)" * (name == "from"))
        for j, score in enumerate(scores):
            floor = score["settings"][0]["heldout"]["noise_floor"][error]
            if floor is not None:
                panel.hlines(floor, j - 0.46, j + 0.46, color="black", linewidth=1, zorder=3,
                             label="noise floor" if j == 0 else None)
        panel.set_ylabel(title)
        panel.grid(True, axis="y", linewidth=0.3)
    panels[-1].set_xticks(range(len(scores)), labels, fontsize=8)
    panels[0].set_title("held-out receivers; * a light that was not tuned on", fontsize=10)
    bottom = legend_below(figure, *panels[0].get_legend_handles_labels(), 8)
    figure.tight_layout(rect=(0, bottom, 1, 1))
    figure.savefig(target / "errors.png", dpi=110)
    pyplot.close(figure)


def draw(folder, target):
    """The names of the pictures; raises InputError."""
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot
    path = folder / "tune.json"
    result, drawn = read_object(path), []
    try:
        if result.get("bias_map"):
            draw_map(pyplot, result, folder, target)
            drawn.append("bias_map.png")
        if result.get("searches"):
            draw_searches(pyplot, result, target)
            drawn.append("searches.png")
        if result["scores"]:
            draw_errors(pyplot, result, target)
            drawn.append("errors.png")
    except DAMAGE as error:
        raise InputError(f"{path}: not the result of 'probelab tune --report', a part is missing "
                         f"or damaged ({type(error).__name__}: {error}); run it again") from error
    return drawn


def main():
    parser = argparse.ArgumentParser(description=first_paragraph(__doc__))
    parser.add_argument("folder", type=pathlib.Path, help="as given to probelab tune --report")
    parser.add_argument("-o", "--output", type=pathlib.Path,
                        help="folder for the pictures (default: the same)")
    options = parser.parse_args()
    target = options.output or options.folder
    try:
        if options.output and not target.is_dir():
            raise InputError(f"-o {target}: no such folder; make it first")
        drawn = draw(options.folder, target)
    except ImportError as error:
        text = no_matplotlib(error)
    except InputError as error:
        text = error
    except OSError as error:
        text = of_system(error)
    else:
        for name in drawn:
            print(target / name)
        return 0
    print(f"tuning_figure.py: {text}", file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main())
