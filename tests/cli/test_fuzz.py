# SPDX-License-Identifier: GPL-3.0-or-later
"""scripts/fuzz adds up what libFuzzer says, goes on where it was, keeps what was found. In place of
libFuzzer a program that says what it would say."""
import csv
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

SOURCE = pathlib.Path(__file__).resolve().parents[2]
PASS = {"format": "glb", "executions": 7, "seconds": 1.5, "edges": 2, "features": 3, "found": [],
        "commit": "c"}
# Loads 3 inputs, then runs 400; the second time it finds something after 100.
FUZZER = """#!/bin/sh
echo x >> {folder}/calls
for word in "$@"; do case $word in -artifact_prefix=*) prefix=${{word#*=}};; esac; done
echo '#3\tINITED cov: 7 ft: 9' >&2
if [ "$(wc -l < {folder}/calls)" = 2 ]; then
  echo boom > "${{prefix}}crash-00"
  echo '#103\tNEW    cov: 8 ft: 11' >&2
  exit 77
fi
echo 'stat::number_of_executed_units: 403' >&2
"""


class FuzzFolder(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)
        (self.folder / "scripts").mkdir()
        for name in ("fuzz", "children.py", "whole_output.py"):
            shutil.copy(SOURCE / "scripts" / name, self.folder / "scripts" / name)
        shutil.copytree(SOURCE / "tests/fuzz/corpus/values_json",
                        self.folder / "tests/fuzz/corpus/values_json")
        (self.folder / "build").mkdir()
        program = self.folder / "build/fuzz_values_json"
        program.write_text(FUZZER.format(folder=self.folder))
        program.chmod(0o755)

    def command(self, *words):
        return [sys.executable, self.folder / "scripts/fuzz", "--no-build", "--build",
                self.folder / "build", "--format", "values_json", *words]

    def fuzz(self, *words):
        return subprocess.run(self.command(*words), capture_output=True, text=True, cwd=self.folder)

    def passes(self):
        text = (self.folder / "results/runs/fuzz/passes.jsonl").read_text()
        return [json.loads(line) for line in text.splitlines()]


