# SPDX-License-Identifier: GPL-3.0-or-later
"""What all scripts have in common; scripts/setup says what it would do; scripts/count_tests.py
counts what ctest wrote; scripts/pipeline.py runs a study and keeps what is done."""
import csv
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

from support import CliTest, PROGRAM

SCRIPTS = pathlib.Path(__file__).resolve().parents[2] / "scripts"
PYTHON = "/usr/bin/python3"  # the distribution's: scripts/setup installs its matplotlib
sys.path.insert(0, str(SCRIPTS))
import pipeline_report  # noqa: E402


def read_csv(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def is_script(path):
    return path.is_file() and path.read_bytes()[:2] == b"#!"


class AllScripts(CliTest):
    SCRIPTS = sorted(p for p in SCRIPTS.rglob("*") if is_script(p))
    # Nothing is left beside the scripts.
    ENVIRONMENT = dict(os.environ, PYTHONDONTWRITEBYTECODE="1", COLUMNS="100")

    def test_all_can_be_called_by_their_name(self):
        self.assertGreater(len(self.SCRIPTS), 15)
        for path in self.SCRIPTS:
            self.assertTrue(os.access(path, os.X_OK), f"{path}: chmod +x")

    def test_help_is_whole(self):
        for path in self.SCRIPTS:
            with self.subTest(script=path.name):
                done = subprocess.run([path, "--help"], capture_output=True, text=True,
                                      env=self.ENVIRONMENT)
                self.assertEqual((done.returncode, done.stderr), (0, ""))
                paragraphs = done.stdout.strip().split("\n\n")
                self.assertTrue(paragraphs[0].lower().startswith("usage:"), paragraphs[0])
                self.assertRegex(paragraphs[1], r"[.:]$|  ")  # a sentence's end, or options

    def one_line(self, *command, words=(), python=sys.executable, path=""):
        """A refusal: one line and exit code 2."""
        done = subprocess.run([python, *map(str, command)], capture_output=True, text=True,
                              cwd=self.folder, env=dict(self.ENVIRONMENT, PYTHONPATH=path))
        self.assertEqual((done.returncode, done.stdout), (2, ""), done.stderr)
        self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)
        for word in words:
            self.assertIn(word, done.stderr)

    def test_results_that_are_none(self):
        (self.folder / "list.json").write_text("[]")
        (self.folder / "other.json").write_text('{"cases": 5}')
        for file, says in (("none.json", "No such file"), ("list.json", "no JSON object"),
                           ("other.json", "it lacks 'cases'")):
            self.one_line(SCRIPTS / "stability.py", "--rows", file, "-o", "out",
                          words=("stability: ", file, says))
        self.assertFalse((self.folder / "out").exists())

    def test_a_program_that_is_another(self):
        self.one_line(SCRIPTS / "stability.py", "--program", "/bin/true", "-o", "out",
                      words=("stability: /bin/true", "no JSON"))
        self.one_line(SCRIPTS / "visibility_images.py", "--program", "/bin/true", "-o", "out",
                      "--runs", "out", python=PYTHON,
                      words=("visibility_images.py: ", "true info: no JSON"))

    def test_cells_that_are_none_cannot_be_compared(self):
        cells = self.folder / "results/cells"
        cells.mkdir(parents=True)
        (cells / "a.json").write_text("{")
        self.one_line(SCRIPTS / "workflow/compare_cells.py", "results", "results",
                      words=("results/cells/a.json", "no JSON"))

    def test_a_python_without_matplotlib(self):
        (self.folder / "matplotlib.py").write_text("raise ImportError('none here')\n")
        (self.folder / "results/cells").mkdir(parents=True)
        (self.folder / "results/cells/a.json").write_text(json.dumps(
            {"error": {"nrmse": 0.1}, "probes": {"stored": 8}, "cell": {
                "id": "a", "study": "mine", "command": "evaluate", "options": {},
                "axes": {"scene": "room", "probes": "8", "layout": "grid"}}}))
        for script, *options in (("figures.py", "results"), ("tuning_figure.py", "results"),
                                 ("precision.py", "--rows", "results/cells/a.json"),
                                 ("visibility_images.py", "--program", "/bin/true", "-o", "out")):
            self.one_line(SCRIPTS / script, *options, path=str(self.folder),
                          words=("none here", "/usr/bin/python3", "python3-matplotlib"))


