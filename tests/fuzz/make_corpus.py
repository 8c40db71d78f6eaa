#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes the seeds of the fuzzers, tests/fuzz/corpus/<format>/*: by the program itself where it has a
writer, else by hand.

    tests/fuzz/make_corpus.py build/release/probelab

JPEG pictures need Pillow and are left as they are without it; so are exr/packed_*.exr, which
OpenEXR's own writer made: one for each codec, and a tiled one.
"""
import base64
import json
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import zlib

HERE = pathlib.Path(__file__).resolve().parent
SOURCE = HERE.parents[1]
CORPUS = HERE / "corpus"
sys.path.insert(0, str(SOURCE / "tests/cli"))
from support import write_exr, write_glb  # noqa: E402


def png(width, height, colour_type, depth, rows, interlaced=False, palette=b""):
    def chunk(name, data):
        crc = zlib.crc32(name + data)
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", crc)
    header = struct.pack(">2I5B", width, height, depth, colour_type, 0, 0, int(interlaced))
    text = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header)
    if palette:
        text += chunk(b"PLTE", palette) + chunk(b"tRNS", b"\xff\x80")
    return text + chunk(b"IDAT", zlib.compress(b"".join(rows))) + chunk(b"IEND", b"")


def data_uri(data, kind="application/octet-stream"):
    return f"data:{kind};base64," + base64.b64encode(data).decode()


def rich_gltf(picture):
    """A little of everything that is read: textures, masks, lights, a camera, an animation, sparse
    and normalised accessors, extensions."""
    corners = struct.pack("<12f", 0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0)
    normals = struct.pack("<12f", *([0, 0, 1] * 4))
    uvs = struct.pack("<8H", 0, 0, 65535, 0, 0, 65535, 65535, 65535)
    indices = struct.pack("<6H", 0, 1, 2, 2, 1, 3)
    times = struct.pack("<2f", 0, 1)
    moves = struct.pack("<6f", 0, 0, 0, 0, 1, 0)
    sparse_index, sparse_value = struct.pack("<4B", 3, 0, 0, 0), struct.pack("<3f", 1, 1, 0.5)
    parts = [corners, normals, uvs, indices, times, moves, sparse_index, sparse_value, picture]
    views, offset = [], 0
    for part in parts:
        views.append({"buffer": 0, "byteOffset": offset, "byteLength": len(part)})
        offset += len(part) + -len(part) % 4
    data = b"".join(p + b"\0" * (-len(p) % 4) for p in parts)

    def accessor(view, component, kind, count, **more):
        return {"bufferView": view, "componentType": component, "type": kind, "count": count, **more}

    sparse = {"count": 1, "indices": {"bufferView": 6, "componentType": 5121},
              "values": {"bufferView": 7}}
    return {
        "asset": {"version": "2.0", "generator": "probelab"},
        "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_emissive_strength",
                           "KHR_texture_transform"],
        "extensions": {"KHR_lights_punctual": {"lights": [
            {"type": "point", "intensity": 5, "color": [1, 0.5, 0.2], "range": 9},
            {"type": "spot", "intensity": 5, "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.5}},
            {"type": "directional", "intensity": 3}]}},
        "scene": 0, "scenes": [{"nodes": [0, 2, 3, 4, 5]}],
        "nodes": [{"name": "pivot", "children": [1], "rotation": [0, 0.70710678, 0, 0.70710678]},
                  {"name": "quad", "mesh": 0, "scale": [2, 1, 1]},
                  {"name": "eye", "camera": 0, "translation": [0, 0, 3]},
                  {"name": "lamp", "extensions": {"KHR_lights_punctual": {"light": 0}}},
                  {"matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 2, 0, 1],
                   "extensions": {"KHR_lights_punctual": {"light": 1}}},
                  {"extensions": {"KHR_lights_punctual": {"light": 2}}}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}],
        "meshes": [{"name": "quad", "primitives": [
            {"attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}, "indices": 3,
             "material": 0},
            {"attributes": {"POSITION": 6}, "mode": 5, "material": 1}]}],
        "materials": [
            {"name": "screen", "alphaMode": "MASK", "alphaCutoff": 0.4, "doubleSided": True,
             "pbrMetallicRoughness": {"metallicFactor": 0, "baseColorTexture": {
                 "index": 0, "extensions": {"KHR_texture_transform": {
                     "offset": [0.1, 0], "rotation": 0.2, "scale": [2, 2]}}}}},
            {"emissiveFactor": [1, 0.5, 0.1], "emissiveTexture": {"index": 0},
             "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 4}}}],
        "textures": [{"source": 0, "sampler": 0}], "images": [{"bufferView": 8,
                                                               "mimeType": "image/png"}],
        "samplers": [{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}],
        "animations": [{"samplers": [{"input": 4, "output": 5, "interpolation": "LINEAR"}],
                        "channels": [{"sampler": 0, "target": {"node": 1, "path": "translation"}}]}],
        "accessors": [accessor(0, 5126, "VEC3", 4, min=[0, 0, 0], max=[1, 1, 0]),
                      accessor(1, 5126, "VEC3", 4), accessor(2, 5123, "VEC2", 4, normalized=True),
                      accessor(3, 5123, "SCALAR", 6), accessor(4, 5126, "SCALAR", 2),
                      accessor(5, 5126, "VEC3", 2), accessor(0, 5126, "VEC3", 4, sparse=sparse)],
        "bufferViews": views, "buffers": [{"byteLength": len(data)}]}, data


def write_pictures(folder):
    folder.mkdir(parents=True, exist_ok=True)
    rgba = png(4, 4, 6, 8, [b"\0" + bytes(range(16 * y, 16 * y + 16)) for y in range(4)])
    (folder / "rgba.png").write_bytes(rgba)
    (folder / "grey16.png").write_bytes(png(3, 2, 0, 16, [b"\1" + bytes(range(6))] * 2))
    (folder / "palette.png").write_bytes(
        png(9, 3, 3, 1, [b"\2\xa5\x80"] * 3, palette=b"\xff\0\0\0\xff\0"))
    (folder / "interlaced.png").write_bytes(
        png(3, 3, 2, 8, [b"\0\1\2\3", b"\0\1\2\3", b"\0\1\2\3", b"\0\1\2\3\4\5\6",
                         b"\0\1\2\3", b"\0\1\2\3\4\5\6\7\x08\x09"], interlaced=True))
    (folder / "claims.png").write_bytes(png(16000, 16000, 6, 8, [b"\0" * 64]))
    try:
        from PIL import Image
    except ImportError:
        return rgba
    image = Image.new("RGB", (17, 9))
    image.putdata([(x * 15 % 256, x * x % 256, 255 - x) for x in range(17 * 9)])
    image.save(folder / "baseline.jpg", quality=60)
    image.save(folder / "progressive.jpg", quality=60, progressive=True, subsampling=2)
    image.convert("L").save(folder / "grey.jpg", quality=30)
    return rgba


def write_scenes(picture):
    for name in ("gltf", "glb", "scene_toml"):
        (CORPUS / name).mkdir(parents=True, exist_ok=True)
    write_glb(CORPUS / "glb/room.glb", emission=(1.0, 0.5, 0.25))
    gltf, data = rich_gltf(picture)
    text = json.dumps(gltf).encode()
    text += b" " * (-len(text) % 4)
    (CORPUS / "glb/rich.glb").write_bytes(
        struct.pack("<4sIII4s", b"glTF", 2, 28 + len(text) + len(data), len(text), b"JSON") + text +
        struct.pack("<I4s", len(data), b"BIN\0") + data)
    gltf["buffers"][0]["uri"] = data_uri(data)
    (CORPUS / "gltf/rich.gltf").write_text(json.dumps(gltf))
    gltf["images"] = [{"uri": data_uri(picture, "image/png")}]
    (CORPUS / "gltf/data_images.gltf").write_text(json.dumps(gltf, indent=1))
    gltf["images"] = [{"uri": "rgba.png"}]
    (CORPUS / "gltf/files.gltf").write_text(json.dumps(gltf))
    furnace = json.loads((SOURCE / "scenes/furnace/furnace.gltf").read_text())
    furnace["buffers"][0]["uri"] = data_uri((SOURCE / "scenes/furnace/furnace.bin").read_bytes())
    (CORPUS / "gltf/furnace.gltf").write_text(json.dumps(furnace))
    write_toml_scenes()


def write_toml_scenes():
    folder = CORPUS / "scene_toml"
    (folder / "room.toml").write_text("""gltf = "room.glb"
