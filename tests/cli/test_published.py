# SPDX-License-Identifier: GPL-3.0-or-later
"""Published numbers: README.md, captions and figures say what the rows in results/published say, by
sums of this file's own. An edited number is found."""
import csv
import json
import lzma
import math
import random
import re
import shutil
import statistics
import subprocess
import sys
import tomllib
import unittest

from support import PROGRAM, SOURCE, CliTest

sys.path.insert(0, str(SOURCE / "scripts"))
import figures_cells  # noqa: E402
import published_rows  # noqa: E402

PUBLISHED = SOURCE / "results/published"
README = SOURCE / "README.md"
# Not all that has a manifest is a study of cells: the hard-case suite and fuzzing are not.
STUDIES = sorted(p.parent for p in PUBLISHED.glob("*/manifest.json")
                 if (SOURCE / "experiments/studies" / (p.parent.name + ".toml")).is_file())
# Names of figures' numbers -> columns of rows.csv.
COLUMNS = {"nrmse": "error.nrmse", "light leak": "error.light_leak",
           "shadow leak": "error.shadow_leak", "bias": "error.bias", "share": "error.share",
           "flicker": "temporal.flicker", "updates to 95 %": "temporal.updates_to_95",
           "updates to 99 %": "temporal.updates_to_99", "query ns": "speed.query_ns_per_point"}
NOT_AXES = {"metric", "value", "low", "high", "seeds", "floor", "scene"}


