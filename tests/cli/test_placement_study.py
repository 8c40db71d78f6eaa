# SPDX-License-Identifier: GPL-3.0-or-later
"""scripts/placement.py: runs what is missing, keeps what is done, reports from rows alone."""
import json
import math
import subprocess
import sys
import time
import unittest

from support import CliTest, PROGRAM, SOURCE

sys.path.insert(0, str(SOURCE / "scripts"))
import placement_report  # noqa: E402
import placement_rows  # noqa: E402

STUDY = """
receivers = 64
rel_error = 0.2
params = "classic"
rays = 16
updates = 2
drawn_lights = 3
seeds = [1, 2]
probes = [8]
scenes = ["scenes/corridor_l/scene.toml"]
[[layout]]
name = "grid"
strategy = "grid"
[[layout]]
name = "scattered"
strategy = "jittered"
ours = true
[retraining]
layouts = ["scattered"]
"""


class PlacementStudy(CliTest):
    def setUp(self):
        super().setUp()
        self.results = self.folder / "results"
        (self.folder / "study.toml").write_text(STUDY)

    def study(self, *options):
        return subprocess.run(
            [sys.executable, SOURCE / "scripts/placement.py", "--study", self.folder / "study.toml",
             "--program", PROGRAM, "--results", self.results, "--cache", self.folder / "cache",
             *options], capture_output=True, text=True, timeout=300)

    def rows(self):
        return [json.loads(line) for line in (self.results / "rows.jsonl").read_text().splitlines()]

    def test_runs_are_kept_and_go_on(self):
        first = self.study("--seeds", "1", "--parts", "main")
        self.assertEqual(first.returncode, 0, first.stderr)
        rows = self.rows()
        # Two layouts under two train states, a held-out one and the drawn lights.
        self.assertEqual(len(rows), 8)
        drawn = [r for r in rows if r["lights"] == "drawn"]
        self.assertEqual([len(r["blocks"]) for r in drawn], [3, 3])
        self.assertLess(drawn[1]["reading"]["seen"], drawn[1]["reading"]["nrmse"])
        self.assertEqual([r["lights"] for r in rows].count("heldout"), 2)
        for row in rows:
            self.assertAlmostEqual(math.sqrt(max(0, sum(row["blocks"].values()))), row["nrmse"],
                                   delta=1e-3 * row["nrmse"])
        with open(self.results / "rows.jsonl", "a") as file:
            file.write('{"scene": "cut sho')
        second = self.study("--jobs", "2")
        self.assertEqual(second.returncode, 0, second.stderr)
        kept = placement_rows.load_rows(self.results)
        # Two seeds, and the second layout at the receivers of the first.
        self.assertEqual(len(kept), 8 + 8 + 3)
        self.assertEqual(kept[:8], rows)
        for words in ("## scattered against the best baseline: held-out lights, N = 8",
                      "## scattered against the best baseline: drawn lights, N = 8",
                      "| corridor_l", "## Retraining"):
            self.assertIn(words, second.stdout)
        published = self.folder / "published"
        report = self.study("--report", "--publish", published)
        self.assertEqual(report.stdout.splitlines()[:-1], second.stdout.splitlines()[:-1])
        self.results = published
        again = self.study("--report")
        self.assertEqual(again.stdout.splitlines()[:-1], second.stdout.splitlines()[:-1])

    def test_sigterm_ends_what_it_runs(self):
        def running():
            found = subprocess.run(["pgrep", "-f", f"{PROGRAM}.*{self.folder}"],
                                   capture_output=True, text=True, check=False)
            return found.stdout.split()

        # Receivers of so little error take longer than this test.
        (self.folder / "study.toml").write_text(STUDY.replace("rel_error = 0.2",
                                                              "rel_error = 0.0005"))
        script = [sys.executable, SOURCE / "scripts/placement.py", "--jobs", "2", "--study",
                  self.folder / "study.toml", "--program", PROGRAM, "--results", self.results,
                  "--cache", self.folder / "cache"]
        with subprocess.Popen(script, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                              text=True) as study:
            while not running() and study.poll() is None:
                time.sleep(0.05)
            time.sleep(1)
            study.terminate()
            errors = study.communicate(timeout=60)[1]
        self.assertEqual(study.returncode, 130, errors)
        self.assertIn("interrupted; finished runs are kept", errors)
        self.assertEqual(running(), [])

    def test_a_failure_is_named_and_leaves_the_others(self):
        (self.folder / "study.toml").write_text(
            STUDY.replace('strategy = "jittered"', 'strategy = "jittered"\noptions = ["jitter=9"]'))
        result = self.study("--seeds", "1", "--parts", "main")
        self.assertEqual(result.returncode, 1)
        self.assertEqual({r["layout"] for r in self.rows()}, {"grid"})
        self.assertIn("failed: corridor_l_scattered_8_1: probelab: --option jitter=9",
                      result.stderr)

    def test_usage(self):
        for options, word in ((("--parts", "mian"), "mian"), (("--strategies", "girds"), "girds"),
                              (("--scenes", "nowhere"), "nowhere"), (("--jobs", "0"), "--jobs")):
            result = self.study(*options)
            self.assertEqual(result.returncode, 2, options)
            self.assertIn(word, result.stderr)
        (self.folder / "study.toml").write_text(STUDY.replace("rel_error", "error"))
        self.assertIn("rel_error", self.study().stderr)
        (self.folder / "study.toml").write_text(STUDY)
        self.assertEqual(self.study("--report").returncode, 2)


