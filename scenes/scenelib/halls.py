# SPDX-License-Identifier: GPL-3.0-or-later
"""Larger or oblique scenes: a colonnade, an attic with acute corners, a house of many sizes."""
from scenelib.blocks import Blocks, circle
from scenelib.files import gltf, lamp, material, png, tiled, toml
from scenelib.rooms import PLASTER, SKY, off, sun


def tiles(x, y):
    """A checker of light and terracotta tiles with grey joints, two by two."""
    if x % 32 in (0, 31) or y % 32 in (0, 31):
        return 120, 116, 110
    grain = (x * 11 + y * 17) % 7
    light = (x // 32 + y // 32) % 2 == 0
    return tuple(c + grain for c in ((206, 198, 182) if light else (164, 92, 66)))


PILLAR = [(0.0, 1.35), (0.25, 1.35), (0.25, 1.22), (0.42, 1.18), (0.55, 1.0), (1.6, 1.0),
          (2.8, 0.95), (4.0, 0.86), (4.15, 0.95), (4.3, 1.0), (4.5, 1.3), (4.8, 1.35), (5.0, 1.35)]


def pillar_hall():
    purpose = ("A hall of 21 round pillars, open to the sun on one side, a skylight above.\n"
               "Visibility changes everywhere: rejecting too much darkens it. Also the benchmark.")
    hall = Blocks("hall")
    hall.fill((-10.8, -0.4, -6.3), (10.8, 0, 6.6), "stone")
    hall.fill((-10.8, 0, -6.3), (10.8, 5.6, 6.6), "stone")
    hall.carve((-10.5, 0, -6), (10.5, 5, 6.6), floor="tiles", north="ochre", west="plaster",
               east="plaster", ceiling="plaster")
    hall.carve((-6.5, 5, -1.5), (6.5, 5.6, -0.5), walls="plaster")
    polygon = circle(0.35, 24)
    for z in (-3.5, 1, 5.5):
        for i in range(7):
            x = -9 + 3 * i
            hall.column((x - 0.6, z - 0.6), (x + 0.6, z + 0.6), polygon, PILLAR, "marble")
    materials = {"stone": material((0.55, 0.52, 0.46)), "plaster": material((0.74, 0.71, 0.66)),
                 "ochre": material((0.68, 0.4, 0.14)), "marble": material((0.78, 0.75, 0.71)),
                 "tiles": material((1.0, 1.0, 1.0), texture="tiles.png", uv=tiled(1.5))}
    out = gltf("pillar_hall", purpose, [hall.mesh()], materials)
    out["tiles.png"] = png(64, 64, tiles)
    out["scene.toml"] = toml(
        purpose, "pillar_hall.gltf", sky=SKY, lights=[sun((0.45, -0.6, -0.66))],
        cameras=[("aisle", (-9.7, 1.7, -1.6), (2.5, 1.9, 0.0), 60),
                 ("north wall", (6.0, 1.7, 4.4), (-2.5, 1.9, -5.0), 60)],
        volume=((-10.78, -0.38, -6.28), (10.78, 5.58, 6.58)), seeds=[(-7.5, 1.5, -1.2)],
        states=[("afternoon", "train", None, None),
                ("noon", "train", {"sun": {"direction": (-0.1, -0.85, -0.5), "intensity": 12}},
                  1.1),
                ("morning", "heldout", {"sun": {"direction": (-0.6, -0.35, -0.7), "intensity": 6,
                                                "color": (1, 0.8, 0.6)}}, 0.6)])
    return out


def attic_warp(p):
    """Box to attic. For x in -4..4 the ceiling falls from 3.2 m to the floor (21.8 degrees between
    them); at x = -8 the alcove's side walls meet in a vertical edge (33.4 degrees)."""
    x, y, z = p
    height = 3.2 * min(1.0, max(0.0, (4 - x) / 8))
    if 0 < y <= 3.2:
        y *= height / 3.2
    elif y > 3.2:
        y = height + (y - 3.2) * 1.08
    if x == -8 and abs(z) < 2:
        z = 0.0
    return x, y, z


def acute_corner():
    purpose = ("An attic whose roof meets the floor at 22 degrees; an alcove with walls at 33.\n"
               "Probes near the edges are close to two surfaces at once, and biases have no room.")
    solid = Blocks("attic")
    solid.fill((-8.9, -0.25, -2.75), (4.9, 3.45, 2.75), "plaster")
    solid.carve((-4, 0, -2.5), (4, 3.2, 2.5), floor="boards", ceiling="panelling", north="teal")
    solid.carve((-8, 0, -1.2), (-4, 2.2, 1.2), floor="boards", walls="red")
    solid.fill((-2.6, 0, -2.5), (-1.4, 1.0, -1.9), "chest", own=True)
    materials = {"plaster": material(PLASTER), "boards": material((0.46, 0.3, 0.18)),
                 "panelling": material((0.72, 0.6, 0.44)), "teal": material((0.12, 0.4, 0.42)),
                 "red": material((0.6, 0.14, 0.1)), "chest": material((0.3, 0.2, 0.14))}
    lamps = [lamp("lamp_attic", (-2.6, 2.1, 1.2), 12.0, (1.0, 0.9, 0.75)),
             lamp("lamp_alcove", (-5.2, 1.6, 0.1), 8.0, (1.0, 0.9, 0.75))]
    out = gltf("acute_corner", purpose, [solid.mesh(warp=attic_warp)], materials, lamps)
    low = {"position": (1.2, 0.7, -1.4), "intensity": 5}
    out["scene.toml"] = toml(
        purpose, "acute_corner.gltf",
        cameras=[("eaves", (-3.5, 1.6, 2.0), (2.6, 0.5, -1.2), 60),
                 ("alcove", (-1.0, 1.4, 0.9), (-7.5, 1.0, -0.1), 45)],
        seeds=[(-2, 1.2, 0), (-5, 1.2, 0)],
        states=[("attic", "train", {"lamp_alcove": off()}, None),
                ("alcove", "train", {"lamp_attic": off()}, None),
                ("low", "heldout", {"lamp_attic": low, "lamp_alcove": off()}, None)])
    return out


def screen(x, y):
    """A test card: colour bars over a grey ramp, black at the rim."""
    if x in (0, 47) or y in (0, 31):
        return 0, 0, 0
    if y >= 24:
        return (int(5.4 * x),) * 3
    bars = ((230, 230, 230), (230, 210, 40), (40, 200, 220), (50, 190, 60), (200, 60, 190),
            (210, 50, 40))
    return bars[x // 8]


def screen_uv(p, axis):
    return (p[2] - 5.6) / 1.2, (1.75 - p[1]) / 0.75


def house():
    """A hall of 12 x 6 x 8 m; west of it three closets of 1 m; east of it a pantry and a study,
    over them an upper room that ten steps lead up to."""
    solid = Blocks("house")
    solid.fill((-1.4, -0.25, -0.25), (0, 2.5, 8.25), "facade")
    solid.fill((-0.2, -0.25, -0.25), (16.4, 6.25, 8.25), "facade")
    inside = {"walls": "plaster", "ceiling": "plaster", "floor": "boards"}
    solid.carve((0, 0, 0), (12, 6, 8), **dict(inside, north="green"))
    for z, width in ((1.2, 0.7), (3.3, 0.6), (5.4, 0.2)):
        solid.carve((-1.2, 0, z), (-0.2, 2.25, z + 1), **dict(inside, west="red"))
        solid.carve((-0.2, 0, z + 0.1), (0, 2, z + 0.1 + width), **inside)
    solid.carve((12.2, 0, 0), (16.2, 2.25, 4.2), **inside)
    solid.carve((12, 0, 2.3), (12.2, 2, 3.1), **inside)
    solid.carve((12.2, 0, 4.4), (16.2, 2.25, 8), **dict(inside, south="blue"))
    solid.carve((12, 0, 5.4), (12.2, 2, 6.4), **inside)
    solid.carve((12.2, 2.5, 0), (16.2, 6, 8), **dict(inside, south="red"))
    solid.carve((12, 2.5, 0), (12.2, 4.5, 1.2), **inside)
    for x in (1.5, 4.5, 7.5):
        solid.carve((x, 1, 8), (x + 1.5, 4.5, 8.25), **dict(inside, floor="plaster"))
    solid.carve((16.2, 3.5, 3.1), (16.4, 4.5, 5.4), **dict(inside, floor="plaster"))
    for step in range(10):
        solid.fill((9 + 0.3 * step, 0, 0), (12, 0.25 * (step + 1), 1.2), "stone", own=True)
    solid.fill((4.5, 0, 3.1), (6, 0.75, 4.2), "cushion", own=True)
    solid.fill((14.5, 0, 0), (16.2, 1.5, 1.2), "facade", own=True)
    solid.patch((16.2, 1.0, 5.6), (16.2, 1.75, 6.8), "screen")
    return solid


def mixed_scale():
    purpose = ("A house: a hall of 12 m, closets of 1 m, stairs, pantry, study, an upper room.\n"
               "No single spacing of probes suits all; large rooms waste what the small ones lack.")
    materials = {"facade": material((0.62, 0.6, 0.56)), "plaster": material((0.78, 0.76, 0.72)),
                 "boards": material((0.47, 0.33, 0.21)), "green": material((0.28, 0.45, 0.26)),
                 "red": material((0.62, 0.15, 0.11)), "blue": material((0.16, 0.27, 0.55)),
                 "stone": material((0.5, 0.49, 0.46)), "cushion": material((0.68, 0.36, 0.1)),
                 "screen": material((0.1, 0.1, 0.1), emission=(4.0, 4.0, 4.0),
                                    emission_texture="screen.png", uv=screen_uv)}
    lamps = [lamp("lamp_study", (14.2, 1.9, 7.2), 5.0, (1.0, 0.85, 0.65)),
             lamp("lamp_hall", (6.0, 4.2, 3.0), 30.0, (1.0, 0.85, 0.65))]
    out = gltf("mixed_scale", purpose, [house().mesh()], materials, lamps)
    out["screen.png"] = png(48, 32, screen)
    out["scene.toml"] = toml(
        purpose, "mixed_scale.gltf", sky=SKY, lights=[sun((-0.4, -0.55, -0.73))],
        cameras=[("hall", (0.7, 1.7, 7.2), (9.0, 2.2, 0.8), 62),
                 ("study", (12.7, 1.6, 4.9), (15.9, 1.1, 6.6), 65),
                 ("closets", (5.2, 1.7, 5.6), (-0.4, 1.0, 3.2), 55),
                 ("upper room", (15.8, 4.2, 7.4), (12.4, 3.4, 0.8), 62)],
        volume=((-1.38, -0.23, -0.23), (16.38, 6.23, 8.23)), seeds=[(6, 1.5, 5)],
        states=[("day", "train", {"lamp_hall": off()}, None),
                ("evening", "train", {"sun": off(), "lamp_study": off()}, 0.05),
                ("morning", "heldout", {"sun": {"direction": (0.45, -0.35, -0.7), "intensity": 7,
                                              "color": (1, 0.85, 0.65)},
                                      "lamp_hall": off()}, 0.7)])
    return out
