#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws what `probelab tune --report DIR` wrote, as PDF and PNG: bias_map (cost, nrmse and light
leak over both biases, with the presets and the optimum), searches (cost against evaluations, with
--compare-searches) and errors (held-out errors of all settings). Needs matplotlib.
"""
import argparse
import csv
import pathlib
import sys

from figures_panels import (COLUMN, MARKERS, PAGE, Sheet, color_bar, colour, load_pyplot,
                            name_places, pretty, ratio_axis, room_for_places, save)
from figures_tables import LEAST_LEAK
from whole_output import (InputError, first_paragraph, no_matplotlib, of_system, read_object,
                          whole_folder)

MAPS = {"cost": "cost", "nrmse": "nrmse", "light_leak": "light leak"}
SEARCHES = {"levenberg_marquardt": "Levenberg-Marquardt from the preset",
            "multi_start": "Levenberg-Marquardt, multi-start",
            "nelder_mead": "Nelder-Mead from the preset", "random": "random search"}
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


def mark_places(panel, places, labels):
    """Marks settings; those at one place share a mark. Returns the marks for a legend."""
    at = {}
    for place in places:
        at.setdefault((place["normal_bias"], place["view_bias"]), []).append(labels[place["name"]])
    handles = []
    for i, ((x, y), names) in enumerate(at.items()):
        tuned = "tuned" in names
        handles += panel.plot(x, y, marker="*" if tuned else MARKERS[i % (len(MARKERS) - 1)],
                              markersize=9 if tuned else 5, color="red" if tuned else "white",
                              markeredgecolor="black", markeredgewidth=0.7, linestyle="",
                              clip_on=False, zorder=3, label=", ".join(dict.fromkeys(names)))
    return handles


def labels_of(result, names):
    """{setting: its label}: a preset's name; a file's without its folders where no other has it."""
    start = result["from"].split(" ")[0]
    short = {name: pathlib.PurePath(start if name == "from" else name).name for name in names}
    return {name: short[name] if [*short.values()].count(short[name]) == 1
            else start if name == "from" else name for name in names}


def draw_map(pyplot, result, folder):
    from matplotlib.colors import LogNorm, Normalize
    normal, view, grids = read_map(folder / "bias_map.csv", result["bias_map"]["size"])
    places = result["bias_map"]["places"]
    labels = labels_of(result, [place["name"] for place in places])
    sheet = Sheet(pyplot, 1, len(MAPS), 2.2, list(labels.values()), width=PAGE, sharey=True)
    for panel, (column, title) in zip(sheet.panels[0], MAPS.items()):
        values = [v for row in grids[column] for v in row]
        logarithmic = min(values) > 0 and max(values) > 3 * min(values)
        norm = (LogNorm if logarithmic else Normalize)(min(values), max(values))
        image = panel.pcolormesh(normal, view, grids[column], norm=norm, cmap="cividis",
                                 shading="nearest", rasterized=True)
        color_bar(sheet.figure, image, panel)
        handles = mark_places(panel, places, labels)
        panel.set_title(f"{title}, train receivers")
        panel.set_xlabel("normal bias, x probe spacing")
        panel.set_xlim(min(normal), max(normal))
        panel.set_ylim(min(view), max(view))
        panel.grid(False)
    sheet.panels[0][0].set_ylabel("view bias, x probe spacing")
    names = [pretty(s["scene"].removesuffix("/scene")) for s in result["scenes"]]
    sheet.figure.suptitle(", ".join(names), fontsize=8)
    sheet.legend(handles, [h.get_label() for h in handles])
    return sheet.figure


def draw_searches(pyplot, result):
    searches = result["searches"]
    floor = min(steps[-1][1] for steps in searches.values())
    sheet = Sheet(pyplot, 1, 1, 2.4, [*SEARCHES.values()])
    panel = sheet.panels[0][0]
    lines = []
    for i, name in enumerate(SEARCHES):
        x, y = zip(*searches[name])
        lines += panel.step(x, [c / floor - 1 + 1e-4 for c in y], where="post", color=colour(i),
                            linewidth=1.8 if name == "levenberg_marquardt" else 1.1)
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.set_xlabel("evaluations (with derivatives: 1 + parameters)")
    panel.set_ylabel("cost over the least, minus 1\n(+ 0.0001)")
    sheet.legend(lines, [*SEARCHES.values()])
    return sheet.figure


def values_at(scores, error):
    """By setting and score, and the noise floors; what is not known is 0."""
    of = [[s["settings"][i]["heldout"][error] or 0 for s in scores]
          for i in range(len(scores[0]["settings"]))]
    floors = [s["settings"][0]["heldout"]["noise_floor"][error] or 0 for s in scores]
    return of, floors


def draw_errors(pyplot, result):
    scores = result["scores"]
    names = [s["setting"] for s in scores[0]["settings"]]
    titles = labels_of(result, names)
    shown = [titles[name] + " (from)" * (name == "from") for name in names] + ["noise floor"]
    places = [f"{pretty(s['scene'].split('/')[0])}\n{s['state']}"
              + ("" if s["lights"] == "train" else " *") for s in scores]
    width = PAGE if len(scores) > 3 else COLUMN
    sheet = Sheet(pyplot, len(ERRORS), 1, 1.35, shown, width=width, sharex=True,
                  more=room_for_places(places, width))
    in_order = SETTINGS + [name for name in names if name not in SETTINGS]
    step = 0.84 / len(names)
    for (panel,), (error, title) in zip(sheet.panels, ERRORS.items()):
        of, floors = values_at(scores, error)
        ratio_axis(panel.yaxis, [v for values in of for v in values] + [f for f in floors if f],
                   smallest=LEAST_LEAK if error.endswith("leak") else 0.0)
        bottom, handles = panel.get_ylim()[0], []
        for i, (name, values) in enumerate(zip(names, of)):
            at = [j + (i - (len(names) - 1) / 2) * step for j in range(len(scores))]
            handles.append(panel.bar(at, [v - bottom for v in values], 0.9 * step, bottom=bottom,
                                     color=colour(in_order.index(name))))
        for j, floor in enumerate(floors):
            if floor:
                panel.hlines(floor, j - 0.46, j + 0.46, color="black", linewidth=0.9,
                             linestyle=":")
        panel.set_ylim(bottom, None)
        panel.set_ylabel(title)
        panel.grid(False, axis="x")
        panel.tick_params(axis="x", length=0)
    name_places(panel, places, width)
    sheet.panels[0][0].set_title("held-out receivers; * a light that was not tuned on")
    sheet.legend(handles + [pyplot.Line2D([], [], color="black", linewidth=0.9, linestyle=":")],
                 shown)
    return sheet.figure


def draw(folder, target):
    """The names of the files; raises InputError."""
    pyplot = load_pyplot()
    path = folder / "tune.json"
    result, figures = read_object(path), {}
    try:
        if result.get("bias_map"):
            figures["bias_map"] = draw_map(pyplot, result, folder)
        if result.get("searches"):
            figures["searches"] = draw_searches(pyplot, result)
        if result["scores"]:
            figures["errors"] = draw_errors(pyplot, result)
    except DAMAGE as error:
        raise InputError(f"{path}: not the result of 'probelab tune --report', a part is missing "
                         f"or damaged ({type(error).__name__}: {error}); run it again") from error
    with whole_folder(target) as part:
        drawn = [name for stem, figure in figures.items() for name in save(figure, part, stem)]
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
