# SPDX-License-Identifier: GPL-3.0-or-later
"""place: layouts as files, their GLB, the smallest budget for an error; --layout of other commands."""
import json
import math
import re
import struct
import unittest

from support import CliTest, write_glb

# Nothing here is about accuracy.
FIELD = ("--rays", 32, "--updates", 4, "--tracer", "embree")
TRUTH = ("--count", 64, "--spp", 32, "--cache", "cache")

SCENE = """gltf = "room.glb"
[[light]]
name = "lamp"
type = "point"
intensity = 5.0
position = [0.5, 2.0, 0.5]
[[state]]
name = "day"
[[state]]
name = "dusk"
lights = { lamp = { intensity = 1.0, position = [-1.0, 2.0, 0.5] } }
[[state]]
name = "night"
split = "heldout"
lights = { lamp = { intensity = 0.5 } }
"""


class PlaceTest(CliTest):
    def setUp(self):
        super().setUp()
        write_glb(self.folder / "room.glb", emission=(1.0, 0.5, 0.25))
        (self.folder / "room.toml").write_text(SCENE)

    def place(self, *options, output="layout.json", probes=27):
        return self.run_json("place", "room.toml", "--probes", probes, "-o", output, "--cache",
                             "cache", *options)

    def layout(self, name="layout.json"):
        """A layout file without what differs from run to run."""
        document = json.loads((self.folder / name).read_text())
        del document["build_s"]
        return document

    def positions(self, name="layout.json"):
        return [tuple(p["position"]) for p in self.layout(name)["probes"]]

    def evaluate(self, *options):
        return self.run_json("evaluate", "room.toml", *FIELD, *TRUTH, *options)

    def glb(self, name):
        """The JSON of a GLB, after a check of its lengths."""
        data = (self.folder / name).read_bytes()
        magic, version, total, length, kind = struct.unpack_from("<4sIII4s", data)
        self.assertEqual((magic, version, total, kind), (b"glTF", 2, len(data), b"JSON"))
        binary, kind = struct.unpack_from("<I4s", data, 20 + length)
        self.assertEqual((kind, 28 + length + binary), (b"BIN\0", len(data)))
        document = json.loads(data[20:20 + length])
        self.assertEqual(document["buffers"], [{"byteLength": binary}])
        return document


