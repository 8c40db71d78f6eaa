# SPDX-License-Identifier: GPL-3.0-or-later
"""The captions of figures: what is drawn, and from which runs. Standard library only."""
import tomllib

from figures_cells import completeness, count, ordered, scenes_and_states
from figures_tables import LEAST_LEAK, SHUT
from overview import ROOT

WARM_UP = tomllib.loads((ROOT / "core/ddgi/presets/probelab.toml").read_text())["warm_up"]

INTERVALS = ("Points are means over seeds, after the lighting states of a scene are combined "
             "within each seed (root of the mean square for nrmse, else the mean); intervals are "
             "the least and the most of the seeds")
NO_INTERVALS = "One seed: no intervals"
FLOOR = "dotted: the noise floor, the reference's own noise"

SAYS = {
    "error_vs_n": "Error (nrmse) against the number of probes stored, by layout; the number beside "
                  "a curve is its slope in log-log scale (least squares); " + FLOOR,
    "error_vs_n_leaks": "Light and shadow leak against the number of probes stored, of the same "
                        "runs; " + FLOOR,
    "thin_wall": "Light leak into a dark room through the wall beside a lit one. Above: by wall "
                 "thickness and probes asked for, with the spacing along the wall (root mean "
                 "square of its two directions, at the thinnest wall); 0: no leak; blank: not run; "
                 "dots: no cell of the lattice has probes in both rooms. Below: the same against "
                 "t / (d sin theta), intervals over seeds. t is the thickness; d and theta are the "
                 "length and the angle with the wall's normal of the ray from a probe at a corner "
                 "of a lattice cell that the wall cuts to the middle of that cell, so that "
                 "d sin theta is half the diagonal of the cell's face along the wall, whatever the "
                 "spacing across it. "
                 "Dashed: from where on the angular blur of the preset's moments alone lets no "
                 "light through, by its distance exponent and Chebyshev power (the bound to that "
                 f"power below {SHUT}), before texels, noise and biases; a preset without the "
                 "visibility test has none. "
                 "Open marks: no cell has probes in both rooms (an odd count across, with a layer "
                 "inside the wall that is not stored, or spacing below the thickness)",
    "visibility_terms": "Error, light leak and shadow leak by the terms of the visibility test "
                        "(exact: by rays, of path-traced light); axes are logarithmic, so that the "
                        "length of a bar has no meaning, its end has; " + FLOOR,
    "rays_hysteresis": "Error after the last update, flicker (sigma / mu over the last 32 "
                       "updates), and updates until the mean over the receivers first reaches 95 "
                       "and 99 % of the last one (left out where that is in the last quarter of "
                       "the run, which then has not settled), by rays a probe and update and by "
                       "hysteresis; warm-up: the first updates without history, then a running "
                       "mean until that has the hysteresis' (all other curves without; preset "
                       f"probelab with {WARM_UP}); "
                       + FLOOR,
    "texels": "Error and light leak by the texels along an edge of the irradiance and moment maps, "
              "at one number of probes and at one number of bytes of texels, where finer maps "
              "leave fewer probes, in another lattice each, which alone moves the error (see "
              "grid_robustness); points of one moment map stand side by side; " + FLOOR,
    "interpolants": "Error, light leak and the time of a query by interpolant and layout; " + FLOOR,
    "formats": "Bias (mean error over mean irradiance) in temporal mode by the format of the "
               "irradiance, the encoding's gamma, hysteresis and rounding. Dashed: rgba32f of the "
               "same gamma and hysteresis, that is, what has not arrived after the updates "
               "whatever the storage; what a point lies below it is lost to storage",
    "speed_error": "Error after the last update of a field that was black before the first, against "
                   "the time of a frame of 1080p (one update and one query a pixel) and against "
                   "the rays of an update, which no machine changes; a mark's area "
                   "grows with the logarithm of the field's bytes, its shape tells the texels "
                   "along an edge of the irradiance and of the moment map. Step line: Pareto "
                   "front of all; " + FLOOR + "; dash-dotted: path tracing of every pixel in "
                   "the time of the frame, from the noise and the time of the reference itself "
                   "(the noise falls with the root of the time; band: the least and the most of "
                   "the seeds). The table "
                   "time_to_error says which setting is first within an error, by the time of its "
                   "updates from black (errors are known after 1, 2, 3, 4, 6, 8, 12, ... updates). "
                   "warm-up: the first updates without history, then a running mean; preset "
                   f"probelab has one of {WARM_UP}, the published presets have none of their own",
    "grid_robustness": "Error and leaks of lattices with the same number of probes in free space, "
                       "moved along every axis by a share of their spacing, under the same rooms "
                       "turned about the vertical axis; the table spread says how far the values "
                       "lie apart; " + FLOOR,
    "bias_map": "Error (nrmse) and light leak on train receivers over normal and view bias, the "
                "field of the tuned biases held still; means over seeds. White marks: presets; "
                "stars: the optimum of each seed, for a cost of error and leak together",
    "layout_tuning": "Error and light leak on held-out receivers by layout, with the parameters of "
                     "a preset and with parameters tuned for that layout, under the lights that "
                     "were tuned on and under others. The table parameters has the tuned values",
    "budget": "Error budget: nrmse, its share and light leak of fields in which one stage after "
              "another is as finite as in the program, all later ones exact; share is the rise of "
              "the mean squared error over the rung before, by that of the last (negative where an "
              "error makes up for an older one). Axes of nrmse and light leak are logarithmic, so "
              "that the length of a bar has no meaning there, its end has; " + FLOOR,
}
LEAKS = (f"Leaks below {LEAST_LEAK:.0e} of the mean irradiance are drawn as 0; the CSV has their "
         "values").replace("e-0", "e-")
