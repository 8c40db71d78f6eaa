# SPDX-License-Identifier: GPL-3.0-or-later
"""probelab stability: names of cases, the JSON's fields, a user's own scene."""
import json
import resource
import signal
import subprocess
import sys
import unittest

from support import CliTest, PROGRAM, SOURCE, write_glb

FIELDS = {"id", "case", "tracer", "format", "expectation", "measured", "verdict"}


class Suite(CliTest):
    def test_a_case_is_a_row_with_the_fixed_names(self):
        result = self.run_json("stability", "--case", "query.outside/rtxgi")
        [row] = result["cases"]
        self.assertLessEqual(FIELDS, set(row))
        self.assertEqual((row["id"], row["format"], row["verdict"]),
                         ("query.outside/rtxgi", "rtxgi", "holds"))
        self.assertEqual(self.files(), [])

    def test_the_table_ends_with_its_counts(self):
        text = self.run_ok("stability", "--case", "files.no_shell").stdout
        self.assertRegex(text, r"(?m)^files\.no_shell +holds ")
        self.assertRegex(text, r"(?m)^1 hold, 0 limits, 0 fail, ")

    def test_one_tracer_leaves_the_others_rows_out(self):
        rows = self.run_json("stability", "--case", "lighting.none", "--tracer", "embree")["cases"]
        self.assertEqual({r["tracer"] for r in rows}, {"embree", "reference"})

    def test_what_was_finished_before_a_signal_is_kept(self):
        process = subprocess.Popen([PROGRAM, "stability", "--tracer", "embree", "--json"],
                                   cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                   text=True)
        while not process.stderr.readline().startswith("stability:"):  # after 10 s
            self.assertIsNone(process.poll())
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 130, errors)
        result = json.loads(output)
        self.assertTrue(result["interrupted"])
        self.assertGreater(len(result["cases"]), 10)
        self.assertLess(len(result["cases"]), 150)
        self.assertEqual({r["verdict"] for r in result["cases"]} - {"holds", "limit"}, set())

    def test_an_unknown_name_is_refused_with_the_nearest(self):
        self.assert_refused("stability", "--case", "query.outsid3",
                            words=("no case is called 'query.outsid3'", "'query.outside'"))
        self.assert_refused("stability", "--case", "nonsense", words=("groups are: geometry, ",))

    def test_the_table_fits_100_columns(self):
        text = self.run_ok("stability", "--case", "files.node_cycle").stdout
        self.assertLessEqual(max(map(len, text.splitlines())), 100)
        self.assertRegex(text, r"s of CPU$")

    def test_an_empty_scene_is_refused(self):
        self.assert_refused("stability", "", words=("SCENE is empty",))

    def test_options_of_a_scene_need_one(self):
        self.assert_refused("stability", "--probes", 27, words=("--probes needs a SCENE",))
        self.assert_refused("stability", "--case", "geometry.shift_limit/embree",
                            "--tracer", "rayquery", words=("no row of the tracer rayquery",))


class OwnScene(CliTest):
    def test_what_must_not_matter_does_not(self):
        result = self.run_json("stability", SOURCE / "scenes/cornell/scene.toml", "--probes", 27,
                               "--count", 128, "--rel-error", 0.2, "--rays", 32, "--updates", 4,
                               "--tracer", "embree")
        rows = {r["id"]: r for r in result["cases"]}
        for name in ("repeat", "threads", "first_update"):
            self.assertEqual(rows["scene." + name]["verdict"], "holds", rows["scene." + name])
        for name in ("translate", "scale_up", "scale_down"):
            self.assertLess(abs(rows["scene." + name]["change"]), 0.01 * result["nrmse"])
        self.assertIn("can be trusted", result["trusted"])
        # Which receivers are looked at counts too: another seed's nrmse differs by less.
        self.assertGreaterEqual(result["spread"], result["sampling"])
        other = self.run_json("stability", SOURCE / "scenes/cornell/scene.toml", "--probes", 27,
                              "--count", 128, "--rel-error", 0.2, "--rays", 32, "--updates", 4,
                              "--tracer", "embree", "--seed", 2, "--case", "scene.seeds")
        self.assertLess(abs(other["nrmse"] - result["nrmse"]),
                        2 * max(other["spread"], result["spread"]))

    def test_an_error_below_the_truths_noise_has_no_digits(self):
        result = self.run_json("stability", SOURCE / "scenes/furnace/scene.toml", "--probes", 8,
                               "--count", 64, "--rel-error", 0.2, "--rays", 64, "--updates", 4,
                               "--tracer", "embree", "--case", "scene.translate")
        self.assertEqual(result["digits"], 0)
        [row] = result["cases"]  # compares the fields, not a score that is clamped to 0
        self.assertIn("E, rms, +", row["measured"])
        self.assertGreater(row["change"], 0)
        self.assertIn("truth's own noise", result["trusted"])


