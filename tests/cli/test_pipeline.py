# SPDX-License-Identifier: GPL-3.0-or-later
"""What the commands say of states, storage, proxies, baselines and shaders."""
import csv
import unittest

from support import CliTest, SOURCE, write_glb

NO_DEVICE = {"VK_ICD_FILENAMES": "/nonexistent/icd.json",
             "VK_DRIVER_FILES": "/nonexistent/icd.json"}
CORNELL = SOURCE / "scenes/cornell/scene.toml"
FIELD = ("--probes", 27, "--rays", 32, "--updates", 4, "--tracer", "embree")
TRUTH = ("--count", 64, "--spp", 32, "--cache", "cache")


class RoomTest(CliTest):
    def setUp(self):
        super().setUp()
        write_glb(self.folder / "room.glb", emission=(1.0, 0.5, 0.25))

    def evaluate(self, *options, field=FIELD):
        return self.run_json("evaluate", "room.glb", *field, *TRUTH, *options)


class States(RoomTest):
    def test_inactive_probes_are_counted(self):
        # 12 cells along the room: the probes of its middle see no surface within their cells.
        result = self.evaluate("--set", "classification=near_surface", "--set", "relocation=true",
                               "--probes", 1000, field=("--rays", 16, "--updates", 1))
        self.assertLess(result["probes"]["active"], result["probes"]["stored"])
        self.assertEqual(result["work"]["rays"], 16 * result["probes"]["active"])
        for name in ("relocate", "classify"):
            self.assertGreater(result["speed"]["state_ms"][name], 0)
        everyone = self.evaluate()
        self.assertEqual(everyone["probes"]["active"], everyone["probes"]["stored"])
        self.assertEqual(everyone["speed"]["state_ms"], {})

    def test_memory_adds_up(self):
        result = self.evaluate("--params", "probelab")
        memory = result["memory"]
        params = result["params"]
        bytes_of = {"rgba32f": 16, "rgba16f": 8, "r11g11b10f": 4, "rgb10a2": 4, "rg32f": 8,
                    "rg16f": 4}
        a_probe = sum(params[f"{kind}_texels"] ** 2 * bytes_of[params[f"{kind}_format"]]
                      for kind in ("irradiance", "moment"))
        self.assertEqual(memory["atlas_per_probe"], a_probe)
        self.assertLessEqual(a_probe, 1168)
        self.assertEqual(memory["atlas"], a_probe * result["probes"]["stored"])
        self.assertGreater(memory["state_and_index"], 0)
        self.assertEqual(result["memory_bytes"], memory["atlas"] + memory["state_and_index"])

    def test_fallbacks_by_what_answered(self):
        # Receivers in the middle of the air have no active probe around them.
        counts = {}
        for fallback in ("none", "nearest"):
            counts[fallback] = self.evaluate(
                "--set", "classification=near_surface", "--set", f"fallback={fallback}",
                field=("--probes", 1000, "--rays", 16, "--updates", 1))["stability"]
        none, nearest = counts["none"], counts["nearest"]
        self.assertGreater(none["fallback_queries"], 0)
        self.assertEqual(none["empty_answers"], none["fallback_queries"])
        self.assertEqual(nearest["empty_answers"], 0)
        self.assertGreater(nearest["nearest_answers"], 0)
        self.assertEqual(nearest["nearest_answers"] + nearest["unoccluded_answers"],
                         nearest["fallback_queries"])

    def test_a_temporal_run_stops_when_it_is_still(self):
        field = ("--probes", 27, "--rays", 32, "--mode", "temporal", "--updates", 60)
        still = self.evaluate("--set", "variability_threshold=0.05", field=field)
        self.assertTrue(still["stopped_early"])
        self.assertLess(still["updates"], 60)
        going = self.evaluate(field=field)
        self.assertFalse(going["stopped_early"])
        self.assertEqual(going["updates"], 60)
        text = self.run_ok("evaluate", "room.glb", *field, *TRUTH, "--set",
                           "variability_threshold=0.05").stdout
        self.assertIn(f"stopped early at {still['updates']}", text)


