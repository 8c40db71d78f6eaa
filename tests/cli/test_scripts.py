# SPDX-License-Identifier: GPL-3.0-or-later
"""scripts/setup says what it would do; scripts/count_tests.py counts what ctest wrote."""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

SCRIPTS = pathlib.Path(__file__).resolve().parents[2] / "scripts"
CASES = {
    "passed": '<testcase name="a" status="run"/>',
    "failed": '<testcase name="b" status="fail"><failure message=""/></testcase>',
    "skipped": '<testcase name="c" status="notrun">'
               '<skipped message="SKIP_REGULAR_EXPRESSION_MATCHED"/></testcase>',
    "disabled": '<testcase name="d" status="disabled"/>',
    "missing": '<testcase name="e" status="notrun">'
               '<skipped message="Unable to find executable"/></testcase>',
}


class CountTests(unittest.TestCase):
    def count(self, *cases):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "tests.xml"
            path.write_text("<testsuite>%s</testsuite>" % "".join(CASES[c] for c in cases))
            return subprocess.run([sys.executable, SCRIPTS / "count_tests.py", path],
                                  capture_output=True, text=True)

    def test_a_test_that_could_not_run_has_failed(self):
        self.assertEqual(self.count("passed", "missing").stdout, "1 1 0\n")

    def test_skipped_and_disabled_are_not_passed(self):
        self.assertEqual(self.count("passed", "failed", "skipped", "disabled").stdout, "1 1 2\n")

    def test_no_test_at_all_is_an_error(self):
        self.assertEqual(self.count().returncode, 1)


def debian_12():
    try:
        text = pathlib.Path("/etc/os-release").read_text()
    except OSError:
        return False
    return "\nID=debian\n" in text and 'VERSION_ID="12"' in text


class Setup(unittest.TestCase):
    def setup_without_packages(self, *options):
        """scripts/setup --dry-run where dpkg-query knows no package."""
        with tempfile.TemporaryDirectory() as folder:
            stub = pathlib.Path(folder) / "dpkg-query"
            stub.write_text("#!/bin/sh\nexit 1\n")
            stub.chmod(0o755)
            path = "%s:%s" % (folder, os.environ["PATH"])
            return subprocess.run([SCRIPTS / "setup", "--dry-run", *options], capture_output=True,
                                  text=True, env=dict(os.environ, PATH=path))

    @unittest.skipUnless(debian_12(), "only Debian 12 takes packages from backports")
    def test_fresh_machine_gets_mesa_from_backports_first(self):
        result = self.setup_without_packages("--tests")
        self.assertEqual(result.returncode, 0, result.stderr)
        installs = [l for l in result.stderr.splitlines() if " install " in l and "apt-get" in l]
        self.assertIn("-t bookworm-backports install mesa-vulkan-drivers", installs[0])
        for package in ("cmake", "libembree-dev", "libgtest-dev"):
            self.assertIn(" %s" % package, installs[1])

    @unittest.skipUnless(debian_12(), "only Debian 12 takes packages from backports")
    def test_no_backports_refuses_them_and_says_what_is_lost(self):
        result = self.setup_without_packages("--no-backports")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertNotIn("-t bookworm-backports", result.stderr)
        self.assertIn("no ray query", result.stderr)

    def test_unknown_option_is_a_usage_error(self):
        for script in ("setup", "test"):
            result = subprocess.run([SCRIPTS / script, "--bogus"], capture_output=True, text=True)
            self.assertEqual(result.returncode, 2)
            self.assertIn("--bogus", result.stderr)


if __name__ == "__main__":
    unittest.main()
