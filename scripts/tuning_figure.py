#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws what `probelab tune --report DIR` wrote: bias_map.png (cost, nrmse and light leak over both
biases, with the presets and the optimum), searches.png (cost against evaluations, with
--compare-searches) and errors.png (held-out errors of all settings). Needs matplotlib.
"""
import argparse
import csv
import json
import pathlib
import sys

MAPS = {"cost": "cost", "nrmse": "nrmse", "light_leak": "light leak"}
SEARCHES = {"levenberg_marquardt": "Levenberg-Marquardt from the preset",
            "multi_start": "Levenberg-Marquardt, multi-start",
            "nelder_mead": "Nelder-Mead from the preset", "random": "random search"}
MARKS = "osD^vPX"
COLOURS = {"from": "tab:blue", "tuned": "red"}
OTHERS = ["tab:green", "tab:purple", "tab:brown", "tab:olive", "tab:cyan", "tab:gray"]
ERRORS = {"nrmse": "nrmse", "light_leak": "light leak", "shadow_leak": "shadow leak"}


def read_map(path):
    """{column: [view][normal]} with the values of both axes."""
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    normal = sorted({float(r["normal_bias"]) for r in rows})
    view = sorted({float(r["view_bias"]) for r in rows})
    grids = {c: [[float(rows[v * len(normal) + n][c]) for n in range(len(normal))]
                 for v in range(len(view))] for c in MAPS}
    return normal, view, grids


def mark_places(panel, places, from_name):
    """Marks settings; those at one place share a mark. Returns the marks for a legend."""
    at = {}
    for place in places:
        name = from_name if place["name"] == "from" else place["name"]
        at.setdefault((place["normal_bias"], place["view_bias"]), []).append(name)
    handles = []
    for i, ((x, y), names) in enumerate(at.items()):
        tuned = "tuned" in names
        handles += panel.plot(x, y, marker="*" if tuned else MARKS[i % len(MARKS)],
                              markersize=15 if tuned else 8, color="red" if tuned else "white",
                              markeredgecolor="black", linestyle="", clip_on=False, zorder=3,
                              label=", ".join(dict.fromkeys(names)))
    return handles


def draw_map(pyplot, result, folder, target):
    from matplotlib.colors import LogNorm, Normalize
    normal, view, grids = read_map(folder / "bias_map.csv")
    figure, panels = pyplot.subplots(1, len(MAPS), figsize=(5 * len(MAPS), 4.4))
    for panel, (column, title) in zip(panels, MAPS.items()):
        values = [v for row in grids[column] for v in row]
        logarithmic = min(values) > 0 and max(values) > 3 * min(values)
        norm = (LogNorm if logarithmic else Normalize)(min(values), max(values))
        image = panel.pcolormesh(normal, view, grids[column], norm=norm, cmap="viridis",
                                 shading="nearest", rasterized=True)
        figure.colorbar(image, ax=panel)
        handles = mark_places(panel, result["bias_map"]["places"], result["from"].split(" ")[0])
        panel.set_title(f"{title}, train receivers", fontsize=10)
        panel.set_xlabel("normal bias, x probe spacing")
        panel.set_xlim(min(normal), max(normal))
        panel.set_ylim(min(view), max(view))
    panels[0].set_ylabel("view bias, x probe spacing")
    figure.suptitle(", ".join(s["scene"] for s in result["scenes"]), fontsize=11)
    figure.legend(handles=handles, loc="lower center", ncol=len(handles), fontsize=9)
    figure.tight_layout(rect=(0, 0.07, 1, 1))
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
    labels = [f"{s['scene'].split('/')[0]}\n{s['state']}" + ("" if s["lights"] == "train" else " *")
              for s in scores]
    figure, panels = pyplot.subplots(len(ERRORS), 1, sharex=True,
                                     figsize=(max(6.4, 1.3 * len(scores) + 2), 7.2))
    width = 0.84 / len(names)
    others = iter(OTHERS * len(names))
    colours = {name: COLOURS.get(name) or next(others) for name in names}
    for panel, (error, title) in zip(panels, ERRORS.items()):
        for i, name in enumerate(names):
            heights = [s["settings"][i]["heldout"][error] or 0 for s in scores]
            panel.bar([j + (i - (len(names) - 1) / 2) * width for j in range(len(scores))], heights,
                      width, color=colours[name], zorder=2,
                      label=result["from"].split(" ")[0] + " (from)" if name == "from" else name)
        for j, score in enumerate(scores):
            floor = score["settings"][0]["heldout"]["noise_floor"][error]
            if floor is not None:
                panel.hlines(floor, j - 0.46, j + 0.46, color="black", linewidth=1, zorder=3,
                             label="noise floor" if j == 0 else None)
        panel.set_ylabel(title)
        panel.grid(True, axis="y", linewidth=0.3)
    panels[-1].set_xticks(range(len(scores)), labels, fontsize=8)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="lower center", fontsize=8,
                  ncol=len(names) + 1)
    panels[0].set_title("held-out receivers; * a light that was not tuned on", fontsize=10)
    figure.tight_layout(rect=(0, 0.04, 1, 1))
    figure.savefig(target / "errors.png", dpi=110)
    pyplot.close(figure)


def draw(folder, target):
    """The names of the pictures."""
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot
    result = json.loads((folder / "tune.json").read_text())
    drawn = []
    if result.get("bias_map"):
        draw_map(pyplot, result, folder, target)
        drawn.append("bias_map.png")
    if result.get("searches"):
        draw_searches(pyplot, result, target)
        drawn.append("searches.png")
    if result["scores"]:
        draw_errors(pyplot, result, target)
        drawn.append("errors.png")
    return drawn


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=pathlib.Path, help="as given to probelab tune --report")
    parser.add_argument("-o", "--output", type=pathlib.Path,
                        help="folder for the pictures (default: the same)")
    options = parser.parse_args()
    target = options.output or options.folder
    try:
        drawn = draw(options.folder, target)
    except ImportError:
        parser.error("matplotlib is not installed (Debian: python3-matplotlib)")
    except (OSError, ValueError, KeyError) as error:
        parser.error(f"{options.folder}: not a report of probelab tune: {error}")
    for name in drawn:
        print(target / name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