class Requirements(RoomTest):
    def test_names_are_checked_before_the_work(self):
        # A truth that would take hours: only a check before it comes back.
        slow = ("--count", 100000, "--spp", 1000000, "--cache", "cache")
        for name, word in (("nrsme", "'nrmse'"), ("stability.clampd", "'stability.clamped'"),
                           ("temporal.flicker", "flicker"), ("speed", "speed")):
            result = self.run_program("evaluate", "room.glb", *FIELD, *slow, "--require",
                                      f"{name}<=1", timeout=60)
            self.assertEqual(result.returncode, 2, result.stderr)
            self.assertIn(word, result.stderr)

    def test_every_number_may_be_named(self):
        def paths(value, prefix=""):
            if isinstance(value, (dict, list)):
                items = value.items() if isinstance(value, dict) else enumerate(value)
                for key, inner in items:
                    yield from paths(inner, f"{prefix}{key}.")
            elif isinstance(value, (int, float)) and not isinstance(value, bool):
                yield prefix[:-1]

        for mode in ("converged", "temporal"):
            result = self.evaluate("--mode", mode)
            conditions = [part for path in paths(result)
                          for part in ("--require", f"{path}>=-1e300")]
            self.assertGreater(len(conditions), 200)
            self.evaluate("--mode", mode, *conditions)


