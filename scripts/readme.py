#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""The numbers of README.md, from the rows in results/published. Standard library only.

  scripts/readme.py --check     exit code 1, and what differs, if README.md says something else
  scripts/readme.py --write     put the numbers of today's rows in

Two marks, which a reader does not see:
  <!-- block: NAME --> ... <!-- end -->     all between them; BLOCKS makes it
  0.0398<!-- = SOURCE -->                   a number; SOURCE is a name in VALUES, or a JSON file in
                                            results/published, '#' and a dotted name

Any other comment is refused, because it may be one of these, misspelt; so is a README without one
of the blocks.
"""
import argparse
import json
import lzma
import pathlib
import re
import statistics
import sys
import tomllib

from overview import COLUMNS, ROOT, describe, markdown_table, scene_name, table_row
from pipeline_report import aligned, number, presets_tables
from placement_report import Tables
from placement_rows import load_rows
from published_rows import numbers, read_rows
from whole_output import of_system

BLOCK = re.compile(r"(<!-- block: ([a-z_]+) -->\n)(.*?)(<!-- end -->)", re.S)
VALUE = re.compile(r"([-+\d.,eE]+)(<!-- = (\S+) -->)")
COMMENT = re.compile(r"<!--.*?(-->|$)", re.S)
# What making numbers of damaged results raises.
DAMAGE = (ArithmeticError, AttributeError, LookupError, TypeError, ValueError, lzma.LZMAError)


class Missing(Exception):
    """What the published results lack."""


def read_json(path):
    try:
        return json.loads(path.read_text())
    except OSError as error:
        raise Missing(of_system(error)) from error
    except ValueError as error:
        raise Missing(f"{path}: {error}") from error


# Blocks: (folder of results/published) -> Markdown.

def overview(published):
    study = tomllib.loads((ROOT / "experiments/studies/overview.toml").read_text())
    rows = []
    for scene in map(scene_name, study["scenes"]):
        for preset in study["presets"]:
            row = read_json(published / "overview" / f"{scene}_{preset}.json")
            rows.append({**row, "name": scene, "preset": preset})
    return markdown_table([COLUMNS] + [table_row(r) for r in rows]) + "\n" \
        + describe(study, rows[0]) + "\n"


def pipeline_presets(published):
    study = tomllib.loads((ROOT / "experiments/studies/pipeline.toml").read_text())
    scenes = [scene_name(s) for table in study["ablation"] if table["name"] == "presets"
              for s in table["scenes"]]
    results = [read_json(published / "pipeline" / f"presets_{s}.json") for s in scenes]
    return presets_tables(scenes, results)[0][0] + "\n"


LAYOUTS = {"optimized": "`optimized`", "optimized_static": "`optimized`, `lights=own`"}


def summary(path):
    """The first table of a report: {(name, N, lights): cells}."""
    lines = [[c.strip() for c in line.strip("|").split("|")]
             for line in path.read_text().splitlines()]
    return {(c[0], int(c[2]), c[1]): c for c in lines if len(c) == 10 and c[2].isdigit()}


def placement(published):
    """The summary of placement.md, a row a layout and budget."""
    found = summary(published / "placement" / "placement.md")
    rows = [["layout", "N", "scenes", "lights it was trained under", "a light it never saw",
             "drawn lights it never saw"]]
    for name, title in LAYOUTS.items():
        for probes in sorted({key[1] for key in found}):
            by_lights = [found.get((name, probes, f"{lights} lights"))
                         for lights in ("same", "held-out", "drawn")]
            if by_lights[0]:
                rows.append([title, str(probes), by_lights[0][3],
                             *(f"{c[4]} {c[5]}" if c else "-" for c in by_lights)])
    seeds, own = {}, seeds_by_layout(published / "placement").get("optimized_static", set())
    for r in load_rows(published / "placement"):
        if r["layout"] in LAYOUTS:
            seeds.setdefault(r["probes"], set()).add(r["seed"])
    about = "; ".join(f"seeds {', '.join(map(str, sorted(seeds[n])))} of N = {n}" if len(seeds[n]) > 1
                      else f"one seed of N = {n}"
                      for n in sorted(seeds) if any(row[1] == str(n) for row in rows))
    if own and own != set().union(*seeds.values()):
        about += f"; `lights=own`: {seeds_text(own).lower()}"
    about += ". Intervals are over blocks of space or drawn lights"
    several = [len(of) > 1 for of in seeds.values()]
    about += (" and seeds" if all(several) else ", and over seeds where there are several"
              if any(several) else " alone")
    return aligned(rows) + "\n\n" + about[:1].upper() + about[1:] + ".\n"


SETTINGS = {"from": "`probelab`", "tuned": "tuned on the scene",
            "left_out": "tuned on the other scenes", "shared": "tuned on all scenes"}
WITH_PARALLAX = {"tuned": "tuned on the scene, with `parallax`"}  # of a study of its own


def seeds_text(seeds):
    return (f"Seeds {', '.join(map(str, sorted(seeds)))}" if len(seeds) > 1
            else "One seed, whose intervals are over blocks of space alone")


def tuning_rows(found, settings):
    """The summary of a tuning.md, a row a setting."""
    rows = []
    budgets = sorted({probes for _, probes, _ in found})
    for name, title, probes in ((*s, n) for s in settings.items() for n in budgets):
        same, other = (found.get((name, probes, f"{l} lights")) for l in ("same", "held-out"))
        if same and other:
            rows.append([title, same[2], same[3], *(f"{c[4]} {c[5]}" for c in (same, other)),
                         *other[6:8]])
    return rows


def seeds_by_layout(folder):
    seeds = {}
    for row in load_rows(folder):
        seeds.setdefault(row["layout"], set()).add(row["seed"])
    return seeds


def tuning(published):
    """The summaries of both studies of tuning."""
    rows = [["parameters", "N", "scenes", "lights tuned on", "other lights", "light leak", "smape"]]
    rows += tuning_rows(summary(published / "tuning" / "tuning.md"), SETTINGS)
    seeds = seeds_by_layout(published / "tuning")
    about = seeds_text(seeds["tuned"])
    if "left_out" in seeds and seeds["left_out"] != seeds["tuned"]:
        about += "; on the other and on all scenes: " + seeds_text(seeds["left_out"]).lower()
    aside = published / "tuning_parallax"
    if aside.is_dir():
        rows += tuning_rows(summary(aside / "tuning.md"), WITH_PARALLAX)
        of_aside = seeds_by_layout(aside)["tuned"]
        if of_aside != seeds["tuned"]:
            about += "; with parallax: " + seeds_text(of_aside).lower()
    return f"{aligned(rows)}\n\n{about}.\n"


BUDGET_SCENES = ("two_rooms_door", "thin_wall/scene_05cm")


def budget(published):
    """Rungs of two scenes: means over seeds and states."""
    rows = read_rows(published / "budget" / "rows.csv")
    scenes = [s for s in BUDGET_SCENES if any(r["scene"] == s for r in rows)]
    table = [["rung", *(t for s in scenes for t in (f"{s.replace('/scene_', ' ')}: nrmse",
                                                     "share"))]]
    rungs = {r["rung"]: (r["name"], r["about"]) for r in rows}
    for rung, (name, about) in sorted(rungs.items()):
        cells = [f"`{name}`: {about}" if about else f"`{name}`"]
        for scene in scenes:
            of = [r for r in rows if r["scene"] == scene and r["rung"] == rung]
            cells.append(number(statistics.fmean(numbers(of, "error.nrmse"))))
            cells.append(f"{100 * statistics.fmean(numbers(of, 'error.share')):.1f} %")
        table.append(cells)
    about = read_json(published / "budget" / "manifest.json")
    return aligned(table) + "\n\n" + facts(about) + "\n"


def facts(manifest):
    """Seeds, receivers, device and version of a study, in one line."""
    plural = "s" * (len(manifest["seeds"]) > 1)
    return (f"Seed{plural} {', '.join(map(str, manifest['seeds']))}; "
            f"{', '.join(f'{r:,}' for r in manifest['receivers'])} receivers a scene, held-out "
            f"half scored; {', '.join(manifest['device'])}, tracer "
            f"{', '.join(manifest['tracer'])}, version {', '.join(manifest['version'])}.")


FIGURES = {
    "error_vs_n": "Error against the number of probes, by layout, under lights that no layout was "
                  "trained on; dotted: the noise of the truth",
    "speed_error": "Error of a field that has just come up from black against the time of a 1080p "
                   "frame and against rays an update; areas grow with the logarithm of bytes, "
                   "shapes tell texels, the step line is the Pareto front, dash-dotted: path "
                   "tracing in the time of the frame",
    "budget": "Where the error comes from: one stage after another as finite as in the program",
}


def figures(published):
    """The figures that matter most, as far as they have been made."""
    parts = []
    for name, says in FIGURES.items():
        if not (published / name / f"{name}.png").exists():
            continue
        stored = numbers(read_rows(published / name / "rows.csv"), "probes.stored")
        about = read_json(published / name / "manifest.json")
        parts.append(f"![{says}](results/published/{name}/{name}.png)\n\n*{says}. "
                     f"N: {min(stored):,.0f} to {max(stored):,.0f} probes stored. {facts(about)} "
                     f"[Whole caption](results/published/{name}/{name}.txt), "
                     f"[rows](results/published/{name}/rows.csv).*\n")
    return "\n".join(parts) or "None has been made yet: `scripts/publish`.\n"


def stability(published):
    """The hard-case suite: how many rows of each group hold, and where the limits are."""
    rows = read_json(published / "stability" / "rows.json")["cases"]
    about = read_json(published / "stability" / "manifest.json")
    table = [["group", "rows", "hold", "limits", "fail"]]
    groups = list(dict.fromkeys(r["group"] for r in rows))
    for group in [*groups, "all"]:
        verdicts = [r["verdict"] for r in rows if group in (r["group"], "all")]
        table.append([group, str(len(verdicts)),
                      *(str(verdicts.count(v)) for v in ("holds", "limit", "fails"))])
    limits = [["limit", "what", "measured"]]
    limits += [[f"`{r['id']}`", r["case"], r["measured"]] for r in rows if r["verdict"] == "limit"]
    return (aligned(table) + "\n\n" + aligned(limits, 3) + "\n\n" +
            f"{about['device']}, both tracers, version {about['version']}.\n")


def rounded(value):
    """Two digits: 0.054, 2,600, 1.2e-06."""
    value = float(f"{value:.2g}")
    return f"{value:,.0f}" if 100 <= value < 1e6 else f"{value:g}"


def precision(published):
    """Where each curve of precision leaves its bound, a line a quantity."""
    rows = read_rows(published / "precision" / "breaks.csv")
    about = read_json(published / "precision" / "manifest.json")
    table = [["quantity", "bound", "holds up to"]]
    panels = {}
    for row in rows:
        panels.setdefault(row["curve"].partition(".")[0], []).append(row)
    for of in panels.values():
        at = {}
        for row in of:
            ends = [row[k] for k in ("breaks_below", "breaks_above") if row[k]]
            says = "nowhere" if row["easy"] in ends and len(set(ends)) == 1 \
                else " and ".join(rounded(float(end)) for end in ends)
            at.setdefault(says, []).append(f"*{row['what']}*")
        says = [f"{', '.join(names)} {end}" for end, names in at.items() if end]
        says += [f"{', '.join(at[''])} to the end"] if "" in at else []
        low, high = (rounded(float(of[0][k])) for k in ("from", "to"))
        table.append([f"{of[0]['axis']}, {low} to {high}", f"{float(of[0]['bound']):g}",
                      "; ".join(says)])
    figure = "results/published/precision"
    return (f"![Where precision goes: errors and the points where they leave their bounds]({figure}"
            f"/precision.png)\n\n*[Whole caption]({figure}/precision.txt), "
            f"[rows]({figure}/rows.csv).*\n\n" + aligned(table, 3) + "\n\n" +
            f"{about['device']}, version {about['version']}.\n")


def long_runs(published):
    """Many updates on three scenes."""
    about = read_json(published / "long_runs" / "manifest.json")
    table = [["scene", "updates", "update ms", "memory MiB", "grown", "trend", "distance", "noise",
              "frozen"]]
    for scene, n in about["scenes"].items():
        table.append([scene, f"{n['updates']:,}", f"{n['update_ms']:.2f}",
                      f"{n['rss_mib']:.1f}", f"{n['grown_mib']:.2f}", f"{n['drift']:+.1f}",
                      f"{n['farthest']:.2g}", f"{n['noise']:.2g}", f"{n['frozen']:.2g}"])
    first = next(iter(about["scenes"].values()))
    return (aligned(table) + "\n\n" +
            f"At most 48 probes of {first['rays']} rays, hysteresis {about['hysteresis']}; "
            f"{about['device']}, tracer {about['tracer']}, version {about['version']}.\n")


def fuzz(published):
    """Executions a format, of all passes."""
    rows = read_rows(published / "fuzz" / "rows.csv")
    about = read_json(published / "fuzz" / "manifest.json")
    kinds = ("crashes", "leaks", "timeouts", "ooms")
    table = [["format", "executions", "since a finding", "a second", "edges", "findings",
              "inputs kept"]]
    for row in rows:
        table.append([row["format"], *(f"{int(row[k]):,}" for k in ("executions", "clean",
                                                                    "exec_per_s", "edges")),
                      str(sum(int(row[k]) for k in kinds)), row["regressions"]])
    return aligned(table) + f"\n\n{about['compiler']}; {about['sanitizers']}.\n"


BLOCKS = {"stability": stability, "precision": precision, "long_runs": long_runs, "fuzz": fuzz,
          "overview": overview, "pipeline_presets": pipeline_presets, "placement": placement,
          "tuning": tuning, "budget": budget, "figures": figures}


# Single numbers.

def worst_leak(layout):
    """Through the wall of 5 cm, of the seeds that both layouts below have."""
    def value(published):
        leaks = {}
        for row in load_rows(published / "placement"):
            if row["scene"] == "thin_wall_05cm" and row["probes"] == 128:
                leaks.setdefault(row["layout"], {}).setdefault(row["seed"], []).append(
                    row["light_leak"])
        both = set(leaks["optimized"]) & set(leaks["grid_best"])
        most = max(v for seed in both for v in leaks[layout][seed])
        return f"{most:.0e}".replace("e-0", "e-") if most > 0 else "0"
    return value


def drawn_ratio(which):
    """The least or most of the scenes' ratios of `optimized` under drawn lights at N = 128."""
    def value(published):
        study = tomllib.loads((ROOT / "experiments/studies/placement.toml").read_text())
        tables = Tables(study, load_rows(published / "placement"))
        ratios = []
        for scene in set(tables.scenes) - set(tables.null):
            key = (scene, "optimized", 128, "drawn")
            seeds = tables.results.seeds(*key)
            _, error = tables.best_baseline(scene, 128, "drawn", seeds)
            if error:
                ratios.append(error / tables.results.nrmse(key, seeds))
        return f"{which(ratios):.2f}"
    return value