time_s = 0.5
[sky]
radiance = [0.5, 0.6, 1.0]
linear = [0.0, 0.5, 0.0]
[[light]]
name = "sun"
type = "directional"
color = [1.0, 1.0, 0.9]
intensity = 3.0
direction = [-0.95, -0.21, -0.21]
[[light]]
name = "lamp"
type = "spot"
intensity = 9
position = [0.0, 2.5, 0.0]
direction = [0, -1, 0]
inner_cone_deg = 10.0
outer_cone_deg = 30.0
range_m = 8.0
[[camera]]
name = "corner"
position = [1.5, 1.6, 1.5]
target = [0.0, 1.5, 0.0]
vertical_fov_deg = 60.0
[volume]
min = [-2.1, -0.1, -2.1]
max = [2.1, 3.1, 2.1]
[receivers]
seeds = [[0.0, 1.6, 0.0]]
[flip]
start = -3.0
stop = 4.0
[[state]]
name = "day"
[[state]]
name = "evening"
split = "heldout"
lights = { sun = { direction = [-0.5, -0.2, 0.8], intensity = 1.0 }, lamp = { color = [1, 0, 0] } }
sky_scale = 0.3
""")
    (folder / "sky.toml").write_text("""[sky]
image = "sky.exr"
[volume]
min = [-1, -1, -1]
max = [1, 1, 1]
""")
    (folder / "lamp.toml").write_text("""gltf = "room.glb"
