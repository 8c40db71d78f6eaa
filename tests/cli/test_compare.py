# SPDX-License-Identifier: GPL-3.0-or-later
"""`probelab compare` on hand-made images, against metrics worked out here from their definitions."""
import math
import unittest

from support import CliTest, write_exr

NAMES = {"nrmse", "rmse", "mae", "bias", "relmse", "smape", "max_abs", "flip"}


def constant(value, width=8, height=4):
    return [[(value, value, value)] * width for _ in range(height)]


class Metrics(CliTest):
    def compare(self, image, reference, *options):
        write_exr(self.folder / "a.exr", image)
        write_exr(self.folder / "ref.exr", reference)
        return self.run_json("compare", "a.exr", "ref.exr", *options)

    def test_json_has_the_fixed_names(self):
        result = self.compare(constant(1.0), constant(1.0))
        self.assertEqual(set(result["error"]), NAMES)
        self.assertEqual((result["width"], result["height"]), (8, 4))
        for name in ("version", "compiler", "command", "seed"):
            self.assertIn(name, result["provenance"])

    def test_equal_images_have_no_error(self):
        image = [[(0.25 * x, 0.5, 0.125 * y) for x in range(8)] for y in range(4)]
        error = self.compare(image, image, "--flip-start", -2, "--flip-stop", 2)["error"]
        for name in ("rmse", "mae", "bias", "relmse", "smape", "flip"):
            self.assertEqual(error[name], 0, name)

    def test_grey_levels_by_hand(self):
        # Half of the pixels 1.5 and 0.5 against 1: mean of the reference 1, differences +-0.5.
        # Luminance weights sum to 1 within 1e-7, so grey keeps its value to about 1e-6.
        image = [[(1.5,) * 3 if (x + y) % 2 else (0.5,) * 3 for x in range(8)] for y in range(4)]
        error = self.compare(image, constant(1.0))["error"]
        self.assertAlmostEqual(error["rmse"], 0.5, delta=1e-6)
        self.assertAlmostEqual(error["mae"], 0.5, delta=1e-6)
        self.assertAlmostEqual(error["bias"], 0.0, delta=1e-6)
        self.assertAlmostEqual(error["relmse"], 0.25 / (1 + 0.01 ** 2), delta=1e-6)
        smape = 0.5 * (2 * 0.5 / (2.5 + 1e-3) + 2 * 0.5 / (1.5 + 1e-3))
        self.assertAlmostEqual(error["smape"], smape, delta=1e-6)
        self.assertAlmostEqual(error["max_abs"], 1.5, delta=1e-6)

    def test_colours_count_by_rec709_luminance(self):
        # Only green differs: 0.7152 of the luminance (Rec.709).
        error = self.compare([[(1.0, 2.0, 1.0)] * 4] * 4, constant(1.0, 4, 4))["error"]
        self.assertAlmostEqual(error["bias"], 0.7152, delta=1e-4)

    def test_a_black_reference_gives_null_ratios_and_says_why_there_is_no_flip(self):
        result = self.compare(constant(0.5), constant(0.0))
        for name in ("rmse", "mae", "bias", "flip"):
            self.assertIsNone(result["error"][name], name)
        self.assertAlmostEqual(result["error"]["max_abs"], 0.5, delta=1e-6)
        self.assertTrue(any("FLIP" in warning for warning in result["warnings"]))

    def test_flip_exposures_are_taken_from_the_options(self):
        result = self.compare(constant(0.5), constant(0.4), "--flip-start", -3, "--flip-stop", 1)
        self.assertEqual(result["flip_exposures"],
                         {"start": -3, "stop": 1, "count": 4, "source": "options"})
        self.assertTrue(0 < result["error"]["flip"] < 1)

    def test_the_error_map_is_a_png(self):
        write_exr(self.folder / "a.exr", constant(0.75, 64, 48))
        write_exr(self.folder / "ref.exr", constant(0.5, 64, 48))
        self.run_ok("compare", "a.exr", "ref.exr", "-o", "error.png")
        self.assertEqual((self.folder / "error.png").read_bytes()[:8], b"\x89PNG\r\n\x1a\n")
        self.assertEqual(self.files(), ["a.exr", "error.png", "ref.exr"])

    def test_the_table_shows_every_metric(self):
        write_exr(self.folder / "a.exr", constant(0.75))
        text = self.run_ok("compare", "a.exr", "a.exr").stdout
        for name in NAMES:
            self.assertRegex(text, rf"(?m)^{name} ")