def typical_ratio(probes):
    """The scenes' geometric mean of ratios of `optimized` under one drawn light at a time."""
    def value(published):
        study = tomllib.loads((ROOT / "experiments/studies/placement.toml").read_text())
        table = Tables(study, load_rows(published / "placement")).light_by_light()
        middle, = (row[4] for row in table[1:]
                   if row[:3] == ["optimized", "geometric mean", str(probes)])
        return middle
    return value


def preset_bytes(row):
    def value(published):
        result = read_json(published / "pipeline" / "presets_cornell.json")
        of, = (r for r in result["ablation"] if r["row"] == row)
        return f"{of['memory']['atlas_per_probe']:,}"
    return value


VALUES = {"placement.drawn.least": drawn_ratio(min), "placement.drawn.most": drawn_ratio(max),
          "placement.typical.128": typical_ratio(128), "placement.typical.512": typical_ratio(512),
          "placement.leak.optimized": worst_leak("optimized"),
          "placement.leak.grid_best": worst_leak("grid_best"),
          "pipeline.bytes.probelab": preset_bytes("probelab"),
          "pipeline.bytes.rtxgi": preset_bytes("base")}


def value_of(source, published):
    if source in VALUES:
        return VALUES[source](published)
    file, _, name = source.partition("#")
    found = read_json(published / file)
    for part in name.split("."):
        if not isinstance(found, dict) or part not in found:
            raise Missing(f"'{source}': there is no '{part}'")
        found = found[part]
    return number(found)