CASES = {
    "passed": '<testcase name="a" status="run"/>',
    "failed": '<testcase name="b" status="fail"><failure message=""/></testcase>',
    "skipped": '<testcase name="c" status="notrun">'
               '<skipped message="SKIP_REGULAR_EXPRESSION_MATCHED"/></testcase>',
    "disabled": '<testcase name="d" status="disabled"/>',
    "missing": '<testcase name="e" status="notrun">'
               '<skipped message="Unable to find executable"/></testcase>',
}


class CountTests(unittest.TestCase):
    def count(self, *cases):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "tests.xml"
            path.write_text("<testsuite>%s</testsuite>" % "".join(CASES[c] for c in cases))
            return subprocess.run([sys.executable, SCRIPTS / "count_tests.py", path],
                                  capture_output=True, text=True)

    def test_a_test_that_could_not_run_has_failed(self):
        self.assertEqual(self.count("passed", "missing").stdout, "1 1 0\n")

    def test_skipped_and_disabled_are_not_passed(self):
        self.assertEqual(self.count("passed", "failed", "skipped", "disabled").stdout, "1 1 2\n")

    def test_no_test_at_all_is_an_error(self):
        self.assertEqual(self.count().returncode, 1)


def debian_12():
    try:
        text = pathlib.Path("/etc/os-release").read_text()
    except OSError:
        return False
    return "\nID=debian\n" in text and 'VERSION_ID="12"' in text


class Setup(unittest.TestCase):
    def setup_without_packages(self, *options):
        """scripts/setup --dry-run where dpkg-query knows no package."""
        with tempfile.TemporaryDirectory() as folder:
            stub = pathlib.Path(folder) / "dpkg-query"
            stub.write_text("#!/bin/sh\nexit 1\n")
            stub.chmod(0o755)
            path = "%s:%s" % (folder, os.environ["PATH"])
            return subprocess.run([SCRIPTS / "setup", "--dry-run", *options], capture_output=True,
                                  text=True, env=dict(os.environ, PATH=path))

    @unittest.skipUnless(debian_12(), "only Debian 12 takes packages from backports")
    def test_fresh_machine_gets_mesa_from_backports_first(self):
        result = self.setup_without_packages("--tests")
        self.assertEqual(result.returncode, 0, result.stderr)
        installs = [l for l in result.stderr.splitlines() if " install " in l and "apt-get" in l]
        self.assertIn("-t bookworm-backports install mesa-vulkan-drivers", installs[0])
        for package in ("cmake", "libembree-dev", "libgtest-dev"):
            self.assertIn(" %s" % package, installs[1])

    @unittest.skipUnless(debian_12(), "only Debian 12 takes packages from backports")
    def test_no_backports_refuses_them_and_says_what_is_lost(self):
        result = self.setup_without_packages("--no-backports")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertNotIn("-t bookworm-backports", result.stderr)
        self.assertIn("no ray query", result.stderr)

    def test_unknown_option_is_a_usage_error(self):
        for script in ("setup", "test"):
            result = subprocess.run([SCRIPTS / script, "--bogus"], capture_output=True, text=True)
            self.assertEqual(result.returncode, 2)
            self.assertIn("--bogus", result.stderr)


TINY_STUDY = """
receivers = 64
rel_error = 0.1
[[bench]]
name = "tiny"
scene = "scenes/pillar_hall/scene.toml"
probes = 16
rays = 16
updates = 2
[[ablation]]
name = "presets"
probes = 16
rays = 32
updates = 2
scenes = ["scenes/missing/scene.toml", "scenes/cornell/scene.toml"]
"""

# A program that benches once, then is interrupted.
STUB = """#!/bin/sh
test "$1" = bench || exit 130
echo '{"stages": {"update": {"median_ms": 2, "p5_ms": 1, "p95_ms": 3}}, "baselines": {},'
echo '"ratios": {"trace_vs_bare": 0.5}, "stage_sum_share": 1, "rays_per_s": {"trace": 3e6},'
echo '"frame_ms": 4, "memory": {"atlas_per_probe": 1536}, "updates": 2, "probes": 16, "rays": 16,'
echo '"scene": "hall/scene", "sweep": null, "provenance": {"device": "d", "tracer": "t", "seed": 7,'
echo '"version": "v1"}}'
"""


