# SPDX-License-Identifier: GPL-3.0-or-later
"""A study of many small cells, ended at random moments and continued, against one that ran through:
by SIGKILL to the study, to it and its cells at once (as when a machine stops), SIGINT and SIGTERM."""
import os
import random
import signal
import socket
import subprocess
import time
import unittest

from faults import LONG, PROGRAM, FaultTest
from studies import EVALUATE, PLACE, left_over, results, write_study


class KilledStudy(FaultTest):
    cell_s = 0.3  # at most so long takes a cell

    def start(self, folder, cache):
        return subprocess.Popen(
            [PROGRAM, "run", "study.toml", "--cache", cache, "--results", folder, "--jobs", "2",
             "--quiet"], cwd=self.folder, env=dict(os.environ, PROBELAB_VALIDATION="0"),
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True)

    def whole(self, folder, cache):
        process = self.start(folder, cache)
        _, error = process.communicate(timeout=1200)
        self.assertEqual(process.returncode, 0, error)
        return results(self.folder / folder)

    def end(self, process, how):
        if process.poll() is None and how == "machine":
            os.killpg(process.pid, signal.SIGKILL)
        elif process.poll() is None:
            process.send_signal(getattr(signal, how))
        _, error = process.communicate(timeout=60)
        if process.returncode == 0:
            return  # it was done just before
        if how in ("SIGINT", "SIGTERM"):
            # Before the handler is there the signal ends it as it ends any program.
            self.assertIn(process.returncode, (130, -signal.SIGINT, -signal.SIGTERM), error)
            if process.returncode == 130:
                self.assertEqual(error.splitlines()[-1], "probelab: interrupted")
        else:
            self.assertEqual(process.returncode, -signal.SIGKILL, error)

    def done(self):
        folder = self.folder / "killed/cells"
        return len([p for p in folder.glob("*.json") if not p.name.startswith(".")])

    def wait(self, process, rng):
        """A random moment: while it starts, or some time after one more cell is done."""
        if rng.random() < 0.2:
            time.sleep(rng.uniform(0, 0.1))
            return
        before, started = self.done(), time.monotonic()
        while process.poll() is None and self.done() == before:
            time.sleep(0.005)
        # Scaled, so that a fast machine is not done with the study after a few of them.
        self.cell_s = min(self.cell_s, time.monotonic() - started)
        time.sleep(rng.uniform(0, self.cell_s))

    def kill_and_continue(self, kills, cells, seed):
        rng = random.Random(seed)
        at_work = 0  # how many found cells done, and cells left to do
        for _ in range(kills):
            process = self.start("killed", "cache-killed")
            self.wait(process, rng)
            self.end(process, rng.choice(("SIGKILL", "machine", "SIGINT", "SIGTERM")))
            at_work += 0 < self.done() < cells
        self.assertGreater(at_work, kills / 2, "most kills fell before or after the work")
        continued = self.whole("killed", "cache-killed")
        through = self.whole("through", "cache")
        self.assertEqual(list(continued), list(through))
        for name in through:
            self.assertTrue(continued[name] == through[name], name)
        self.assertEqual(len(os.listdir(self.folder / "killed/cells")), cells)
        self.assertEqual(left_over(self.folder / "killed"), [])

    def test_equals_one_that_ran_through(self):
        seeds = 100 if LONG else 8
        write_study(self.folder, PLACE, seeds)
        self.kill_and_continue(100 if LONG else 8, 4 * seeds, seed=7)

    def test_what_a_killed_cell_had_begun_to_write_goes(self):
        write_study(self.folder, PLACE, 1)
        self.whole("killed", "cache")
        gone = subprocess.Popen(["true"])
        gone.wait()
        tag = f"{gone.pid}-{socket.gethostname().replace('.', '_')}"
        for cell in (self.folder / "killed/cells").glob("*.json"):
            cell.unlink()
            (self.folder / "killed/files" / cell.stem / f".l.{tag}.tmp.json").write_text("")
        self.assertEqual(len(left_over(self.folder / "killed")), 4)
        self.whole("killed", "cache")
        self.assertEqual(left_over(self.folder / "killed"), [])

    @unittest.skipUnless(LONG, "the long form: PROBELAB_LONG=1")
    def test_with_a_device_too(self):
        write_study(self.folder, EVALUATE, 60)
        self.kill_and_continue(100, 120, seed=8)