class Place(PlaceTest):
    def test_what_a_single_probe_has_no_number_for(self):
        self.assertIsNone(self.place(probes=1)["report"]["spacing_m"])
        self.assertEqual(self.place(probes=2)["report"]["spacing_m"]["min"],
                         self.place(probes=2)["report"]["spacing_m"]["max"])

    def test_the_order_of_probes_does_not_matter(self):
        """A full lattice whose file lists its probes from the last is the same field."""
        self.place(probes=27)
        document = json.loads((self.folder / "layout.json").read_text())
        points = document["lattice"]["probe_of_point"]
        self.assertEqual(points, list(range(27)))
        document["lattice"]["probe_of_point"] = points[::-1]
        document["probes"] = document["probes"][::-1]
        (self.folder / "turned.json").write_text(json.dumps(document))
        first, turned = (self.evaluate("--layout", name)["error"]["nrmse"]
                         for name in ("layout.json", "turned.json"))
        self.assertAlmostEqual(first, turned, delta=0.1 * first)

    def test_options_of_a_search_need_one(self):
        for option in (("--count", "64"), ("--rel-error", "0.5"), ("--updates", "3")):
            with self.subTest(option=option):
                self.assert_refused("place", "room.toml", "-o", "layout.json", *option,
                                    words=(option[0], "--max-nrmse"))

    def test_names_of_the_result(self):
        result = self.place("--strategy", "poisson")
        for name in ("output", "glb", "scene", "state", "strategy", "probes", "lattice", "layout",
                     "report", "params", "search", "drawn_lights", "seed", "version", "provenance"):
            self.assertIn(name, result)
        self.assertEqual(set(result["layout"]), {"interpolant", "voxels", "index_bytes", "asked",
                                                 "seed", "options", "evaluations", "build_s"})
        self.assertEqual(set(result["report"]), {"inside_geometry", "pinned", "clearance_m",
                                                 "spacing_m", "reached"})
        self.assertEqual(set(result["report"]["reached"]), {"0", "1", "2", "4", "8"})
        self.assertEqual((result["strategy"], result["layout"]["asked"]), ("poisson", 27))
        self.assertEqual(result["probes"]["stored"], 27)
        self.assertEqual(result["report"]["inside_geometry"], 0)
        self.assertIsNone(result["lattice"])
        self.assertEqual(len(self.positions()), 27)

    def test_the_report_is_printed(self):
        text = self.run_ok("place", "room.toml", "--probes", 27, "-o", "layout.json").stdout
        for words in ("27 stored, 27 active, grid of 3 x 3 x 3", "box=free", "clearance", "spacing",
                      "by none", "by 8 or more", "built in", "evaluations"):
            self.assertIn(words, text)

    def test_drawn_lights(self):
        """Their errors are told one by one, are the same for the same seed, and fall with N."""
        few = self.place("--drawn-lights", 6, probes=8)["drawn_lights"]
        self.assertEqual(few, self.place("--drawn-lights", 6, probes=8)["drawn_lights"])
        self.assertEqual((few["lights"], len(few["each"])), (6, 6))
        self.assertEqual({light["kind"] for light in few["each"]}, {"lamp"})
        for name, mean in (("nrmse", lambda v: math.sqrt(sum(x * x for x in v) / 6)),
                           ("smape", lambda v: sum(v) / 6)):
            self.assertAlmostEqual(few[name], mean([light[name] for light in few["each"]]),
                                   delta=1e-6)
        many = self.place("--drawn-lights", 6, probes=216)["drawn_lights"]
        self.assertGreater(min(light["nrmse"] for light in many["each"]), 0)
        self.assertLess(many["nrmse"], 0.7 * few["nrmse"])
        self.assertIsNone(self.place()["drawn_lights"])
        text = self.run_ok("place", "room.toml", "-o", "a.json", "--drawn-lights", "6").stdout
        self.assertRegex(text, r"drawn lights +nrmse [0-9.]+ under 6 \(least")
        self.assertRegex(text, r"what reading bounds +nrmse [0-9.]+ under every other one;")

    def test_what_reading_bounds(self):
        """The layout's own error is that of the lights scored; weights fitted to these are best."""
        drawn = self.place("--drawn-lights", 6, probes=27)["drawn_lights"]
        bound, scored = drawn["reading"], [e["nrmse"] for e in drawn["each"][1::2]]
        self.assertAlmostEqual(bound["nrmse"], math.sqrt(sum(e * e for e in scored) / 3),
                               delta=1e-6)
        self.assertLess(bound["seen"], bound["unseen"])
        self.assertLess(bound["seen"], 0.8 * bound["nrmse"])
        self.assertIsNone(self.place("--drawn-lights", 1)["drawn_lights"]["reading"])

    def test_seeds(self):
        for strategy in ("grid", "relocated", "jittered", "poisson"):
            with self.subTest(strategy=strategy):
                for name, seed in (("a", 1), ("b", 1), ("c", 2)):
                    self.place("--strategy", strategy, "--seed", seed, output=f"{name}.json")
                self.assertEqual(self.layout("a.json"), self.layout("b.json"))
                same = self.positions("a.json") == self.positions("c.json")
                self.assertEqual(same, strategy in ("grid", "relocated"))

    def test_options_reach_the_strategy(self):
        free, bounds = (self.place("--option", f"box={box}", output=f"{box}.json")
                        for box in ("free", "bounds"))
        self.assertEqual(bounds["layout"]["options"]["box"], "bounds")
        self.assertNotEqual(self.layout("free.json")["lattice"], self.layout("bounds.json")["lattice"])
        self.assertLess(bounds["probes"]["stored"], free["probes"]["stored"])

    def test_a_strategy_that_scores_is_cached_and_knows_no_state(self):
        # Train states alone count, so the state that is asked for changes nothing.
        made = self.place("--strategy", "grid_best", "--state", "day", output="day.json", probes=8)
        self.assertGreater(made["layout"]["evaluations"], 1)
        cached = list((self.folder / "cache").glob("layout-*.json"))
        self.assertEqual(len(cached), 1)
        cached[0].write_text("{damaged")
        again = self.place("--strategy", "grid_best", "--state", "night", output="night.json",
                           probes=8)
        self.assertEqual(self.layout("day.json"), self.layout("night.json"))
        self.assertEqual(list((self.folder / "cache").glob("layout-*.json")), cached)
        kept = self.place("--strategy", "grid_best", output="kept.json", probes=8)
        self.assertEqual(kept["layout"]["build_s"], again["layout"]["build_s"])

    def test_optimized_shares_its_starts_with_their_own_strategies(self):
        def lattices(folder):
            return {p.name: json.loads(p.read_text())["build_s"]
                    for p in (self.folder / folder).glob("layout-*.json")
                    if json.loads(p.read_text())["strategy"] == "grid_best"}

        quick = [word for option in ("proposals=2", "pool=1", "pool_least=0", "fit=2", "generated=1")
                 for word in ("--option", option)]
        self.place("--strategy", "grid_best", output="start.json")
        kept = lattices("cache")
        self.assertEqual(len(kept), 1)
        found = self.place("--strategy", "optimized", *quick, output="found.json")
        self.assertEqual(lattices("cache"), kept)
        made = self.run_json("place", "room.toml", "--probes", 27, "-o", "made.json", "--cache",
                             "empty", "--strategy", "optimized", *quick)
        self.assertEqual(lattices("empty").keys(), kept.keys())
        self.assertEqual(self.layout("found.json"), self.layout("made.json"))
        self.assertEqual(found["layout"]["evaluations"], made["layout"]["evaluations"])
        self.assertGreater(found["layout"]["evaluations"], 2)
        # What is found counts with the time that it took when it was made.
        self.assertGreater(found["layout"]["build_s"], sum(kept.values()))

    def test_help_lists_strategies_and_the_options_of_one(self):
        page = self.run_ok("place", "--strategy", "poisson", "--help").stdout
        for words in ("\nStrategies\n", "\n  grid_best ", "\nOptions of poisson (", "clearance=0 .. ",
                      "interpolant=maxent | knn"):
            self.assertIn(words, page)
        self.assertIn("\nOptions of grid (", self.run_ok("place", "--help").stdout)


