# SPDX-License-Identifier: GPL-3.0-or-later
"""glTF, PNG and scene TOML as bytes, the same on every machine.

PNGs hold stored (uncompressed) deflate blocks written here, because the compressed bytes of zlib
differ between its versions.
"""
import json
import math
import struct
import zlib

FLOAT, UINT16, UINT32 = 5126, 5123, 5125


def material(base, emission=None, texture=None, emission_texture=None, uv=None):
    """A diffuse material. base: albedo; emission: radiance; textures: file names; uv(point, axis of
    the face's normal) -> (u, v)."""
    return {"base": base, "emission": emission, "texture": texture,
            "emission_texture": emission_texture, "uv": uv}


def tiled(size):
    """Texture coordinates for a texture that repeats every `size` metres."""
    def uv(p, axis):
        if axis == 1:
            return p[0] / size, p[2] / size
        return p[2 if axis == 0 else 0] / size, -p[1] / size
    return uv


def lamp(name, position, candela, color=(1.0, 1.0, 1.0)):
    return {"name": name, "position": position, "intensity": candela, "color": color}


def gltf(stem, purpose, meshes, materials, lamps=(), cameras=()):
    """{file name: bytes} of stem.gltf and .bin. cameras: (name, position, target, fov degrees)."""
    names = sorted({name for mesh in meshes for name in mesh.materials()})
    document = {"asset": {"version": "2.0", "generator": "scenes/generate.py",
                          "extras": {"purpose": purpose}},
                "scene": 0, "scenes": [{"nodes": []}], "nodes": [], "meshes": [],
                "materials": [], "accessors": [], "bufferViews": []}
    for name in names:
        document["materials"].append(material_json(document, name, materials[name]))
    data = bytearray()
    for mesh in meshes:
        primitives = [primitive(document, data, mesh, name, materials[name], names.index(name))
                      for name in mesh.materials()]
        document["meshes"].append({"name": mesh.name, "primitives": primitives})
        add_node(document, {"name": mesh.name, "mesh": len(document["meshes"]) - 1})
    add_lamps(document, lamps)
    for name, position, target, fov_deg in cameras:
        document.setdefault("cameras", []).append(
            {"name": name, "type": "perspective",
             "perspective": {"yfov": round(math.radians(fov_deg), 6), "znear": 0.01}})
        add_node(document, {"name": name, "camera": len(document["cameras"]) - 1,
                            "translation": list(position),
                            "rotation": look_rotation(position, target)})
    document["buffers"] = [{"uri": stem + ".bin", "byteLength": len(data)}]
    text = json.dumps(document, indent=1) + "\n"
    return {stem + ".gltf": text.encode(), stem + ".bin": bytes(data)}


def add_node(document, node):
    document["scenes"][0]["nodes"].append(len(document["nodes"]))
    document["nodes"].append(node)


def add_lamps(document, lamps):
    if not lamps:
        return
    document.setdefault("extensionsUsed", []).append("KHR_lights_punctual")
    document["extensions"] = {"KHR_lights_punctual": {"lights": [
        {"name": l["name"], "type": "point", "color": list(l["color"]), "intensity": l["intensity"]}
        for l in lamps]}}
    for i, l in enumerate(lamps):
        add_node(document, {"name": l["name"], "translation": list(l["position"]),
                            "extensions": {"KHR_lights_punctual": {"light": i}}})


