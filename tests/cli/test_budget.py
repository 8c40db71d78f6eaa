# SPDX-License-Identifier: GPL-3.0-or-later
"""probelab budget: the rungs, their agreement with evaluate, refusals."""
import unittest

from support import CliTest, SOURCE, write_glb

WALL = SOURCE / "scenes/thin_wall/scene_05cm.toml"
SMALL = ("--count", 128, "--rel-error", 0.2, "--probes", 100, "--rays", 32, "--updates", 4,
         "--params", "probelab")
NAMES = ["exact", "moments", "texels", "rays", "formats", "field"]


class Budget(CliTest):
    def test_last_rung_is_evaluate_and_shares_sum_to_one(self):
        budget = self.run_json("budget", WALL, *SMALL, "--exact-rays", 512)
        score = self.run_json("evaluate", WALL, *SMALL)
        self.assertEqual(budget["error"], score["error"])
        rungs = budget["rungs"]
        self.assertEqual([r["name"] for r in rungs], NAMES)
        for name in ("nrmse", "bias", "light_leak", "shadow_leak", "smape"):
            self.assertEqual(rungs[-1][name], score["error"][name], name)
        self.assertAlmostEqual(sum(r["share"] for r in rungs), 1, places=9)
        before = 0
        for rung in rungs:
            rise = rung["mean_square"] - before
            self.assertAlmostEqual(rung["share"], rise / rungs[-1]["mean_square"], places=9)
            before = rung["mean_square"]
        for name in ("lattice", "params", "seed", "version", "device", "tracer", "converged"):
            self.assertEqual(budget[name], score[name], name)
        self.assertEqual(budget["noise_floor"], score["error"]["noise_floor"])

    def test_without_bounces_the_stages_end_at_the_field(self):
        # A black panel that emits, alone in space: no light comes through the probes, so rays and
        # formats rebuilt on the host must be what the device's field holds, but for a texel's last
        # place (2^-10 of fp16).
        write_glb(self.folder / "panel.glb", [(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)],
                  [(0, 1, 2), (0, 2, 3)], base_color=(0, 0, 0, 1), emission=(1, 1, 1),
                  camera=None, double_sided=True)
        (self.folder / "panel.toml").write_text(
            'gltf = "panel.glb"\n[volume]\nmin = [-2.0, -2.0, -2.0]\nmax = [2.0, 2.0, 2.0]\n')
        rungs = self.run_json("budget", "panel.toml", *SMALL, "--exact-rays", 64, "--split", "all",
                              "--set", "irradiance_format=rgba16f")["rungs"]
        formats, field = rungs[-2], rungs[-1]
        self.assertGreater(field["nrmse"], 0.05)
        for name in ("nrmse", "bias", "smape", "light_leak", "shadow_leak"):
            self.assertAlmostEqual(formats[name], field[name], delta=2 ** -10, msg=name)
        self.assertGreater(abs(rungs[-3]["nrmse"] - rungs[-4]["nrmse"]), 2 ** -10)

    def test_threads_change_no_byte_and_the_seed_does(self):
        def rungs(*more):
            return self.run_json("budget", WALL, *SMALL, "--exact-rays", 256, *more)["rungs"]
        one = rungs("--threads", 1)
        self.assertEqual(one, rungs("--threads", 2))
        self.assertNotEqual(one, rungs("--seed", 2))

    def test_text_names_every_rung_and_require_holds_the_field(self):
        text = self.run_ok("budget", WALL, *SMALL, "--exact-rays", 64,
                           "--require", "nrmse>0").stdout
        for name in NAMES:
            self.assertRegex(text, rf"(?m)^{name} .* %")
        unmet = self.run_program("budget", WALL, *SMALL, "--exact-rays", 64,
                                 "--require", "nrmse<=0")
        self.assertEqual(unmet.returncode, 3)
        self.assert_refused("budget", WALL, *SMALL, "--require", "rung<=0", words=["rung"])

    def test_parameters_without_visibility_say_so(self):
        result = self.run_json("budget", WALL, *SMALL, "--exact-rays", 64,
                               "--set", "visibility=false")
        self.assertIn("no visibility", result["rungs"][1]["about"])
        self.assertGreater(result["rungs"][1]["light_leak"], result["rungs"][0]["light_leak"])

    def test_refusals(self):
        self.assert_refused("budget", WALL, *SMALL, "--mode", "temporal", words=["converged"])
        self.assert_refused("budget", WALL, *SMALL, "--exact-rays", 63, words=["even"])
        write_glb(self.folder / "dark.glb")
        dark = self.run_program("budget", "dark.glb", "--count", 64, "--rel-error", 0.5,
                                "--probes", 8)
        self.assertEqual((dark.returncode, dark.stdout), (2, ""))
        self.assertIn("no scored receiver gets light", dark.stderr.splitlines()[-1])


if __name__ == "__main__":
    unittest.main()
