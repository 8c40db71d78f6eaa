# SPDX-License-Identifier: GPL-3.0-or-later
"""What the command-line tests share: running the program, and writing small glTF and EXR files.

The program's path is in the environment variable PROBELAB. Standard library only.
"""
import json
import os
import pathlib
import struct
import subprocess
import tempfile
import unittest

PROGRAM = os.environ.get("PROBELAB", "probelab")
SOURCE = pathlib.Path(__file__).resolve().parents[2]


class CliTest(unittest.TestCase):
    """A test with a folder of its own, in which the program runs."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def run_program(self, *arguments, env=None, timeout=300):
        environment = dict(os.environ, **(env or {}))
        return subprocess.run(
            [PROGRAM, *map(str, arguments)], cwd=self.folder, env=environment,
            stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=timeout)

    def run_ok(self, *arguments, **options):
        result = self.run_program(*arguments, **options)
        self.assertEqual(result.returncode, 0, result.stderr)
        return result

    def run_json(self, *arguments, **options):
        """The JSON object that --json prints; nothing else may be on stdout."""
        return json.loads(self.run_ok(*arguments, "--json", **options).stdout)

    def assert_refused(self, *arguments, code=2, words=(), env=None):
        """One clear line on stderr, the exit code, nothing on stdout, and no file written."""
        before = self.files()
        result = self.run_program(*arguments, env=env)
        self.assertEqual(result.returncode, code, result.stderr)
        self.assertEqual(result.stdout, "")
        lines = result.stderr.splitlines()
        self.assertEqual(len(lines), 1, result.stderr)
        self.assertTrue(lines[0].startswith("probelab: "), lines[0])
        for word in words:
            self.assertIn(word, lines[0])
        self.assertEqual(self.files(), before, "a refused command wrote something")
        return lines[0]

    def files(self):
        return sorted(str(p.relative_to(self.folder)) for p in self.folder.rglob("*"))


# A box of 4 m x 3 m x 4 m seen from inside: 8 corners, 12 triangles facing in.
ROOM_CORNERS = [(x, y, z) for x in (-2.0, 2.0) for y in (0.0, 3.0) for z in (-2.0, 2.0)]
_QUADS_OUT = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
ROOM_TRIANGLES = [t for a, b, c, d in _QUADS_OUT for t in ((c, b, a), (d, c, a))]


def write_glb(path, positions=None, triangles=None, base_color=(0.5, 0.5, 0.5, 1.0),
              emission=(0.0, 0.0, 0.0), camera=(0.0, 1.5, 1.0), double_sided=False):
    """A GLB of one mesh, by default the room; `camera` looks along -z (None: no camera)."""
    positions = ROOM_CORNERS if positions is None else positions
    triangles = ROOM_TRIANGLES if triangles is None else triangles
    indices = b"".join(struct.pack("<3H", *t) for t in triangles)
    points = b"".join(struct.pack("<3f", *p) for p in positions)
    padding = b"\0" * (-len(indices) % 4)
    finite = [p for p in positions if all(abs(c) < 1e30 for c in p)]
    bounds = [[f(p[i] for p in finite) for i in range(3)] for f in (min, max)]
    nodes = [{"name": "room", "mesh": 0}]
    gltf = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "meshes": [{"name": "room", "primitives": [
            {"attributes": {"POSITION": 1}, "indices": 0, "material": 0}]}],
        "materials": [{"name": "wall", "doubleSided": double_sided, "emissiveFactor": emission,
                       "pbrMetallicRoughness": {"baseColorFactor": base_color,
                                                "metallicFactor": 0.0}}],
        "accessors": [
            {"bufferView": 0, "componentType": 5123, "count": 3 * len(triangles), "type": "SCALAR"},
            {"bufferView": 1, "componentType": 5126, "count": len(positions), "type": "VEC3",
             "min": bounds[0], "max": bounds[1]}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": len(indices)},
            {"buffer": 0, "byteOffset": len(indices) + len(padding), "byteLength": len(points)}],
        "buffers": [{"byteLength": len(indices) + len(padding) + len(points)}],
    }
    if camera is not None:
        gltf["cameras"] = [{"type": "perspective",
                            "perspective": {"yfov": 1.0, "znear": 0.01, "aspectRatio": 1.5}}]
        nodes.append({"name": "eye", "camera": 0, "translation": list(camera)})
    gltf["nodes"] = nodes
    gltf["scenes"] = [{"nodes": list(range(len(nodes)))}]
    text = json.dumps(gltf).encode()
    text += b" " * (-len(text) % 4)
    binary = indices + padding + points
    binary += b"\0" * (-len(binary) % 4)
    total = 12 + 8 + len(text) + 8 + len(binary)
    data = (struct.pack("<4sII", b"glTF", 2, total) +
            struct.pack("<I4s", len(text), b"JSON") + text +
            struct.pack("<I4s", len(binary), b"BIN\0") + binary)
    pathlib.Path(path).write_bytes(data)


def write_exr(path, pixels):
    """An uncompressed RGB float EXR; pixels[y][x] = (r, g, b)."""
    height, width = len(pixels), len(pixels[0])

    def attribute(name, kind, data):
        return (name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(data)) + data)

    channels = b"".join(name + b"\0" + struct.pack("<iBxxxii", 2, 0, 1, 1)
                        for name in (b"B", b"G", b"R")) + b"\0"
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    header = struct.pack("<ii", 20000630, 2) + b"".join([
        attribute("channels", "chlist", channels),
        attribute("compression", "compression", b"\0"),
        attribute("dataWindow", "box2i", window),
        attribute("displayWindow", "box2i", window),
        attribute("lineOrder", "lineOrder", b"\0"),
        attribute("pixelAspectRatio", "float", struct.pack("<f", 1.0)),
        attribute("screenWindowCenter", "v2f", struct.pack("<2f", 0.0, 0.0)),
        attribute("screenWindowWidth", "float", struct.pack("<f", 1.0))]) + b"\0"
    row_bytes = 3 * 4 * width
    first = len(header) + 8 * height
    offsets = b"".join(struct.pack("<Q", first + y * (8 + row_bytes)) for y in range(height))
    rows = b""
    for y, row in enumerate(pixels):
        planes = b"".join(struct.pack("<f", pixel[c]) for c in (2, 1, 0) for pixel in row)
        rows += struct.pack("<ii", y, row_bytes) + planes
    pathlib.Path(path).write_bytes(header + offsets + rows)