[[light]]
name = "lamp"
type = "point"
color = [1.0, 0.5, 0.25]
intensity = 1e2
position = [0.5, 2.0, 0.0]
""")


def write_by_program(program):
    room = CORPUS / "glb/room.glb"
    for name in ("layout_json", "receivers_json", "points_csv", "values_json", "params_toml",
                 "study_toml", "exr"):
        (CORPUS / name).mkdir(parents=True, exist_ok=True)

    with tempfile.TemporaryDirectory() as folder:
        def run(*words):
            subprocess.run([program, *map(str, words), "--cache", "cache", "--quiet"], cwd=folder,
                           check=True, stdout=subprocess.DEVNULL)

        # Every number in them is a matter of seeds, but for the times and the version.
        shutil.copy(room, folder)
        for name, words in {"grid": ("grid",), "maxent": ("jittered",),
                            "knn": ("poisson", "--option", "interpolant=knn"),
                            "relocated": ("relocated",)}.items():
            run("place", "room.glb", "--strategy", *words, "--probes", 8, "-o",
                CORPUS / f"layout_json/{name}.json")
        run("receivers", "room.glb", "--count", 6, "--spp", 4, "-o",
            CORPUS / "receivers_json/six.json")
        run("receivers", "room.glb", "--count", 1, "--spp", 4, "-o",
            CORPUS / "receivers_json/one.json")
        run("reference", "room.glb", "--width", 3, "--height", 2, "--spp", 1, "-o", "r.exr")
        shutil.copy(pathlib.Path(folder) / "r.exr", CORPUS / "exr/layers.exr")
    (CORPUS / "points_csv/points.csv").write_text(
        "x,y,z,nx,ny,nz\n# in the middle\n0,1.5,0,0,1,0\n\n-1.9, 1e0, +0.5, 1, 0, 0.0\n")
    (CORPUS / "points_csv/bare.csv").write_text("0,1,0,0,0,-2\r\n")
    gains = "3f8000003f8000003f800000" * 4
    (CORPUS / "values_json/two.json").write_text(json.dumps({
        "format": "probelab values 1", "program": "0.1.0", "scene": "room.glb", "state": "",
        "params": "probelab", "probes_hash": "0" * 32, "texels": 2, "probes": 2,
        "gains": [gains, ""]}, indent=1))
    for preset in (SOURCE / "core/ddgi/presets").glob("*.toml"):
        shutil.copy(preset, CORPUS / "params_toml" / preset.name)
    (CORPUS / "params_toml/changes.toml").write_text(
        'preset = "rtxgi"\nrays = 64\nnormal_bias = 0.3\nirradiance_format = "rgba16f"\n')
    (CORPUS / "params_toml/set.txt").write_text("rays=128\n")
    (CORPUS / "study_toml/study.toml").write_text(STUDY)
    write_exr(CORPUS / "exr/sky.exr", [[(0.5, 0.25, x + y) for x in range(4)] for y in range(2)])


STUDY = """about = "everything that a study can say"
command = "evaluate"
scenes = ["room.glb", "room.toml"]
states = "all"
seeds = [1, 2]
[options]
rays = 16
params = "rtxgi.toml"
set = ["normal_bias=0.2"]
exact = true
dump = "e.csv"
[[axis]]
name = "probes"
option = "probes"
values = [1, 8]
[[axis]]
name = "layout"
[[axis.value]]
name = "grid"
[[axis.value]]
name = "jittered"
options = { strategy = "jittered" }
with = { probes = [8] }
[size.smoke]
scenes = ["room.toml"]
seeds = [1]
states = ["day"]
axes = { probes = [8] }
"""


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    program = str(pathlib.Path(sys.argv[1]).resolve())
    write_scenes(write_pictures(CORPUS / "picture"))
    write_by_program(program)


if __name__ == "__main__":
    main()
