# SPDX-License-Identifier: GPL-3.0-or-later
"""What the fault tests share: running the program with a fault, and what must hold then.

The program's path is in PROBELAB, the preloaded library's (shim.cpp) in PROBELAB_SHIM. With
PROBELAB_LONG=1 the tests take their long form. Standard library only.
"""
import os
import pathlib
import resource
import shutil
import subprocess
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "cli"))
from support import PROGRAM, CliTest, write_glb  # noqa: E402,F401

SHIM = os.environ.get("PROBELAB_SHIM", "")
LONG = os.environ.get("PROBELAB_LONG", "0") not in ("", "0")
DEVICE_LOST, OUT_OF_DEVICE_MEMORY, OUT_OF_HOST_MEMORY, INITIALIZATION_FAILED = -4, -2, -1, -3
# A field in half a second.
TINY = ("--count", 16, "--spp", 4, "--rays", 16, "--updates", 2, "--probes", 8, "--tracer",
        "embree", "--cache", "cache", "--quiet")


class FaultTest(CliTest):
    """A folder with room.glb, and the program without the validation layer, which would report
    what the injected faults lead to."""

    def setUp(self):
        super().setUp()
        write_glb(self.folder / "room.glb", emission=(1.0, 0.5, 0.25))

    def run_program(self, *arguments, env=None, **options):
        return super().run_program(*arguments, env={"PROBELAB_VALIDATION": "0", **(env or {})},
                                   **options)

    def run_limited(self, *arguments, limit=None, megabytes=0, file_bytes=0, stdout=None):
        """With limits on the address space or on the size of files."""
        def set_limits():
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            if megabytes:
                resource.setrlimit(resource.RLIMIT_AS, (megabytes << 20, megabytes << 20))
            if file_bytes:
                resource.setrlimit(resource.RLIMIT_FSIZE, (file_bytes, file_bytes))

        # Python ignores SIGXFSZ, and so does the program then: writes fail with EFBIG.
        return subprocess.run(
            [PROGRAM, *map(str, arguments)], cwd=self.folder, preexec_fn=set_limits,
            restore_signals=False, env=dict(os.environ, PROBELAB_VALIDATION="0"),
            stdin=subprocess.DEVNULL, stdout=stdout or subprocess.PIPE, stderr=subprocess.PIPE,
            text=True, timeout=300)

    def faulty(self, call, after, result):
        """The environment in which `call` fails after `after` calls."""
        return {**self.shim(), "FAULT_CALL": call, "FAULT_AFTER": str(after),
                "FAULT_RESULT": str(result)}

    def shim(self):
        if not SHIM:
            self.skipTest("PROBELAB_SHIM names no library")
        # An instrumented program wants its own runtime first; the shim may stand before it, and has
        # some of the operators new; and a crash is to be one.
        asan = os.environ.get("ASAN_OPTIONS", "")
        more = "verify_asan_link_order=0:alloc_dealloc_mismatch=0:handle_segv=0"
        return {"LD_PRELOAD": SHIM, "ASAN_OPTIONS": f"{asan}:{more}".lstrip(":")}

    def count_calls(self, call, *arguments):
        """How often a command makes a call."""
        self.run_ok(*arguments, env={**self.shim(), "FAULT_CALL": call, "FAULT_COUNT": "count"})
        path = self.folder / "count"
        count = int(path.read_text())
        path.unlink()
        return count

    def assert_fails(self, result, code, *words):
        """One clear line on stderr, nothing on stdout, the exit code."""
        self.assertEqual(result.returncode, code, result.stderr)
        self.assertFalse(result.stdout)
        lines = result.stderr.splitlines()
        self.assertEqual(len(lines), 1, result.stderr)
        self.assertTrue(lines[0].startswith("probelab: "), lines[0])
        for word in words:
            self.assertIn(word, lines[0])

    def own_files(self):
        """What is there but for the cache."""
        return [name for name in self.files() if not name.startswith("cache")]

    def in_namespace(self, script, **variables):
        """Runs a shell script that may mount file systems, seen by it alone; skips where that is
        not allowed. $PROGRAM is the program."""
        unshare = shutil.which("unshare")
        words = [unshare, "-m"] if os.geteuid() == 0 else [unshare, "-Urm"]
        probe = [*words, "mount", "-t", "tmpfs", "tmpfs", "/tmp"] if unshare else ["false"]
        if subprocess.run(probe, capture_output=True).returncode != 0:
            raise unittest.SkipTest("no file system can be mounted here")
        environment = dict(os.environ, PROGRAM=PROGRAM, PROBELAB_VALIDATION="0", **variables)
        return subprocess.run([*words, "sh", "-eu", "-c", script], cwd=self.folder,
                              env=environment, capture_output=True, text=True, timeout=300)