class UseOfALayout(PlaceTest):
    def test_a_layout_scores_like_its_strategy_under_any_state(self):
        for strategy in ("grid", "poisson"):
            self.place("--strategy", strategy)
            for state in ("day", "night"):
                with self.subTest(strategy=strategy, state=state):
                    given = self.evaluate("--layout", "layout.json", "--state", state)
                    made = self.evaluate("--strategy", strategy, "--probes", 27, "--state", state)
                    self.assertEqual(given["error"], made["error"])
                    self.assertEqual((given["strategy"], given["layout"]["asked"]), (strategy, 27))
                    self.assertEqual(given["lattice"], [3, 3, 3] if strategy == "grid" else None)

    def test_evaluate_prints_what_the_layout_is(self):
        self.place("--strategy", "poisson")
        text = self.run_ok("evaluate", "room.toml", *FIELD, *TRUTH, "--layout",
                           "layout.json").stdout
        self.assertIn("27 stored, 27 active, poisson, interpolant maxent", text)

    def test_render_and_bench_take_one(self):
        self.place("--strategy", "poisson")
        size = ("--width", 24, "--height", 16, "--spp", 1)
        for name, more in (("plain", ()), ("balls", ("--show-probes",))):
            self.run_ok("render", "room.toml", "-o", f"{name}.exr", "--layout", "layout.json",
                        *FIELD, *size, *more)
        self.assertGreater(self.run_json("compare", "balls.exr", "plain.exr")["error"]["rmse"], 0)
        result = self.run_json("bench", "room.toml", "--layout", "layout.json", "--rays", 16,
                               "--updates", 3, "--tracer", "embree")
        self.assertEqual((result["probes"], result["strategy"]), (27, "poisson"))
        self.assertIsNone(result["ratios"]["query_vs_textbook"])

    def test_short_options_of_the_grid(self):
        short = self.evaluate("--probes", 27, "--lattice", "bounds", "--vertical", 2)
        long = self.evaluate("--probes", 27, "--option", "box=bounds", "--option", "vertical=2")
        self.assertEqual(short["error"], long["error"])
        self.assert_refused("evaluate", "room.toml", "--strategy", "poisson", "--lattice", "free",
                            words=("--lattice", "'poisson'", "'box'"))


