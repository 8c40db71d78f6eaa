# SPDX-License-Identifier: GPL-3.0-or-later
"""render, evaluate and bench on a small room: names, options, refusals, equal bytes."""
import csv
import json
import unittest

from support import CliTest, SOURCE, write_glb

NO_DEVICE = {"VK_ICD_FILENAMES": "/nonexistent/icd.json",
             "VK_DRIVER_FILES": "/nonexistent/icd.json"}
# Nothing here is about accuracy.
FIELD = ("--probes", 27, "--rays", 32, "--updates", 4, "--tracer", "embree")
TRUTH = ("--count", 64, "--spp", 32, "--cache", "cache")
METRICS = ("nrmse", "bias", "relmse", "smape", "p95", "p99", "light_leak", "shadow_leak",
           "dark_leak", "leak_area", "noise_floor", "max_abs", "surface", "volume")


class FieldTest(CliTest):
    def setUp(self):
        super().setUp()
        write_glb(self.folder / "room.glb", emission=(1.0, 0.5, 0.25))


class Evaluate(FieldTest):
    def evaluate(self, *options, **more):
        return self.run_json("evaluate", "room.glb", *FIELD, *TRUTH, *options, **more)

    def test_fixed_names(self):
        result = self.evaluate()
        for name in ("scene", "strategy", "probes", "params", "error", "speed", "work",
                     "layout_build_s", "memory_bytes", "updates", "temporal", "stability",
                     "device", "tracer", "seed", "version"):
            self.assertIn(name, result)
        self.assertEqual(set(result["probes"]), {"stored", "active"})
        self.assertEqual(result["tracer"], "embree")
        self.assertIsNone(result["temporal"])
        for name in METRICS:
            self.assertIn(name, result["error"])
        for name in ("update_ms", "generate_ms", "trace_ms", "shade_ms", "occlude_ms",
                     "resolve_ms", "blend_ms", "query_ns_per_point", "frame_ms", "rays_per_s"):
            self.assertIn(name, result["speed"])
        for name in ("non_finite", "clamped", "fallback_queries", "tiny_weight_sum"):
            self.assertIn(name, result["stability"])
        self.assertEqual(result["stability"]["non_finite"], 0)
        self.assertEqual(result["params"]["rays"], 32)
        self.assertLessEqual(result["probes"]["stored"], 27)
        frame = result["speed"]["update_ms"] + 2.0736 * result["speed"]["query_ns_per_point"]
        self.assertAlmostEqual(result["speed"]["frame_ms"], frame, delta=1e-6 * frame)

    def test_settings_reach_the_parameters(self):
        params = self.evaluate("--params", "classic", "--set", "normal_bias=0.3",
                               "--set", "irradiance_format=rgba32f")["params"]
        self.assertEqual(params["normal_bias"], 0.3)
        self.assertEqual(params["irradiance_format"], "rgba32f")
        self.assertEqual(params["visibility"], False)

    def test_a_receivers_file_gives_the_numbers_of_the_cache(self):
        cached = self.evaluate()
        self.run_ok("receivers", "room.glb", "-o", "r.json", *TRUTH)
        given = self.run_json("evaluate", "room.glb", *FIELD, "--receivers", "r.json")
        self.assertEqual(given["error"], cached["error"])

    def test_same_seed_same_numbers_on_any_threads(self):
        dumps = []
        for threads in (1, 2):
            self.evaluate("--threads", threads, "--dump", f"{threads}.csv",
                          env={"LP_NUM_THREADS": str(threads)})
            dumps.append((self.folder / f"{threads}.csv").read_bytes())
        self.assertEqual(dumps[0], dumps[1])

    def test_dump_has_a_row_a_receiver(self):
        self.evaluate("--dump", "est.csv")
        with open(self.folder / "est.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual(len(rows), 64)
        self.assertEqual(list(rows[0]), "index,x,y,z,nx,ny,nz,kind,region,split,area,est_r,est_g,"
                                        "est_b,a_r,a_g,a_b,b_r,b_g,b_b".split(","))
        self.assertTrue(all(-2 <= float(row["x"]) <= 2 for row in rows))

    def test_temporal_mode_follows_the_run(self):
        result = self.run_json("evaluate", "room.glb", "--probes", 27, "--rays", 32, *TRUTH,
                               "--tracer", "embree", "--mode", "temporal", "--updates", 40)
        self.assertEqual(result["updates"], 40)
        self.assertEqual(list(result["temporal"]["nrmse_after"]),
                         "1 2 3 4 6 8 12 16 24 32".split())
        self.assertGreater(result["temporal"]["flicker"], 0)

    def test_requirement(self):
        met = self.run_program("evaluate", "room.glb", *FIELD, *TRUTH, "--require", "nrmse<=10",
                               "--require", "stability.non_finite==0")
        self.assertEqual(met.returncode, 0, met.stderr)
        unmet = self.run_program("evaluate", "room.glb", *FIELD, *TRUTH, "--require", "nrmse<0")
        self.assertEqual(unmet.returncode, 3)
        self.assertIn("not met: nrmse: wanted < 0, measured", unmet.stderr)

    def test_validation_layers_have_nothing_to_say(self):
        self.evaluate("--validation")
        self.evaluate(env={"PROBELAB_VALIDATION": "1"})


class Render(FieldTest):
    SIZE = ("--width", 24, "--height", 16)

    def test_image_picture_and_comparison(self):
        self.run_ok("reference", "room.glb", "-o", "ref.exr", "--spp", 16, *self.SIZE)
        result = self.run_json("render", "room.glb", "-o", "out.exr", *FIELD, *self.SIZE,
                               "--spp", 4, "--compare", "ref.exr")
        self.assertEqual(self.files(), ["out.exr", "out.png", "ref.exr", "ref.png", "room.glb"])
        again = self.run_json("compare", "out.exr", "ref.exr")
        for name, value in result["comparison"]["error"].items():
            self.assertAlmostEqual(value, again["error"][name], delta=1e-6, msg=name)

    def test_same_seed_same_image(self):
        for name in ("a", "b"):
            self.run_ok("render", "room.glb", "-o", f"{name}.exr", *FIELD, *self.SIZE, "--spp", 2)
        self.assertEqual((self.folder / "a.png").read_bytes(), (self.folder / "b.png").read_bytes())
        error = self.run_json("compare", "a.exr", "b.exr")["error"]
        self.assertEqual((error["rmse"], error["relmse"]), (0, 0))

    def test_probes_can_be_shown(self):
        for name, options in (("plain", ()), ("balls", ("--show-probes",))):
            self.run_ok("render", "room.glb", "-o", f"{name}.exr", *FIELD, *self.SIZE, *options)
        self.assertGreater(self.run_json("compare", "balls.exr", "plain.exr")["error"]["rmse"], 0)

    def test_traced_visibility(self):
        """In an empty room rays see all probes, so they say what no test at all says; where a
        wall stands between, they do not."""
        scene = SOURCE / "scenes/two_rooms_door/scene.toml"
        look = (*self.SIZE, "--set", "visibility=false")
        for folder, of, options in (("empty", "room.glb", look),
                                    ("wall", scene, (*look, "--camera", "unlit room"))):
            for name, more in (("plain", ()), ("traced", ("--traced-visibility",))):
                told = self.run_json("render", of, "-o", f"{folder}_{name}.exr", *FIELD, *options,
                                     "--spp", 2, *more)
                self.assertEqual(told["traced_visibility"], name == "traced")
        same, other = (self.run_json("compare", f"{of}_traced.exr", f"{of}_plain.exr")["error"]
                       for of in ("empty", "wall"))
        self.assertLess(same["rmse"], 1e-4)
        self.assertGreater(other["rmse"], 0.01)

    def test_a_reference_of_another_size_is_refused_at_once(self):
        self.run_ok("reference", "room.glb", "-o", "ref.exr", "--spp", 4, *self.SIZE)
        self.assert_refused("render", "room.glb", "-o", "out.exr", "--width", 32, "--height", 16,
                            "--compare", "ref.exr", words=("ref.exr", "24 x 16"))


class Bench(FieldTest):
    def test_names(self):
        result = self.run_json("bench", "room.glb", "--probes", 27, "--rays", 16, "--updates", 6,
                               "--tracer", "embree")
        for stage in ("update", "generate", "trace", "shade", "resolve", "blend"):
            self.assertEqual(set(result["stages"][stage]), {"median_ms", "p5_ms", "p95_ms"})
        self.assertGreater(result["ratios"]["trace_vs_bare"], 0)


class Refusals(FieldTest):
    def test_no_probes(self):
        for value in ("0", "-3", "1.5"):
            self.assert_refused("evaluate", "room.glb", f"--probes={value}",
                                words=("--probes", value))

    def test_unknown_names(self):
        for option, value, word in (
                ("--params", "rtxg", "'rtxgi'"), ("--strategy", "gird", "'grid'"),
                ("--set", "normal_bais=1", "'normal_bias'"), ("--tracer", "embre", "embree"),
                ("--mode", "conv", "converged"), ("--lattice", "box", "bounds")):
            with self.subTest(option=option):
                self.assert_refused("evaluate", "room.glb", option, value, words=(value[:4], word))

    def test_values_out_of_range(self):
        for text in ("normal_bias=-1", "normal_bias=nan", "rays=0", "visibility=3", "=1",
                     "normal_bias", "normal_bias="):
            with self.subTest(text=text):
                self.assert_refused("evaluate", "room.glb", "--set", text, words=("--set", text))

    def test_unknown_key_in_a_parameter_file(self):
        (self.folder / "mine.toml").write_text('preset = "rtxgi"\nnormal_bais = 0.1\n')
        self.assert_refused("evaluate", "room.glb", "--params", "mine.toml",
                            words=("mine.toml:2", "'normal_bias'"))

    def test_receivers_of_another_scene(self):
        self.run_ok("receivers", "room.glb", "-o", "r.json", *TRUTH)
        write_glb(self.folder / "other.glb", emission=(0.1, 0.1, 0.1))
        self.assert_refused("evaluate", "other.glb", "--receivers", "r.json", words=("r.json",))

    def test_damaged_receivers(self):
        self.run_ok("receivers", "room.glb", "-o", "r.json", *TRUTH)
        text = (self.folder / "r.json").read_text()
        document = json.loads(text)
        document["receivers"][3]["a"] = [0, "x", 0]
        for damaged in (text[:len(text) // 2], "[]", json.dumps(document)):
            (self.folder / "r.json").write_text(damaged)
            self.assert_refused("evaluate", "room.glb", "--receivers", "r.json", words=("r.json",))

    def test_no_vulkan_device(self):
        for command in (("evaluate", "room.glb"), ("render", "room.glb", "-o", "o.exr"),
                        ("bench", "room.glb")):
            with self.subTest(command=command[0]):
                self.assert_refused(*command, code=1, words=("Vulkan",), env=NO_DEVICE)

    def test_unknown_device(self):
        self.assert_refused("evaluate", "room.glb", "--device", "no such device", code=1,
                            words=("no such device",))

    def test_outputs(self):
        self.assert_refused("evaluate", "room.glb", "--dump", "no/est.csv", words=("no",))
        self.assert_refused("evaluate", "room.glb", "--dump", "est.txt", words=(".csv",))
        self.assert_refused("render", "room.glb", "-o", "no/o.exr", words=("no",))


if __name__ == "__main__":
    unittest.main()