def table(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def combined(values, name):
    """States of one seed, as captions say."""
    if name == "error.nrmse":
        return math.sqrt(statistics.fmean(v * v for v in values))
    return statistics.fmean(values)


def recomputed(rows, point):
    """The (value, low, high) of a figure's point from the rows; None if it is of another kind."""
    column = COLUMNS.get(point["metric"])
    if column is None or column not in rows[0] or point["scene"] == "all scenes":
        return None
    keys = [k for k in point if k in rows[0] and k not in NOT_AXES]
    seeds, states = {}, {}
    for row in rows:
        # Beside cells of `evaluate` those of `budget` count by their first rung.
        of_point = {"rung", "name"} & set(keys) or row.get("rung") in (None, "", "0")
        if row["scene"] == point["scene"] and of_point:
            states.setdefault(row["scene"], set()).add(row["state"])
            if row[column] and all(row[k] == point[k] for k in keys):
                seeds.setdefault(row["seed"], []).append((row["state"], float(row[column])))
    values = [combined([v for _, v in of], column) for of in seeds.values()
              if {s for s, _ in of} == states[point["scene"]]]
    return (statistics.fmean(values), min(values), max(values)) if values else None


def floor_of(rows, point):
    """The reference's noise at a figure's point, from the rows."""
    floors = [{**r, COLUMNS[point["metric"]]: r["error.noise_floor."
                                                 + COLUMNS[point["metric"]].partition(".")[2]]}
              for r in rows]
    return recomputed(floors, point)[0]


def wrong_points(folder, rows, most=60):
    """Points of a study's figure that are not what the rows give, of a sample; and how many were
    compared."""
    points = [p for p in table(folder / f"{folder.name}.csv") if p.get("metric") in COLUMNS]
    random.Random(1).shuffle(points)
    wrong, compared = [], 0
    for point in points[:most]:
        found = recomputed(rows, point)
        if found is None:
            continue
        compared += 1
        stated = [float(point[k]) for k in ("value", "low", "high")]
        # Both files have 9 digits, and sums of them.
        if any(abs(f - s) > 1e-7 * max(abs(f), abs(s)) + 1e-15 for f, s in zip(found, stated)):
            wrong.append((point, found))
    return wrong, compared


class Readme(CliTest):
    def check(self, text, published=PUBLISHED):
        (self.folder / "README.md").write_text(text)
        return subprocess.run(
            [sys.executable, "-B", SOURCE / "scripts/readme.py", "--check", "--readme",
             self.folder / "README.md", "--published", published], capture_output=True, text=True)

    def test_says_what_the_rows_say(self):
        done = self.check(README.read_text())
        self.assertEqual((done.returncode, done.stderr), (0, ""))

    def test_an_edited_number_is_found(self):
        text = README.read_text()
        blocks = list(re.finditer(r"<!-- block: (\w+) -->\n(.*?)<!-- end -->", text, re.S))
        values = list(re.finditer(r"[-+\d.,eE]+(?=<!-- = \S+ -->)", text))
        self.assertGreaterEqual(len(blocks), 5)
        self.assertGreaterEqual(len(values), 4)
        places = []
        for block in blocks:
            digits = [m.start() for m in re.finditer(r"\d", block.group(2))]
            places.append(block.start(2) + digits[len(digits) // 3])
        places += [v.end() - 1 for v in values]
        edited = list(text)
        for at in places:
            edited[at] = str((int(edited[at]) + 1) % 10)
        done = self.check("".join(edited))
        self.assertEqual(done.returncode, 1)
        self.assertEqual(len(done.stderr.splitlines()), len(places), done.stderr)

    def refused(self, text, *words, published=PUBLISHED):
        done = self.check(text, published)
        self.assertEqual((done.returncode, len(done.stderr.splitlines())), (2, 1), done.stderr)
        for word in words:
            self.assertIn(word, done.stderr)

    def test_a_misspelt_mark_is_found(self):
        text = README.read_text()
        line = text[:text.index("<!-- block: overview -->")].count("\n") + 1
        for old, new, says in (
                ("block: overview", "blok: overview", f":{line}: '<!-- blok: overview -->'"),
                ("<!-- block: overview -->", "<!--block: overview-->", f":{line}: "),
                ("block: overview", "block: overvew", "no block 'overvew'"),
                ("<!-- = pipeline.bytes.rtxgi -->", " <!-- = pipeline.bytes.rtxgi -->", "no mark"),
                ("<!-- = pipeline.bytes.rtxgi -->", "<!-- pipeline.bytes.rtxgi -->", "no mark")):
            self.assertEqual(text.count(old), 1)
            self.refused(text.replace(old, new), "README.md", says)

    def test_a_block_that_is_gone_is_missed(self):
        text = README.read_text()
        for name in re.findall(r"<!-- block: (\w+) -->", text):
            self.refused(re.sub(rf"<!-- block: {name} -->\n.*?<!-- end -->", "", text, flags=re.S),
                         f"block '{name}' is missing")

    def test_what_is_not_there_or_damaged_is_named(self):
        done = subprocess.run([sys.executable, "-B", SOURCE / "scripts/readme.py", "--check",
                               "--readme", "/nonexist"], capture_output=True, text=True)
        self.assertEqual((done.returncode, done.stderr),
                         (2, "readme.py: /nonexist: No such file or directory\n"))
        published = self.folder / "published"
        shutil.copytree(PUBLISHED, published)
        (published / "fuzz/manifest.json").write_text("[]")
        self.refused(README.read_text(), "'fuzz' cannot be made", str(published),
                     published=published)

    def test_write_puts_the_numbers_back(self):
        text = README.read_text()
        path = self.folder / "README.md"
        path.write_text(re.sub(r"(<!-- block: budget -->\n).*?(<!-- end -->)", r"\1\2", text,
                               flags=re.S))
        subprocess.run([sys.executable, "-B", SOURCE / "scripts/readme.py", "--write", "--readme",
                        path], check=True, capture_output=True)
        self.assertEqual(path.read_text(), text)

    def test_every_number_of_the_overview(self):
        cells = {}
        for line in README.read_text().splitlines():
            words = [w.strip() for w in line.strip("|").split("|")]
            if len(words) == 11 and words[1] in ("classic", "rtxgi", "probelab"):
                cells[words[0], words[1]] = words[2:]
        study = tomllib.loads((SOURCE / "experiments/studies/overview.toml").read_text())
        self.assertEqual(len(cells), len(study["scenes"]) * len(study["presets"]))
        for (scene, preset), words in cells.items():
            row = json.loads((PUBLISHED / "overview" / f"{scene}_{preset}.json").read_text())
            error = row["error"]
            wanted = [error["nrmse"], error["noise_floor"]["nrmse"], error["bias"],
                      error["light_leak"], error["shadow_leak"], error["dark_leak"],
                      row["speed"]["update_ms"], row["speed"]["frame_ms"],
                      row["memory_bytes"] / 1024]
            for word, value, digits in zip(words, wanted, (3, 2, 2, 2, 2, 2, 3, 3, 3)):
                with self.subTest(scene=scene, preset=preset, word=word):
                    if value is None:
                        self.assertEqual(word, "-")
                    else:  # half a unit of the last digit, relative to the first
                        self.assertAlmostEqual(float(word), value,
                                               delta=0.51 * 10 ** (1 - digits) * abs(value))

    def test_placement_ratios(self):
        """Geometric means over scenes of the best baseline's nrmse over ours, from the rows."""
        study = tomllib.loads((SOURCE / "experiments/studies/placement.toml").read_text())
        packed = (PUBLISHED / "placement/rows.jsonl.xz").read_bytes()
        rows = [json.loads(line) for line in lzma.decompress(packed).decode().splitlines()]
        ours = {r["name"] for r in study["layout"] if r.get("ours")}
        squares, states = {}, {}
        for r in rows:
            if r["seed"] == r["layout_seed"]:
                squares.setdefault((r["scene"], r["probes"], r["lights"], r["layout"]), {}) \
                    .setdefault(r["seed"], {})[r["state"]] = sum(r["blocks"].values())
            states.setdefault((r["scene"], r["lights"]), set()).add(r["state"])
        lines = re.findall(r"\| `optimized`(, `lights=own`)? +\| +(\d+) \| +(\d+) \| +(\S+) .*?\| "
                           r"+(\S+) ", README.read_text())
        self.assertGreaterEqual(len(lines), 2)
        for own, probes, scenes, same, heldout in lines:
            layout = "optimized_static" if own else "optimized"
            for lights, stated in (("same", same), ("heldout", heldout)):
                ratios = []
                for (scene, lit), of in states.items():
                    whole = {name: {s for s, found in seeds.items() if set(found) == of}
                             for (c, n, l, name), seeds in squares.items()
                             if (c, n, l) == (scene, int(probes), lights)}
                    seeds = whole.get(layout)
                    if lit != lights or scene in study["null_scenes"] or not seeds:
                        continue
                    mean = {name: math.sqrt(statistics.fmean(
                        v for s in seeds for v in squares[scene, int(probes), lights, name][s]
                        .values())) for name, has in whole.items() if seeds <= has}
                    best = min(e for name, e in mean.items() if name not in ours)
                    ratios.append(best / mean[layout])
                self.assertEqual(len(ratios), int(scenes))
                # Three digits; blocks have four.
                self.assertAlmostEqual(float(stated), statistics.geometric_mean(ratios),
                                       delta=0.006 * float(stated))


class Studies(unittest.TestCase):
    def test_figures_are_of_the_rows(self):
        self.assertTrue(STUDIES)
        for folder in STUDIES:
            if folder.name in ("bias_map", "layout_tuning"):
                continue  # maps; and settings, below
            with self.subTest(study=folder.name):
                rows = table(folder / "rows.csv")
                wrong, compared = wrong_points(folder, rows)
                self.assertEqual(wrong, [])
                self.assertGreater(compared, 3)
                column = next(COLUMNS[p["metric"]]
                              for p in table(folder / f"{folder.name}.csv")
                              if p.get("metric") in COLUMNS and p["scene"] != "all scenes"
                              and COLUMNS[p["metric"]] in rows[0])
                for row in rows:  # a changed row would be found
                    if row[column]:
                        row[column] = str(1.01 * float(row[column]) + 1e-3)
                self.assertTrue(wrong_points(folder, rows)[0])

    def test_none_is_missing(self):
        commands = {path.stem for path in (SOURCE / "experiments/studies").glob("*.toml")
                    if "command" in tomllib.loads(path.read_text())}
        self.assertEqual({folder.name for folder in STUDIES}, commands)

    def test_slopes_and_floors_are_of_the_rows(self):
        folder = PUBLISHED / "error_vs_n"
        rows, points = table(folder / "rows.csv"), table(folder / "error_vs_n.csv")
        slopes = [p for p in points if p["metric"] == "slope"]
        self.assertGreaterEqual(len(slopes), 8)
        for line in slopes:
            of = [p for p in points if p["metric"] == "nrmse"
                  and all(p[k] == line[k] for k in ("scene", "layout"))]
            found = statistics.linear_regression([math.log(float(p["stored"])) for p in of],
                                                 [math.log(float(p["value"])) for p in of]).slope
            self.assertAlmostEqual(float(line["value"]), found, places=6)
        for point in random.Random(2).sample([p for p in points if p["floor"]], 20):
            self.assertAlmostEqual(float(point["floor"]), floor_of(rows, point), places=8)

    def test_fronts_are_what_nothing_beats(self):
        points = [p for p in table(PUBLISHED / "speed_error/speed_error.csv")
                  if p["metric"] == "nrmse"]
        for scene in {p["scene"] for p in points}:
            of = [p for p in points if p["scene"] == scene]
            for cost in ("frame_ms", "work_rays"):
                places = [(float(p[cost]), float(p["value"])) for p in of]
                front = [not any(a <= x and b <= y and (a, b) != (x, y) for a, b in places) for x, y in places]
                self.assertEqual([p["front_" + cost] == "1" for p in of], front)

    def test_tuned_and_untuned_errors_are_of_the_rows(self):
        folder = PUBLISHED / "layout_tuning"
        if folder not in STUDIES:
            self.skipTest("the study has not been published")
        rows = table(folder / "rows.csv")
        for point in table(folder / "layout_tuning.csv")[:40]:
            column, seeds = COLUMNS[point["metric"]], {}
            for row in rows:
                if row[column] and all(row[k] == point[k] for k in ("scene", "layout", "setting",
                                                                    "lights")):
                    seeds.setdefault(row["seed"], []).append(float(row[column]))
            found = statistics.fmean(combined(of, column) for of in seeds.values())
            self.assertAlmostEqual(float(point["value"]), found, delta=1e-7 * abs(found) + 1e-15)

    def test_captions_are_of_the_rows(self):
        for folder in STUDIES:
            with self.subTest(study=folder.name):
                rows = table(folder / "rows.csv")
                about = json.loads((folder / "manifest.json").read_text())
                for path in folder.glob(f"{folder.name}*.txt"):
                    text = path.read_text()
                    cells = len({r["id"] for r in rows})
                    self.assertRegex(text, rf"From {cells} of \d+ cells")
                    seeds = sorted({r["seed"] for r in rows}, key=int)
                    self.assertIn(f"seeds: {', '.join(seeds)};", text)
                    self.assertEqual([str(s) for s in about["seeds"]], seeds)
                    for word in (*about["device"], *about["version"][:12]):
                        self.assertIn(word, text)
                    stored = [float(r["probes.stored"]) for r in rows if r.get("probes.stored")]
                    if stored:
                        low, high = f"{min(stored):,.0f}", f"{max(stored):,.0f}"
                        self.assertIn(f" {low} stored" if low == high
                                      else f" {low} to {high} stored", text)

    def test_every_study_has_what_it_should(self):
        for folder in STUDIES:
            for ending in ("csv", "pdf", "png", "txt"):
                self.assertTrue((folder / f"{folder.name}.{ending}").is_file(),
                                f"{folder.name}.{ending}")
            about = json.loads((folder / "manifest.json").read_text())
            for key in ("command", "cells", "seeds", "device", "driver", "version", "compiler"):
                self.assertTrue(about[key], f"{folder.name}: {key}")


class Manifest(CliTest):
    def test_receivers_of_a_tuning(self):
        cells = self.folder / "cells"
        cells.mkdir()
        (cells / "a.json").write_text(json.dumps(
            {"scenes": [{"receivers": 256}], "cell": {
                "id": "a", "study": "mine", "command": "tune", "options": {},
                "axes": {"scene": "room", "state": "day"}}}))
        study, = figures_cells.load_folder(self.folder)[0]
        about = published_rows.manifest(study, "smoke", "", "")
        self.assertEqual(about["receivers"], [256])


class Publish(CliTest):
    def publish(self, *options):
        return subprocess.run(
            [sys.executable, "-B", SOURCE / "scripts/publish", "--program", PROGRAM, "--size", "smoke",
             "--only", "formats", "--runs", self.folder / "runs", "-o", self.folder / "out", *options],
            capture_output=True, text=True, timeout=300)

    def compare(self, other):
        return subprocess.run(
            [sys.executable, "-B", SOURCE / "scripts/workflow/compare_cells.py",
             self.folder / "runs/formats", other], capture_output=True, text=True)

    def test_what_a_size_does_not_have_is_refused(self):
        for size, name, sizes in (("smoke", "overview", "quick or published"),
                                  ("quick", "pipeline", "published"),
                                  ("smoke", "images", "quick or published")):
            done = self.publish("--size", size, "--only", name)
            self.assertEqual((done.returncode, done.stdout), (2, ""))
            self.assertEqual(done.stderr, f"publish: --only {name}: there is nothing of size "
                                          f"{size}; --size {sizes} has it\n")

    def test_a_program_that_is_another_is_refused(self):
        for program, says in (("/bin/true", "printed no list of cells"),
                              ("/bin/false", "exit code 1"), ("/etc", "Permission denied")):
            done = self.publish("--list", "--program", program)
            self.assertEqual((done.returncode, done.stdout), (2, ""))
            self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)
            self.assertIn(says, done.stderr)

    def test_from_cells_to_rows_and_figure(self):
        listed = self.publish("--list")
        self.assertEqual(listed.returncode, 0, listed.stderr)
        self.assertRegex(listed.stdout, r"formats +4 cells +about 0 min")
        done = self.publish()
        self.assertEqual((done.returncode, done.stdout), (0, f"{self.folder / 'out'}\n"), done.stderr)
        folder = self.folder / "out/formats"
        rows = table(folder / "rows.csv")
        self.assertEqual(len(rows), 4)
        self.assertEqual(wrong_points(folder, rows), ([], 4))
        about = json.loads((folder / "manifest.json").read_text())
        self.assertEqual(about["cells"], "4 of 192 cells of the study (4 of 4 of its size smoke)")
        self.assertIn("From 4 of 192 cells", (folder / "formats.txt").read_text())
        self.assertTrue((folder / "formats.pdf").is_file())
        # What is there is kept, and the same cells elsewhere are the same.
        cells = {p: p.stat().st_mtime_ns for p in (self.folder / "runs/formats/cells").iterdir()}
        self.assertIn("formats                 4 cells  about 0 min 00 s", self.publish("--list").stdout)
        self.publish()
        self.assertEqual({p: p.stat().st_mtime_ns for p in cells}, cells)
        other = self.folder / "other"
        shutil.copytree(self.folder / "runs/formats", other)
        path = next((other / "cells").iterdir())
        result = json.loads(path.read_text())
        result["cell"]["seconds"] = result["speed"]["update_ms"] = 77
        path.write_text(json.dumps(result))
        self.assertEqual(self.compare(other).returncode, 0)
        result["error"]["nrmse"] += 1e-9
        path.write_text(json.dumps(result))
        found = self.compare(other)
        self.assertEqual(found.returncode, 1)
        self.assertIn(f"{path.stem}: error.nrmse differ", found.stderr)


if __name__ == "__main__":
    unittest.main()
