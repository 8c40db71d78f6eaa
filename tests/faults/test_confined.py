# SPDX-License-Identifier: GPL-3.0-or-later
"""What a scene's file can make the program do: read files in its own folder, and nothing else."""
import json
import shutil
import struct
import subprocess
import unittest

from faults import PROGRAM, FaultTest
from support import ROOM_CORNERS


class Confined(FaultTest):
    def test_program_imports_nothing_that_starts_a_shell(self):
        if not shutil.which("nm"):
            self.skipTest("nm is not there")
        text = subprocess.run(["nm", "-D", "--undefined-only", PROGRAM], capture_output=True,
                              text=True, check=True).stdout
        names = {line.split()[-1].split("@")[0] for line in text.splitlines()}
        self.assertIn("fopen", {n.removesuffix("64") for n in names})  # the list is one of imports
        starting = {n for n in names
                    if n.startswith(("exec", "posix_spawn", "wordexp")) or n in (
                        "system", "popen", "fexecve", "dlopen", "dlmopen")}
        # A study starts the program itself, with its arguments as a list.
        self.assertEqual(starting, {"execv"})

    def opened(self, scene):
        log = self.folder / "opened"
        self.run_program("check", scene, env={**self.shim(), "FAULT_OPENED": log})
        paths = log.read_text().splitlines()
        log.unlink()
        return paths

    def test_only_the_scenes_folder_is_read(self):
        points = [c for corner in ROOM_CORNERS[:3] for c in corner]
        data = struct.pack("<9f", *points)
        for place in ("secret.bin", "scene/fine.bin", "scene/inside/fine.bin"):
            (self.folder / place).parent.mkdir(parents=True, exist_ok=True)
            (self.folder / place).write_bytes(data)
        (self.folder / "scene/link.bin").symlink_to(self.folder / "secret.bin")
        (self.folder / "scene/up").symlink_to(self.folder)
        gltf = {"asset": {"version": "2.0"},
                "buffers": [{"byteLength": len(data), "uri": "fine.bin"}],
                "bufferViews": [{"buffer": 0, "byteLength": len(data)}],
                "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
                "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
                "textures": [{"source": 0}], "images": [{"uri": "fine.bin"}],
                "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
                "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}], "scene": 0}
        path = self.folder / "scene/scene.gltf"
        inside = str((self.folder / "scene").resolve())
        for uri in ("fine.bin", "inside/fine.bin", "../secret.bin", "inside/../../secret.bin",
                    str(self.folder / "secret.bin"), f"file://{self.folder}/secret.bin",
                    "%2e%2e/secret.bin", "link.bin", "up/secret.bin", "$(cat ../secret.bin)"):
            for kind in ("buffers", "images"):
                changed = json.loads(json.dumps(gltf))
                changed[kind][0]["uri"] = uri
                path.write_text(json.dumps(changed))
                with self.subTest(uri=uri, kind=kind):
                    paths = self.opened("scene/scene.gltf")
                    self.assertIn("scene/scene.gltf", paths)
                    own = [p for p in paths if "secret" in p or p.startswith(str(self.folder))]
                    self.assertEqual([p for p in own if not p.startswith(inside + "/")], [])
                    self.assertEqual([p for p in own if "link" in p or "/up/" in p], [])
                    if uri in ("fine.bin", "inside/fine.bin"):
                        self.assertIn(f"{inside}/{uri}", own)


if __name__ == "__main__":
    unittest.main()
