# SPDX-License-Identifier: GPL-3.0-or-later
"""Help pages, usage errors and the exit codes that go with them."""
import re
import unittest

from support import CliTest

# Every command with its required arguments missing is a usage error, but for those without any.
COMMANDS = ("info", "init", "check", "reference", "receivers", "place", "render", "evaluate",
            "compare", "tune", "bench", "report", "budget", "stability")


class HelpPages(CliTest):
    def test_program_lists_every_command(self):
        text = self.run_ok("--help").stdout
        listed = re.findall(r"^  ([a-z]+) ", text, re.MULTILINE)
        for command in COMMANDS:
            self.assertIn(command, listed)

    def test_each_command_shows_defaults_and_an_example(self):
        for command in COMMANDS:
            with self.subTest(command=command):
                text = self.run_ok(command, "--help").stdout
                self.assertIn(f"Usage: probelab {command}", text)
                self.assertIn(f"Example\n  probelab {command}", text)
                self.assertIn("--seed N", text)
                self.assertIn("(default: 1)", text)
                self.assertIn("(default: results/runs/cache)", text)

    def test_no_page_is_wider_than_80_columns(self):
        for command in COMMANDS:
            with self.subTest(command=command):
                page = self.run_ok(command, "--help").stdout.split("\nExample\n")[0]
                self.assertLessEqual(max(map(len, page.splitlines())), 80)

    def test_short_flag_prints_the_same_page(self):
        self.assertEqual(self.run_ok("check", "-h").stdout, self.run_ok("check", "--help").stdout)

    def test_version_is_one_line(self):
        self.assertRegex(self.run_ok("--version").stdout, r"\A\d+\.\d+\.\d+\S*\n\Z")


class UsageErrors(CliTest):
    def test_no_command(self):
        self.assert_refused(words=("name a command", "check"))

    def test_mistyped_command_names_the_nearest(self):
        self.assert_refused("recievers", words=("recievers", "did you mean 'receivers'?"))

    def test_mistyped_option_names_the_nearest(self):
        self.assert_refused("receivers", "s.toml", "-o", "r.json", "--cuont", "5",
                            words=("receivers", "'--cuont'", "did you mean '--count'?"))

    def test_mistyped_option_wins_over_the_required_one_that_it_hides(self):
        self.assert_refused("receivers", "s.toml", "--ouput", "r.json",
                            words=("did you mean '--output'?",))

    def test_missing_argument(self):
        self.assert_refused("check", words=("SCENE is required", "--help"))

    def test_argument_too_many(self):
        self.assert_refused("check", "a.toml", "b.toml", words=("'b.toml'", "too many"))

    def test_option_without_its_value(self):
        self.assert_refused("check", "a.toml", "--seed", words=("--seed", "needs a value"))

    def test_values_of_the_wrong_kind(self):
        for option, value in (("--seed", "-1"), ("--seed", "x"), ("--seed", "1e99"),
                              ("--threads", "-2"), ("--count", "0"), ("--count", "2.5"),
                              ("--rel-error", "nan"), ("--rel-error", "-0.1"), ("--spp", "0"),
                              ("--seconds", "inf")):
            with self.subTest(option=option, value=value):
                self.assert_refused("receivers", "s.toml", "-o", "r.json", f"{option}={value}",
                                    words=(option, value))

    def test_a_requirement_that_cannot_be_read(self):
        for text in ("nrmse", "nrmse<=", "<=3", "nrmse<=abc", "nrmse=0.1"):
            with self.subTest(text=text):
                self.assert_refused("compare", "a.exr", "b.exr", "--require", text,
                                    words=("--require", text))


if __name__ == "__main__":
    unittest.main()
