#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where precision goes: errors over distance, scale, contrast, wall and albedo, a curve a tracer,
format and formula, and where each breaks. Runs `probelab stability --curves` and publishes it.
The figure needs matplotlib, the rest the standard library.

  scripts/precision.py                      results/published/precision
  scripts/precision.py --rows rows.json     from what `probelab stability --curves --json` printed

Writes rows.csv (a point a line), breaks.csv (a curve a line), manifest.json, precision.png, .pdf
and .txt, the caption.
"""
import argparse
import csv
import json
import pathlib
import sys

from whole_output import naming, printed, run_main, whole_folder

sys.dont_write_bytecode = True
ROOT = pathlib.Path(__file__).resolve().parents[1]
COMMAND = ["probelab", "stability", "--curves", "--json"]
PANELS = {"distance": "far from the origin", "scale": "large and small",
          "contrast": "contrast that a format holds", "dark_room": "contrast that weights hold",
          "wall": "thin walls", "albedo": "bright walls"}
LEAST = 1e-8  # errors below count as none: half an ulp of fp32 is 6e-8


def number(value):
    return "" if value is None else f"{value:.6g}"


def point_rows(curves):
    return [{"curve": c["id"], "tracer": c["tracer"], "x": number(p["x"]),
             "error": "nan" if p["error"] is None else number(p["error"])}
            for c in curves for p in c["points"]]


def break_rows(curves):
    return [{"curve": c["id"], "what": c["curve"], "tracer": c["tracer"], "axis": c["axis"],
             "measure": c["measure"], "bound": number(c["bound"]),
             "easy": number(c["easy"]), "from": number(c["points"][0]["x"]),
             "to": number(c["points"][-1]["x"]),
             "breaks_below": number(c["breaks_below"]), "breaks_above": number(c["breaks_above"])}
            for c in curves]


def write_csv(path, rows):
    with open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def manifest(result):
    provenance = result["provenance"]
    return {"study": "precision", "command": " ".join(COMMAND), "curves": len(result["curves"]),
            "points": sum(len(c["points"]) for c in result["curves"]),
            **{k: provenance[k] for k in ("device", "driver", "tracer", "version", "compiler",
                                          "build_type", "seed") if k in provenance},
            "seconds": round(result["seconds"], 1)}


def caption(result):
    broken = sum(c["breaks_below"] is not None or c["breaks_above"] is not None
                 for c in result["curves"])
    return ("Where precision goes. Each curve is the error of one tracer, format or formula; the "
            "dashed line is the bound above which it counts as broken, crosses mark where that is "
            f"({broken} of {len(result['curves'])} curves). Errors below {LEAST:g} are drawn as 0. "
            "Distance, scale: a room of 4 m with a pillar that emits and a lamp, 16 probes, "
            "against itself at the origin and at scale 1; 'from a file': its node lies that far "
            "away, and the loader takes the distance into the scene's origin. Contrast: probes "
            "in closed boxes beside one of radiance 1; a point in a room beside one of radiance 1. "
            "Walls: light of a bright room behind a wall between probes 1 m apart; ray query and "
            "fp16 lie on their preset's curve. Albedo: a "
            "closed room from black, until 1 % of the bounces or 5,000 are left. "
            f"{result['device']}, version {result['version']}.\n")


def style(i):
    from figures_panels import MARKERS, colour
    return {"color": colour(i), "marker": MARKERS[i % len(MARKERS)],
            "linestyle": ("-", "--", ":")[i // 7 % 3] if i < 14 else "-."}


def draw_panel(panel, curves):
    """Returns handles for the legend."""
    from figures_panels import ratio_axis
    from matplotlib.ticker import NullLocator
    handles = []
    shown = [p["error"] for c in curves for p in c["points"] if p["error"] is not None]
    for i, curve in enumerate(curves):
        points = [p for p in curve["points"] if p["error"] is not None]
        look = style(i)
        handles += panel.plot([p["x"] for p in points],
                              [p["error"] if p["error"] > LEAST else 0 for p in points],
                              markersize=2.6, linewidth=0.9, **look)
        for at in (curve["breaks_below"], curve["breaks_above"]):
            if at is not None:
                panel.plot([at], [curve["bound"]], marker="x", markersize=6, markeredgewidth=1.3,
                           color=look["color"], zorder=5)
    panel.axhline(curves[0]["bound"], color="black", linewidth=0.8, linestyle="--")
    ratio_axis(panel.xaxis, [p["x"] for c in curves for p in c["points"]])
    ratio_axis(panel.yaxis, [e if e > LEAST else 0 for e in shown] + [curves[0]["bound"]],
               margin=1.6)
    for axis in (panel.xaxis, panel.yaxis):  # nine marks a decade are a grey bar over eight
        axis.set_minor_locator(NullLocator())
    return handles


def draw(result, folder):
    from figures_panels import PAGE, load_pyplot, save
    pyplot = load_pyplot()
    panels = {name: [c for c in result["curves"] if c["id"].startswith(name + ".")]
              for name in PANELS}
    panels = {name: curves for name, curves in panels.items() if curves}
    figure, axes = pyplot.subplots((len(panels) + 1) // 2, 2, squeeze=False,
                                   figsize=(PAGE, 2.1 * ((len(panels) + 1) // 2)))
    flat = [a for line in axes for a in line]
    for panel in flat[len(panels):]:
        panel.remove()
    for panel, (name, curves) in zip(flat, panels.items()):
        handles = draw_panel(panel, curves)
        panel.set_title(PANELS[name])
        panel.set_xlabel(curves[0]["axis"])
        panel.set_ylabel("error" if name != "wall" else "light that leaks")
        if name in ("wall", "albedo", "dark_room"):
            panel.invert_xaxis()  # so that it gets harder to the right
        panel.legend(handles, [c["curve"] for c in curves], loc="upper left", fontsize=6,
                     bbox_to_anchor=(1.0, 1.03), borderaxespad=0.2, handlelength=1.6)
    save(figure, folder, "precision")


def publish(result, folder):
    write_csv(folder / "rows.csv", point_rows(result["curves"]))
    write_csv(folder / "breaks.csv", break_rows(result["curves"]))
    (folder / "manifest.json").write_text(json.dumps(manifest(result), indent=1) + "\n")
    (folder / "precision.txt").write_text(caption(result))


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default=ROOT / "build/release/probelab", type=pathlib.Path,
                        help="the program (default: build/release/probelab)")
    parser.add_argument("--rows", type=pathlib.Path, help="what the command printed, not run again")
    parser.add_argument("--no-figure", action="store_true", help="without matplotlib")
    parser.add_argument("-o", "--output", default=ROOT / "results/published/precision",
                        type=pathlib.Path, help="folder (default: results/published/precision)")
    options = parser.parse_args()
    if not options.no_figure:
        import matplotlib  # noqa: F401: before the minutes that the curves take
    result = printed(options.program, COMMAND[1:], {"curves": list}, options.rows)
    with whole_folder(options.output) as folder:
        publish(result, folder)
        if not options.no_figure:
            draw(result, folder)
    with naming("stdout"):
        print(options.output)


if __name__ == "__main__":
    run_main(main)
