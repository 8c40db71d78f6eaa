# SPDX-License-Identifier: GPL-3.0-or-later
"""core/cmake/WriteVersion.cmake: a version tells programs of different sources apart."""
import subprocess
import unittest

from support import CliTest, SOURCE


class Version(CliTest):
    def git(self, *words):
        subprocess.run(["git", "-c", "user.name=a", "-c", "user.email=a@b", *words], cwd=self.folder,
                       check=True, capture_output=True)

    def write(self, name, text):
        (self.folder / name).parent.mkdir(exist_ok=True)
        (self.folder / name).write_text(text)

    def version(self, git="git"):
        header = self.folder / "version.h"
        subprocess.run(["cmake", f"-DGIT={git}", f"-DSOURCE={self.folder}", "-DVERSION=1.2.3",
                        f"-DOUTPUT={header}", "-P", SOURCE / "core/cmake/WriteVersion.cmake"],
                       check=True)
        return header.read_text().split('"')[1]

    def test_tells_sources_apart(self):
        self.write("core/a.cpp", "1")
        self.write("README.md", "a")
        self.git("init", "-q")
        self.git("add", "core", "README.md")
        self.git("commit", "-qm", "one")
        clean = self.version()
        self.assertRegex(clean, r"^1\.2\.3\+[0-9a-f]{7,}$")
        written = (self.folder / "version.h").stat().st_mtime_ns
        self.assertEqual(self.version(), clean)
        self.assertEqual((self.folder / "version.h").stat().st_mtime_ns, written)
        self.write("README.md", "b")  # is not compiled
        self.assertEqual(self.version(), clean)
        seen = {clean}
        for name, text in (("core/a.cpp", "2"), ("core/a.cpp", "3"), ("core/new.cpp", "1"),
                           ("core/new.cpp", "2")):
            self.write(name, text)
            version = self.version()
            self.assertRegex(version, rf"^{clean[:6]}.*-dirty\.[0-9a-f]{{8}}$".replace("+", r"\+"))
            self.assertNotIn(version, seen)
            seen.add(version)
        self.git("add", "core")
        self.git("commit", "-qm", "two")
        self.assertNotIn(self.version(), seen)

    def test_without_git(self):
        self.assertEqual(self.version(git=""), "1.2.3")
        self.assertEqual(self.version(), "1.2.3")  # no checkout


if __name__ == "__main__":
    unittest.main()
