# SPDX-License-Identifier: GPL-3.0-or-later
"""Bad input: one clear line that names file and element, the exit code, and nothing half-written."""
import json
import math
import os
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

    def test_a_scene_too_small_for_single_precision(self):
        write_glb(self.folder / "dust.glb",
                  positions=[[1e-10 * c for c in p] for p in ROOM_CORNERS])
        self.assert_refused("check", "dust.glb", words=("dust.glb", "1e-08 m", "scale it up"))

    def test_a_truth_below_zero(self):
        self.run_ok("receivers", "room.glb", "-o", "r.json", "--count", 16, "--spp", 4)
        text = (self.folder / "r.json").read_text()
        document = json.loads(text)
        document["receivers"][3]["a"][1] = -5
        (self.folder / "r.json").write_text(json.dumps(document))
        self.assert_refused("evaluate", "room.glb", "--receivers", "r.json",
                            words=("r.json", "'a' must not be negative"))

    def test_no_receivers_wanted(self):
        self.assert_refused("receivers", "room.glb", "--count", "0", "-o", "r.json",
                            words=("--count", "'0'"))

    def test_points_that_cannot_be_read(self):
        for text, word in (("0,1,0,0,1\n", "1"), ("0,1,0,0,0,0\n", "1"),
                           ("0,1,0,0,1,0\n0,1,x,0,1,0\n", "2"), ("", ""),
                           ("0,1,0,0,1,0\n1e30,0,0,0,1,0\n", "line 2: the position is")):
            with self.subTest(text=text):
                (self.folder / "points.csv").write_text(text)
                self.assert_refused("receivers", "room.glb", "--points", "points.csv",
                                    "--seconds", "1", "-o", "r.json", words=("points.csv", word))

    def test_points_and_count_together(self):
        self.assert_refused("receivers", "room.glb", "--points", "p.csv", "--count", "5",
                            "-o", "r.json", words=("--count", "--points"))


class Streams(CliTest):
    """What is printed beside the result is no reason to end otherwise."""

    def test_stderr_that_takes_nothing(self):
        with open("/dev/full", "w") as full:
            for code, words in ((2, ("nosuch",)), (1, ("info", "--device", "nosuch"))):
                done = subprocess.run([PROGRAM, *words], cwd=self.folder, stderr=full,
                                      stdout=subprocess.DEVNULL, check=False)
                self.assertEqual(done.returncode, code, words)

    def test_a_limit_on_files_leaves_nothing(self):
        write_glb(self.folder / "room.glb", emission=(1.0, 1.0, 1.0))
        before = self.files()
        done = subprocess.run(
            ["bash", "-c", 'ulimit -f 4; exec "$0" "$@"', PROGRAM, "reference", "room.glb", "--spp",
             "1", "--width", "160", "--height", "90", "--quiet", "-o", "r.exr"], cwd=self.folder,
            capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn("r.exr: cannot be written", done.stderr)
        self.assertEqual(self.files(), before)

    def test_a_link_stays_one(self):
        write_glb(self.folder / "room.glb", emission=(1.0, 1.0, 1.0))
        (self.folder / "deep").mkdir()
        (self.folder / "link.exr").symlink_to("deep/r.exr")
        self.run_ok("reference", "room.glb", "--spp", "1", "--width", "4", "--height", "4", "-o",
                    "link.exr")
        self.assertTrue((self.folder / "link.exr").is_symlink())
        self.assertTrue((self.folder / "deep/r.exr").is_file())
        (self.folder / "lost.exr").symlink_to("none/r.exr")
        self.assert_refused("reference", "room.glb", "-o", "lost.exr",
                            words=("none", "does not exist"))


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
        for signal_number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
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


    def ends_at_once(self, *words):
        process = subprocess.Popen([PROGRAM, *words], cwd=self.folder, stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True)
        time.sleep(2)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=20)
        self.assertEqual(process.returncode, 130, err)

    def test_waiting_for_a_pipe(self):
        os.mkfifo(self.folder / "pipe.gltf")
        self.ends_at_once("check", "pipe.gltf")

    def test_making_many_receivers(self):
        write_glb(self.folder / "room.glb", emission=(1.0, 1.0, 1.0))
        self.ends_at_once("receivers", "room.glb", "--count", "16000000", "-o", "r.json")
        self.assert_refused("receivers", "room.glb", "--count", "2000000000", "-o", "r.json",
                            words=("--count",))


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

    def test_a_number_is_an_index_and_no_part_of_a_name(self):
        for number in ("5", "99"):
            result = self.run_program("info", "--device", number)
            self.assertEqual(result.returncode, 1)
            self.assertIn(f"no Vulkan device matches '{number}'", result.stderr)

    def test_unknown_device(self):
        result = self.run_program("info", "--device", "no such device")
        self.assertEqual(result.returncode, 1)
        self.assertIn("no such device", result.stderr)


if __name__ == "__main__":
    unittest.main()
