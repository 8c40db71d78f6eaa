# SPDX-License-Identifier: GPL-3.0-or-later
"""The rows of scripts/placement.py, their errors by block and seed, and intervals of ratios.

A row's `blocks` hold, by block of held-out receivers, the sum of a (E-A)(E-B) over that of a A B of
all, so that they sum to nrmse^2; all errors and intervals come from them. Standard library only.
"""
import json
import lzma
import math
import random
import statistics

REPLICATES = 2000


def load_rows(folder):
    """The rows of rows.jsonl, or of rows.jsonl.xz; the last of a key counts. A line that a kill cut
    short is left out."""
    rows = {}
    packed, plain = folder / "rows.jsonl.xz", folder / "rows.jsonl"
    if plain.exists():
        text = plain.read_text()
    elif packed.exists():
        text = lzma.decompress(packed.read_bytes()).decode()
    else:
        return []
    for line in text.splitlines():
        try:
            row = json.loads(line)
            rows[tuple(row[k] for k in ("scene", "layout", "probes", "layout_seed", "state",
                                        "seed", "settings"))] = row
        except (ValueError, LookupError, TypeError):
            continue
    return list(rows.values())


class Results:
    """Rows of layouts that were made and scored with the same seed, by what the tables ask for."""

    def __init__(self, rows):
        self.rows, self.found = rows, {}
        for row in rows:
            if row["seed"] == row["layout_seed"]:
                key = (row["scene"], row["layout"], row["probes"], row["lights"])
                self.found.setdefault(key, {}).setdefault(row["seed"], []).append(row)
        states = {}
        for row in rows:
            states.setdefault((row["scene"], row["lights"]), set()).add(row["state"])
        for (scene, _, _, lights), seeds in self.found.items():
            for seed in [s for s, of in seeds.items() if len(of) < len(states[scene, lights])]:
                del seeds[seed]  # not all of its states are done

    def seeds(self, *key):
        return set(self.found.get(key, {}))

    def of(self, key, seeds):
        return [row for seed in sorted(seeds) for row in self.found[key][seed]]

    def squares(self, key, seeds):
        """[seed] of {block: squared error relative to the truth, mean over states}."""
        result = []
        for seed in sorted(seeds):
            blocks, rows = {}, self.found[key][seed]
            for row in rows:
                for block, error in row["blocks"].items():
                    blocks[block] = blocks.get(block, 0) + error / len(rows)
            result.append(blocks)
        return result

    def nrmse(self, key, seeds):
        """Root of the mean over seeds and states of nrmse^2."""
        squares = [sum(blocks.values()) for blocks in self.squares(key, seeds)]
        return math.sqrt(max(0.0, statistics.fmean(squares)))


def dense(squares, names):
    return [[blocks.get(name, 0.0) for name in names] for blocks in squares]


def draws(seeds, blocks):
    """REPLICATES times: how often each seed and which blocks are drawn, with replacement."""
    generator = random.Random(1)
    for _ in range(REPLICATES):
        yield ([generator.randrange(seeds) for _ in range(seeds)],
               generator.choices(range(blocks), k=blocks))


def percentiles(values):
    values = sorted(values)
    return values[int(0.025 * (len(values) - 1))], values[math.ceil(0.975 * (len(values) - 1))]


def bootstrap_sums(squares, names):
    """[replicate] sums of [seed][block] under the same draws for everything of the same shape."""
    table = dense(squares, names)
    sums = []
    for drawn_seeds, drawn_blocks in draws(len(table), len(names)):
        per_seed = {s: sum(map(table[s].__getitem__, drawn_blocks)) for s in set(drawn_seeds)}
        sums.append(sum(per_seed[s] for s in drawn_seeds))
    return sums


def paired_ratios(first, second):
    """Ratio of nrmse, and its replicates by a paired bootstrap over blocks and seeds; undefined
    replicates are infinite."""
    names = sorted({name for blocks in first + second for name in blocks})
    totals = [sum(sum(b.values()) for b in squares) for squares in (first, second)]
    ratio = math.sqrt(max(0.0, totals[0]) / totals[1]) if totals[1] > 0 else math.inf
    return ratio, [math.sqrt(max(0.0, a) / b) if b > 0 else math.inf
                   for a, b in zip(bootstrap_sums(first, names), bootstrap_sums(second, names))]