class Fuzz(FuzzFolder):
    def test_a_run_that_ended_is_not_run_again(self):
        self.assertEqual(self.fuzz("--runs", "400").returncode, 0)
        self.assertEqual(self.fuzz("--runs", "400").returncode, 0)
        self.assertEqual([p["executions"] for p in self.passes()], [400])

    def test_passes_add_up_and_a_finding_stays_in_sight(self):
        done = self.fuzz("--runs", "900", "--publish", str(self.folder / "published"))
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertEqual([p["executions"] for p in self.passes()], [400, 100, 400])
        with open(self.folder / "published/rows.csv", newline="") as file:
            [row] = csv.DictReader(file)
        self.assertEqual({k: row[k] for k in ("executions", "clean", "passes", "crashes", "edges",
                                              "regressions")},
                         {"executions": "900", "clean": "400", "passes": "3", "crashes": "1",
                          "edges": "8", "regressions": "1"})
        found = self.folder / "tests/fuzz/regressions/values_json/crash-00"
        self.assertEqual(found.read_text(), "boom\n")

    def test_publishing_keeps_the_rows_of_formats_without_passes_here(self):
        self.fuzz("--runs", "400", "--publish", "published")
        manifest = self.folder / "published/manifest.json"
        manifest.write_text(manifest.read_text().replace('"commits": [', '"commits": ["elsewhere",'))
        passes = self.folder / "results/runs/fuzz/passes.jsonl"
        passes.write_text(passes.read_text().replace("values_json", "glb"))
        self.fuzz("--report", "--publish", "published")
        with open(self.folder / "published/rows.csv", newline="") as file:
            rows = {row["format"]: row["executions"] for row in csv.DictReader(file)}
        self.assertEqual(rows, {"values_json": "400", "glb": "400"})
        self.assertIn("elsewhere", json.loads(manifest.read_text())["commits"])

    def test_sigterm_ends_libfuzzer_and_keeps_its_pass(self):
        program = self.folder / "build/fuzz_values_json"
        program.write_text("#!/bin/sh\n"
                           f"echo $$ > {self.folder}/started\n"
                           "trap 'kill $!; exit 72' INT\n"
                           "echo '#3\tINITED cov: 7 ft: 9' >&2\n"
                           "echo '#33\tpulse cov: 7 ft: 9' >&2\n"
                           "sleep 60 &\n"
                           "wait\n")
        with subprocess.Popen(self.command("--runs", "400"), stdout=subprocess.DEVNULL,
                              stderr=subprocess.PIPE, text=True, cwd=self.folder) as fuzz:
            while not (self.folder / "started").exists() and fuzz.poll() is None:
                time.sleep(0.05)
            time.sleep(0.2)
            fuzz.terminate()
            errors = fuzz.communicate(timeout=30)[1]
        self.assertEqual(fuzz.returncode, 130, errors)
        self.assertTrue(errors.endswith("fuzz: interrupted; the passes so far are kept\n"), errors)
        self.assertEqual([p["executions"] for p in self.passes()], [30])
        started = int((self.folder / "started").read_text())
        self.assertRaises(ProcessLookupError, os.kill, started, 0)

    def test_a_line_that_a_kill_cut_is_left_out(self):
        self.fuzz("--runs", "400")
        with open(self.folder / "results/runs/fuzz/passes.jsonl", "a") as file:
            file.write('{"format": "values_json", "execu')
        done = self.fuzz("--report")
        self.assertRegex(done.stdout, r"values_json +400 +400 +1 ")
        self.assertEqual(self.fuzz("--runs", "450").returncode, 1)  # the second pass finds
        self.assertRegex(self.fuzz("--report").stdout, r"values_json +500 +0 +2 ")

    def test_most_passes_have_short_inputs(self):
        os.remove(self.folder / "build/fuzz_values_json")
        program = self.folder / "build/fuzz_values_json"
        program.write_text("#!/bin/sh\n"
                           "echo '#3\tINITED cov: 7 ft: 9' >&2\n"
                           "echo 'stat::number_of_executed_units: 13' >&2\n")
        program.chmod(0o755)
        self.fuzz("--runs", "60")
        self.assertEqual([p["longest_input"] for p in self.passes()],
                         [256, 256, 256, 1024, 256, 256])

    def test_a_time_out_of_a_process_that_was_stopped_is_none(self):
        program = self.folder / "build/fuzz_values_json"
        program.write_text(
            "#!/bin/sh\n"
            "for word in \"$@\"; do case $word in -artifact_prefix=*) prefix=${word#*=};; esac; done\n"
            "[ -z \"$prefix\" ] && { grep -q slow \"$2\"; exit $((70 * !$?)); }\n"
            "echo '#3\tINITED cov: 7 ft: 9' >&2\n"
            "echo '#23\tNEW    cov: 7 ft: 9' >&2\n"
            "echo quick > ${prefix}timeout-11\n"
            "[ -e again ] && echo slow > ${prefix}timeout-22\n"
            "touch again\n"
            "exit 70\n")
        done = self.fuzz("--runs", "40")
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertEqual([(p["slept"], p["found"]) for p in self.passes()],
                         [(1, []), (1, ["timeout"])])
        found = self.folder / "tests/fuzz/regressions/values_json"
        self.assertEqual([p.name for p in found.iterdir()], ["timeout-22"])

    def test_a_program_that_ends_without_an_input_is_an_error(self):
        (self.folder / "build/fuzz_values_json").write_text("#!/bin/sh\nexit 5\n")
        done = self.fuzz("--runs", "10")
        self.assertEqual(done.returncode, 1)
        self.assertIn("ended with 5 after 0 executions and kept no input", done.stderr)

    def test_a_format_that_fails_ends_the_others_which_keep_their_passes(self):
        started = self.folder / "started"
        (self.folder / "build/fuzz_values_json").write_text(
            f"#!/bin/sh\nwhile [ ! -e {started} ]; do sleep 0.05; done\nsleep 0.2\nexit 5\n")
        other = self.folder / "build/fuzz_glb"
        other.write_text("#!/bin/sh\n"
                         "trap 'kill $!; exit 72' INT\n"
                         "echo '#3\tINITED cov: 7 ft: 9' >&2\n"
                         "echo '#33\tpulse cov: 7 ft: 9' >&2\n"
                         "sleep 60 &\n"
                         f"touch {started}\n"
                         "wait\n")
        other.chmod(0o755)
        (self.folder / "tests/fuzz/corpus/glb").mkdir()
        begun = time.monotonic()
        done = self.fuzz("--format", "glb", "--jobs", "2", "--runs", "30")
        self.assertLess(time.monotonic() - begun, 30)
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn("fuzz_values_json ended with 5", done.stderr)
        self.assertNotIn("Traceback", done.stderr)
        self.assertEqual({p["format"]: p["executions"] for p in self.passes()},
                         {"values_json": 0, "glb": 30})


