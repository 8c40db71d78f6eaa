# SPDX-License-Identifier: GPL-3.0-or-later
"""tune: parameters as a file that loads again, its scores, and what is refused."""
import csv
import json
import math
import signal
import subprocess
import tomllib
import unittest

from support import PROGRAM, ROOM_TRIANGLES, SOURCE, CliTest, write_glb

# Nothing here is about accuracy.
FIELD = ("--rays", 32, "--updates", 2, "--tracer", "embree", "--probes", 27)
TRUTH = ("--count", 192, "--spp", 256, "--cache", "cache")
QUICK = (*FIELD, *TRUTH, "--starts", 2, "--against", "rtxgi")

SCENE = """gltf = "room.glb"
[[light]]
name = "lamp"
type = "point"
intensity = 5.0
position = [0.5, 2.0, 0.5]
[[camera]]
name = "corner"
position = [1.5, 1.6, 1.5]
target = [0.0, 1.0, 0.0]
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


class TuneTest(CliTest):
    def setUp(self):
        super().setUp()
        write_glb(self.folder / "room.glb", emission=(1.0, 0.5, 0.25))
        (self.folder / "room.toml").write_text(SCENE)

    def tune(self, *options, output="tuned.toml", scene="room.toml"):
        return self.run_json("tune", scene, "-o", output, *QUICK, *options)

    def score(self, result, state, setting):
        """The held-out numbers of a setting."""
        part, = (s for s in result["scores"] if s["state"] == state)
        row, = (s for s in part["settings"] if s["setting"] == setting)
        return row["heldout"]


class Tune(TuneTest):
    def test_result_and_file(self):
        # A bias that is too large here for certain; the preset itself may be hard to better.
        result = self.tune("--set", "normal_bias=0.4")
        for name in ("scenes", "from", "parameters", "singular_values", "correlation", "cost",
                     "settled", "rounds", "step_check", "outer", "starts", "evaluations",
                     "gradients", "error", "summary", "gains", "scores", "params", "fields", "seconds", "provenance"):
            self.assertIn(name, result)
        self.assertEqual([p["key"] for p in result["parameters"]],
                         ["normal_bias", "view_bias", "visibility_floor", "chebyshev_power",
                          "facing_offset", "crush_threshold"])
        # Never worse on what it minimises; two states are tuned on, the third is not.
        self.assertLess(result["cost"]["tuned"], result["cost"]["from"])
        self.assertEqual([(s["state"], s["lights"]) for s in result["scores"]],
                         [("day", "train"), ("dusk", "train"), ("night", "heldout")])
        for before, after in ((r["before"], r["after"]) for r in result["rounds"]):
            self.assertLessEqual(after, before)
        # A file that TOML reads, with what was tuned and the base.
        text = (self.folder / "tuned.toml").read_text()
        values = tomllib.loads(text)
        self.assertEqual(values["preset"], "probelab")
        self.assertEqual(values["rays"], 32)
        for p in result["parameters"]:
            self.assertEqual(values[p["key"]], p["tuned"])
            self.assertGreaterEqual(p["tuned"], p["low"])
            self.assertLessEqual(p["tuned"], p["high"])
        self.assertIn("x s_i, was 0.4", text)
        self.assertIn("night (not tuned on)", text)

    def test_scores_are_those_of_evaluate(self):
        result = self.tune("--vary", "normal_bias,view_bias")
        common = (*FIELD, *TRUTH, "--state", "night")
        tuned = self.run_json("evaluate", "room.toml", *common, "--params", "tuned.toml")
        rtxgi = self.run_json("evaluate", "room.toml", *common, "--params", "rtxgi")
        for name, found in (("tuned", tuned), ("rtxgi", rtxgi)):
            for error in ("nrmse", "smape", "light_leak", "shadow_leak"):
                self.assertEqual(self.score(result, "night", name)[error], found["error"][error])
        part = result["scores"][2]
        gain = next(s for s in part["settings"] if s["setting"] == "rtxgi")["gain"]
        self.assertAlmostEqual(gain["ratio"], rtxgi["error"]["nrmse"] / tuned["error"]["nrmse"],
                               delta=1e-6)
        self.assertLessEqual(gain["low"], gain["ratio"])
        self.assertGreaterEqual(gain["high"] or math.inf, gain["ratio"])  # null: unbounded

    def test_same_seed_same_bytes(self):
        options = ("--vary", "normal_bias,view_bias,chebyshev_power", "--seed", 5)
        result = self.tune(*options, output="a.toml")
        self.assertIsNotNone(result["step_check"])
        self.run_ok("tune", "room.toml", "-o", "b.toml", *QUICK, "--threads", 1, "--quiet",
                    *options)
        self.assertEqual((self.folder / "a.toml").read_bytes(),
                         (self.folder / "b.toml").read_bytes())

    def test_cross_validation(self):
        # Seed 5: a part of the step pays on what was left out; seed 2: none of it does.
        options = ("--vary", "normal_bias,view_bias", "--parsimony", 0, "--rounds", 1)
        whole = self.tune(*options, "--seed", 5, "--folds", 0)
        self.assertIsNone(whole["step_check"])
        result = self.tune(*options, "--seed", 5, "--folds", 4)
        check = result["step_check"]
        self.assertEqual((check["folds"], check["shares"]), (4, [0, 0.25, 0.5, 0.75, 1]))
        self.assertEqual(check["share"], check["shares"][check["costs"].index(min(check["costs"]))])
        self.assertTrue(0 < check["share"] < 1, check)
        for costs, cost in zip(zip(*check["fold_costs"]), check["costs"]):
            self.assertAlmostEqual(sum(costs), cost, delta=1e-12)
        # Before the step the folds' costs sum to the cost of the whole.
        self.assertAlmostEqual(check["costs"][0], result["cost"]["from"], delta=1e-9)
        # The solution is the same, and values are that share of the way to it (biases are linear).
        self.assertEqual(whole["rounds"][0]["solved"], result["rounds"][0]["solved"])
        self.assertEqual((whole["rounds"][0]["step"], result["rounds"][0]["step"]), (1, 1))
        for of_whole, p in zip(whole["parameters"], result["parameters"]):
            self.assertAlmostEqual(p["tuned"] - p["from"],
                                   check["share"] * (of_whole["tuned"] - of_whole["from"]),
                                   delta=1e-5)
        kept = self.tune(*options, "--seed", 2, "--folds", 4)
        self.assertEqual(kept["step_check"]["share"], 0)
        for p in kept["parameters"]:
            self.assertEqual(p["tuned"], p["from"])
            self.assertNotEqual(p["optimum"], p["from"])

    def test_an_outer_search_keeps_the_share_and_six_digits(self):
        result = self.tune("--vary", "view_bias,normal_bias,distance_exponent", "--seed", 5,
                           "--parsimony", 0, "--outer-evaluations", 3, "--rounds", 1)
        self.assertTrue(0 < result["step_check"]["share"] < 1, result["step_check"])
        for p in result["parameters"]:
            self.assertEqual(p["tuned"], float(f"{p['tuned']:.6g}"))

    def test_a_state_without_light_is_left_out(self):
        write_glb(self.folder / "dark.glb")
        text = SCENE.replace("room.glb", "dark.glb")
        text += '[[state]]\nname = "off"\nlights = { lamp = { intensity = 0.0 } }\n'
        (self.folder / "switched.toml").write_text(text)
        result = self.run_ok("tune", "switched.toml", "-o", "t.toml", *QUICK, "--vary", "view_bias",
                             "--json")
        self.assertIn("left out, since no train receiver gets light in it: off", result.stderr)
        self.assertEqual([s["state"] for s in json.loads(result.stdout)["scores"]],
                         ["day", "dusk", "night"])
        refused = self.run_program("tune", "switched.toml", "-o", "u.toml", *QUICK, "--state",
                                   "off")
        self.assertEqual(refused.returncode, 2)
        self.assertIn("in state off, so there is no error", refused.stderr)

    def test_held_out_states_alone(self):
        text = SCENE.replace('name = "day"', 'name = "day"\nsplit = "heldout"').replace(
            'name = "dusk"', 'name = "dusk"\nsplit = "heldout"')
        (self.folder / "heldout.toml").write_text(text)
        result = self.run_ok("tune", "heldout.toml", "-o", "t.toml", *QUICK, "--vary", "view_bias",
                             "--rounds", 1, "--json")
        self.assertIn("no state is a train state", result.stderr)
        scores = json.loads(result.stdout)["scores"]
        self.assertEqual({s["lights"] for s in scores}, {"train"})

    def test_receivers_of_a_held_out_state(self):
        text = SCENE.replace('name = "day"', 'name = "day"\nsplit = "heldout"')
        (self.folder / "first.toml").write_text(text)
        self.run_ok("receivers", "first.toml", "-o", "r.json", "--count", 192, "--spp", 256)
        options = ("first.toml", "-o", "t.toml", *FIELD, "--receivers", "r.json", "--starts", 2,
                   "--against", "rtxgi", "--vary", "view_bias", "--rounds", 1)
        refused = self.run_program("tune", *options)
        self.assertEqual(refused.returncode, 2)
        self.assertIn("'day', the state of the receivers, is held out", refused.stderr)
        self.run_ok("tune", *options, "--state", "day")

    def test_one_state(self):
        result = self.tune("--state", "dusk", "--vary", "view_bias")
        self.assertEqual([(s["state"], s["lights"]) for s in result["scores"]],
                         [("dusk", "train"), ("day", "heldout"), ("night", "heldout")])

    def test_from_a_file_with_changes(self):
        (self.folder / "mine.toml").write_text('preset = "gdc2019"\nnormal_bias = 0.2\n')
        result = self.tune("--from", "mine.toml", "--set", "variance_bias=0.01", "--vary",
                           "normal_bias")
        values = tomllib.loads((self.folder / "tuned.toml").read_text())
        self.assertEqual(values["preset"], "gdc2019")
        self.assertEqual(values["variance_bias"], 0.01)
        self.assertEqual(set(values), {"preset", "variance_bias", "normal_bias", "rays"})
        self.assertEqual(result["parameters"][0]["from"], 0.2)

    def test_keys_that_change_the_atlases(self):
        result = self.tune("--vary", "view_bias,distance_exponent", "--outer-evaluations", 3,
                           "--rounds", 1)
        self.assertEqual(len(result["outer"]), 3)
        self.assertEqual([p["key"] for p in result["parameters"]],
                         ["view_bias", "distance_exponent"])
        tried = [step["values"]["distance_exponent"] for step in result["outer"]]
        self.assertEqual(len({*tried, 200}), 4)  # none twice
        self.assertLessEqual(result["cost"]["tuned"], result["cost"]["from"])

    def test_parallax_from_0(self):
        # The preset leaves it out; varied, it reads the same at 0 and has a derivative there.
        quick = ("--folds", 0, "--rounds", 1)
        result = self.tune("--vary", "parallax", *quick)
        value, = result["parameters"]
        self.assertEqual((value["from"], value["low"]), (0, 0))
        self.assertGreater(value["tuned"], 0)
        self.assertIsNotNone(value["standard_deviation"])
        self.assertLess(result["cost"]["tuned"], result["cost"]["from"])
        other = self.tune("--vary", "view_bias", *quick)
        self.assertAlmostEqual(result["cost"]["from"] / other["cost"]["from"], 1, 12)

    def test_report_and_map(self):
        (self.folder / "report").mkdir()
        result = self.tune("--vary", "normal_bias,view_bias", "--report", "report", "--bias-map",
                           "map.csv", "--bias-map-size", 3, "--compare-searches", 20,
                           "--folds", 0)
        table = json.loads((self.folder / "report/tune.json").read_text())
        for part in table["scores"]:
            for setting in part["settings"]:
                # The blocks' errors sum to nrmse^2.
                self.assertAlmostEqual(math.sqrt(max(0, sum(setting["blocks"].values()))),
                                       setting["heldout"]["nrmse"], delta=1e-6)
        rows = list(csv.DictReader((self.folder / "map.csv").read_text().splitlines()))
        self.assertEqual(len(rows), 9)
        self.assertEqual((self.folder / "map.csv").read_text(),
                         (self.folder / "report/bias_map.csv").read_text())
        # No point of the map has a lower cost than what was found, but for what parsimony allows.
        least = min(float(r["cost"]) for r in rows)
        self.assertAlmostEqual(least, result["bias_map"]["least_cost"], delta=1e-6 * least)
        self.assertLess(result["bias_map"]["tuned_cost"], 1.01 * least)
        places = {p["name"]: p for p in result["bias_map"]["places"]}
        self.assertEqual((places["rtxgi"]["normal_bias"], places["rtxgi"]["view_bias"]),
                         (0.04, 0.04))
        for name, steps in result["searches"].items():
            costs = [cost for _, cost in steps]
            self.assertEqual(costs, sorted(costs, reverse=True), name)
        self.assertEqual(result["searches"]["nelder_mead"][-1][0], 20)

    def test_values(self):
        result = self.tune("--vary", "none", "--fit-values", "values.json", "--set",
                           "irradiance_format=rgba32f")
        self.assertEqual(result["parameters"], [])
        rows = result["values"]["scores"]
        self.assertEqual([(r["state"], r["fitted"]) for r in rows],
                         [("day", True), ("dusk", False), ("night", False)])
        self.assertLess(rows[0]["train"]["after"]["nrmse"], rows[0]["train"]["before"]["nrmse"])
        found = self.run_json("evaluate", "room.toml", *FIELD, *TRUTH, "--params", "tuned.toml",
                              "--values", "values.json")
        self.assertEqual(found["error"]["nrmse"], rows[0]["heldout"]["after"]["nrmse"])

    def test_text_report(self):
        text = self.run_ok("tune", "room.toml", "-o", "tuned.toml", *QUICK, "--vary",
                           "view_bias").stdout
        for words in ("view_bias", "round", "held-out receivers", "noise floor", "over tuned",
                      "traced visibility", "settled", "step taken", "cross-validated on 4 folds"):
            self.assertIn(words, text)


class SeveralScenes(TuneTest):
    def setUp(self):
        super().setUp()
        (self.folder / "other.toml").write_text(SCENE.replace("0.5, 2.0, 0.5", "-0.5, 1.0, 0.5"))

    def test_shared_and_leave_one_out(self):
        options = ("--vary", "view_bias", "--rounds", 1, "--parsimony", 0, "--folds", 0)
        result = self.run_json("tune", "room.toml", "other.toml", "-o", "tuned.toml", *QUICK,
                               *options, "--leave-one-out")
        self.assertEqual(len(result["scores"]), 6)
        folds = result["leave_one_out"]["folds"]
        self.assertEqual([f["left_out"] for f in folds], [s["scene"] for s in result["scenes"]])
        for fold in folds:
            self.assertEqual({s["scene"] for s in fold["scores"]}, {fold["left_out"]})
        # A fold is what the other scene alone gives, and not what both give.
        alone = self.tune(*options, output="alone.toml")
        self.assertEqual(folds[1]["values"]["view_bias"], alone["parameters"][0]["tuned"])
        self.assertNotEqual(folds[0]["values"], folds[1]["values"])
        self.assertNotEqual(alone["parameters"][0]["tuned"], result["parameters"][0]["tuned"])

    def test_from_three_scenes_on_folds_are_scenes(self):
        (self.folder / "third.toml").write_text(SCENE.replace("0.5, 2.0, 0.5", "1.0, 1.5, -0.5"))
        result = self.run_json("tune", "room.toml", "other.toml", "third.toml", "-o", "t.toml",
                               *QUICK, "--vary", "view_bias", "--rounds", 1, "--folds", 2)
        check = result["step_check"]
        self.assertEqual(check["folds"], 3)
        # Each scene counts for a third of the cost, and is a fold.
        for costs in check["fold_costs"]:
            self.assertAlmostEqual(3 * costs[0], result["cost"]["from"],
                                   delta=0.1 * result["cost"]["from"])

    def test_the_shared_solution_outlives_a_signal(self):
        process = subprocess.Popen(
            [PROGRAM, "tune", "room.toml", "other.toml", "-o", "t.toml", *map(str, QUICK), "--vary",
             "view_bias", "--rounds", "1", "--leave-one-out"], cwd=self.folder,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        while not process.stderr.readline().startswith("leaving out"):
            self.assertIsNone(process.poll())
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 130, errors)
        self.assertIn("view_bias", output)
        self.assertTrue((self.folder / "t.toml").exists())

    def test_options_of_one_scene(self):
        for option, value in (("--receivers", "r.json"), ("--layout", "l.json"),
                              ("--fit-values", "v.json")):
            self.assert_refused("tune", "room.toml", "other.toml", "-o", "t.toml", option, value,
                                words=(option, "one scene"))
        self.assert_refused("tune", "room.toml", "room.toml", "-o", "t.toml",
                            words=("room.toml", "named twice"))


class Refusals(TuneTest):
    def refuse(self, *options, words=(), output="t.toml", scene="room.toml"):
        self.assert_refused("tune", scene, "-o", output, "--quiet", *options, words=words)

    def test_keys(self):
        self.refuse("--vary", "normal_bais", words=("--vary", "normal_bais", "normal_bias"))
        self.refuse("--vary", "view_bias,view_bias", words=("--vary", "view_bias", "twice"))
        self.refuse("--vary", "relocation", words=("--vary", "relocation", "cannot be tuned"))
        self.refuse("--vary", "crush_threshold", "--set", "crush=none",
                    words=("crush_threshold", "no effect"))

    def test_outputs(self):
        self.refuse(output="tuned.json", words=(".toml",))
        self.refuse(output="room.toml", words=("room.toml", "read by this command"))
        (self.folder / "mine.toml").write_text('preset = "rtxgi"\n')
        self.refuse("--from", "mine.toml", output="mine.toml", words=("read by this command",))
        (self.folder / "notes.toml").write_text('title = "mine"\n')
        self.refuse(output="notes.toml", words=("notes.toml", "no parameters"))
        self.refuse("--report", "missing", words=("missing",))
        (self.folder / "report").mkdir()
        self.refuse("--report", "report", "--fit-values", "report/tune.json",
                    words=("report/tune.json", "two outputs"))
        self.refuse("--bias-map", "map.csv", "--bias-map-size", 0,
                    words=("--bias-map", "draws none"))

    def test_what_would_have_no_effect(self):
        self.refuse("--starts", 100000, words=("--starts",))
        for folds in (1, 17, -1, "x"):
            self.refuse("--folds", folds, words=("--folds", "2 to 16", "0 for none"))
        self.refuse("--vary", "none", "--compare-searches", 5, words=("--compare-searches",))
        self.refuse("--rays", 16, "--set", "rays=64", words=("--rays 16", "rays=64", "disagree"))

    def test_receivers(self):
        for count in (1, 8):
            result = self.run_program("tune", "room.toml", "-o", "t.toml", *FIELD, "--quiet",
                                      "--count", count, "--spp", 32, "--cache", "cache")
            self.assertEqual(result.returncode, 2)
            self.assertIn("too few", result.stderr)
            self.assertFalse((self.folder / "t.toml").exists())
        self.refuse("--points", "p.csv", words=("--points", "held out"))

    def test_unlit_scene(self):
        write_glb(self.folder / "dark.glb")
        result = self.run_program("tune", "dark.glb", "-o", "t.toml", *QUICK, "--quiet")
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertIn("no train receiver gets light", result.stderr)
        self.assertEqual(len(result.stderr.splitlines()), 1)
        self.assertFalse((self.folder / "t.toml").exists())

    def test_no_active_probe(self):
        # Two walls face outwards, so every probe sees back faces and counts as inside of something.
        triangles = [t[::-1] if i < 4 else t for i, t in enumerate(ROOM_TRIANGLES)]
        write_glb(self.folder / "outwards.glb", triangles=triangles, emission=(1.0, 0.5, 0.25))
        result = self.run_program("tune", "outwards.glb", "-o", "t.toml", *QUICK, "--quiet",
                                  "--set", "classification=inside", "--set",
                                  "backface_threshold=0.05")
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertIn("active", result.stderr)
        self.assertEqual(len(result.stderr.splitlines()), 1)
        self.assertFalse((self.folder / "t.toml").exists())

    def test_requirement(self):
        self.refuse("--require", "gain<=1", words=("gain",))
        result = self.run_program("tune", "room.toml", "-o", "t.toml", *QUICK, "--quiet", "--vary",
                                  "view_bias", "--require", "summary.gain_from>=1000")
        self.assertEqual(result.returncode, 3, result.stderr)
        self.assertTrue((self.folder / "t.toml").exists())

    def test_interrupted(self):
        process = subprocess.Popen(
            [PROGRAM, "tune", "room.toml", "-o", "t.toml", *map(str, TRUTH), "--tracer", "embree",
             "--probes", "27", "--updates", "150"],
            cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        while not process.stderr.readline().startswith("round 1"):
            self.assertIsNone(process.poll())
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 130, errors)
        self.assertFalse((self.folder / "t.toml").exists())
        self.assertEqual([f for f in self.files() if "t.toml" in f], [])


# Draws a report; says which texts are cut and which legends lie on a panel.
DRAW_AND_CHECK = """
import pathlib, sys
sys.path.insert(0, sys.argv[1])
import figures_panels
figures_panels.load_pyplot()
import tuning_figure
save = tuning_figure.save
def save_and_check(figure, folder, stem):
    figure.canvas.draw()
    legend = figure.legends[0]
    for text in [*legend.get_texts(), *(t for panel in figure.axes for t in (
            panel.title, panel.xaxis.label, panel.yaxis.label))]:
        box = text.get_window_extent()
        if text.get_text() and not (0 <= box.x0 and box.x1 <= figure.bbox.x1 and 0 <= box.y0
                                    and box.y1 <= figure.bbox.y1):
            print(stem, "cuts", text.get_text())
    if any(legend.get_window_extent().overlaps(panel.get_tightbbox()) for panel in figure.axes):
        print(stem, "has its legend on a panel")
    print(stem, *(text.get_text() for text in legend.get_texts()))
    return save(figure, folder, stem)
