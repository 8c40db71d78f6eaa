# SPDX-License-Identifier: GPL-3.0-or-later
"""scripts/tuning.py: runs what is missing, keeps what is done, and knows what folds started from."""
import json
import statistics
import subprocess
import sys
import tomllib
import unittest

from support import CliTest, PROGRAM, SOURCE

sys.path.insert(0, str(SOURCE / "scripts"))
import row_study  # noqa: E402

STUDY = """
receivers = 64
rel_error = 0.2
params = "probelab"
rays = 16
updates = 2
seeds = [1]
probes = [8]
strategy = "grid"
published = ["rtxgi"]
vary = ["normal_bias"]
scenes = ["scenes/corridor_l/scene.toml", "scenes/cornell/scene.toml"]
[searches]
scenes = []
[leave_one_out]
seeds = [1]
set = ["normal_bias=0.3"]
"""


class TuningStudy(CliTest):
    def setUp(self):
        super().setUp()
        self.results = self.folder / "results"
        self.write(STUDY)

    def write(self, text):
        (self.folder / "study.toml").write_text(text)

    def study(self, *options):
        return subprocess.run(
            [sys.executable, "-B", SOURCE / "scripts/tuning.py", "--study",
             self.folder / "study.toml", "--program", PROGRAM, "--results", self.results,
             "--cache", self.folder / "cache", *options], capture_output=True, text=True,
            timeout=300)

    def test_folds_have_a_start_of_their_own(self):
        first = self.study()
        self.assertEqual(first.returncode, 0, first.stderr)
        rows = [json.loads(line) for line in (self.results / "rows.jsonl").read_text().splitlines()]
        of_folds = [r for r in rows if r["layout"] in ("left_out", "shared")]
        self.assertEqual({r["scene"] for r in of_folds}, {"corridor_l", "cornell"})
        for row in rows:
            self.assertEqual("set=normal_bias=0.3" in row["settings"], row in of_folds)
        reports = self.results / "reports"
        starts = {unit: json.loads((reports / unit / "tune.json").read_text())["parameters"][0]["from"]
                  for unit in ("corridor_l_8_1", "all_8_1")}
        self.assertEqual(starts["all_8_1"], 0.3)
        self.assertNotEqual(starts["corridor_l_8_1"], 0.3)
        for title in ("tuned (tuned on the scene)", "left_out (tuned on the other scenes)"):
            self.assertIn(f"## {title} against the best published preset", first.stdout)
        again = self.study("--program", "/bin/false")  # nothing is missing, so nothing runs
        self.assertEqual(again.returncode, 0, again.stderr)
        self.assertEqual(again.stdout, first.stdout)

        self.write(STUDY.replace("0.3", "0.2"))
        other = self.study("--report")
        self.assertIn(f"{len(of_folds)} rows were made with other settings", other.stderr)
        self.assertNotIn("## left_out", other.stdout)
        self.assertEqual(self.study("--program", "/bin/false", "--parts", "scenes").returncode, 0)
        self.assertEqual(self.study("--program", "/bin/false").returncode, 1)

    def test_one_scene(self):
        self.write(STUDY.replace("rays = 16", "fit_values = true\nrays = 16"))
        done = self.study("--scenes", "cornell", "--parts", "scenes")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.publishes_what_there_is()
        self.tells_of_texels_fitted_after_tuning(done)

    def publishes_what_there_is(self):
        published = self.folder / "published"
        self.assertEqual(self.study("--report", "--publish", published).returncode, 0)
        self.assertEqual((published / "tuning.md").read_text(),
                         (self.results / "tuning.md").read_text())
        self.assertTrue((published / "rows.jsonl.xz").is_file())
        self.assertTrue((published / "cornell_8_1/tuned.toml").is_file())
        # Rows of other settings are not published; a study without any of its own replaces nothing.
        before = (published / "rows.jsonl.xz").read_bytes()
        self.write(STUDY.replace("updates = 2", "updates = 3"))
        result = self.study("--report", "--publish", published)
        self.assertIn("nothing is published", result.stderr)
        self.assertEqual((published / "rows.jsonl.xz").read_bytes(), before)

    def tells_of_texels_fitted_after_tuning(self, done):
        _, rest = done.stdout.split("## Texels fitted to one light")
        row, = (line for line in rest.split("\n##")[0].splitlines() if "cornell" in line)
        cells = [cell.strip() for cell in row.strip("|").split("|")]
        tuned = json.loads((self.results / "reports/cornell_8_1/tune.json").read_text())
        first, *others = tuned["values"]["scores"]
        self.assertEqual(cells[1:3], ["1", first["state"]])
        preset, = (s["heldout"]["nrmse"] for score in tuned["scores"] for s in score["settings"]
                   if score["state"] == first["state"] and s["setting"] == "rtxgi")
        before, after = (first["heldout"][when]["nrmse"] for when in ("before", "after"))
        wanted = [preset, before, after, preset / after, before / after]
        wanted += [statistics.fmean(s["heldout"][when]["nrmse"] ** 2 for s in others) ** 0.5
                   for when in ("before", "after")]
        for cell, value in zip(cells[3:], wanted):
            self.assertAlmostEqual(float(cell.split()[0]) / value, 1, delta=0.006, msg=row)

        # Values that are missing, a preset without rows, a scene that does not count.
        path = self.results / "rows.jsonl"
        rows = [json.loads(line) for line in path.read_text().splitlines()]
        for score in (s for r in rows if r["layout"] == "tuned" for s in r["run"]["fitted"]):
            score["after"] = 0 if score["fitted"] else None
        path.write_text("".join(json.dumps(r) + "\n" for r in rows))
        self.write('null_scenes = ["cornell"]\n' + STUDY.replace('["rtxgi"]', '["gdc2019"]'))
        done = self.study("--report")
        self.assertEqual(done.returncode, 0, done.stderr)
        table = done.stdout.split("## Texels fitted to one light")[1].split("\n##")[0]
        row, = (line for line in table.splitlines() if "cornell" in line)
        self.assertEqual([c.strip() for c in row.strip("|").split("|")][5:8], ["0", "-", "-"])

    def test_usage(self):
        for options, word in ((("--parts", "senes"), "senes"), (("--scenes", "nowhere"), "nowhere")):
            result = self.study(*options)
            self.assertEqual(result.returncode, 2, options)
            self.assertIn(word, result.stderr)
        self.write(STUDY.replace("published", "publshed"))
        self.assertIn("'published' is missing; see experiments/studies/tuning.toml",
                      self.study().stderr)
        for text, word in (
                (STUDY.replace("seeds = [1]", "seeds = 1", 1), "seeds = 1: a list is needed"),
                (f"set = 3\n{STUDY}", "a value of the wrong kind")):
            self.write(text)
            self.assertIn(word, self.study().stderr)
        self.write(STUDY)
        self.assertEqual(self.study("--report").returncode, 2)

    def test_folders_are_named_after_the_study(self):
        (self.folder / "nowhere_yet.toml").write_text(STUDY)
        done = subprocess.run([sys.executable, "-B", SOURCE / "scripts/tuning.py", "--study",
                               self.folder / "nowhere_yet.toml", "--report"], capture_output=True,
                              text=True, timeout=60)
        self.assertEqual(done.returncode, 2)
        self.assertIn("results/runs/nowhere_yet: no results there", done.stderr)
        self.assertFalse((SOURCE / "results/runs/nowhere_yet").exists())

    def test_a_study_on_another_one(self):
        (self.folder / "base.toml").write_text(STUDY)
        self.write('base = "base.toml"\nscenes = ["scenes/cornell/scene.toml"]\n'
                   "[leave_one_out]\nseeds = []\n")
        whole, own = (tomllib.loads(text) for text in (STUDY, (self.folder / "study.toml").read_text()))
        own.pop("base")
        self.assertEqual(row_study.load(self.folder / "study.toml"), whole | own)
        for name, word in (("study.toml", "has a base itself"), ("none.toml", "No such file")):
            self.write(f'base = "{name}"\n')
            result = self.study("--report")
            self.assertEqual(result.returncode, 2)
            self.assertIn(f"base '{name}'", result.stderr)
            self.assertIn(word, result.stderr)


if __name__ == "__main__":
    unittest.main()