class Pipeline(CliTest):
    def pipeline(self, *options, program=PROGRAM):
        return subprocess.run(
            [sys.executable, "-B", SCRIPTS / "pipeline.py", "--program", program, "--study",
             self.folder / "study.toml", "--results", self.folder / "runs" / "pipeline", *options],
            cwd=self.folder, capture_output=True, text=True, timeout=300)

    def setUp(self):
        super().setUp()
        (self.folder / "study.toml").write_text(TINY_STUDY)
        self.results = self.folder / "runs" / "pipeline"

    def test_a_failed_run_leaves_the_others_and_is_named(self):
        result = self.pipeline()
        self.assertEqual(result.returncode, 1, result.stderr)
        self.assertIn("presets_missing: probelab: scenes/missing/scene.toml", result.stderr)
        self.assertEqual(result.stdout.splitlines()[-1], str(self.results / "pipeline.md"))
        text = (self.results / "pipeline.md").read_text()
        self.assertTrue(result.stdout.startswith(text))
        self.assertIn("1 of 3 runs are missing", text)
        files = {p.name: p for p in self.results.iterdir()}
        self.assertEqual(set(files), {"pipeline.md", "bench_tiny.json", "presets_cornell.json"})
        self.assertLess(files["presets_cornell.json"].stat().st_size, 60000)
        presets = json.loads(files["presets_cornell.json"].read_text())
        self.assertEqual(presets["provenance"]["seed"], 1)
        by_name = {line.split("|")[1].strip(): [c.strip() for c in line.split("|")[2:-1]]
                   for line in text.splitlines() if line.startswith("|")}
        rows = {row["row"]: row for row in presets["ablation"]}
        for name in ("classic", "gdc2019", "majercik2021", "probelab"):
            of, cells = rows[name], by_name[name]
            self.assertAlmostEqual(float(cells[0]) / of["error"]["nrmse"], 1, delta=0.005)
            self.assertEqual(float(cells[3]), of["memory"]["atlas_per_probe"])
            self.assertAlmostEqual(float(cells[4]) / of["ratios"]["update_ms"], 1, delta=0.005)
        self.assertEqual(by_name["rtxgi"][4], "1.00")
        # What is there is not run again.
        before = {p: p.stat().st_mtime_ns for p in self.results.glob("*.json")}
        again = self.pipeline("--resume")
        self.assertEqual((self.results / "pipeline.md").read_text(), text, again.stderr)
        self.assertEqual({p: p.stat().st_mtime_ns for p in self.results.glob("*.json")}, before)

    def test_an_interrupt_leaves_what_is_done(self):
        stub = self.folder / "stub"
        stub.write_text(STUB)
        stub.chmod(0o755)
        result = self.pipeline(program=stub)
        self.assertEqual(result.returncode, 130, result.stderr)
        self.assertIn("interrupted; finished runs are kept", result.stderr)
        text = (self.results / "pipeline.md").read_text()
        self.assertIn("**Incomplete (interrupted): 2 of 3 runs are missing.**", text)
        self.assertIn("- presets_cornell: not run", text)
        self.assertRegex(text, r"\| update, ms +\| +2\.00 \| +1\.00 \| +3\.00 \|")
        self.assertIn("N = 16 probes, 16 rays. Device d, tracer t, seed 7, version v1. `probelab "
                      "bench scenes/pillar_hall/scene.toml --probes 16 --rays 16 --updates 2`",
                      text)
        self.assertTrue((self.results / "bench_tiny.json").exists())

    def test_a_study_that_lacks_a_key_is_a_usage_error(self):
        (self.folder / "study.toml").write_text(TINY_STUDY.replace("rel_error", "error"))
        result = self.pipeline()
        self.assertEqual(result.returncode, 2)
        self.assertIn("rel_error", result.stderr.splitlines()[-1])
        self.assertFalse(self.results.exists())


def ablation_row(name, nrmse, factor, update, same=False):
    return {"row": name, "error": {"nrmse": nrmse}, "same_estimates": same, "rays_per_probe": 32,
            "memory": {"atlas_per_probe": 1536}, "probes": {"stored": 20},
            "ratios": {"nrmse": factor, "update_ms": update, "trace_ms": 1.0,
                       "query_ns_per_point": 1.0}}


