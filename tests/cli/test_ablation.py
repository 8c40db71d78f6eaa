# SPDX-License-Identifier: GPL-3.0-or-later
"""evaluate --ablation: rows are data, each row is the run that its settings alone would be."""
import unittest

from support import CliTest, SOURCE, write_glb

FIELD = ("--probes", 27, "--rays", 32, "--updates", 4, "--tracer", "embree")
TRUTH = ("--count", 64, "--spp", 32, "--cache", "cache")
BUILT_IN = ("drop_one", "presets", "storage", "talk")
PRESETS = ("classic", "gdc2019", "majercik2021", "probelab", "rtxgi")


class AblationTest(CliTest):
    def setUp(self):
        super().setUp()
        # A lamp, so that irradiance varies and every error is above 0.
        write_glb(self.folder / "room.glb")
        (self.folder / "room.toml").write_text(
            'gltf = "room.glb"\n[[light]]\nname = "lamp"\ntype = "point"\nintensity = 5.0\n'
            'position = [0.5, 2.0, 0.5]\n')

    def write(self, text):
        (self.folder / "mine.toml").write_text(text)
        return "mine.toml"

    def evaluate(self, *options):
        return self.run_json("evaluate", "room.toml", *FIELD, *TRUTH, *options)

    def ablate(self, text, *options):
        result = self.evaluate("--ablation", self.write(text), *options)
        rows = {row["row"]: row for row in result["ablation"]}
        skipped = {row["row"]: row["why"] for row in result["ablation_skipped"]}
        return result, rows, skipped


class Rows(AblationTest):
    def test_every_part_can_be_left_out_with_parallax_too(self):
        for preset in ("rtxgi", "probelab"):  # without and with a fallback that looks at distances
            result = self.evaluate("--ablation", "drop_one", "--params", preset,
                                   "--set", "parallax=0.5")
            rows = {row["row"]: row for row in result["ablation"]}
            self.assertLess(rows["no visibility"]["memory"]["atlas_per_probe"],
                            rows["base"]["memory"]["atlas_per_probe"], preset)

    def test_a_row_is_the_run_with_its_settings(self):
        result, rows, skipped = self.ablate(
            '[[row]]\nname = "blind"\nset = ["visibility=false"]\n'
            '[[row]]\nname = "same"\nset = ["rays=32"]\n'
            '[[row]]\nname = "later"\nmode = "temporal"\nset = ["visibility=false"]\n'
            '[[row]]\nname = "by direction"\nset = ["ray_order=direction"]\n',
            "--set", "ray_order=probe")
        self.assertEqual(list(rows), ["base", "blind", "by direction"])
        self.assertEqual(set(skipped), {"same", "later"})
        base, blind = rows["base"], rows["blind"]
        self.assertEqual(base["error"], self.evaluate()["error"])
        alone = self.evaluate("--set", "visibility=false")
        self.assertEqual(blind["error"], alone["error"])
        self.assertEqual(blind["memory"], alone["memory"])
        self.assertEqual(result["error"], base["error"])
        self.assertAlmostEqual(blind["ratios"]["nrmse"],
                               blind["error"]["nrmse"] / base["error"]["nrmse"], delta=1e-9)
        self.assertFalse(blind["same_estimates"])
        self.assertTrue(rows["by direction"]["same_estimates"])
        self.assertEqual(rows["by direction"]["ratios"]["nrmse"], 1)
        for name in ("update_ms", "trace_ms", "query_ns_per_point"):
            self.assertGreater(blind["speed"][name], 0)
            self.assertGreater(blind["ratios"][name], 0)
            self.assertEqual(base["ratios"][name], 1)

    def test_a_row_can_place_and_start_anew(self):
        _, rows, skipped = self.ablate(
            '[[row]]\nname = "half"\nprobes = 0.5\n'
            '[[row]]\nname = "tall"\nvertical = 4.0\n'
            '[[row]]\nname = "clamp"\nclamp_over_mean = 0.5\n'
            '[[row]]\nname = "preset"\nparams = "classic"\n'
            '[[row]]\nname = "or else"\nset = ["fallback=lerp_unoccluded"]\n'
            'else_set = ["facing=none"]\n', "--set", "visibility=false",
            "--set", "irradiance_texels=12")
        self.assertEqual(skipped, {})
        self.assertLessEqual(rows["half"]["probes"]["stored"], 14)
        self.assertNotEqual(rows["tall"]["error"], rows["base"]["error"])
        # The clamp is below what the walls send, so it must take light away.
        self.assertLess(rows["clamp"]["error"]["bias"], rows["base"]["error"]["bias"])
        self.assertIn("radiance_clamp=", " ".join(rows["clamp"]["set"]))
        # The row starts from the preset alone, but for --rays.
        self.assertEqual(rows["preset"]["error"],
                         self.evaluate("--params", "classic")["error"])
        # lerp_unoccluded needs visibility.
        self.assertEqual(rows["or else"]["set"], ["facing=none"])

    def test_the_table_names_rows_and_what_was_skipped(self):
        text = self.run_ok("evaluate", "room.toml", *FIELD, *TRUTH, "--set", "ray_order=probe",
                           "--ablation", self.write(
            '[[row]]\nname = "by direction"\nset = ["ray_order=direction"]\nabout = "a note"\n'
            '[[row]]\nname = "nothing"\n')).stdout
        row = next(line for line in text.splitlines() if line.startswith("by direction"))
        self.assertTrue(row.endswith("same bytes"), row)
        self.assertIn("a note", text)
        self.assertIn("skipped: nothing: changes nothing here", text)

    def test_built_in_rows_apply_to_every_preset(self):
        # All rows are resolved before the scene is read, so the missing scene must be what fails.
        for name in BUILT_IN:
            for preset in PRESETS:
                with self.subTest(ablation=name, preset=preset):
                    self.assert_refused("evaluate", "none.glb", "--params", preset, "--ablation",
                                        name, words=("none.glb",))

    def test_storage_rows_keep_to_the_bytes(self):
        text = (SOURCE / "experiments/ablations/storage.toml").read_text()
        names = [line.split('"')[1] for line in text.splitlines()
                 if line.startswith("name") and " and " in line and "border" not in line]
        self.assertGreaterEqual(len(names), 8)
        for name in names:
            form, irradiance, _, moments = name.split()
            size = int(irradiance) ** 2 * (8 if form == "rgba16f" else 4) + int(moments) ** 2 * 4
            self.assertLessEqual(size, 1168, name)