class Vertical(RoomTest):
    def spacings(self, *options):
        field = self.folder / "field"
        field.mkdir(exist_ok=True)
        self.evaluate("--dump-field", field, *options,
                      field=("--probes", 200, "--rays", 4, "--updates", 1))
        with open(field / "probes.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        steps = []
        for axis in ("x", "y", "z"):
            places = sorted({round(float(row[axis]), 4) for row in rows})
            steps.append((places[-1] - places[0]) / (len(places) - 1))
        return steps

    def test_cells_are_taller(self):
        # Counts are whole numbers: one layer more or less of 3 or 4 is a third.
        for vertical in (1.0, 2.0):
            x, y, z = self.spacings("--vertical", vertical)
            self.assertAlmostEqual(y / ((x + z) / 2), vertical, delta=0.33 * vertical)

    def test_range(self):
        for value in ("0.2", "8.5"):
            self.assert_refused("evaluate", "room.glb", "--vertical", value,
                                words=("vertical=" + value, "0.25"))
        self.assert_refused("evaluate", "room.glb", "--vertical", "0", words=("--vertical",))


class Proxy(CliTest):
    SMALL = ("--probes", 27, "--rays", 32, "--updates", 2, "--count", 64, "--spp", 32)

    def test_report(self):
        plain = self.run_json("evaluate", CORNELL, *self.SMALL)
        self.assertIsNone(plain["ray_proxy"])
        # A metre is more than any wall allows.
        result = self.run_json("evaluate", CORNELL, *self.SMALL, "--ray-proxy", 1.0)
        proxy = result["ray_proxy"]
        self.assertLess(proxy["triangles_after"], proxy["triangles_before"])
        self.assertEqual(proxy["asked_m"], 1.0)
        self.assertAlmostEqual(proxy["bound_m"], proxy["thinnest_wall_m"] / 4, delta=1e-6)
        self.assertLessEqual(proxy["error_m"], proxy["bound_m"])
        self.assertEqual(proxy["leaks"], 0)
        self.assertGreater(proxy["blocked"], 100)
        self.assertGreater(proxy["build_s"], 0)

    def test_value(self):
        for value in ("-0.01", "nan", "x"):
            self.assert_refused("evaluate", CORNELL, f"--ray-proxy={value}",
                                words=("--ray-proxy",))


class Baselines(RoomTest):
    def bench(self, *options):
        return self.run_json("bench", "room.glb", "--probes", 64, "--rays", 16, "--updates", 6,
                             "--tracer", "embree", *options)

    def test_textbook_beside_ours(self):
        result = self.bench("--params", "probelab")
        for name in ("trace_vs_bare", "blend_vs_textbook", "query_vs_textbook"):
            self.assertGreater(result["ratios"][name], 0)
        baselines = result["baselines"]
        self.assertEqual(baselines["textbook"], {"irradiance_texels": 8, "moment_texels": 16,
                                                 "probes": result["probes"], "rays": 16})
        whole = baselines["textbook_blend"]["median_ms"]
        self.assertGreater(whole, baselines["textbook_blend_moments"]["median_ms"])
        self.assertGreater(whole, baselines["textbook_blend_irradiance"]["median_ms"])
        self.assertGreater(baselines["textbook_query"]["median_ns"], 0)
        # Each ratio is a median over the updates, so it lies within what the ranges allow.
        blend, book = result["stages"]["blend"], baselines["textbook_blend"]
        ratio = result["ratios"]["blend_vs_textbook"]
        self.assertLess(book["p5_ms"] / blend["p95_ms"] * 0.5, ratio)
        self.assertGreater(book["p95_ms"] / blend["p5_ms"] * 2, ratio)
        self.assertEqual(result["work"]["rays"], 16 * result["active_probes"])
        self.assertGreater(result["stage_sum_share"], 0.2)
        self.assertLess(result["stage_sum_share"], 1.02)
        self.assertIsNone(result["sweep"])

    def test_blending_is_compared_a_probe(self):
        # The corridor fills a tenth of its lattice; the textbook blends every lattice point.
        result = self.run_json("bench", SOURCE / "scenes/corridor_l/scene.toml", "--probes", 256,
                               "--lattice", "bounds", "--rays", 16, "--updates", 6)
        textbook = result["baselines"]["textbook_blend"]["median_ms"]
        points = result["baselines"]["textbook"]["probes"]
        self.assertGreater(points, 8 * result["active_probes"])
        expected = (textbook / points) / (result["stages"]["blend"]["median_ms"] /
                                          result["active_probes"])
        # Ratio of medians against median of ratios, on a machine that may be busy.
        self.assertLess(result["ratios"]["blend_vs_textbook"], 3 * expected)
        self.assertGreater(result["ratios"]["blend_vs_textbook"], expected / 3)

    def test_sweep_fits_its_points(self):
        sweep = self.bench("--sweep", "--sweep-probes", 2048)["sweep"]
        for axis in ("probes", "rays"):
            points = sweep[axis]["points"]
            x = [p[axis] for p in points]
            y = [p["update_ms"] for p in points]
            self.assertGreaterEqual(len(x), 3)
            self.assertEqual(x, sorted(x))
            fit = sweep[axis]["fits"]["update"]
            a, b = fit["a_ms"], fit["b_us"] * 1e-3
            # At the least squares, the gradient of the sum of squared relative residuals is 0.
            residuals = [(a + b * xi - yi) / yi for xi, yi in zip(x, y)]
            self.assertAlmostEqual(sum(r / yi for r, yi in zip(residuals, y)), 0, delta=1e-9)
            self.assertAlmostEqual(sum(r * xi / yi for r, xi, yi in zip(residuals, x, y)), 0,
                                   delta=1e-6)
            self.assertAlmostEqual(fit["largest_residual"], max(map(abs, residuals)), delta=1e-9)

    def test_a_sweep_needs_points(self):
        self.assert_refused("bench", "room.glb", "--sweep", "--sweep-probes", "100",
                            words=("--sweep-probes",))


class Shaders(RoomTest):
    def shaders(self, scene, *options):
        report = self.run_json("check", scene, *options)["shaders"]
        return report, {s["stage"]: s for s in report["stages"]}

    def test_parts_that_are_off_are_not_compiled_in(self):
        full, stages = self.shaders("room.glb")
        plain, less = self.shaders("room.glb", "--params", "classic")
        self.assertTrue(full["parts"]["visibility"])
        self.assertFalse(plain["parts"]["visibility"])
        self.assertLess(less["query"]["words"], stages["query"]["words"])
        self.assertLess(less["resolve"]["words"], stages["resolve"]["words"])
        self.assertNotIn("moment atlas", full["absent_buffers"])
        self.assertIn("moment atlas", plain["absent_buffers"])
        self.assertLess(stages["shade"]["words"], stages["shade"]["full_words"])

    def test_a_scenes_features_decide_the_rest(self):
        (self.folder / "lit.toml").write_text(
            'gltf = "room.glb"\n[sky]\nradiance = [1.0, 1.0, 1.0]\n'
            '[[light]]\nname = "lamp"\ntype = "point"\nintensity = 5.0\n'
            'position = [0.0, 2.0, 0.0]\n')
        dark, dark_stages = self.shaders("room.glb")
        lit, stages = self.shaders("lit.toml")
        for name in ("SKY", "LIGHTS", "OCCLUDED"):
            self.assertIn(name, dark["absent_buffers"])
            self.assertNotIn(name, lit["absent_buffers"])
        self.assertNotIn("add light", dark_stages)
        self.assertLess(stages["add light"]["words"], stages["add light"]["full_words"])
        self.assertGreater(stages["shade"]["words"], dark_stages["shade"]["words"])


class ParameterList(RoomTest):
    def test_lists_what_evaluate_knows_without_a_device(self):
        listed = self.run_json("info", "--params", env=NO_DEVICE)["params"]
        used = self.evaluate(field=("--probes", 27, "--updates", 1))["params"]
        used.pop("name")
        self.assertEqual([p["key"] for p in listed], list(used))
        for p in listed:
            self.assertEqual(p["presets"]["rtxgi"], used[p["key"]], p["key"])
            self.assertTrue(p["range"] and p["advice"], p["key"])
        self.assertEqual(next(p["unit"] for p in listed if p["key"] == "normal_bias"), "x s_i")
        text = self.run_ok("info", "--params", env=NO_DEVICE).stdout
        self.assertIn("moment_texels", text)
        self.assertIn("majercik2021", text)


if __name__ == "__main__":
    unittest.main()