def material_json(document, name, spec):
    pbr = {"baseColorFactor": list(spec["base"]) + [1.0], "metallicFactor": 0.0,
           "roughnessFactor": 1.0}
    out = {"name": name, "pbrMetallicRoughness": pbr}
    if spec["texture"]:
        pbr["baseColorTexture"] = {"index": texture_index(document, spec["texture"])}
    if spec["emission"]:
        strength = max(spec["emission"])
        out["emissiveFactor"] = [e / strength for e in spec["emission"]]
        if strength != 1:
            out["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
            if "KHR_materials_emissive_strength" not in document.setdefault("extensionsUsed", []):
                document["extensionsUsed"].append("KHR_materials_emissive_strength")
    if spec["emission_texture"]:
        out["emissiveTexture"] = {"index": texture_index(document, spec["emission_texture"])}
    return out


def texture_index(document, file_name):
    document.setdefault("samplers", [{"magFilter": 9729, "minFilter": 9729, "wrapS": 10497,
                                      "wrapT": 10497}])
    images = document.setdefault("images", [])
    for i, image in enumerate(images):
        if image["uri"] == file_name:
            return i
    images.append({"uri": file_name, "mimeType": "image/png"})
    document.setdefault("textures", []).append({"source": len(images) - 1, "sampler": 0})
    return len(images) - 1


def primitive(document, data, mesh, name, spec, material_index):
    uv_of = spec["uv"]
    vertices, indices = {}, []
    for triangle_material, corners in mesh.triangles:
        if triangle_material != name:
            continue
        axis = normal_axis(corners) if uv_of else 0
        for p in corners:
            key = tuple(p) + (tuple(uv_of(p, axis)) if uv_of else ())
            indices.append(vertices.setdefault(key, len(vertices)))
    rows = list(vertices)
    attributes = {"POSITION": add_accessor(document, data, [r[:3] for r in rows], "VEC3", FLOAT)}
    if uv_of:
        uvs = [r[3:] for r in rows]
        attributes["TEXCOORD_0"] = add_accessor(document, data, uvs, "VEC2", FLOAT)
    kind = UINT16 if len(rows) < 65535 else UINT32
    index = add_accessor(document, data, [(i,) for i in indices], "SCALAR", kind)
    return {"attributes": attributes, "indices": index, "material": material_index}


def normal_axis(corners):
    spread = [max(p[a] for p in corners) - min(p[a] for p in corners) for a in range(3)]
    return spread.index(min(spread))


def add_accessor(document, data, rows, shape, kind):
    """Appends rows to the buffer and returns the accessor's index; every view starts at 4 bytes."""
    width = len(rows[0])
    flat = [value for row in rows for value in row]
    code = {FLOAT: "f", UINT16: "H", UINT32: "I"}[kind]
    packed = struct.pack("<%d%s" % (len(flat), code), *flat)
    view = {"buffer": 0, "byteOffset": len(data), "byteLength": len(packed),
            "target": 34962 if kind == FLOAT else 34963}
    accessor = {"bufferView": len(document["bufferViews"]), "componentType": kind,
                "count": len(rows), "type": shape}
    if shape == "VEC3":
        exact = struct.unpack("<%df" % len(flat), packed)
        accessor["min"] = [min(exact[a::width]) for a in range(width)]
        accessor["max"] = [max(exact[a::width]) for a in range(width)]
    data += packed + b"\0" * (-len(packed) % 4)
    document["bufferViews"].append(view)
    document["accessors"].append(accessor)
    return len(document["accessors"]) - 1


def look_rotation(position, target):
    """The quaternion (x, y, z, w) that turns a glTF camera (along -Z, +Y up) to a target."""
    d = [b - a for a, b in zip(position, target)]
    yaw = math.atan2(-d[0], -d[2])
    pitch = math.atan2(d[1], math.hypot(d[0], d[2]))
    cy, sy, cp, sp = (math.cos(yaw / 2), math.sin(yaw / 2), math.cos(pitch / 2),
                      math.sin(pitch / 2))
    return [round(v, 9) + 0.0 for v in (cy * sp, sy * cp, -sy * sp, cy * cp)]


def png(width, height, pixel):
    """An 8-bit RGB image from pixel(x, y) -> (r, g, b) in sRGB values 0..255."""
    raw = b"".join(b"\0" + bytes(v for x in range(width) for v in pixel(x, y))
                   for y in range(height))
    stream = b"\x78\x01"
    for start in range(0, len(raw), 65535):
        part = raw[start:start + 65535]
        final = start + 65535 >= len(raw)
        stream += struct.pack("<BHH", final, len(part), len(part) ^ 0xFFFF) + part
    stream += struct.pack(">I", zlib.adler32(raw))
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", stream), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in chunks)


def value_text(value):
    if isinstance(value, str):
        return json.dumps(value)
    if isinstance(value, dict):
        return "{ " + ", ".join("%s = %s" % (k, value_text(v)) for k, v in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(value_text(v) for v in value) + "]"
    return repr(float(value))


def toml(purpose, file_name=None, sky=None, lights=(), cameras=(), volume=None, seeds=(),
         flip=None, states=(), turn_deg=None):
    """A scene TOML. cameras: (name, position, target, fov degrees); volume: (min, max); flip:
    (start, stop); states: (name, split, {light: changes}, sky scale or None); turn_deg turns all of
    it."""
    lines = ["# " + line for line in purpose.split("\n")]
    if file_name:
        lines.append("gltf = " + value_text(file_name))
    if turn_deg:
        lines.append("turn_deg = " + value_text(turn_deg))

    def table(head, values):
        lines.extend(["", head] + ["%s = %s" % (k, value_text(v)) for k, v in values.items()])

    if sky:
        table("[sky]", sky)
    for light in lights:
        table("[[light]]", light)
    for name, position, target, fov_deg in cameras:
        table("[[camera]]", {"name": name, "position": position, "target": target,
                             "vertical_fov_deg": fov_deg})
    if volume:
        table("[volume]", {"min": volume[0], "max": volume[1]})
    if seeds:
        table("[receivers]", {"seeds": seeds})
    if flip:
        table("[flip]", {"start": flip[0], "stop": flip[1]})
    for name, split, changes, sky_scale in states:
        values = {"name": name, "split": split}
        if changes:
            values["lights"] = changes
        if sky_scale is not None:
            values["sky_scale"] = sky_scale
        table("[[state]]", values)
    return ("\n".join(lines) + "\n").encode()