class Refusals(FuzzFolder):
    def refused(self, *words, says, last=False, **options):
        """Exit code 2 and one line, or, after a usage text, a last one."""
        done = subprocess.run(self.command(*words), stderr=subprocess.PIPE, text=True,
                              cwd=self.folder, **{"stdout": subprocess.DEVNULL, **options})
        self.assertEqual(done.returncode, 2, done.stderr)
        lines = done.stderr.splitlines()
        self.assertTrue(last or len(lines) == 1, done.stderr)
        self.assertRegex(lines[-1], "^fuzz: .*" + says)

    def test_options_that_cannot_be_meant(self):
        for jobs in ("0", "-1"):
            self.refused("--jobs", jobs, says="--jobs: must be a positive number", last=True)
        self.refused("--report", "--publish", "", says="--publish: is empty", last=True)
        self.assertFalse((self.folder / "results").exists())

    def test_a_folder_that_cannot_be(self):
        for name in ("/dev/null", "/dev/full/x"):
            self.refused("--report", "--publish", name, says=f"{name}.*: Not a directory")

    def test_nothing_can_be_printed(self):
        for unbuffered in ("", "1"):
            with open("/dev/full", "w") as full:
                self.refused("--report", says="stdout: No space left on device", stdout=full,
                             env=dict(os.environ, PYTHONUNBUFFERED=unbuffered))

    def test_a_build_that_fails(self):
        cmake = self.folder / "cmake"
        cmake.write_text("#!/bin/sh\nexit 7\n")
        cmake.chmod(0o755)
        words = [w for w in self.command() if w != "--no-build"]
        done = subprocess.run(words, capture_output=True, text=True, cwd=self.folder,
                              env=dict(os.environ, PATH=f"{self.folder}:{os.environ['PATH']}"))
        self.assertEqual((done.returncode, len(done.stderr.splitlines())), (2, 1), done.stderr)
        self.assertRegex(done.stderr, r"^fuzz: cmake --preset fuzz .*: failed with 7\n$")

    def test_a_program_that_cannot_be_run(self):
        program = self.folder / "build/fuzz_values_json"
        program.write_text("no program\n")
        self.refused(says="fuzz_values_json: Exec format error")
        program.chmod(0o644)
        self.refused(says="fuzz_values_json: not executable", last=True)

    def test_passes_that_are_a_folder(self):
        (self.folder / "results/runs/fuzz/passes.jsonl").mkdir(parents=True)
        self.refused("--report", says="passes.jsonl: Is a directory")

    def test_lines_that_are_no_passes_are_left_out(self):
        path = self.folder / "results/runs/fuzz/passes.jsonl"
        path.parent.mkdir(parents=True)
        bad = ["3", "[]", '{"format": "glb"}', "[" * 100000,
               *(json.dumps({**PASS, **change}) for change in (
                   {"seconds": "x"}, {"executions": None}, {"executions": float("nan")},
                   {"found": ["flood"]}, {"found": [[]]}, {"commit": 5}))]
        path.write_bytes(b"\xff\xfe{}\n" + "\n".join([*bad, json.dumps(PASS)]).encode() + b"\n")
        done = self.fuzz("--report", "--format", "glb", "--publish", "published")
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertRegex(done.stdout, r"(?m)^glb +7 +7 +1 ")

    def test_damaged_published_files_stay_as_they_are(self):
        passes = self.folder / "results/runs/fuzz/passes.jsonl"
        passes.parent.mkdir(parents=True)
        passes.write_text("".join(json.dumps({**PASS, "format": name}) + "\n"
                                  for name in ("exr", "glb")))
        self.assertEqual(self.fuzz("--report", "--publish", "published").returncode, 0)
        passes.write_text(json.dumps(PASS) + "\n")
        rows, manifest = (self.folder / "published" / n for n in ("rows.csv", "manifest.json"))
        whole = {path: path.read_bytes() for path in (rows, manifest)}
        head, *lines = whole[rows].splitlines(keepends=True)
        damages = {rows: [b"", b"\xff", head, head + lines[0], whole[rows][:-1],
                          whole[rows].replace(b",7,", b",x,"), whole[rows].replace(b",7,", b",")],
                   manifest: [b"", b"\xff", b"[]", b"{}", b'{"commits": "c", "longest_input": {}}',
                              b'{"commits": [], "longest_input": {}}', whole[manifest][:-9]]}
        for path, texts in damages.items():
            for text in texts:
                with self.subTest(file=path.name, text=text):
                    path.write_bytes(text)
                    self.refused("--report", "--publish", "published", says="published.*: ")
                    there = {p: p.read_bytes() for p in rows.parent.iterdir()}
                    self.assertEqual(there, {**whole, path: text})
            path.write_bytes(whole[path])
        manifest.unlink()  # a file that is absent is none that is damaged
        self.assertEqual(self.fuzz("--report", "--publish", "published").returncode, 0)
        self.assertEqual(rows.read_bytes(), whole[rows])
        self.assertEqual(manifest.read_bytes(), whole[manifest])

    def test_the_published_rows_are_not_taken_for_damaged(self):
        shutil.copytree(SOURCE / "results/published/fuzz", self.folder / "published")
        rows = (self.folder / "published/rows.csv").read_bytes()
        done = self.fuzz("--report", "--publish", "published")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual((self.folder / "published/rows.csv").read_bytes(), rows)


class Corpus(unittest.TestCase):
    def test_presets_are_those_of_now(self):
        # One that lacks a parameter is refused whole, and what is behind the refusal never fuzzed.
        for preset in (SOURCE / "core/ddgi/presets").glob("*.toml"):
            seed = SOURCE / "tests/fuzz/corpus/params_toml" / preset.name
            self.assertEqual(seed.read_text(), preset.read_text(), "run tests/fuzz/make_corpus.py")


if __name__ == "__main__":
    unittest.main()
