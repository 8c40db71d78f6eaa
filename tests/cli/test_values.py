# SPDX-License-Identifier: GPL-3.0-or-later
"""Fitted texel values put on a field by evaluate and render: what they change, and what is refused."""
import json
import unittest

import test_tune
from test_tune import FIELD, TRUTH


class Values(test_tune.TuneTest):
    def setUp(self):
        super().setUp()
        # A room this even moves by less than the places of a small format.
        self.tune("--vary", "none", "--fit-values", "values.json", "--set",
                  "irradiance_format=rgba32f")
        self.options = ("--params", "tuned.toml")

    def evaluate(self, *options):
        return self.run_json("evaluate", "room.toml", *FIELD, *TRUTH, *self.options, *options)

    def test_on_a_field(self):
        plain, fitted = self.evaluate(), self.evaluate("--values", "values.json")
        self.assertIsNone(plain["values"])
        self.assertEqual((fitted["values"]["file"], fitted["values"]["state"]),
                         ("values.json", "day"))
        self.assertNotEqual(plain["error"]["nrmse"], fitted["error"]["nrmse"])
        self.assertEqual(plain["updates"], fitted["updates"])
        image = self.run_json("render", "room.toml", "-o", "a.exr", "--width", 16, "--height", 9,
                              "--spp", 1, *FIELD, *self.options)
        other = self.run_json("render", "room.toml", "-o", "b.exr", "--width", 16, "--height", 9,
                              "--spp", 1, *FIELD, *self.options, "--values", "values.json")
        self.assertIsNone(image["values"])
        self.assertEqual(other["values"]["state"], "day")
        self.assertNotEqual((self.folder / "a.exr").read_bytes(),
                            (self.folder / "b.exr").read_bytes())

    def test_gains_of_1_change_nothing(self):
        values = json.loads((self.folder / "values.json").read_text())
        values["gains"] = [""] * values["probes"]
        (self.folder / "ones.json").write_text(json.dumps(values))
        self.assertEqual(self.evaluate("--values", "ones.json")["error"], self.evaluate()["error"])

    def test_refusals(self):
        (self.folder / "bad.json").write_text("{")
        for options, says in ((("--values", "missing.json"), "missing.json"),
                              (("--values", "bad.json"), "bad.json: not a JSON object"),
                              (("--values", "values.json", "--ablation", "query"), "--values"),
                              (("--values", "values.json", "--lattice", "bounds"), "values.json: "),
                              (("--values", "values.json", "--set", "irradiance_texels=4"),
                               "irradiance texels")):
            self.assert_refused("evaluate", "room.toml", *FIELD, *TRUTH, *self.options, *options,
                                words=(says,))


if __name__ == "__main__":
    unittest.main()