class Refusals(AblationTest):
    def refuse(self, text, *words):
        self.assert_refused("evaluate", "room.glb", "--ablation", self.write(text), words=words)

    def test_unknown_name_lists_what_there_is(self):
        self.assert_refused("evaluate", "room.glb", "--ablation", "drop_on",
                            words=("drop_on", *BUILT_IN))
        self.assert_refused("evaluate", "room.glb", "--ablation", "none.toml",
                            words=("none.toml",))

    def test_bad_files(self):
        self.refuse('[[row]]\nname = "a"\nabuot = "x"\n', "mine.toml:3", "'about'")
        self.refuse('[[rows]]\nname = "a"\n', "mine.toml:1", "'row'")
        self.refuse('[[row]]\nset = []\n', "mine.toml:1", "name")
        self.refuse('[[row]]\nname = "a"\nset = "x=1"\n', "mine.toml:3", "list")
        self.refuse('[[row]]\nname = "a"\nvertical = -1.0\n', "mine.toml:3", "above 0")
        self.refuse('[[row]]\nname = "a"\nmode = "temproal"\n', "mine.toml:1", "'temporal'")
        self.refuse('[[row]]\nname = "a"\n[[row]]\nname = "a"\n', "mine.toml:3", "already")
        self.refuse('about = "nothing"\n', "mine.toml", "[[row]]")
        self.refuse('[[row]]\nname = "a\n', "mine.toml:2")

    def test_rows_that_cannot_be_applied(self):
        self.refuse('[[row]]\nname = "a"\nset = ["normal_bais=0.1"]\n', "mine.toml:1", "'a'",
                    "'normal_bias'")
        self.refuse('[[row]]\nname = "a"\nset = ["irradiance_fit=true"]\n', "mine.toml:1",
                    "encoding_gamma")

    def test_dumps_are_of_one_field(self):
        self.assert_refused("evaluate", "room.glb", "--ablation", "talk", "--dump", "e.csv",
                            words=("--dump",))


if __name__ == "__main__":
    unittest.main()