def row(layout, errors, seed=1, lights="same", probes=8, **more):
    """A row whose blocks have these squared errors."""
    blocks = {str(i): e for i, e in enumerate(errors)}
    return {"scene": "s", "layout": layout, "probes": probes, "layout_seed": seed, "seed": seed,
            "state": lights, "lights": lights, "settings": "x", "blocks": blocks,
            "nrmse": math.sqrt(sum(errors)), "light_leak": 0.1, "smape": 0.2,
            "floors": {"light_leak": 0.01}, **more}


class Report(unittest.TestCase):
    STUDY = {"layout": [{"name": "a"}, {"name": "b"}, {"name": "ours", "ours": True}],
             "probes": [8]}

    def test_ratio_of_root_mean_squares(self):
        # sqrt((0.16 + 0.04) / (0.01 + 0.04)) = 2 in every replicate: the same in each block.
        first, second = [{"0": 0.08, "1": 0.08}, {"0": 0.02, "1": 0.02}], None
        second = [{k: v / 4 for k, v in blocks.items()} for blocks in first]
        ratio, drawn = placement_rows.paired_ratios(first, second)
        self.assertAlmostEqual(ratio, 2)
        self.assertEqual(len(drawn), placement_rows.REPLICATES)
        self.assertAlmostEqual(min(drawn), 2)
        self.assertAlmostEqual(max(drawn), 2)

    def test_interval_is_that_of_the_blocks(self):
        # One block of 100 rules: it is drawn in 63 % of replicates, none of it in the others.
        first = [{str(i): 1.0 if i == 0 else 0.01 for i in range(100)}]
        second = [{str(i): 0.01 for i in range(100)}]
        low, high = placement_rows.percentiles(placement_rows.paired_ratios(first, second)[1])
        self.assertAlmostEqual(low, 1)
        self.assertAlmostEqual(high, math.sqrt(1 + 3 * 0.99))  # drawn three times

    def test_the_best_baseline_is_that_of_the_column(self):
        rows = [row("a", [0.04]), row("b", [0.09]), row("ours", [0.01]),
                row("a", [0.09], lights="heldout"), row("b", [0.04], lights="heldout"),
                row("ours", [0.01], lights="heldout")]
        tables = placement_report.Tables(self.STUDY, rows)
        for lights, best in (("same", "a"), ("heldout", "b")):
            table, summary = tables.comparison("ours", 8, lights)
            self.assertEqual(table[1][:6], ["s", "1", best, "0.200", "0.100", "2.00"])
            self.assertEqual(summary[4], "2.00")

    def test_a_baseline_without_all_seeds_is_no_candidate(self):
        rows = [row("a", [0.04]), row("b", [0.09]), row("b", [0.09], seed=2),
                row("ours", [0.01]), row("ours", [0.01], seed=2)]
        table, _ = placement_report.Tables(self.STUDY, rows).comparison("ours", 8, "same")
        self.assertEqual(table[1][2], "b")

    def test_a_leak_below_the_noise_counts_as_noise(self):
        self.assertEqual(placement_report.error_ratio(0.2, 0.001, 0.1), 2)
        self.assertEqual(placement_report.error_ratio(0.02, 0.2, 0.1), 0.5)
        self.assertIsNone(placement_report.error_ratio(0.02, 0.03, 0.1))
        self.assertEqual(placement_report.error_ratio(0.2, 0, 0), float("inf"))
        self.assertEqual(placement_report.number(float("inf")), "inf")

    def test_light_by_light(self):
        # Ratios 2, 2 and 1/4, whose geometric mean is 1; one light has 16 of 18 parts of the error.
        rows = [row("a", [0.04, 0.04, 0.01], lights="drawn"), row("b", [9, 9, 9], lights="drawn"),
                row("ours", [0.01, 0.01, 0.16], lights="drawn")]
        table = placement_report.Tables(self.STUDY, rows).light_by_light()
        self.assertEqual(table[1], ["ours", "s", "8", "3", "1.00", "67 %", "89 %"])
        self.assertEqual(table[2][1:5], ["geometric mean", "8", "", "1.00"])
        same = placement_report.Tables(self.STUDY, [row("a", [0.04]), row("ours", [0.01])])
        self.assertIsNone(same.light_by_light())

    def test_what_reading_bounds(self):
        rows = [row("ours", [0.01], lights="drawn", seed=seed,
                    reading={"nrmse": 0.4 * seed, "unseen": 0.2 * seed, "seen": 0.1 * seed})
                for seed in (1, 2)]
        rows += [row("a", [0.01], lights="drawn", reading={"nrmse": 1, "unseen": 1, "seen": 1}),
                 row("ours", [0.01])]
        table = placement_report.Tables(self.STUDY, rows).readings()
        self.assertEqual(table[1:], [["ours", "s", "8", "2", "0.632", "2.00", "4.00"],
                                     ["ours", "geometric mean", "8", "", "", "2.00", "4.00"]])
        self.assertIsNone(placement_report.Tables(self.STUDY, rows[3:]).readings())

    def test_the_budget_that_meets_an_error(self):
        points = [(64, 0.8), (256, 0.4), (1024, 0.2)]  # error = 6.4 / sqrt(N)
        self.assertEqual(placement_report.meets(points, 0.9), (64, "<="))
        budget, sign = placement_report.meets(points, 0.5657)
        self.assertAlmostEqual(budget, 128, delta=0.1)
        self.assertEqual(sign, "")
        self.assertEqual(placement_report.meets(points, 0.1), (None, ">1024"))
        self.assertAlmostEqual(placement_report.slope(points), -0.5)