class PipelineReport(unittest.TestCase):
    def test_numbers_have_three_digits(self):
        for value, text in ((None, "-"), (0, "0"), (1.0, "1.00"), (0.99951, "1.00"),
                            (0.012345, "0.0123"), (-0.5, "-0.500"), (12345.0, "12,300"),
                            (99.96, "100"), (2.5e-7, "2.50e-07")):
            self.assertEqual(pipeline_report.number(value), text)

    def test_factors_by_scene_and_their_geometric_mean(self):
        base = ablation_row("base", 0.1, 1.0, 1.0)
        skipped = [{"row": "nothing", "why": "changes nothing here"}]
        scenes = [{"ablation": [base, ablation_row("blind", 0.2, 2.0, 0.5),
                                ablation_row("exact", 0.1, 1.0, 1.0, same=True)],
                   "ablation_skipped": skipped},
                  {"ablation": [base, ablation_row("blind", 0.8, 8.0, 0.5)],
                   "ablation_skipped": skipped + [{"row": "exact", "why": "no texture"}]}]
        (table,), caption = pipeline_report.factor_tables(["a", "b"], scenes)
        cells = [[c.strip() for c in line.split("|")[1:-1]] for line in table.splitlines()]
        # No column for probes and rays: no row changes them.
        self.assertEqual(cells[0], ["row", "a", "b", "mean", "B/probe", "update", "trace", "query"])
        self.assertEqual(cells[2][:3], ["base nrmse", "0.100", "0.100"])
        # sqrt(2 * 8) = 4
        self.assertEqual(cells[4][:4], ["blind", "2.00", "8.00", "4.00"])
        self.assertEqual(cells[4][4:], ["1536", "0.500", "1.00", "1.00"])
        self.assertEqual(cells[5][:4], ["exact", "=", "-", "1.00"])
        self.assertIn("Left out in every scene: nothing (changes nothing here).", caption)
        self.assertEqual(len({len(line) for line in table.splitlines()}), 1)


class Precision(CliTest):
    def test_rows_and_breaking_points_are_those_of_the_curves(self):
        result = self.run_json("stability", "--curves", "--case", "wall.classic")
        result["provenance"]["command"] = "probelab stability --curves --json"  # as if it were all
        (self.folder / "rows.json").write_text(json.dumps(result))
        subprocess.run([sys.executable, SCRIPTS / "precision.py", "--rows", self.folder / "rows.json",
                        "--no-figure", "-o", self.folder / "out"], check=True, capture_output=True)
        [curve] = result["curves"]
        rows = read_csv(self.folder / "out/rows.csv")
        self.assertEqual(len(rows), len(curve["points"]))
        for row, point in zip(rows, curve["points"]):  # six digits
            self.assertAlmostEqual(float(row["x"]) / point["x"], 1, delta=1e-5)
            self.assertAlmostEqual(float(row["error"]) / point["error"], 1, delta=1e-5)
        [broken] = read_csv(self.folder / "out/breaks.csv")
        self.assertEqual(float(broken["breaks_below"]), 0.5)  # no visibility: it never holds
        self.assertEqual(broken["breaks_above"], "")
        manifest = json.loads((self.folder / "out/manifest.json").read_text())
        self.assertEqual((manifest["curves"], manifest["points"]), (1, len(rows)))
        self.assertIn("1 of 1 curves", (self.folder / "out/precision.txt").read_text())


