#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compares the cells of two results folders of `probelab run`, times aside. Exit code 1, and what
differs, if they are not the same. Standard library only."""
import argparse
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from whole_output import InputError, read_object  # noqa: E402

# What another run may change: times, and where the run was.
TIMES = {"": ("speed", "provenance", "layout_build_s", "seconds"), "cell": ("seconds", "scene"),
         "layout": ("build_s",), "receivers": ("seconds", "from_cache")}


def without_times(result):
    for member, names in TIMES.items():
        of = result.get(member) if member else result
        for name in names:
            if isinstance(of, dict):
                of.pop(name, None)
    return result


def cells(folder):
    return {p.stem: without_times(read_object(p))
            for p in sorted((folder / "cells").glob("*.json"))}


def differing(a, b, name=""):
    """Dotted names of what is not equal."""
    if isinstance(a, dict) and isinstance(b, dict):
        return [d for k in sorted({*a, *b}) for d in differing(a.get(k), b.get(k), f"{name}.{k}")]
    return [] if a == b else [name.lstrip(".")]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("first", type=pathlib.Path)
    parser.add_argument("second", type=pathlib.Path)
    options = parser.parse_args()
    try:
        first, second = cells(options.first), cells(options.second)
    except (InputError, OSError) as error:
        print(f"compare_cells.py: {error}", file=sys.stderr)
        return 2
    wrong = [f"{i}: only in one of the folders" for i in sorted({*first} ^ {*second})]
    for i in sorted({*first} & {*second}):
        names = differing(first[i], second[i])
        wrong += [f"{i}: {', '.join(names)} differ"] * bool(names)
    for line in wrong:
        print(f"compare_cells.py: {line}", file=sys.stderr)
    if not first:
        print(f"compare_cells.py: {options.first}: no cells", file=sys.stderr)
        return 1
    if not wrong:
        print(f"{len(first)} cells, the same in both, times aside")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
