# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes with a closed form or a long tradition: sheets facing in, or no triangles at all."""
from scenelib.blocks import Blocks, icosphere, rectangle
from scenelib.files import gltf, lamp, material, toml

WHITE = (0.73, 0.73, 0.73)


def cornell():
    purpose = ("The classic box: an area light, two blocks, red and green walls that bleed.\n"
               "Open at the front; evening sky comes in there in two of the three states.")
    box = Blocks("box")
    lo, hi = (-1.5, 0, -1.5), (1.5, 3, 1.5)
    box.fill((-1.6, -0.1, -1.6), (1.6, 3.1, 1.5), "white")
    box.carve(lo, hi, west="red", east="green")
    box.patch((-0.4, 3, -0.35), (0.4, 3, 0.35), "panel")
    box.column((-1.15, -1.15), (0.05, 0.05), rectangle(0.85, 0.8, 18), [(0, 1), (1.75, 1)], "white")
    box.column((0.1, 0.1), (1.2, 1.2), rectangle(0.8, 0.8, -17), [(0, 1), (0.8, 1)], "white")

    def inner(centre, axis, sign):
        return all(a <= c <= b for a, c, b in zip(lo, centre, hi)) and not (
            axis == 2 and centre[2] == hi[2])

    materials = {"white": material(WHITE), "red": material((0.63, 0.065, 0.05)),
                 "green": material((0.14, 0.45, 0.09)),
                 "panel": material((0.78, 0.78, 0.78), emission=(17.0, 12.0, 6.8))}
    out = gltf("cornell", purpose, [box.mesh(keep=inner)], materials,
               cameras=[("red corner", (0.9, 2.3, 1.3), (-1.2, 0.7, -0.6), 60)])
    out["scene.toml"] = toml(
        purpose, "cornell.gltf", sky={"radiance": (0.3, 0.4, 0.6)}, seeds=[(0, 2.2, 1)],
        cameras=[("front", (0, 1.5, 5.9), (0, 1.5, 0), 39)],
        volume=((-1.501, -0.001, -1.501), (1.501, 3.001, 1.501)),
        states=[("panel", "train", None, 0), ("panel and sky", "train", None, 1),
                ("panel and dusk", "heldout", None, 0.35)])
    return out


def furnace_box(name, albedo):
    box = Blocks("box")
    box.fill((-2.1, -1.35, -1.6), (2.1, 1.35, 1.6), "glow")
    box.carve((-2, -1.25, -1.5), (2, 1.25, 1.5))

    def inner(centre, axis, sign):
        return abs(centre[0]) <= 2 and abs(centre[1]) <= 1.25 and abs(centre[2]) <= 1.5

    glow = material((albedo,) * 3, emission=(1.0, 1.0, 1.0))
    return gltf(name, furnace_purpose(albedo), [box.mesh(keep=inner)], {"glow": glow})


def furnace_purpose(albedo):
    return ("The white furnace: a closed box that emits 1 everywhere, albedo %g.\n"
            "The irradiance is pi / (1 - albedo) at every point, whatever the normal." % albedo)


def furnace():
    out = {}
    for albedo, stem, scene in ((0.5, "furnace", "scene.toml"),
                                (0.9, "furnace_090", "scene_090.toml")):
        out.update(furnace_box(stem, albedo))
        out[scene] = toml(furnace_purpose(albedo), stem + ".gltf", seeds=[(0, 0, 0)],
                          cameras=[("inside", (-1.6, 0.2, 1.1), (1.2, -0.2, -0.8), 60)])
    return out


def sphere_light():
    purpose = ("A diffuse sphere (radius 2 by area, albedo 0.6) around an off-centre point light.\n"
               "Indirect irradiance is uniform: albedo / (1 - albedo) intensity / radius^2.")
    out = gltf("sphere_light", purpose, [icosphere("sphere", "wall", 4, 2.0)],
               {"wall": material((0.6, 0.6, 0.6))}, lamps=[lamp("bulb", (0.9, 0.4, -0.6), 10.0)])
    out["scene.toml"] = toml(purpose, "sphere_light.gltf", seeds=[(0, 0, 0)],
                             cameras=[("inside", (-1.3, 0.1, 0.9), (1.2, 0.1, -0.8), 70)])
    return out


def linear_sky():
    purpose = ("No triangles: a sky linear in direction, L(d) = radiance (1 + linear . d).\n"
               "Irradiance is radiance (pi + (2 pi / 3) linear . n) everywhere.")
    return {"scene.toml": toml(
        purpose, sky={"radiance": (1.0, 0.8, 0.5), "linear": (0.3, 0.6, -0.4)},
        volume=((-2, -2, -2), (2, 2, 2)), seeds=[(0, 0, 0)],
        cameras=[("middle", (0, 0, 0), (0, 0.3, -1), 60)])}
