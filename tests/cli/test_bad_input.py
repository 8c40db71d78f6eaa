# SPDX-License-Identifier: GPL-3.0-or-later
"""Bad input: one clear line that names file and element, the exit code, and nothing half-written."""
import math
import signal
import subprocess
import time
import unittest

from support import CliTest, PROGRAM, ROOM_CORNERS, write_glb

SCENE = 'gltf = "room.glb"\n'


class BadScenes(CliTest):
    def setUp(self):
        super().setUp()
        write_glb(self.folder / "room.glb", emission=(1.0, 1.0, 1.0))

    def write_toml(self, text):
        (self.folder / "scene.toml").write_text(text)

    def test_missing_file(self):
        for scene in ("no.glb", "no.gltf", "no.toml"):
            with self.subTest(scene=scene):
                self.assert_refused("check", scene, words=(scene, "no such file"))

    def test_a_folder_or_another_kind_of_file(self):
        (self.folder / "notes.txt").write_text("hello")
        self.assert_refused("check", ".", words=(".",))
        self.assert_refused("check", "notes.txt", words=("notes.txt",))

    def test_truncated_glb(self):
        data = (self.folder / "room.glb").read_bytes()
        for length in (0, 3, 12, 19, 200, len(data) // 2, len(data) - 1):
            with self.subTest(length=length):
                (self.folder / "cut.glb").write_bytes(data[:length])
                self.assert_refused("check", "cut.glb", words=("cut.glb",))

    def test_vertex_that_is_not_a_number(self):
        for value in (math.nan, math.inf):
            with self.subTest(value=value):
                corners = [list(p) for p in ROOM_CORNERS]
                corners[5][1] = value
                write_glb(self.folder / "bad.glb", positions=corners)
                self.assert_refused("check", "bad.glb", words=("bad.glb", "room"))
                self.assert_refused("receivers", "bad.glb", "-o", "r.json", words=("bad.glb",))

    def test_unknown_camera(self):
        self.assert_refused("reference", "room.glb", "--camera", "eyes", "-o", "r.exr",
                            words=("eyes", "did you mean 'eye'?"))

    def test_scene_without_a_camera(self):
        write_glb(self.folder / "blind.glb", camera=None)
        self.assert_refused("reference", "blind.glb", "-o", "r.exr", words=("camera",))

    def test_unknown_state(self):
        self.write_toml(SCENE + '[[state]]\nname = "evening"\n')
        self.assert_refused("receivers", "scene.toml", "--state", "evning", "-o", "r.json",
                            words=("evning", "did you mean 'evening'?"))

    def test_unknown_key_names_line_and_nearest(self):
        self.write_toml(SCENE + "[volume]\nmin = [-1, 0, -1]\nmaxx = [1, 2, 1]\n")
        self.assert_refused("check", "scene.toml", words=("scene.toml", "maxx", "4", "'max'"))

    def test_volume_of_zero_size(self):
        for corner in ("[0, 0, 0]", "[2, 3, 0]", "[-1, 3, 2]"):
            with self.subTest(max=corner):
                self.write_toml(SCENE + f"[volume]\nmin = [0, 0, 0]\nmax = {corner}\n")
                self.assert_refused("check", "scene.toml", words=("scene.toml", "volume"))

    def test_no_receivers_wanted(self):
        self.assert_refused("receivers", "room.glb", "--count", "0", "-o", "r.json",
                            words=("--count", "'0'"))

    def test_points_that_cannot_be_read(self):
        for text, word in (("0,1,0,0,1\n", "1"), ("0,1,0,0,0,0\n", "1"),
                           ("0,1,0,0,1,0\n0,1,x,0,1,0\n", "2"), ("", "")):
            with self.subTest(text=text):
                (self.folder / "points.csv").write_text(text)
                self.assert_refused("receivers", "room.glb", "--points", "points.csv",
                                    "--seconds", "1", "-o", "r.json", words=("points.csv", word))

    def test_points_and_count_together(self):
        self.assert_refused("receivers", "room.glb", "--points", "p.csv", "--count", "5",
                            "-o", "r.json", words=("--count", "--points"))


class BadOutputs(CliTest):
    """Refused before the work starts, so these take no time."""

    def setUp(self):
        super().setUp()
        write_glb(self.folder / "room.glb", emission=(1.0, 1.0, 1.0))

    def test_missing_folder(self):
        words = ("no", "does not exist")
        self.assert_refused("reference", "room.glb", "-o", "no/r.exr", words=words)
        self.assert_refused("receivers", "room.glb", "-o", "no/r.json", words=words)

    def test_output_is_a_folder(self):
        (self.folder / "r.exr").mkdir()
        self.assert_refused("reference", "room.glb", "-o", "r.exr", words=("r.exr", "folder"))

    def test_wrong_extension(self):
        self.assert_refused("reference", "room.glb", "-o", "r.png", words=(".exr",))
        self.assert_refused("receivers", "room.glb", "-o", "r.csv", words=(".json",))

    def test_cache_that_cannot_be_made(self):
        (self.folder / "file").write_text("")
        self.assert_refused("receivers", "room.glb", "-o", "r.json", "--cache", "file/cache",
                            words=("file/cache",))


class Interrupts(CliTest):
    def test_leaves_nothing_behind(self):
        write_glb(self.folder / "room.glb", emission=(1.0, 1.0, 1.0))
        for signal_number in (signal.SIGINT, signal.SIGTERM):
            with self.subTest(signal=signal_number):
                process = subprocess.Popen(
                    [PROGRAM, "reference", "room.glb", "-o", "r.exr", "--seconds", "600"],
                    cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
                time.sleep(1.5)
                process.send_signal(signal_number)
                out, err = process.communicate(timeout=60)
                self.assertEqual(process.returncode, 130, err)
                self.assertEqual(out, "")
                self.assertEqual(err.splitlines()[-1], "probelab: interrupted")
                self.assertEqual(self.files(), ["room.glb"])


class NoDevice(CliTest):
    # The loader's own settings: no driver but a file that is not there.
    ENVIRONMENT = {"VK_ICD_FILENAMES": "/nonexistent/icd.json",
                   "VK_DRIVER_FILES": "/nonexistent/icd.json"}

    def test_info_still_says_what_there_is_and_fails(self):
        result = self.run_program("info", env=self.ENVIRONMENT)
        self.assertEqual(result.returncode, 1)
        self.assertIn("embree", result.stdout)
        self.assertEqual(len(result.stderr.splitlines()), 1, result.stderr)
        self.assertIn("Vulkan", result.stderr)

    def test_commands_on_the_host_need_no_device(self):
        write_glb(self.folder / "room.glb", emission=(1.0, 1.0, 1.0))
        self.run_ok("check", "room.glb", env=self.ENVIRONMENT)

    def test_unknown_device(self):
        result = self.run_program("info", "--device", "no such device")
        self.assertEqual(result.returncode, 1)
        self.assertIn("no such device", result.stderr)


if __name__ == "__main__":
    unittest.main()