DRAW = """
import json, pathlib, sys
sys.path.insert(0, sys.argv[1])
import figures_panels
import placement_figure
save = figures_panels.save
def save_and_tell(figure, folder, stem):
    print(stem, *(len(panel.lines) for panel in figure.axes),
          *(text.get_text() for text in figure.legends[0].get_texts()))
    return save(figure, folder, stem)
figures_panels.save = save_and_tell
print(placement_figure.write_figure(json.loads(sys.argv[2]), json.loads(sys.argv[3]),
                                    pathlib.Path(sys.argv[4])))
"""


class Curves(CliTest):
    """By the distribution's Python, which has matplotlib."""

    def draw(self, budgets):
        study = {**Report.STUDY, "curves": {"layouts": ["a", "ours"]}}
        rows = [row(name, [1 / n, 2 / n], lights=lights, probes=n)
                for name in ("a", "ours") for n in budgets for lights in ("same", "heldout")]
        done = subprocess.run(["/usr/bin/python3", "-B", "-c", DRAW, SOURCE / "scripts",
                               json.dumps(study), json.dumps(rows), self.folder],
                              capture_output=True, text=True)
        return done.stdout.splitlines(), done.stderr

    def test_a_panel_a_scene_and_kind_of_light(self):
        told, error = self.draw((64, 256, 1024))
        self.assertEqual(told, ["curves 2 2 a ours", "[]"], error)
        self.assertEqual(self.files(), ["curves.pdf", "curves.png"])

    def test_two_budgets_are_no_curve(self):
        self.assertEqual(self.draw((64, 256))[0], ["[]"])
        self.assertEqual(self.files(), [])


if __name__ == "__main__":
    unittest.main()