class Glb(PlaceTest):
    def test_positions_come_back(self):
        self.place("--strategy", "poisson", "--glb", "probes.glb")
        document = self.glb("probes.glb")
        self.assertEqual([n["name"] for n in document["nodes"]],
                         [f"probe {i}" for i in range(27)])
        self.assertEqual([tuple(n["translation"]) for n in document["nodes"]], self.positions())
        self.assertEqual({document["meshes"][n["mesh"]]["name"] for n in document["nodes"]},
                         {"active probe"})
        # A tenth of the probe's bias length in radius.
        for node, probe in zip(document["nodes"], self.layout()["probes"]):
            self.assertAlmostEqual(node["scale"][0], 0.1 * probe["bias_m"], places=6)
        self.place("--strategy", "file", "--option", "path=probes.glb", output="back.json")
        self.assertEqual(self.positions("back.json"), self.positions())
        self.place("--strategy", "file", "--option", "path=layout.json", output="copy.json")
        self.assertEqual(self.positions("copy.json"), self.positions())

    def test_pinned_probes_stay_pinned(self):
        (self.folder / "points.csv").write_text("x,y,z,pinned\n0,1,0,0\n1,1,1,1\n")
        self.place("--strategy", "file", "--option", "path=points.csv", "--glb", "probes.glb")
        nodes = self.glb("probes.glb")["nodes"]
        meshes = [m["name"] for m in self.glb("probes.glb")["meshes"]]
        self.assertEqual([meshes[n["mesh"]] for n in nodes], ["active probe", "pinned probe"])
        result = self.place("--strategy", "file", "--option", "path=probes.glb", output="b.json")
        self.assertEqual(result["report"]["pinned"], 1)
        self.assertEqual([p["pinned"] for p in self.layout("b.json")["probes"]], [False, True])

    def test_inactive_probes_have_their_colour(self):
        self.place("--set", "classification=near_surface", "--glb", "probes.glb", probes=512)
        document = self.glb("probes.glb")
        names = [document["meshes"][n["mesh"]]["name"] for n in document["nodes"]]
        self.assertEqual(set(names), {"active probe", "inactive probe"})
        # Those farthest from the walls see no near surface.
        middle = min(document["nodes"], key=lambda n: sum(
            (a - b) ** 2 for a, b in zip(n["translation"], (0.0, 1.5, 0.0))))
        self.assertEqual(names[document["nodes"].index(middle)], "inactive probe")