class Requirements(CliTest):
    def setUp(self):
        super().setUp()
        write_exr(self.folder / "a.exr", constant(1.1))
        write_exr(self.folder / "ref.exr", constant(1.0))

    def require(self, *conditions):
        options = [part for text in conditions for part in ("--require", text)]
        return self.run_program("compare", "a.exr", "ref.exr", *options)

    def test_met(self):
        result = self.require("bias<=0.11", "error.bias>0.09", "max_abs < 2", "width==8")
        self.assertEqual(result.returncode, 0, result.stderr)

    def test_not_met_names_wanted_and_measured(self):
        result = self.require("bias<=0.05", "mae<1")
        self.assertEqual(result.returncode, 3)
        line = result.stderr.splitlines()[-1]
        self.assertRegex(line, r"^probelab: not met: bias: wanted <= 0\.05, measured 0\.1")
        self.assertNotIn("mae", line)
        self.assertIn("bias", result.stdout)

    def test_unknown_name_gives_the_nearest(self):
        result = self.require("bais<=0.05")
        self.assertEqual(result.returncode, 2)
        self.assertIn("did you mean 'bias'?", result.stderr)

    def test_null_cannot_be_compared(self):
        result = self.require("nrmse<=0.05")
        self.assertEqual(result.returncode, 2)
        self.assertIn("null", result.stderr)


class BadImages(CliTest):
    def setUp(self):
        super().setUp()
        write_exr(self.folder / "a.exr", constant(1.0))

    def test_sizes_differ(self):
        write_exr(self.folder / "b.exr", constant(1.0, 4, 4))
        self.assert_refused("compare", "b.exr", "a.exr", words=("4 x 4", "8 x 4"))

    def test_not_finite(self):
        for value in (math.nan, math.inf):
            with self.subTest(value=value):
                image = constant(1.0)
                image[2][3] = (1.0, value, 1.0)
                write_exr(self.folder / "b.exr", image)
                self.assert_refused("compare", "b.exr", "a.exr", "-o", "error.png",
                                    words=("b.exr", "(3, 2)", "not finite"))
                self.assert_refused("compare", "a.exr", "b.exr", words=("b.exr", "(3, 2)"))

    def test_missing_file(self):
        self.assert_refused("compare", "a.exr", "missing.exr",
                            words=("missing.exr", "no such file"))

    def test_truncated_file(self):
        data = (self.folder / "a.exr").read_bytes()
        (self.folder / "b.exr").write_bytes(data[:len(data) // 2])
        self.assert_refused("compare", "b.exr", "a.exr", words=("b.exr",))

    def test_unknown_layer(self):
        self.assert_refused("compare", "a.exr", "a.exr", "--layer", "irradiance",
                            words=("irradiance",))

    def test_output_in_a_missing_folder(self):
        self.assert_refused("compare", "a.exr", "a.exr", "-o", "no/error.png",
                            words=("no", "does not exist"))

    def test_two_outputs_at_one_place(self):
        self.assert_refused("compare", "a.exr", "a.exr", "-o", "z.png", "--picture", "./z.png",
                            words=("z.png", "both"))

    def test_exposures_that_show_nothing(self):
        self.assert_refused("compare", "a.exr", "a.exr", "--flip-start", "999", "--flip-stop",
                            "1000", words=("999", "64 stops"))

    def test_output_of_the_wrong_kind(self):
        self.assert_refused("compare", "a.exr", "a.exr", "-o", "error.jpg", words=(".png",))

    def test_one_flip_exposure_alone(self):
        self.assert_refused("compare", "a.exr", "a.exr", "--flip-start", "1",
                            words=("--flip-stop",))


if __name__ == "__main__":
    unittest.main()
