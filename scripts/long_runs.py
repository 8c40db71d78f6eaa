#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs fields for 100,000 updates with hysteresis on three of the shipped scenes and publishes what
was seen: memory, drift, distance from the converged field, stalls. Standard library only.

  scripts/long_runs.py                      results/published/long_runs, about 15 minutes
  scripts/long_runs.py --updates 4000 -o long          a short one

Each scene's result is kept in results/runs/long_runs, by the program and the options, so that a
run that was killed runs no scene again that it has finished. Writes rows.csv (a fiftieth of a run a
line), cases.csv (a judgement a line) and manifest.json. Exit code 3 when a case fails.
"""
import argparse
import csv
import hashlib
import json
import pathlib
import statistics
import subprocess
import sys

from whole_output import InputError, naming, object_of, run_main, whole_folder

ROOT = pathlib.Path(__file__).resolve().parents[1]
SCENES = ("cornell", "sun_room", "two_rooms_door")
# Few probes and rays, so that 100,000 updates take minutes.
OPTIONS = ["--params", "probelab", "--probes", "48", "--rays", "16", "--count", "128",
           "--rel-error", "0.1", "--tracer", "embree"]
BATCH = ("updates", "mean", "distance", "nrmse", "frozen", "update_ms", "slowest_ms", "rss_mib")
SETTINGS = ("probes", "rays", "updates")
JUDGEMENT = ("id", "verdict", "expectation", "measured")


def say(text):
    print(f"long_runs: {text}", file=sys.stderr, flush=True)


def is_whole(result):
    """Whether it has all that is published of it."""
    try:
        numbers = [b[k] for b in result["batches"] for k in BATCH]
        texts = [c[k] for c in result["cases"] for k in JUDGEMENT]
        numbers_of(result)
        return (bool(numbers and texts) and isinstance(result["provenance"], dict)
                and "hysteresis" in result and all(isinstance(t, str) for t in texts)
                and all(n is None or isinstance(n, (int, float)) for n in numbers))
    except (LookupError, TypeError, ValueError):
        return False


def parsed(path):
    """What is kept there; None if nothing is, or it is damaged."""
    try:
        result = object_of(path.read_text(), path)
    except (OSError, ValueError, InputError):
        return None
    return result if is_whole(result) else None


def result_of(program, scene, updates, runs):
    """What the program printed, from earlier where nothing has changed."""
    words = ["stability", f"scenes/{scene}/scene.toml", "--long-run", str(updates), *OPTIONS,
             "--json"]
    key = hashlib.sha256(program.read_bytes() + "\0".join(words).encode()).hexdigest()[:16]
    path = runs / f"{scene}_{key}.json"
    kept = parsed(path)
    if kept is None:
        say(" ".join(["probelab", *words]))
        done = subprocess.run([program, *words], cwd=ROOT, stdout=subprocess.PIPE, text=True,
                              check=False)
        if done.returncode not in (0, 3):
            sys.exit(done.returncode)
        kept = object_of(done.stdout, f"{program} stability")
        if not is_whole(kept):
            raise InputError(f"{program}: not what 'probelab {' '.join(words)}' prints")
        with whole_folder(runs) as folder:
            (folder / path.name).write_text(done.stdout)
    return kept


def numbers_of(result):
    """Of a whole run, for the manifest."""
    return {**result["long_run"], **{k: result[k] for k in (*SETTINGS, "receivers")},
            # Not of the clock: a process may have been stopped in between.
            "update_ms": statistics.median(b["update_ms"] for b in result["batches"]),
            "rss_mib": result["batches"][-1]["rss_mib"],
            "fails": sum(c["verdict"] == "fails" for c in result["cases"])}


def number(value):
    return f"{value:.6g}" if isinstance(value, float) else "" if value is None else value


def write_csv(path, columns, rows):
    with open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows({k: number(v) for k, v in row.items()} for row in rows)


def publish(results, folder):
    write_csv(folder / "rows.csv", ("scene", *BATCH),
              [{"scene": scene, **{k: b[k] for k in BATCH}} for scene, r in results.items()
               for b in r["batches"]])
    write_csv(folder / "cases.csv", ("scene", *SETTINGS, *JUDGEMENT),
              [{"scene": scene, **{k: r[k] for k in SETTINGS}, **{k: c[k] for k in JUDGEMENT}}
               for scene, r in results.items() for c in r["cases"]])
    first = next(iter(results.values()))
    numbers = {scene: numbers_of(r) for scene, r in results.items()}
    manifest = {"study": "long_runs", "command": "scripts/long_runs.py", "options": OPTIONS,
                "hysteresis": first["hysteresis"], "scenes": numbers,
                **{k: first["provenance"][k] for k in ("device", "driver", "tracer", "version",
                                                       "compiler", "build_type", "seed")
                   if k in first["provenance"]}}
    (folder / "manifest.json").write_text(json.dumps(manifest, indent=1) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default=ROOT / "build/release/probelab", type=pathlib.Path,
                        help="the program (default: build/release/probelab)")
    parser.add_argument("--updates", type=int, default=100000, help="a scene (default: 100000)")
    parser.add_argument("--scenes", default=",".join(SCENES),
                        help=f"names in scenes/ (default: {','.join(SCENES)})")
    parser.add_argument("--runs", default=ROOT / "results/runs/long_runs", type=pathlib.Path,
                        help="where results are kept (default: results/runs/long_runs)")
    parser.add_argument("-o", "--output", default=ROOT / "results/published/long_runs",
                        type=pathlib.Path, help="folder (default: results/published/long_runs)")
    options = parser.parse_args()
    if not options.program.exists():
        parser.error(f"{options.program}: not built yet; scripts/run builds it")
    program = options.program.resolve()
    results = {scene: result_of(program, scene, options.updates, options.runs)
               for scene in options.scenes.split(",")}
    with whole_folder(options.output) as folder:
        publish(results, folder)
    with naming("stdout"):
        for scene, result in results.items():
            for case in result["cases"]:
                print(f"{scene:16} {case['id']:16} {case['verdict']:6} {case['measured']}")
    sys.exit(3 if any(c["verdict"] == "fails" for r in results.values() for c in r["cases"]) else 0)


if __name__ == "__main__":
    run_main(main, interrupted="finished scenes are kept")