class SmallestBudget(PlaceTest):
    def search(self, *options):
        return self.run_program("place", "room.toml", *FIELD, *TRUTH, "-o", "layout.json", "--json",
                                *options)

    def test_the_smallest_that_meets_it(self):
        loose = json.loads(self.search("--max-nrmse", 10).stdout)["search"]
        self.assertEqual((loose["met"], loose["probes"]), (True, 1))
        errors = {s["probes"]: s["train_nrmse"] for s in loose["steps"]}
        self.assertEqual(loose["train_nrmse"], errors[1])
        wanted = 0.999 * errors[1]
        result = self.search("--max-nrmse", wanted, "--probes", 64)
        search = json.loads(result.stdout)["search"]
        self.assertTrue(search["met"])
        self.assertLessEqual(search["train_nrmse"], wanted)
        self.assertEqual(len(self.layout()["probes"]), next(
            s["stored"] for s in search["steps"] if s["probes"] == search["probes"]))
        below = [s["probes"] for s in search["steps"] if s["probes"] < search["probes"]]
        self.assertGreaterEqual(max(below), 0.95 * search["probes"] - 1)
        # Checked on held-out receivers, apart from the choice.
        self.assertEqual(search["heldout_met"], search["heldout_nrmse"] <= wanted)
        self.assertEqual(result.returncode, 0 if search["heldout_met"] else 3, result.stderr)

    def test_not_met_keeps_the_best(self):
        result = self.search("--max-nrmse", "1e-6", "--probes", 20)
        self.assertEqual(result.returncode, 3)
        search = json.loads(result.stdout)["search"]
        self.assertFalse(search["met"])
        self.assertEqual([s["probes"] for s in search["steps"]], [8, 16, 20])
        best = min(search["steps"], key=lambda s: s["train_nrmse"])
        self.assertEqual((search["probes"], search["train_nrmse"]),
                         (best["probes"], best["train_nrmse"]))
        self.assertEqual(len(self.layout()["probes"]), best["stored"])
        self.assertIn("not met: nrmse <= 1e-06 with up to 20 probes", result.stderr)


