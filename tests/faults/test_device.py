# SPDX-License-Identifier: GPL-3.0-or-later
"""Devices that are lost, out of memory, without ray query, crashing, or not there: one line that
says which call failed, exit code 1, earlier outputs untouched, and studies that go on."""
import random
import unittest

from faults import (DEVICE_LOST, INITIALIZATION_FAILED, LONG, OUT_OF_DEVICE_MEMORY,
                    OUT_OF_HOST_MEMORY, TINY, FaultTest)
from studies import EVALUATE, results, write_study

NO_DRIVER = {"VK_ICD_FILENAMES": "/nonexistent/icd.json", "VK_DRIVER_FILES": "/nonexistent/icd.json"}


class Device(FaultTest):
    EVALUATE = ("evaluate", "room.glb", *TINY, "--dump", "out.csv")

    def setUp(self):
        super().setUp()
        (self.folder / "out.csv").write_text("from before")

    def assert_named(self, command, environment, *words):
        result = self.run_program(*command, env=environment)
        self.assert_fails(result, 1, *words)
        self.assertEqual((self.folder / "out.csv").read_text(), "from before")
        self.assertEqual(self.own_files(), ["out.csv", "room.glb"])

    def moments(self, call, command):
        """Before which of its calls a command is made to fail: the first, the last, others."""
        self.run_ok(*command, "--dump", "fine.csv")
        calls = self.count_calls(call, *command, "--dump", "fine.csv")
        (self.folder / "fine.csv").unlink()
        self.assertGreater(calls, 2)
        some = random.Random(calls).sample(range(1, calls - 1), min(calls - 2, 40 if LONG else 1))
        return sorted({0, *some, calls - 1})

    def check(self, call, result, name):
        for after in self.moments(call, self.EVALUATE[:-2]):
            with self.subTest(call=call, after=after):
                self.assert_named(self.EVALUATE, self.faulty(call, after, result), call, name)

    def test_lost_at_a_submission(self):
        self.check("vkQueueSubmit2", DEVICE_LOST, "VK_ERROR_DEVICE_LOST")

    def test_lost_while_waiting(self):
        self.check("vkWaitForFences", DEVICE_LOST, "VK_ERROR_DEVICE_LOST")

    def test_out_of_device_memory(self):
        self.check("vkAllocateMemory", OUT_OF_DEVICE_MEMORY, "VK_ERROR_OUT_OF_DEVICE_MEMORY")

    def test_out_of_host_memory_in_the_driver(self):
        self.check("vkCreateComputePipelines", OUT_OF_HOST_MEMORY, "VK_ERROR_OUT_OF_HOST_MEMORY")

    def test_no_device_can_be_made(self):
        self.assert_named(self.EVALUATE, self.faulty("vkCreateDevice", 0, INITIALIZATION_FAILED),
                          "vkCreateDevice", "VK_ERROR_INITIALIZATION_FAILED")

    def test_other_commands_with_a_device(self):
        lost = self.faulty("vkQueueSubmit2", 3, DEVICE_LOST)
        for command in (
                ("render", "room.glb", "--probes", 8, "--width", 8, "--height", 8, "--rays", 16,
                 "--tracer", "embree", "--quiet", "-o", "picture.exr"),
                ("tune", "room.glb", *TINY, "-o", "tuned.toml")):
            self.assert_named(command, lost, "VK_ERROR_DEVICE_LOST")

    def test_without_ray_query_embree_traces(self):
        hidden = {**self.shim(), "FAULT_HIDE": "VK_KHR_ray_query"}
        words = [w for w in TINY if w not in ("--tracer", "embree")]
        result = self.run_json("evaluate", "room.glb", *words, env=hidden)
        self.assertEqual(result["tracer"], "embree")
        self.assert_named(("evaluate", "room.glb", *words, "--tracer", "rayquery"), hidden,
                          "has no ray query", "--tracer embree")
        self.assertIn("ray query  no", self.run_ok("info", env=hidden).stdout)

    def test_no_driver(self):
        self.assert_named(self.EVALUATE, NO_DRIVER, "there is no Vulkan device",
                          "mesa-vulkan-drivers")
        for command in (("check", "room.glb"),
                        ("receivers", "room.glb", "--count", 16, "--spp", 4, "--quiet", "-o",
                         "r.json"),
                        ("place", "room.glb", "--strategy", "grid", "--probes", 8, "--quiet", "-o",
                         "l.json")):
            self.run_ok(*command, env=NO_DRIVER)


class StudyOnAFailingDevice(FaultTest):
    WORDS = ("run", "study.toml", "--cache", "cache", "--jobs", 2, "--quiet", "--results")

    def test_goes_on(self):
        write_study(self.folder, EVALUATE, 2)
        # Of four cells one is there; then the device is lost, then its driver crashes.
        listed = self.run_json("run", "study.toml", "--list", "--results", "out")["list"]
        self.run_ok(*self.WORDS, "out", "--cell", listed[0]["id"])
        first = results(self.folder / "out/cells")
        self.assertEqual(len(first), 1)
        for result, words in ((DEVICE_LOST, "vkQueueSubmit2: VK_ERROR_DEVICE_LOST"),
                              ("crash", "ended by signal 11")):
            with self.subTest(result=result):
                failed = self.run_program(*self.WORDS, "out",
                                          env=self.faulty("vkQueueSubmit2", 10, result))
                self.assertIn("1 found, 3 failed", failed.stdout)
                failed.stdout = ""
                self.assert_fails(failed, 1, "3 of 4 cells failed", words)
                self.assertEqual(results(self.folder / "out/cells"), first)
        self.run_ok(*self.WORDS, "out")
        self.run_ok(*self.WORDS, "through")
        self.assertEqual(results(self.folder / "out/cells"), results(self.folder / "through/cells"))
        log = (self.folder / "out/study.csv").read_text()
        self.assertEqual(len(log.splitlines()), 5)


if __name__ == "__main__":
    unittest.main()