ALL_SCENES = ("'All scenes' is the geometric mean over scenes; its intervals are 95 % bootstrap "
              "intervals (2,000 replicates that draw seeds within scenes)")


def several(values, most=12):
    values = [str(v) for v in values if v != ""]
    if len(values) > most:
        return ", ".join(values[:most]) + f" and {len(values) - most} more"
    return ", ".join(values)


def numbers(study, of):
    """Those that are there and not zero, each once, by size."""
    return ordered(n for n in map(of, study.cells) if n)


def probes_text(study):
    asked = numbers(study, lambda c: c.of_scene("layout.asked"))
    stored = numbers(study, lambda c: c.of_scene("probes.stored"))
    if not stored:
        return ""
    text = f"N: {several(f'{a:,.0f}' for a in asked)} probes asked for, "
    low, high = stored[0], stored[-1]
    return text + (f"{low:,.0f} stored" if low == high else f"{low:,.0f} to {high:,.0f} stored")


def run_facts(study):
    """What the runs had in common, and what not."""
    facts = [probes_text(study), f"seeds: {several(study.distinct(lambda c: c.seed))}"]
    rays = numbers(study, lambda c: c.value("params.rays"))
    if rays:
        facts.append(f"rays a probe and update: {several(f'{r:.0f}' for r in rays)}")
    modes = study.distinct(lambda c: c.text("mode"))
    if any(modes):
        updates = [u for u in study.distinct(lambda c: c.settings.get("updates", "")) if u]
        facts.append(f"mode: {several(modes)}"
                     + (f", {several(updates)} updates" if updates else ""))
    receivers = numbers(study, lambda c: c.receivers())
    if receivers:
        splits = several(study.distinct(lambda c: c.text("receivers.split")))
        facts.append(f"receivers a scene: {several(f'{r:,.0f}' for r in receivers)}"
                     + (f", scored: {splits}" if splits else ""))
    facts += [f"scenes (states): {scenes_and_states(study.cells)}",
              f"device: {several(study.distinct(lambda c: c.text('device')))}, tracer "
              + several(study.distinct(lambda c: c.text("tracer"))),
              f"version: {several(study.distinct(lambda c: c.text('version')))}"]
    return [f for f in facts if f]


def rungs_text(study):
    """What the cells say of each rung."""
    about = {r["name"]: r.get("about", "") for c in study.cells for r in c.found("rungs") or []}
    return "; ".join(f"{name}: {text}" if text else name for name, text in about.items())


def caption(kind, suffix, study, tables, damaged):
    """One paragraph of plain text."""
    rows = [r for table in tables.values() for r in table]
    says = SAYS[f"{kind}_{suffix}" if suffix else kind]
    parts = [says, f"The rungs: {rungs_text(study)}"] if kind == "budget" else [says]
    parts.append(INTERVALS if any((r.get("seeds") or 0) > 1 for r in rows) else NO_INTERVALS)
    if any(r.get("scene") == "all scenes" for r in rows):
        parts.append(ALL_SCENES)
    if "leak" in says and any(r.get("metric") in ("light leak", "shadow leak") for r in rows):
        parts.append(LEAKS)
    parts.append(f"From {completeness(study)}; " + "; ".join(run_facts(study)))
    parts += study.left_out
    if damaged:
        parts.append(f"{count(damaged, 'damaged cell')} left out")
    return ". ".join(parts) + ".\n"