class Refusals(PlaceTest):
    def refuse(self, *options, words):
        self.assert_refused("place", "room.toml", "-o", "l.json", *options, words=words)

    def test_names_and_values(self):
        for options, words in (
                (("--strategy", "poison"), ("--strategy", "'poisson'")),
                (("--option", "bix=free"), ("bix", "'box'")),
                (("--option", "box=fre"), ("box=fre", "'free'")),
                (("--option", "box"), ("--option box",)),
                (("--option", "=free"), ("--option =free",)),
                (("--option", "box=free", "--option", "box=bounds"), ("box", "twice")),
                (("--option", "vertical=nan"), ("vertical=nan", "0.25")),
                (("--probes", "0"), ("--probes", "0")),
                (("--probes", "99999999"), ("--probes 99999999",)),
                (("--max-nrmse", "-1"), ("--max-nrmse", "-1")),
                (("--params", "rtxg"), ("'rtxgi'",)),
                (("--state", "dawn"), ("dawn",)),
                (("--glb", "probes.txt"), (".glb",)),
                (("--glb", "no/probes.glb"), ("no",))):
            with self.subTest(options=options):
                self.refuse(*options, words=words)
        self.assert_refused("place", "room.toml", "-o", "l.csv", words=(".json",))
        self.assert_refused("place", "room.toml", words=("-o",))

    def test_outputs_replace_no_input_and_no_other_glb(self):
        def kept(path, *command, words):
            before = path.read_bytes()
            with self.subTest(command=command):
                self.assert_refused("place", *command, words=words)
                self.assertEqual(path.read_bytes(), before)

        self.place("--glb", "probes.glb", probes=8)
        self.place("--glb", "probes.glb", probes=8)  # its own files may be replaced
        new = ("-o", "new.json")
        room, probes, layout = (self.folder / n for n in ("room.glb", "probes.glb", "layout.json"))
        # The geometry of the scene, and the scene itself by another name.
        kept(room, "room.toml", *new, "--glb", "room.glb", words=("room.glb", "file of probes"))
        (self.folder / "link.glb").symlink_to("room.glb")
        kept(room, "room.glb", *new, "--glb", "link.glb", words=("link.glb", "scene"))
        for name, data in (("empty.glb", b""), ("cut.glb", probes.read_bytes()[:60]),
                           ("other.glb", probes.read_bytes().replace(b"probelab ", b"modeller "))):
            other = self.folder / name
            other.write_bytes(data)
            kept(other, "room.toml", *new, "--glb", name, words=(name, "file of probes"))
        # What strategy `file` reads.
        read = ("room.toml", "--strategy", "file", "--option")
        kept(probes, *read, "path=probes.glb", *new, "--glb", "./probes.glb", words=("--option path",))
        kept(layout, *read, "path=layout.json", "-o", "./layout.json", words=("--option path",))

    def test_a_search_needs_light(self):
        write_glb(self.folder / "dark.glb")
        result = self.run_program("place", "dark.glb", *FIELD, *TRUTH, "-o", "l.json",
                                  "--max-nrmse", "0.1")
        self.assertEqual((result.returncode, result.stdout), (2, ""), result.stderr)
        last = result.stderr.splitlines()[-1]
        for words in ("probelab: --max-nrmse", "undefined without light"):
            self.assertIn(words, last)
        self.assertNotIn("at most 8 probes", result.stderr)
        self.assertFalse((self.folder / "l.json").exists())

    def test_a_layout_is_kept_that_drawn_lights_cannot_score(self):
        write_glb(self.folder / "black.glb", base_color=(0, 0, 0, 1))
        result = self.run_program("place", "black.glb", "--probes", 8, "-o", "kept.json",
                                  "--drawn-lights", 3, "--quiet")
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertIn("no indirect light of those that were drawn reaches a receiver of black.glb",
                      result.stderr)
        self.assertEqual(len(self.positions("kept.json")), 8)

    def test_a_scene_of_heldout_states_is_scored_under_drawn_lights_alone(self):
        (self.folder / "late.toml").write_text(
            'gltf = "room.glb"\n'
            '[[light]]\nname = "lamp"\ntype = "point"\nposition = [0, 2, 0]\nintensity = 3\n'
            '[[state]]\nname = "on"\nsplit = "heldout"\n')
        drawn = self.run_json("place", "late.toml", "--probes", 8, "-o", "late.json",
                              "--drawn-lights", 3)["drawn_lights"]
        self.assertEqual([light["kind"] for light in drawn["each"]], ["lamp"] * 3)

    def test_optimized_refuses_at_once(self):
        """What a search of minutes would find out at its end."""
        for option in ("cells=9", "cells=nan", "cutoff=0.31", "pool=-1", "fit=1.5", "k=1.5",
                       "wall_gap=Auto", "interpolant=none"):
            self.refuse("--strategy", "optimized", "--option", option, words=(option,))
        write_glb(self.folder / "dark.glb")
        result = self.run_program("place", "dark.glb", "--probes", 8, "--strategy", "optimized",
                                  "--option", "lights=own", "-o", "dark.json")
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertIn("no lighting state to train on lights a train receiver", result.stderr)

    def test_a_search_needs_train_receivers(self):
        (self.folder / "points.csv").write_text("0,1,0,0,1,0\n")
        self.run_ok("receivers", "room.toml", "-o", "r.json", "--points", "points.csv", "--spp", 8,
                    "--cache", "cache")  # so that the refused command writes nothing
        self.refuse("--max-nrmse", "1", "--points", "points.csv", "--spp", "8", "--cache", "cache",
                    words=("--points", "train"))

    def test_requirements(self):
        self.refuse("--require", "probes.sotred>=9", words=("'probes.stored'",))
        unmet = self.run_program("place", "room.toml", "--probes", 8, "-o", "layout.json",
                                 "--require", "probes.stored>=9")
        self.assertEqual(unmet.returncode, 3)
        self.assertIn("not met: probes.stored: wanted >= 9, measured 8", unmet.stderr)

    def test_files_of_positions(self):
        for name, text, words in (
                ("few.csv", "", ("few.csv",)), ("word.csv", "0,1,x\n", ("word.csv", "x")),
                ("nan.csv", "0,nan,0\n", ("nan.csv",)), ("short.csv", "0,1\n", ("short.csv",)),
                ("far.csv", "0,1,0\n900,1,0\n", ("far.csv",)),
                ("order.csv", "x,z,y\n0,1,0\n", ("order.csv", "line 1", "x,z,y")),
                ("many.csv", "0,1,0\n0,1,1\n1,1,1\n", ("3", "2")),
                ("bad.glb", "glTF", ("bad.glb",)), ("bad.json", "[]", ("bad.json",)),
                ("bad.txt", "0,1,0", ("bad.txt",))):
            (self.folder / name).write_text(text)
            with self.subTest(name=name):
                self.refuse("--strategy", "file", "--option", f"path={name}", "--probes", "2",
                            words=words)
        self.refuse("--strategy", "file", words=("path",))
        self.refuse("--strategy", "file", "--option", "path=none.csv", words=("none.csv",))

    def test_layouts(self):
        self.place("--strategy", "poisson", probes=8)
        text = (self.folder / "layout.json").read_text()

        def changed(change):
            document = json.loads(text)
            change(document)
            return json.dumps(document)

        def influence(name, value):
            return changed(lambda d: d["influence"].__setitem__(name, value))

        for damaged in (
                "", "[]", text[:len(text) // 2], text.replace("probelab layout 2", "layout 9"),
                changed(lambda d: d.pop("probes")), changed(lambda d: d.update(probes=[])),
                changed(lambda d: d["probes"][0].update(position=[0, 1])),
                changed(lambda d: d["probes"][0].update(position=[0, "1", 0])),
                changed(lambda d: d["probes"][0].update(bias_m=-1)),
                changed(lambda d: d["probes"][0].update(bias_m=1e999)),
                changed(lambda d: d["probes"][0].update(bias_m=1e37)),
                changed(lambda d: d["probes"][0].update(position=[1e6, 0, 0])),
                changed(lambda d: d["probes"].pop()), changed(lambda d: d.update(more=1)),
                changed(lambda d: d.update(interpolant="lattice")),
                changed(lambda d: d.update(geometry_hash="0" * 32)),
                influence("voxel_begin", [0]), influence("entry_weights", "zz"),
                influence("count", [2 ** 30] * 3), influence("entry_probes", [2 ** 31])):
            (self.folder / "bad.json").write_text(damaged)
            with self.subTest(text=damaged[:80]):
                self.assert_refused("evaluate", "room.toml", "--layout", "bad.json",
                                    words=("bad.json",))
        self.assert_refused("evaluate", "room.toml", "--layout", "none.json", words=("none.json",))

    def test_a_layout_of_another_scene(self):
        self.place("--strategy", "poisson", probes=8)
        write_glb(self.folder / "other.glb", camera=(0.0, 1.0, 1.0), emission=(1.0, 1.0, 1.0),
                  positions=[(x, y, z) for x in (-3.0, 3.0) for y in (0.0, 3.0) for z in (-2.0, 2.0)])
        self.assert_refused("render", "other.glb", "-o", "o.exr", "--layout", "layout.json",
                            words=("layout.json",))

    def test_a_layout_leaves_nothing_to_place(self):
        for option in (("--strategy", "grid"), ("--probes", "8"), ("--option", "box=free"),
                       ("--lattice", "free"), ("--vertical", "2")):
            with self.subTest(option=option):
                line = self.assert_refused("evaluate", "room.toml", "--layout", "l.json", *option,
                                           words=("--layout", option[0]))
                self.assertTrue(re.search("exclude", line), line)
        self.assert_refused("bench", "room.toml", "--layout", "l.json", "--sweep",
                            words=("--layout", "--sweep"))


if __name__ == "__main__":
    unittest.main()
