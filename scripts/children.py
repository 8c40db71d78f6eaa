# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands that a script runs, and that end with it. Standard library only."""
import signal
import subprocess
import threading


def terminate_as_interrupt():
    """SIGTERM ends the script as Ctrl-C does: what is done is kept, what runs is ended."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)


class Children:
    """Commands run by many threads, which interrupt() ends together."""

    def __init__(self):
        self.lock, self.live, self.ended = threading.Lock(), set(), False

    def run(self, command, **options):
        """As subprocess.run with its output as text; None once they were interrupted."""
        with self.lock:
            if self.ended:
                return None
            process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                       text=True, **options)
            self.live.add(process)
        try:
            output, errors = process.communicate()
        except BaseException:
            self.interrupt()
            process.communicate()  # until it has ended
            raise
        finally:
            with self.lock:
                self.live.discard(process)
        return subprocess.CompletedProcess(command, process.returncode, output, errors)

    def interrupt(self):
        """No command starts any more; those that run get SIGINT."""
        with self.lock:
            self.ended = True
            for process in self.live:
                process.send_signal(signal.SIGINT)