class Curves(CliTest):
    def test_a_curve_has_its_points_bound_and_breaking_points(self):
        result = self.run_json("stability", "--curves", "--case", "contrast.rgb10a2_gamma5")
        [curve] = result["curves"]
        self.assertEqual((curve["id"], curve["tracer"]), ("contrast.rgb10a2_gamma5", "embree"))
        self.assertEqual(len(curve["points"]), 25)
        broken = [p["x"] for p in curve["points"] if p["error"] > curve["bound"]]
        self.assertTrue(all(x < curve["breaks_below"] or x > curve["breaks_above"]
                            for x in broken), curve)
        self.assertTrue(1 <= curve["breaks_above"] <= 1.1, curve)
        self.assertEqual(self.files(), [])

    def test_the_table_has_a_line_a_curve(self):
        text = self.run_ok("stability", "--curves", "--case", "wall.reference").stdout
        self.assertRegex(text, r"(?m)^wall\.reference +0\.01 +- +- +0$")

    def test_what_does_not_fit_is_refused(self):
        self.assert_refused("stability", "--curves", "--case", "wall.clasic",
                            words=("no curve is called 'wall.clasic'", "'wall.classic'"))
        self.assert_refused("stability", "--curves", "--case", "wall.rtxgi_rayquery",
                            "--tracer", "embree", words=("no curve of the tracer embree",))
        self.assert_refused("stability", SOURCE / "scenes/cornell/scene.toml", "--curves",
                            words=("--curves", "SCENE"))


class LongRun(CliTest):
    def test_a_run_is_judged_and_its_parts_are_told(self):
        result = self.run_json("stability", SOURCE / "scenes/cornell/scene.toml", "--params",
                               "probelab", "--probes", 8, "--rays", 8, "--count", 64,
                               "--rel-error", 0.3, "--tracer", "embree", "--long-run", 2000)
        self.assertEqual(result["updates"], 2000)  # 50 parts of 40 samples
        self.assertEqual([b["updates"] for b in result["batches"]], list(range(40, 2001, 40)))
        self.assertEqual([c["id"] for c in result["cases"]],
                         ["long.memory", "long.drift", "long.converged", "long.stall"])
        self.assertGreater(result["batches"][-1]["rss_mib"], 20)
        self.assertGreater(result["long_run"]["noise"], result["long_run"]["expected"])

    def test_it_needs_a_scene_and_enough_updates(self):
        self.assert_refused("stability", "--long-run", 5000, words=("--long-run needs a SCENE",))
        self.assert_refused("stability", SOURCE / "scenes/cornell/scene.toml", "--long-run", 1999,
                            words=("--long-run", "2000"))
        self.assert_refused("stability", SOURCE / "scenes/cornell/scene.toml", "--long-run", 2100,
                            words=("--long-run 2100", "ask for 4000"))
        self.assert_refused("stability", SOURCE / "scenes/cornell/scene.toml", "--long-run", 2000,
                            "--updates", 5, words=("--long-run excludes --updates",))

    def test_it_needs_light(self):
        write_glb(self.folder / "room.glb")  # nothing in it shines
        done = self.run_program("stability", "room.glb", "--probes", 8, "--rays", 8, "--count", 64,
                                "--rel-error", 0.3, "--tracer", "embree", "--long-run", 2000,
                                "--quiet")
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        self.assertRegex(done.stderr, r"^probelab: room\.glb: no light arrives .+ --state\n$")