def check_marks(text, readme):
    """Raises Missing where a comment is no mark, or a block is unknown or nowhere."""
    known = {place for match in BLOCK.finditer(text) for place in (match.start(1), match.start(4))}
    known |= {match.start(2) for match in VALUE.finditer(text)}
    for match in COMMENT.finditer(text):
        if match.start() not in known:
            line = text.count("\n", 0, match.start()) + 1
            raise Missing(f"{readme}:{line}: '{match[0].splitlines()[0]}' is no mark, or not where "
                          "one may stand; see scripts/readme.py --help")
    found = [match[2] for match in BLOCK.finditer(text)]
    for name in found:
        if name not in BLOCKS:
            raise Missing(f"{readme}: there is no block '{name}'; {', '.join(BLOCKS)}")
    for name in BLOCKS:
        if name not in found:
            raise Missing(f"{readme}: block '{name}' is missing; put in <!-- block: {name} --> "
                          "and <!-- end -->, each on a line of its own")


def made(name, make, published):
    """What a block or value is; Missing where results are damaged."""
    try:
        return make(published)
    except DAMAGE as error:
        raise Missing(f"'{name}' cannot be made, its results in {published} lack something: "
                      f"{type(error).__name__}: {error}") from error


def renewed(text, published, readme):
    """The README with the numbers of the published rows, and what was different."""
    check_marks(text, readme)
    differ = []

    def block(match):
        head, name, old, tail = match.groups()
        new = made(name, BLOCKS[name], published)
        if new != old:
            differ.append(f"block {name}: {first_difference(old, new)}")
        return head + new + tail

    def value(match):
        old, mark, source = match.groups()
        new = made(source, lambda of: value_of(source, of), published)
        if new != old:
            differ.append(f"{source}: README.md says {old}, the rows say {new}")
        return new + mark

    return VALUE.sub(value, BLOCK.sub(block, text)), differ


def first_difference(old, new):
    for a, b in zip(old.splitlines(), new.splitlines()):
        if a != b:
            return f"README.md says '{a.strip()}', the rows say '{b.strip()}'"
    return "another number of lines"


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--check", action="store_true", help="compare, write nothing")
    what.add_argument("--write", action="store_true", help="put the numbers in")
    parser.add_argument("--readme", type=pathlib.Path, default=ROOT / "README.md")
    parser.add_argument("--published", type=pathlib.Path, default=ROOT / "results/published")
    options = parser.parse_args()
    try:
        text = options.readme.read_text()
        new, differ = renewed(text, options.published, options.readme)
        if options.write and new != text:
            options.readme.write_text(new)
    except Missing as error:
        print(f"readme.py: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"readme.py: {of_system(error)}", file=sys.stderr)
        return 2
    except UnicodeDecodeError as error:
        print(f"readme.py: {options.readme}: no text: {error}", file=sys.stderr)
        return 2
    for line in differ:
        print(f"readme.py: {line}", file=sys.stderr)
    return 1 if differ and options.check else 0


if __name__ == "__main__":
    sys.exit(main())
