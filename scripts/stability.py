#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs the hard-case suite and publishes its rows. Standard library only.

  scripts/stability.py                      results/published/stability, about 25 s of CPU time
  scripts/stability.py --rows rows.json     from what `probelab stability --json` printed

Writes rows.json (a row a line) and manifest.json (where they come from). Exit code 3 when a case
fails.
"""
import argparse
import json
import pathlib
import sys

from whole_output import printed, run_main, whole_folder

ROOT = pathlib.Path(__file__).resolve().parents[1]
COMMAND = ["probelab", "stability", "--json"]


def publish(result, folder):
    """Rows without their times, which are the machine's."""
    rows = [{k: v for k, v in row.items() if k != "seconds"} for row in result["cases"]]
    counts = {v: sum(r["verdict"] == v for r in rows) for v in ("holds", "limit", "fails")}
    provenance = result["provenance"]
    manifest = {"study": "stability", "command": " ".join(COMMAND), "rows": len(rows), **counts,
                **{k: provenance[k] for k in ("device", "driver", "tracer", "version", "compiler",
                                              "build_type", "seed") if k in provenance},
                "seconds": round(result["seconds"], 1)}
    lines = ",\n".join("  " + json.dumps(r, ensure_ascii=False) for r in rows)
    (folder / "rows.json").write_text('{"cases": [\n' + lines + "\n]}\n")
    (folder / "manifest.json").write_text(json.dumps(manifest, indent=1) + "\n")
    return counts


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", default=ROOT / "build/release/probelab", type=pathlib.Path,
                        help="the program (default: build/release/probelab)")
    parser.add_argument("--rows", type=pathlib.Path, help="what the command printed, not run again")
    parser.add_argument("-o", "--output", default=ROOT / "results/published/stability",
                        type=pathlib.Path, help="folder (default: results/published/stability)")
    options = parser.parse_args()
    result = printed(options.program, COMMAND[1:], {"cases": list}, options.rows, codes=(0, 3))
    with whole_folder(options.output) as folder:
        counts = publish(result, folder)
    print(f"{counts['holds']} hold, {counts['limit']} limits, {counts['fails']} fail",
          file=sys.stderr)
    sys.exit(3 if counts["fails"] else 0)


if __name__ == "__main__":
    run_main(main)
