#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""FLIP by an independent implementation, for the images of tests/unit/metrics/flip_test.cpp.

The expected values live in tests/unit/metrics/flip_expected.json, and the test compares ours with
them. This script computes them again with NVIDIA's flip-evaluator and compares, or writes the file.
It needs that package from PyPI, in a virtual environment of its own:

    python3 -m venv VENV && VENV/bin/pip install flip-evaluator numpy
    VENV/bin/python scripts/crosscheck_flip.py [--write]
"""
import argparse
import json
import pathlib
import sys

EXPECTED = pathlib.Path(__file__).resolve().parent.parent / "tests/unit/metrics/flip_expected.json"
TOLERANCE = 1e-6  # of the same program on another machine: float rounding of a mean


def noise(x, y, c):
    """Integer hash in [0, 1); the same arithmetic modulo 2^32 as in the test."""
    h = (x * 73856093 ^ y * 19349663 ^ c * 83492791) & 0xFFFFFFFF
    h = (h ^ (h >> 13)) * 1274126177 & 0xFFFFFFFF
    return ((h ^ (h >> 16)) & 0xFFFF) / 65536.0


def image(width, height, value):
    """value(x, y, channel) over the image, as float32 [y][x][channel]."""
    import numpy as np
    return np.array([[[value(x, y, c) for c in range(3)] for x in range(width)]
                     for y in range(height)], dtype=np.float32)


def gradient(w, h):
    return lambda x, y, c: (x / (w - 1), y / (h - 1), 0.5)[c]


def spot(w, h):
    return lambda x, y, c: 0.05 * (c + 1) + 1000.0 / (1.0 + (x - 20) ** 2 + (y - 15) ** 2) ** 2


def cases():
    """name: (kind, reference, test, parameters)."""
    w, h = 61, 43
    g, s = gradient(w, h), spot(w, h)
    fixed = {"startExposure": -3.0, "stopExposure": 4.0, "numExposures": 7}
    return {
        "ldr_offset": ("LDR", image(w, h, g), image(w, h, lambda x, y, c: 0.9 * g(x, y, c)), {}),
        "ldr_checker": ("LDR", image(w, h, lambda x, y, c: (x // 3 + y // 3) % 2),
                        image(w, h, lambda x, y, c: 0.5), {}),
        "ldr_noise": ("LDR", image(w, h, noise), image(w, h, lambda x, y, c: noise(x + 7, y, c)),
                      {}),
        "ldr_green_blue": ("LDR", image(w, h, lambda x, y, c: float(c == 1)),
                           image(w, h, lambda x, y, c: float(c == 2)), {}),
        "ldr_smaller_than_filter": ("LDR", image(7, 5, gradient(7, 5)),
                                    image(7, 5, lambda x, y, c: noise(x, y, c)), {}),
        "ldr_other_distance": ("LDR", image(w, h, g),
                               image(w, h, lambda x, y, c: g(x, y, c) ** 2), {"ppd": 30.0}),
        "hdr_spot": ("HDR", image(w, h, s), image(w, h, lambda x, y, c: 0.8 * s(x, y, c)), fixed),
        "hdr_automatic": ("HDR", image(w, h, s),
                          image(w, h, lambda x, y, c: s(x, y, c) * (0.5 + noise(x, y, c))), {}),
        "hdr_leak_in_the_dark": ("HDR", image(w, h, lambda x, y, c: 2.0 if x < 15 else 0.0),
                                 image(w, h, lambda x, y, c: 2.0 if x < 15 else 0.02), fixed),
    }


def evaluate(kind, reference, test, parameters):
    import flip_evaluator
    import numpy as np
    error_map, mean, used = flip_evaluator.evaluate(
        reference, test, kind, inputsRGB=False, applyMagma=False, parameters=dict(parameters))
    error_map = np.asarray(error_map).reshape(reference.shape[0], reference.shape[1], -1)[:, :, 0]
    row = {"mean": float(mean), "center": float(error_map[reference.shape[0] // 2,
                                                          reference.shape[1] // 2]),
           "max": float(error_map.max())}
    if kind == "HDR":
        row.update(start=used["startExposure"], stop=used["stopExposure"],
                   count=used["numExposures"])
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--write", action="store_true", help="replace the expected values")
    write = parser.parse_args().write
    try:
        rows = {name: evaluate(*case) for name, case in cases().items()}
    except ImportError as error:
        print(f"crosscheck_flip: {error}; it is a package from PyPI: python3 -m venv VENV && "
              "VENV/bin/pip install flip-evaluator numpy, then VENV/bin/python "
              "scripts/crosscheck_flip.py", file=sys.stderr)
        sys.exit(2)
    if write:
        EXPECTED.write_text(json.dumps(rows, indent=2) + "\n")
    expected = json.loads(EXPECTED.read_text())
    failed = sorted(expected.keys() ^ rows.keys())
    for name, row in rows.items():
        difference = max((abs(row[k] - v) for k, v in expected.get(name, {}).items()), default=1)
        print(f"{name:26} mean {row['mean']:.6f}  differs by at most {difference:.1e}")
        if difference > TOLERANCE:
            failed.append(name)
    if failed:
        sys.exit(f"not as expected: {', '.join(failed)}")


if __name__ == "__main__":
    main()