class Scripts(CliTest):
    def test_rows_that_are_none_leave_what_was_published(self):
        (self.folder / "rows.csv").write_text("published\n")
        for name, text in (("none.json", None), ("empty.json", ""), ("other.json", "{}"),
                           ("part.json", '{"curves": [{"id": "wall.classic"}]}')):
            if text is not None:
                (self.folder / name).write_text(text)
            done = subprocess.run(
                [sys.executable, "-B", SOURCE / "scripts/precision.py", "--no-figure", "--rows",
                 self.folder / name, "-o", self.folder], capture_output=True, text=True)
            self.assertEqual(done.returncode, 2, name)
            self.assertRegex(done.stderr, r"^precision: .+\n$")
            self.assertEqual((self.folder / "rows.csv").read_text(), "published\n")
            self.assertFalse((self.folder / "manifest.json").exists())


    def test_what_is_not_the_whole_run_is_refused(self):
        case = {"id": "files.missing", "verdict": "holds"}
        curve = {"id": "wall.classic", "curve": "c", "tracer": "embree", "axis": "x",
                 "measure": "m", "bound": 1, "easy": 0, "breaks_below": None, "breaks_above": None,
                 "points": [{"x": 1, "error": 0}]}
        # Members of the one and of the other, so that the command line alone tells them apart.
        whole = {"cases": [case], "curves": [curve], "interrupted": False, "seconds": 1.5,
                 "device": "d", "version": "v"}
        suite, curves = "probelab stability --json", "probelab stability --curves --json"
        for script, command, parts in (
                ("stability", suite, (f"{suite} --case files", f"{suite} --tracer=embree",
                                      "probelab stability 'my room.toml' --json", curves)),
                ("precision", curves, (f"{curves} --case wall", suite,
                                       f"{curves} --tracer embree"))):
            for result in (*({"provenance": {"command": part}} for part in parts),
                           {"provenance": {}}, {"provenance": {"command": command}, "cases": [],
                                                "curves": []},
                           {"provenance": {"command": command}, "interrupted": None},
                           {"provenance": {"command": command}, "interrupted": True}):
                with self.subTest(script=script, result=result):
                    done = self.publish(script, {**whole, **result})
                    self.assertEqual(done.returncode, 2, done.stderr)
                    self.assertRegex(done.stderr, rf"^{script}: .*rows\.json: .+\n$")
                    self.assertFalse((self.folder / "out").exists())
            harmless = f"{command} --quiet --threads 1 --cache=elsewhere --seed 2"
            done = self.publish(script, {**whole, "provenance": {"command": harmless}})
            self.assertEqual(done.returncode, 0, done.stderr)
            (self.folder / "out").rename(self.folder / f"of_{script}")

    def publish(self, script, result):
        (self.folder / "rows.json").write_text(json.dumps(result))
        return subprocess.run(
            [sys.executable, "-B", SOURCE / f"scripts/{script}.py", "--rows",
             self.folder / "rows.json", "-o", self.folder / "out",
             *["--no-figure"][:script == "precision"]], capture_output=True, text=True)

    def test_what_they_run_themselves_must_be_whole_too(self):
        stub = self.folder / "stub"
        stub.write_text("#!/bin/sh\necho '{\"cases\": [{\"verdict\": \"holds\"}], \"seconds\": 1,"
                        "\"interrupted\": true, \"provenance\": {\"command\": \"probelab stability "
                        "--json\"}}'\n")
        stub.chmod(0o755)
        done = subprocess.run([sys.executable, "-B", SOURCE / "scripts/stability.py", "--program",
                               stub, "-o", self.folder / "out"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertRegex(done.stderr, r"^stability: .*stub: interrupted.*\n$")
        self.assertFalse((self.folder / "out").exists())

    def test_a_full_disk_is_named(self):
        def no_space():  # as a full disk, this fails the write and names no file
            resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))

        (self.folder / "rows.json").write_text(json.dumps(
            {"cases": [{"id": "a", "verdict": "holds"}], "interrupted": False, "seconds": 1,
             "provenance": {"command": "probelab stability --json"}}))
        done = subprocess.run(
            [sys.executable, "-B", SOURCE / "scripts/stability.py", "--rows",
             self.folder / "rows.json", "-o", self.folder / "out"], capture_output=True, text=True,
            preexec_fn=no_space)
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertRegex(done.stderr, rf"^stability: {self.folder}/out: File too large\n$")
        self.assertEqual(list((self.folder / "out").iterdir()), [])


if __name__ == "__main__":
    unittest.main()
