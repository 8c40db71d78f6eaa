# SPDX-License-Identifier: GPL-3.0-or-later
"""Memory of the host that runs out, by a limit on the address space and by single allocations that
fail: the command works, or says so in one line with exit code 1; never a crash, never half a file."""
import json
import random
import unittest

from faults import LONG, FaultTest

COMMANDS = {
    "receivers": ("receivers", "room.glb", "--count", 16, "--spp", 4, "--cache", "cache",
                  "--quiet", "--json", "-o", "out.json"),
    "place": ("place", "room.glb", "--strategy", "jittered", "--probes", 8, "--cache", "cache",
              "--quiet", "--json", "-o", "out.json"),
    "init": ("init", "room.glb", "--force", "--json", "-o", "out.json.toml"),
}


class HostMemory(FaultTest):
    def outcome(self, result, *words):
        """Whether it worked; otherwise it must have failed as it should."""
        out = self.folder / "out.json"
        if out.exists():
            json.loads(out.read_text())
            out.unlink()
        self.assertEqual([n for n in self.own_files() if ".tmp" in n], [])
        if result.returncode == 0:
            json.loads(result.stdout)
            return True
        result.stdout = ""
        self.assert_fails(result, 1)
        self.assertTrue("memory" in result.stderr, result.stderr)
        return False

    def test_address_space(self):
        worked = []
        for megabytes in range(120, 420, 10 if LONG else 60):
            result = self.run_limited(*COMMANDS["receivers"], "--threads", 1, megabytes=megabytes)
            if result.returncode == 127:
                continue  # the loader could not map the libraries; the program did not start
            with self.subTest(megabytes=megabytes):
                worked.append(self.outcome(result))
        self.assertIn(False, worked)
        self.assertIn(True, worked)

    def test_request_beyond_any_memory(self):
        result = self.run_limited("receivers", "room.glb", "--count", 16000000, "-o", "out.json",
                                  "--cache", "cache", "--quiet", megabytes=300)
        self.assertFalse(self.outcome(result))

    def check(self, name):
        command = COMMANDS[name]
        calls = self.count_calls("new", *command)
        rng = random.Random(3)
        failed = 0
        for i in range(400 if LONG else 12):
            # Uniform, and uniform in the logarithm: early ones are of another kind.
            after = rng.randrange(calls) if i % 2 else int(calls ** rng.random())
            with self.subTest(command=name, after=after):
                for path in (self.folder / "cache").glob("*"):
                    path.unlink()
                result = self.run_program(*command, env=self.faulty("new", after, 0))
                failed += not self.outcome(result)
        self.assertGreater(failed, 0)

    def test_allocation_in_receivers(self):
        self.check("receivers")

    def test_allocation_in_place(self):
        self.check("place")

    def test_allocation_in_init(self):
        self.check("init")


if __name__ == "__main__":
    unittest.main()
