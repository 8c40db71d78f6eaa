# SPDX-License-Identifier: GPL-3.0-or-later
"""run: studies as cells with identity by content, resumable, and what happens when cells fail."""
import csv
import fcntl
import json
import os
import pathlib
import signal
import struct
import subprocess
import time

from support import PROGRAM, SOURCE, CliTest, write_glb

STUDY = """about = "a try"
command = "evaluate"
scenes = ["room.toml"]
states = "all"
seeds = [1, 2]
[options]
count = 32
spp = 16
rays = 16
updates = 2
tracer = "embree"
[[axis]]
name = "probes"
option = "probes"
values = [1, 8]
[[axis]]
name = "layout"
[[axis.value]]
name = "grid"
[[axis.value]]
name = "jittered"
options = { strategy = "jittered" }
[size.smoke]
seeds = [1]
states = ["day"]
axes = { probes = [8] }
"""
SCENE = """gltf = "room.glb"
[[state]]
name = "day"
[[state]]
name = "night"
split = "heldout"
sky_scale = 0.5
"""
JITTERED = 'options = { strategy = "jittered" }'
TIMES = ("speed", "provenance", "layout_build_s")


class RunTest(CliTest):
    def setUp(self):
        super().setUp()
        write_glb(self.folder / "room.glb", emission=(1.0, 0.5, 0.25))
        (self.folder / "room.toml").write_text(SCENE)
        self.write(STUDY)

    def write(self, text):
        (self.folder / "study.toml").write_text(text)

    def study(self, *options):
        return self.run_json("run", "study.toml", "--cache", "cache", "--results", "out", *options)

    def run_fails(self, code, *arguments):
        """The last line on stderr."""
        result = self.run_program(*arguments)
        self.assertEqual(result.returncode, code, result.stderr)
        return result.stderr.splitlines()[-1]

    def ids(self, *options):
        return [c["id"] for c in self.study("--list", *options)["list"]]

    def cells(self, folder="out"):
        """{id: result without times} of the finished cells."""
        found = {}
        for path in (self.folder / folder / "cells").iterdir():
            self.assertEqual(path.suffix, ".json")
            result = json.loads(path.read_text())
            for name in TIMES:
                result.pop(name, None)
            result["cell"].pop("seconds")
            result["layout"].pop("build_s", None)
            result["receivers"].pop("seconds", None)
            result["receivers"].pop("from_cache", None)
            found[path.stem] = result
        return found

    def test_a_study_is_the_product_of_its_axes(self):
        cells = self.study("--list")["list"]
        self.assertEqual(len(cells), 2 * 2 * 2 * 2)
        self.assertEqual(len({c["id"] for c in cells}), len(cells))
        self.assertEqual({c["axes"]["state"] for c in cells}, {"day", "night"})
        self.assertFalse(any(c["done"] for c in cells))
        smoke = self.study("--list", "--size", "smoke")["list"]
        self.assertEqual([c["axes"]["layout"] for c in smoke], ["grid", "jittered"])
        self.assertTrue({c["id"] for c in smoke} <= {c["id"] for c in cells})
        self.assertEqual(len(self.ids("--size", "smoke", "--scale", "3")), 6)

    def test_identity_is_of_content(self):
        before = self.ids()
        self.write(STUDY.replace("a try", "another text"))
        self.assertEqual(self.ids(), before)
        self.write(STUDY.replace("rays = 16", "rays = 32"))
        self.assertFalse(set(self.ids()) & set(before))
        self.write(STUDY)
        (self.folder / "room.toml").write_text(SCENE + "# a remark\n")
        self.assertFalse(set(self.ids()) & set(before))

    def test_what_is_there_is_kept_and_the_table_has_every_cell(self):
        first = self.study("--size", "smoke")
        self.assertEqual((first["done"], first["found"], first["failed"]), (2, 0, []))
        kept = self.cells()
        again = self.study("--size", "smoke")
        self.assertEqual((again["done"], again["found"]), (0, 2))
        self.assertEqual(self.cells(), kept)
        with open(self.folder / "out/study.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual([r["layout"] for r in rows], ["grid", "jittered"])
        for row in rows:
            self.assertEqual(float(row["error.nrmse"]), kept[row["id"]]["error"]["nrmse"])
        (self.folder / "out/cells" / f"{rows[0]['id']}.json").write_text('{"cell": ')
        self.assertEqual(self.study("--size", "smoke")["done"], 1)  # a damaged cell is missing
        self.assertEqual(self.cells(), kept)

    def test_what_is_found_has_the_names_of_now(self):
        self.study("--size", "smoke")
        old = self.cells()
        self.write(STUDY.replace('name = "layout"', 'name = "where"').replace(
            'name = "grid"', 'name = "lattice"'))
        again = self.study("--size", "smoke")
        self.assertEqual((again["done"], again["found"]), (0, 2))
        found = self.cells()
        self.assertEqual([r["cell"]["axes"]["where"] for r in found.values()],
                         [{"grid": "lattice"}.get(name, name) for name in
                          (old[i]["cell"]["axes"]["layout"] for i in found)])
        for i, result in found.items():
            self.assertEqual({**result, "cell": None}, {**old[i], "cell": None})

    def test_a_cell_is_what_the_command_says(self):
        self.study("--size", "smoke")
        for cell in self.cells().values():
            strategy = "jittered" if cell["cell"]["axes"]["layout"] == "jittered" else "grid"
            alone = self.run_json("evaluate", "room.toml", "--state", "day", "--seed", 1, "--count",
                                  32, "--spp", 16, "--rays", 16, "--updates", 2, "--tracer",
                                  "embree", "--probes", 8, "--strategy", strategy, "--cache",
                                  "cache")
            self.assertEqual(cell["error"], alone["error"])

    def test_one_cell_alone(self):
        chosen = self.ids()[5]
        self.assertEqual(self.study("--cell", chosen)["done"], 1)
        self.assertEqual(list(self.cells()), [chosen])
        self.assertIn("no cell 'abc'", self.run_fails(2, "run", "study.toml", "--cell", "abc"))

    def test_a_failing_cell_stops_no_other(self):
        self.write(STUDY.replace('strategy = "jittered"', 'strategy = "jitered"'))
        error = self.run_fails(1, "run", "study.toml", "--size", "smoke", "--cache", "cache",
                               "--results", "out")
        self.assertIn("1 of 2 cells failed", error)
        self.assertIn("unknown strategy 'jitered'", error)
        self.assertEqual(len(self.cells()), 1)

    def start(self, folder):
        return subprocess.Popen([PROGRAM, "run", "study.toml", "--cache", "cache", "--results",
                                 folder, "--jobs", "2", "--quiet", "--json"], cwd=self.folder,
                                stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def wait_for_cells(self, folder, count, process):
        cells = self.folder / folder / "cells"
        while process.poll() is None:
            if cells.is_dir() and len(list(cells.glob("*.json"))) >= count:
                return
            time.sleep(0.01)

    def test_killed_and_continued_equals_one_that_two_share(self):
        process = self.start("killed")
        for done in (2, 5, 9):
            self.wait_for_cells("killed", done, process)
            process.send_signal(signal.SIGKILL)
            process.communicate()
            for path in (self.folder / "killed/cells").glob("*.json"):
                json.loads(path.read_text())  # whole
            process = self.start("killed")
        _, error = process.communicate()
        self.assertEqual(process.returncode, 0, error)
        both = [self.start("shared") for _ in range(2)]
        told = []
        for process in both:
            text, error = process.communicate()
            self.assertEqual(process.returncode, 0, error)
            told.append(json.loads(text))
        self.assertEqual(sum(t["done"] for t in told), 16)
        for t in told:
            self.assertEqual(t["done"] + t["found"], 16)
            self.assertGreater(t["done"], 0)
        left_over = [p for p in (self.folder / "killed/cells").iterdir() if p.suffix != ".json"]
        for path in left_over:
            path.unlink()
        self.assertEqual(self.cells("killed"), self.cells("shared"))
        self.assertEqual(len(self.cells("shared")), 16)

    def smoke(self):
        return subprocess.Popen([PROGRAM, "run", "study.toml", "--size", "smoke", "--cache", "cache",
                                 "--results", "out", "--jobs", "2"], cwd=self.folder, stdout=subprocess.DEVNULL,
                                stderr=subprocess.PIPE, text=True)

    def test_what_another_run_has_in_hand_is_waited_for_and_that_is_said(self):
        (self.folder / "out/logs").mkdir(parents=True)
        held = self.ids("--size", "smoke")[0]
        with open(self.folder / "out/logs" / f"{held}.txt", "w") as log:
            fcntl.flock(log, fcntl.LOCK_EX)
            process = self.smoke()
            said = ""
            while "waiting" not in said and process.poll() is None:
                said += process.stderr.read(1)
            self.assertEqual([c for c in self.cells() if c == held], [])
        _, rest = process.communicate()
        self.assertEqual(process.returncode, 0, said + rest)
        self.assertIn("for 1 cell that another run has in hand", rest)
        self.assertEqual(len(self.cells()), 2)

    def test_a_log_that_cannot_be_written_fails_its_cell_alone(self):
        first, second = self.ids("--size", "smoke")
        (self.folder / "out/logs" / f"{first}.txt").mkdir(parents=True)
        _, error = self.smoke().communicate()
        self.assertIn(f"failed: {first}", error)
        self.assertIn(f"{first}.txt: cannot be written: Is a directory", error)
        self.assertEqual(list(self.cells()), [second])

    def test_a_signal_to_one_cell_is_its_failure_alone(self):
        self.write(STUDY.replace("count = 32", "count = 20000").replace("spp = 16", "spp = 2000"))
        process = self.smoke()
        children = pathlib.Path(f"/proc/{process.pid}/task/{process.pid}/children")
        while len(found := children.read_text().split()) < 2:
            self.assertIsNone(process.poll())
            time.sleep(0.01)
        os.kill(int(found[0]), signal.SIGTERM)
        said = ""
        while "failed: " not in said and process.poll() is None:
            said = process.stderr.readline()
        self.assertRegex(said, "interrupted|ended by signal 15")  # before it handles signals
        self.assertIsNone(process.poll())  # the other one goes on
        process.send_signal(signal.SIGINT)
        process.communicate()
        self.assertEqual(process.returncode, 130)

    def test_an_interrupt_ends_it_and_leaves_nothing_half_done(self):
        process = self.start("out")
        self.wait_for_cells("out", 1, process)
        process.send_signal(signal.SIGINT)
        _, error = process.communicate()
        self.assertEqual(process.returncode, 130, error)
        self.assertIn("interrupted", error)
        self.assertTrue(self.cells())  # asserts that there is nothing but results

    def test_bad_studies_are_named(self):
        def expect(text, *parts):
            self.write(text)
            error = self.run_fails(2, "run", "study.toml", "--list")
            for part in ("study.toml", *parts):
                self.assertIn(part, error)
        expect(STUDY.replace("seeds =", "sseds ="), ":5:", "did you mean 'seeds'")
        expect(STUDY.replace("room.toml", "rom.toml"), ":3:", "'rom.toml' is not there")
        expect(STUDY.replace('"evaluate"', '"evalute"'), ":2:", "did you mean 'evaluate'")
        expect(STUDY.replace("[1, 2]", "[]"), "seeds", "not empty")
        expect(STUDY.replace("values = [1, 8]", "values = [1, 1]"), "'1' twice")
        expect(STUDY.replace("count = 32", "seed = 3"), "seeds = [...]")
        expect(STUDY.replace('states = "all"', 'states = ["dawn"]'), "none of the study's states")
        expect("about = 3", "about")
        expect("about = ", ":1:")
        self.write(STUDY)
        self.assertIn("did you mean 'smoke'", self.run_fails(2, "run", "study.toml", "--size", "smok"))
        self.write(STUDY.replace("probes = [8]", "probes = [9]"))
        self.assertIn("has no '9'", self.run_fails(2, "run", "study.toml", "--size", "smoke"))

    def test_options_that_the_command_does_not_have(self):
        def refused(text, *parts):
            self.write(text)
            error = self.run_fails(2, "run", "study.toml", "--list")
            for part in ("study.toml", *parts):
                self.assertIn(part, error)
        refused(STUDY.replace("count = 32", "cuont = 32"), "evaluate has no option 'cuont'",
                "did you mean 'count'")
        refused(STUDY.replace('strategy = "jittered"', 'strateg = "jittered"'), "'strateg'")
        refused(STUDY.replace('"evaluate"', '"bench"'), "bench has no option")
        self.write(STUDY)
        self.assertIn("the study names its seeds", self.run_fails(2, "run", "study.toml", "--seed",
                                                                  "3", "--list"))

    def test_studies_of_other_scripts_are_named(self):
        for name, script in (("overview", "overview"), ("placement_ablation", "placement"),
                             ("tuning", "tuning"), ("tuning_parallax", "tuning"),
                             ("pipeline", "pipeline")):
            path = SOURCE / f"experiments/studies/{name}.toml"
            self.assertIn(f"scripts/{script}.py runs it", self.run_fails(2, "run", path))

    def test_a_value_with_another_command(self):
        self.write(STUDY.replace('name = "grid"', 'name = "grid"\ncommand = "receivers"'))
        self.assertIn("command is 'receivers'", self.run_fails(2, "run", "study.toml", "--list"))
        other = STUDY.replace('name = "grid"', 'name = "rungs"\ncommand = "budget"')
        self.write(other.replace("probes = [8]", 'probes = [8], layout = ["rungs"]'))
        self.assertEqual(self.study("--size", "smoke")["failed"], [])
        result, = self.cells().values()
        self.assertEqual((result["cell"]["command"], result["rungs"][0]["name"]),
                         ("budget", "exact"))
        with open(self.folder / "out/study.csv", newline="") as file:
            row, = csv.DictReader(file)
        for rung in result["rungs"]:
            self.assertEqual(float(row[f"rungs.{rung['name']}.nrmse"]), rung["nrmse"])

    def test_results_that_cannot_be_written(self):
        (self.folder / "file").write_text("")
        error = self.run_fails(2, "run", "study.toml", "--size", "smoke", "--results", "file/x")
        self.assertIn("--results file/x/cells: cannot be created", error)
        if os.geteuid() == 0:
            return  # root writes anywhere
        folder = pathlib.Path(self.folder / "out")
        folder.mkdir()
        folder.chmod(0o500)
        self.assertIn("out", self.run_fails(2, "run", "study.toml", "--size", "smoke", "--results",
                                            "out"))

    def test_what_would_mislead_is_refused(self):
        def expect(text, *parts):
            self.write(text)
            error = self.run_fails(2, "run", "study.toml", "--list")
            for part in parts:
                self.assertIn(part, error)
        expect(STUDY.replace('name = "grid"', 'name = "grid"\noptions = { probes = 3 }'),
               "'probes' and 'layout' both set 'probes'")
        both = STUDY.replace('name = "grid"', 'name = "grid"\noptions = { set = ["rays=8"] }')
        expect(both.replace("[size.smoke]", '[[axis]]\nname = "more"\n[[axis.value]]\nname = "x"\n'
                            'options = { set = ["view_bias=0.1", "rays=9"] }\n[size.smoke]'),
               "'layout' and 'more' both set 'set rays'")
        expect(STUDY.replace("[1, 2]", "[1, 1]"), "seed 1 stands twice")
        expect(STUDY.replace('["room.toml"]', '["room.toml", "./room.toml"]'), "stands twice")
        expect(STUDY.replace('"all"', '["day", "nigth"]'), "'nigth'", "did you mean 'night'")
        expect(STUDY.replace(JITTERED, ""), "one and the same")
        expect(STUDY.replace("count = 32", 'dump = "/elsewhere/x.csv"'), "within the cell's own folder")
        expect(STUDY.replace("count = 32", 'dump = "../x.csv"'), "within the cell's own folder")
        expect(STUDY.replace("count = 32", "threads = 1"), "'threads' is not for options")
        expect(STUDY.replace("count = 32", 'params = ""'), "not empty")
        for axis in ("id", "seconds"):
            expect(STUDY.replace('name = "probes"', f'name = "{axis}"'), f"'{axis}' is a column")
        expect(STUDY.replace("values = [1, 8]", 'values = [1, 8]\n[[axis.value]]\nname = "x"'),
               "not both")
        for value, says in (('{ probs = [8] }', "did you mean 'probes'"), ('{ probes = [9] }', "no '9'"),
                            ('{ layout = ["grid"] }', "no axis above has the name 'layout'"),
                            ('[8]', "must be a table"), ('{ probes = 8 }', "must be a list")):
            expect(STUDY.replace(JITTERED, f"{JITTERED}\nwith = {value}"), says)
        expect(STUDY.replace("count = 32", "count = 32\nnosuch = false"), "no option 'nosuch'")
        expect(STUDY.replace("[size.smoke]", "[size.smoke]\nsed = 3"), "unknown key 'sed'")
        expect(STUDY.replace("count = 32", "count = 32\nprobes = 3"),
               "axis 'probes' sets 'probes'", "no effect")
        expect(STUDY.replace("count = 32", 'count = 32\nset = ["view_bias=0.1"]').replace(
            'option = "probes"\nvalues = [1, 8]',
            '[[axis.value]]\nname = "8"\noptions = { set = ["view_bias=0.2"] }'),
            "axis 'probes' sets 'set view_bias'", "no effect")
        expect(STUDY.replace("[1, 2]", f"{list(range(10001))}"), ":5:", "more than 10000 seeds")
        self.write(STUDY)
        self.assertIn("more than 10000 seeds",
                      self.run_fails(2, "run", "study.toml", "--scale", "2000000000"))

    def test_a_value_stands_beside_the_values_that_it_names(self):
        self.write(STUDY.replace(JITTERED, f"{JITTERED}\nwith = {{ probes = [1] }}"))
        found = {(c["axes"]["probes"], c["axes"]["layout"]) for c in self.study("--list")["list"]}
        self.assertEqual(found, {("1", "grid"), ("1", "jittered"), ("8", "grid")})
        smoke = [c["axes"]["layout"] for c in self.study("--list", "--size", "smoke")["list"]]
        self.assertEqual(smoke, ["grid"])
        self.write(STUDY.replace(JITTERED, f"{JITTERED}\nwith = {{ probes = [1] }}").replace(
            "axes = { probes = [8] }", 'axes = { probes = [8], layout = ["jittered"] }'))
        self.assertIn("no cell", self.run_fails(2, "run", "study.toml", "--size", "smoke"))

    def test_scenes_of_one_name_are_told_apart(self):
        for name in ("a", "b"):
            folder = self.folder / name / "room"
            folder.mkdir(parents=True)
            write_glb(folder / "room.glb", emission=(1.0, 0.5, 0.25 if name == "a" else 0.5))
            (folder / "scene.toml").write_text(SCENE)
        self.write(STUDY.replace('["room.toml"]', '["a/room/scene.toml", "b/room/scene.toml"]'))
        names = {c["axes"]["scene"] for c in self.study("--list")["list"]}
        self.assertEqual(names, {"a/room", "b/room"})

    def test_inputs_lie_beside_the_study_and_count_by_content(self):
        text = STUDY.replace("count = 32", 'points = "p.csv"').replace("spp = 16", "spp = 8")
        (self.folder / "deep").mkdir()
        (self.folder / "deep/study.toml").write_text(text.replace("room.toml", "../room.toml"))
        points = self.folder / "deep/p.csv"
        points.write_text("0,1,0,0,1,0\n0.5,1,0,0,1,0\n")
        words = ("run", "deep/study.toml", "--cache", "cache", "--results", "out", "--size", "smoke")
        self.assertEqual(self.run_json(*words)["done"], 2)
        self.assertEqual(self.run_json(*words)["found"], 2)
        points.write_text("0,1,0,0,1,0\n")
        self.assertEqual(self.run_json(*words)["done"], 2)

    def test_buffers_beside_a_gltf_of_probes_count(self):
        buffer = self.folder / "p.bin"
        accessor = {"bufferView": 0, "componentType": 5126, "count": 1, "type": "VEC3",
                    "min": [0, 1, 0], "max": [0, 1, 0]}
        (self.folder / "p.gltf").write_text(json.dumps({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}], "accessors": [accessor],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 0}]}],
            "bufferViews": [{"buffer": 0, "byteLength": 12}],
            "buffers": [{"uri": "p.bin", "byteLength": 12}]}))
        self.write(STUDY.replace(JITTERED, 'options = { strategy = "file", option = ["path=p.gltf"] }'))
        layouts = []
        for height in (1.0, 1.5):
            buffer.write_bytes(struct.pack("<3f", 0, height, 0))
            self.assertGreater(self.study("--size", "smoke")["done"], 0)
            self.run_ok("place", "room.toml", "--strategy", "file", "--option", "path=p.gltf",
                        "--probes", "1", "-o", f"{height}.json", "--cache", "cache")
            layouts.append(json.loads((self.folder / f"{height}.json").read_text())["probes"])
        self.assertNotEqual(*layouts)
        axes = [c["cell"]["axes"]["layout"] for c in self.cells().values()]
        self.assertEqual(sorted(axes), ["grid", "jittered", "jittered"])

    def test_every_input_of_a_list_counts_by_content(self):
        self.write("""about = "two files"
command = "tune"
scenes = ["room.toml"]
seeds = [1]
[options]
against = "rtxgi,deep/mine.toml"
output = "tuned.toml"
""")
        (self.folder / "deep").mkdir()
        mine = self.folder / "deep/mine.toml"
        mine.write_text('preset = "rtxgi"\n')
        cells = self.study("--list")["list"]
        self.assertEqual([c["axes"]["state"] for c in cells], ["train"])
        mine.write_text('preset = "rtxgi"\nview_bias = 0.2\n')
        self.assertNotEqual(self.ids(), [c["id"] for c in cells])

    def test_an_axis_may_be_called_as_a_number_of_the_result_is(self):
        self.write(STUDY.replace('name = "probes"\noption', 'name = "error.nrmse"\noption').replace(
            "probes = [8]", '"error.nrmse" = [8]'))
        self.assertEqual(self.study("--size", "smoke")["failed"], [])
        with open(self.folder / "out/study.csv", newline="") as file:
            rows = list(csv.reader(file))
        self.assertEqual(len(set(rows[0])), len(rows[0]))
        for row in rows[1:]:
            values = dict(zip(rows[0], row))
            self.assertEqual(values["error.nrmse"], "8")
            self.assertLess(float(values["result.error.nrmse"]), 8)

    def test_damaged_cells_and_lost_outputs_are_made_again(self):
        self.write(STUDY.replace("count = 32", 'count = 32\ndump = "e.csv"'))
        self.assertEqual(self.study("--size", "smoke")["done"], 2)
        for damage in ('{"cell": 5, "x": 1}', '{"cell": {"id": 3}, "x": 1}', ""):
            next((self.folder / "out/cells").glob("*.json")).write_text(damage)
            self.assertEqual(self.study("--size", "smoke")["done"], 1, damage)
        dump = next((self.folder / "out/files").rglob("e.csv"))
        dump.unlink()
        self.assertEqual(self.study("--size", "smoke")["done"], 1)
        self.assertTrue(dump.is_file())