class LongRuns(CliTest):
    def long_runs(self):
        return subprocess.run([sys.executable, SCRIPTS / "long_runs.py", "--program", PROGRAM,
                               "--updates", "2000", "--scenes", "cornell", "--runs",
                               self.folder / "runs", "-o", self.folder / "out"],
                              capture_output=True, text=True)

    def test_what_was_run_is_not_run_again(self):
        first = self.long_runs()
        self.assertIn(first.returncode, (0, 3), first.stderr)
        self.assertIn("probelab stability scenes/cornell/scene.toml", first.stderr)
        cases = read_csv(self.folder / "out/cases.csv")
        self.assertEqual([c["id"] for c in cases],
                         ["long.memory", "long.drift", "long.converged", "long.stall"])
        self.assertEqual(first.returncode,
                         3 if any(c["verdict"] == "fails" for c in cases) else 0)
        self.assertEqual(len(read_csv(self.folder / "out/rows.csv")), 50)
        again = self.long_runs()
        self.assertEqual((again.returncode, again.stdout), (first.returncode, first.stdout))
        self.assertEqual(again.stderr, "")

    def test_a_damaged_kept_result_is_run_again(self):
        batch = dict.fromkeys(("updates", "mean", "distance", "nrmse", "frozen", "update_ms",
                               "slowest_ms", "rss_mib"), 1.5)
        case = {"id": "long.drift", "verdict": "holds", "expectation": "none", "measured": "0"}
        whole = {"long_run": {"noise": 1}, "batches": [batch], "cases": [case], "provenance": {},
                 "hysteresis": 0.97, "updates": 1, "probes": 1, "rays": 1, "receivers": 1}
        stub = self.folder / "stub"
        stub.write_text(f"#!/bin/sh\necho x >> {self.folder}/calls\n"
                        f"cat <<'EOF'\n{json.dumps(whole)}\nEOF\n")
        stub.chmod(0o755)
        command = [sys.executable, SCRIPTS / "long_runs.py", "--program", stub, "--scenes",
                   "cornell", "--runs", self.folder / "runs", "-o", self.folder / "out"]
        subprocess.run(command, check=True, capture_output=True)
        [kept] = (self.folder / "runs").iterdir()
        damaged = [{**whole, **change} for change in (
            {"long_run": 3}, {"batches": 3}, {"batches": [3]}, {"batches": []}, {"cases": None},
            {"batches": [{**batch, "update_ms": "x"}]}, {"batches": [{**batch, "mean": []}]},
            {"cases": [{**case, "id": []}]}, {"cases": [3]}, {"provenance": []})]
        damaged += [[], {k: v for k, v in whole.items() if k != "receivers"}]
        for i, result in enumerate(damaged):
            with self.subTest(kept=result):
                kept.write_text(json.dumps(result))
                done = subprocess.run(command, capture_output=True, text=True)
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertEqual(json.loads(kept.read_text()), whole)
                self.assertEqual((self.folder / "calls").read_text(), "x\n" * (i + 2))


# In place of clang-tidy: what it would print, and how it would end.
TIDY = {
    "ok": "exit 0",
    "warning": "echo \"$PWD/core/a.cpp:1:1: warning: odd [bugprone-odd]\"",
    "error": "echo \"$PWD/core/a.cpp:1:1: error: no such type [clang-diagnostic-error]\"; exit 1",
    "crash": "kill -SEGV $$",
    "crash in a wrapper": "exit 139",
    "fatal": "exit 255",
}


class Analyse(CliTest):
    def setUp(self):
        super().setUp()
        for name in ("scripts", "core", "bin"):
            (self.folder / name).mkdir()
        shutil.copy(SCRIPTS / "analyse", self.folder / "scripts/analyse")
        (self.folder / "core/a.cpp").write_text("")
        self.stub("cmake", "exit 0")
        self.stub("git", "echo core/a.cpp")

    def stub(self, name, text):
        path = self.folder / "bin" / name
        path.write_text(f"#!/bin/sh\n{text}\n")
        path.chmod(0o755)

    def tidy(self, *options):
        return subprocess.run(
            [self.folder / "scripts/analyse", "--only", "tidy", *options], capture_output=True,
            text=True, env=dict(os.environ, PATH=f"{self.folder}/bin:{os.environ['PATH']}"))

    def test_a_clang_tidy_that_did_not_run_is_a_finding(self):
        for name, code, says in (("ok", 0, "ok: no warning"), ("warning", 1, "1 warnings"),
                                 ("error", 1, "1 FAILED to parse"),
                                 ("crash", 1, "FAILED: clang-tidy did not run"),
                                 ("crash in a wrapper", 1, "FAILED: clang-tidy did not run"),
                                 ("fatal", 1, "FAILED: clang-tidy did not run")):
            with self.subTest(clang_tidy=name):
                self.stub("clang-tidy", TIDY[name])
                done = self.tidy()
                self.assertEqual(done.returncode, code, done.stdout + done.stderr)
                self.assertRegex(done.stdout.splitlines()[-1], f"^tidy +1 sources +{says}")

    def test_no_source_that_matches_is_a_finding(self):
        self.stub("clang-tidy", TIDY["ok"])
        done = self.tidy("--files", "nosuchfile")
        self.assertEqual(done.returncode, 1, done.stdout + done.stderr)
        self.assertIn("FAILED: none", done.stdout)
        self.assertEqual(self.tidy("--files", "a[.]cpp").returncode, 0)

    def test_what_is_no_regular_expression_is_refused_first(self):
        for pattern in ("(", "[", ""):
            done = self.tidy("--files", pattern)
            self.assertEqual((done.returncode, done.stdout), (2, ""), done.stderr)
            self.assertRegex(done.stderr, r"^analyse: --files takes a regular expression.*\n$")
        self.assertFalse((self.folder / "results").exists())


if __name__ == "__main__":
    unittest.main()