tuning_figure.save = save_and_check
print(*tuning_figure.draw(pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[2])))
"""
PRESETS = ("rtxgi", "majercik2021", "gdc2019", "classic", "/home/me/corn.toml")


def report(presets=PRESETS):
    """What of tune.json is drawn."""
    error = {"nrmse": 0.2, "light_leak": 0.01, "shadow_leak": 0.02}
    settings = [{"setting": name, "heldout": {**error, "noise_floor": error}}
                for name in ("from", "tuned", *presets)]
    places = [{"name": name, "normal_bias": 0.1 * i, "view_bias": 0.1 * i}
              for i, name in enumerate(("from", "tuned", *presets))]
    return {"from": "probelab rays=16", "scenes": [{"scene": "room/scene"}],
            "bias_map": {"size": 2, "places": places},
            "searches": {name: [[1, 2.0], [30, 1.0 + i]] for i, name in enumerate(
                ("levenberg_marquardt", "multi_start", "nelder_mead", "random"))},
            "scores": [{"scene": "room/scene", "state": state, "lights": "train",
                        "settings": settings} for state in ("day", "dusk", "night")]}


class Figure(CliTest):
    """scripts/tuning_figure.py, by the distribution's Python, which has matplotlib."""
    PYTHON = "/usr/bin/python3"
    MAP = ("normal_bias,view_bias,cost,nrmse,light_leak\n0,0,1,0.1,0.01\n1,0,2,0.2,0.02\n"
           "0,1,3,0.3,0.03\n1,1,4,0.4,0.04\n")

    def write(self, result, bias_map=MAP):
        (self.folder / "tune.json").write_text(json.dumps(result))
        (self.folder / "bias_map.csv").write_text(bias_map)

    def test_legends_fit(self):
        twins = ("a/tuned.toml", "b/tuned.toml", "a_preset_with_a_rather_long_name.toml")
        for presets in (PRESETS[:3], PRESETS, (*PRESETS, *twins)):
            self.write(report(presets))
            done = subprocess.run([self.PYTHON, "-B", "-c", DRAW_AND_CHECK, SOURCE / "scripts",
                                   self.folder], capture_output=True, text=True, timeout=300)
            names = [n if n in twins[:2] else n.split("/")[-1] for n in presets]
            self.assertEqual(done.stdout.splitlines(), [
                " ".join(("bias_map probelab tuned", *names)),
                "searches Levenberg-Marquardt from the preset Levenberg-Marquardt, multi-start "
                "Nelder-Mead from the preset random search",
                " ".join(("errors probelab (from) tuned", *names, "noise floor")),
                "bias_map.pdf bias_map.png searches.pdf searches.png errors.pdf errors.png"],
                done.stderr)

    def refused(self, *options, words=()):
        done = subprocess.run([self.PYTHON, "-B", SOURCE / "scripts/tuning_figure.py", self.folder,
                               *options], capture_output=True, text=True, timeout=300)
        self.assertEqual((done.returncode, done.stdout), (2, ""), done.stderr)
        self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)
        for word in words:
            self.assertIn(word, done.stderr)

    def test_damaged_reports(self):
        lacking = report()
        lacking["scores"][0]["settings"][1]["heldout"] = None
        lacking["bias_map"] = None
        for result, word in (([], "no JSON object"), ({}, "'scores'"), (lacking, "TypeError")):
            self.write(result)
            self.refused(words=(str(self.folder / "tune.json"), word))
        for cut in (self.MAP[:-6], self.MAP[:-15], self.MAP[:44], ""):
            self.write(report(), cut)
            self.refused(words=(str(self.folder / "bias_map.csv"), "again" if cut else "0 values"))
        (self.folder / "tune.json").write_text('{"scor')
        self.refused(words=(str(self.folder / "tune.json"), "no JSON"))

    def test_folders_that_are_missing(self):
        self.write(report())
        missing = self.folder / "missing"
        self.refused("-o", missing, words=(f"-o {missing}: no such folder",))
        (self.folder / "tune.json").unlink()
        self.refused(words=(f"{self.folder / 'tune.json'}: No such file",))


if __name__ == "__main__":
    unittest.main()
