# SPDX-License-Identifier: GPL-3.0-or-later
"""Full disks and places that cannot be written: one line that names the file, exit code 1 (2 where
it is seen before any work), what was there before is kept, and a study goes on when there is room."""
import json
import unittest

from faults import TINY, FaultTest
from studies import PLACE, results, write_study

# A command and what it writes.
COMMANDS = {
    "small picture": (("reference", "room.glb", "--width", 2, "--height", 2, "--spp", 1, "--quiet",
                       "-o", "out.exr"), "out.exr"),
    "picture": (("reference", "room.glb", "--width", 32, "--height", 16, "--spp", 1, "--quiet",
                 "-o", "out.exr"), "out.exr"),
    "receivers": (("receivers", "room.glb", "--count", 16, "--spp", 4, "--cache", "cache",
                   "--quiet", "-o", "out.json"), "out.json"),
    "layout": (("place", "room.glb", "--strategy", "jittered", "--probes", 8, "--cache", "cache",
                "--quiet", "-o", "out.json"), "out.json"),
    "scene": (("init", "room.glb", "--force", "--quiet", "-o", "out.toml"), "out.toml"),
}


class FullDisk(FaultTest):
    def check(self, title):
        command, output = COMMANDS[title]
        path = self.folder / output
        self.run_ok(*command)  # the cache has what the command computes
        size = path.stat().st_size
        before = self.own_files()
        path.write_text("from before")
        for limit in (64, size - 16):  # the digits of a time may be fewer
            result = self.run_limited(*command, file_bytes=limit)
            result.stdout = ""  # a table may stand there already
            self.assert_fails(result, 1, "cannot be written", "File too large")
            self.assertEqual(self.own_files(), before)
            self.assertEqual(path.read_bytes(), b"from before")

    def test_picture_in_one_buffer(self):
        self.check("small picture")

    def test_picture(self):
        self.check("picture")

    def test_receivers(self):
        self.check("receivers")

    def test_layout(self):
        self.check("layout")

    def test_scene(self):
        self.check("scene")

    def test_estimates(self):
        # A limit on files would hit the driver's shared memory too; so a small disk.
        words = " ".join(map(str, ("evaluate", "room.glb", *TINY))).replace("16", "64", 1)
        result = self.in_namespace(f"""
            mkdir small
            mount -t tmpfs -o size=4k tmpfs small
            code=0
            "$PROGRAM" {words} --dump small/out.csv >out 2>error || code=$?
            test $code = 1
            ls -A small
            umount small
        """)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(result.stdout, "")
        error = (self.folder / "error").read_text().splitlines()
        self.assertEqual(error, ["probelab: small/out.csv: cannot be written: "
                                 "No space left on device"])

    def test_standard_output(self):
        with open("/dev/full", "w") as full:
            result = self.run_limited("check", "room.glb", "--json", stdout=full)
        self.assert_fails(result, 1, "standard output cannot be written")

    def test_study_goes_on_when_there_is_room(self):
        write_study(self.folder, PLACE, 2)
        script = """
            mkdir small
            mount -t tmpfs -o size=64k tmpfs small
            study() {
              code=0
              "$PROGRAM" run study.toml --results small/out --cache cache --quiet "$@" 2>error || code=$?
              cat error
              echo "exit $code"
            }
            study
            mount -o remount,size=20m small
            study
            cp -r small/out kept
            umount small
        """
        result = self.in_namespace(script)
        self.assertEqual(result.returncode, 0, result.stderr)
        lines = result.stdout.splitlines()
        self.assertIn("exit 1", lines)
        error = lines[lines.index("exit 1") - 1]
        self.assertTrue(error.startswith("probelab: "), result.stdout)
        self.assertIn("exit 0", lines[lines.index("exit 1"):], result.stdout)
        self.run_ok("run", "study.toml", "--results", "through", "--cache", "cache", "--quiet")
        kept, through = results(self.folder / "kept"), results(self.folder / "through")
        self.assertEqual(list(kept), list(through))
        self.assertTrue(kept == through)


class ReadOnly(FaultTest):
    def test_below_a_file(self):
        (self.folder / "file").write_text("")
        for command, _ in COMMANDS.values():
            words = [str(w).replace("out.", "file/out.") for w in command]
            self.assert_fails(self.run_program(*words), 2, "file", "does not exist")

    def test_read_only_file_system(self):
        write_study(self.folder, PLACE, 1)
        script = """
            mkdir fixed
            mount -t tmpfs -o size=64k tmpfs fixed
            mount -o remount,ro fixed
            code=0
            "$PROGRAM" run study.toml --results fixed/out --cache cache 2>>error || code=$?
            test $code = 2
            for words in "receivers room.glb -o fixed/r.json --cache cache" \\
                "reference room.glb -o fixed/r.exr" "init room.glb -o fixed/r.toml" \\
                "receivers room.glb -o r.json --cache fixed/cache" \\
                "place room.glb --strategy grid -o fixed/l.json --cache cache"; do
              code=0
              "$PROGRAM" $words --quiet 2>>error || code=$?
              test $code = 2
            done
            umount fixed
            cat error >&2
        """
        result = self.in_namespace(script)
        self.assertEqual(result.returncode, 0, result.stderr)
        lines = result.stderr.splitlines()
        self.assertEqual(len(lines), 6, result.stderr)
        for line in lines:
            self.assertTrue(line.startswith("probelab: "), line)
            self.assertIn("Read-only file system", line)

    def test_cache_that_is_a_file(self):
        (self.folder / "cache").write_text("a file")
        result = self.run_program("receivers", "room.glb", "-o", "r.json", "--cache", "cache")
        self.assert_fails(result, 2, "--cache cache", "cannot be created")


if __name__ == "__main__":
    unittest.main()
