# SPDX-License-Identifier: GPL-3.0-or-later
"""Rooms with one question each: a dark room, thin walls, a door, a window, a bend."""
from scenelib.blocks import Blocks
from scenelib.files import gltf, lamp, material, png, tiled, toml

PLASTER = (0.75, 0.73, 0.7)
CONCRETE = (0.5, 0.5, 0.48)
SUN = {"name": "sun", "type": "directional", "color": (1.0, 0.95, 0.87), "intensity": 10.0}
TURNS_DEG = (15, 30, 45)  # scenes that stand at an angle to the axes, and to any lattice
SKY = {"radiance": (0.5, 0.65, 0.9)}


def sun(direction):
    return dict(SUN, direction=direction)


def off():
    return {"intensity": 0}


def sealed_room():
    purpose = ("A room without any opening on a ground plane under sun and sky.\n"
               "Not a photon gets in: inside, any light that a probe field shows is a leak.")
    solid = Blocks("ground and room")
    solid.fill((-9, -0.5, -9), (9, 0, 9), "ground")
    solid.fill((-3.3, 0, -2.8), (3.3, 3.3, 2.8), "plaster")
    solid.carve((-3, 0, -2.5), (3, 3, 2.5), floor="boards")
    solid.fill((5.2, 0, -3.6), (5.5, 2.6, 3), "clay", own=True)
    solid.fill((-1.5, 0, 4.2), (2.4, 0.5, 5.2), "clay", own=True)
    solid.fill((-0.4, 0, -1), (1.2, 0.75, 0.2), "boards", own=True)
    materials = {"ground": material((0.45, 0.44, 0.38)), "plaster": material(PLASTER),
                 "boards": material((0.5, 0.33, 0.2)), "clay": material((0.65, 0.22, 0.12))}
    out = gltf("sealed_room", purpose, [solid.mesh()], materials)
    out["scene.toml"] = toml(
        purpose, "sealed_room.gltf", sky=SKY, lights=[sun((0.4, -0.85, -0.3))],
        cameras=[("outside", (4.9, 1.7, 7.0), (3.0, 1.3, -0.6), 62),
                 ("inside", (-2.6, 1.7, 2.1), (1.5, 0.9, -1), 65)],
        volume=((-9, -0.5, -9), (9, 5, 9)), seeds=[(-2, 1.5, 1.5), (4.2, 1.5, 6)], flip=(-2, 4),
        states=[("noon", "train", None, None),
                ("morning", "train", {"sun": {"direction": (-0.8, -0.4, 0.45), "intensity": 7}},
                  0.8),
                ("evening", "heldout", {"sun": {"direction": (0.85, -0.3, -0.3), "intensity": 4}},
                 0.4)])
    return out


def thin_wall():
    out = {}
    for cm in (1, 2, 5, 10, 20, 50):
        purpose = ("Two closed rooms that share a wall of %d cm, one lit and one dark.\n"
                   "The dark room's irradiance is exactly 0: how thin may a wall be?" % cm)
        half, stem = cm / 200, "thin_wall_%02dcm" % cm
        solid = Blocks("rooms")
        solid.fill((-half - 4.25, -0.25, -2.25), (half + 4.25, 2.85, 2.25), "plaster")
        solid.carve((-half - 4, 0, -2), (-half, 2.6, 2), floor="boards", north="red")
        solid.carve((half, 0, -2), (half + 4, 2.6, 2), floor="tiles", south="blue")
        solid.fill((-half - 2.2, 0, -1.4), (-half - 1.2, 0.9, -0.4), "boards", own=True)
        solid.fill((half + 1.4, 0, 0.2), (half + 2.6, 0.5, 1.4), "plaster", own=True)
        materials = {"plaster": material(PLASTER), "boards": material((0.48, 0.32, 0.2)),
                     "red": material((0.62, 0.12, 0.09)), "blue": material((0.12, 0.22, 0.6)),
                     "tiles": material((0.4, 0.42, 0.42))}
        lamps = [lamp("lamp_west", (-half - 2.4, 2.1, 0.9), 12.0, (1.0, 0.85, 0.65)),
                 lamp("lamp_east", (half + 2.8, 1.7, -0.9), 12.0, (0.8, 0.9, 1.0))]
        out.update(gltf(stem, purpose, [solid.mesh()], materials, lamps))
        near = {"position": (-half - 0.6, 1.3, 1.1), "intensity": 6}
        text = lambda turn: toml(
            purpose, stem + ".gltf", turn_deg=turn,
            cameras=[("west", (-half - 3.7, 1.6, 1.7), (-half - 0.6, 1.0, -0.9), 65),
                     ("east", (half + 3.7, 1.6, -1.7), (half, 0.9, 0.5), 65)],
            seeds=[(-half - 3, 1.5, 0), (half + 3, 1.5, 0)], flip=(-2, 4),
            states=[("west", "train", {"lamp_east": off()}, None),
                    ("east", "train", {"lamp_west": off()}, None),
                    ("west_near", "heldout", {"lamp_west": near, "lamp_east": off()}, None)])
        out["scene_%02dcm.toml" % cm] = text(None)
        if cm == 5:
            out.update(("scene_05cm_turned_%d.toml" % turn, text(turn)) for turn in TURNS_DEG)
    return out


def two_rooms_door():
    purpose = ("A lit room and an unlit one behind an open door (0.9 m x 2.1 m in a 20 cm wall).\n"
               "A shaft of direct light and the red wall's glow are all that the second room gets.")
    solid = Blocks("rooms")
    solid.fill((-5.3, -0.25, -2.75), (5.3, 3.05, 2.75), "plaster")
    solid.carve((-5.1, 0, -2.5), (-0.1, 2.8, 2.5), floor="boards", north="red")
    solid.carve((0.1, 0, -2.5), (5.1, 2.8, 2.5), floor="boards", south="green")
    solid.carve((-0.1, 0, 0.3), (0.1, 2.1, 1.2), floor="boards")
    solid.fill((-3.6, 0, -2.5), (-1.8, 0.8, -1.7), "wood", own=True)
    solid.fill((2.2, 0, -0.6), (3.4, 0.45, 0.6), "wood", own=True)
    materials = {"plaster": material(PLASTER), "boards": material((0.5, 0.36, 0.24)),
                 "red": material((0.65, 0.13, 0.1)), "green": material((0.16, 0.45, 0.18)),
                 "wood": material((0.35, 0.22, 0.13))}
    lamps = [lamp("lamp_west", (-2.6, 2.3, -0.4), 18.0, (1.0, 0.9, 0.75)),
             lamp("lamp_east", (3.2, 2.3, -1.2), 14.0, (1.0, 0.9, 0.75))]
    out = gltf("two_rooms_door", purpose, [solid.mesh()], materials, lamps)
    floor_lamp = {"position": (-4.2, 1.1, 1.9), "intensity": 14}
    text = lambda turn: toml(
        purpose, "two_rooms_door.gltf", turn_deg=turn,
        cameras=[("unlit room", (4.7, 1.6, -2.0), (-0.6, 1.1, 1.0), 62),
                 ("lit room", (-4.7, 1.7, 2.1), (-0.4, 1.0, -0.6), 65)],
        seeds=[(-3, 1.5, 1), (3, 1.5, -1.5)],
        states=[("west", "train", {"lamp_east": off()}, None),
                ("east", "train", {"lamp_west": off()}, None),
                ("floor_lamp", "heldout", {"lamp_west": floor_lamp, "lamp_east": off()}, None)])
    out["scene.toml"] = text(None)
    out.update(("scene_turned_%d.toml" % turn, text(turn)) for turn in TURNS_DEG)
    return out


def planks(x, y):
    """Four planks of 16 texels with dark joints and a little grain."""
    plank, across = divmod(y, 16)
    joint = across == 0 or (x + 23 * plank) % 64 == 0
    grain = 0.04 * (plank * 5 % 4) + 0.02 * ((x * 7 + y * 13) % 3)
    shade = (0.45 if joint else 1.0) * (0.86 + grain)
    return tuple(int(c * shade) for c in (186, 142, 98))


def sun_room():
    purpose = ("A room with two windows: patches of sun on textured boards light it from below.\n"
               "The strongest contrast between direct and indirect light of all scenes.")
    solid = Blocks("room")
    solid.fill((-3.3, -0.3, -2.55), (3.3, 3.1, 2.55), "facade")
    solid.carve((-3, 0, -2.25), (3, 2.8, 2.25), floor="boards", walls="plaster", ceiling="plaster",
                west="orange")
    for x in (-2.1, 0.5):
        solid.carve((x, 0.8, 2.25), (x + 1.6, 2.4, 2.55), walls="plaster", floor="plaster",
                    ceiling="plaster")
    solid.fill((-1.2, 0, -2.25), (1.0, 0.9, -1.75), "cabinet", own=True)
    solid.fill((1.6, 0, -0.9), (2.6, 0.45, 0.6), "cabinet", own=True)
    materials = {"facade": material((0.6, 0.58, 0.55)), "plaster": material((0.8, 0.79, 0.77)),
                 "orange": material((0.7, 0.33, 0.1)), "cabinet": material((0.2, 0.35, 0.42)),
                 "boards": material((1.0, 1.0, 1.0), texture="planks.png", uv=tiled(0.8))}
    out = gltf("sun_room", purpose, [solid.mesh()], materials)
    out["planks.png"] = png(64, 64, planks)
    out["scene.toml"] = toml(
        purpose, "sun_room.gltf", sky=SKY, lights=[sun((-0.35, -0.6, -0.7))],
        cameras=[("room", (2.6, 1.6, 1.9), (-1.8, 0.9, -1.2), 68),
                 ("windows", (-1.6, 1.5, -1.5), (0.8, 1.2, 2.3), 70)],
        volume=((-3.28, -0.28, -2.53), (3.28, 3.08, 2.53)), seeds=[(0, 1.5, 0.5)],
        states=[("noon", "train", None, None),
                ("morning", "train", {"sun": {"direction": (0.55, -0.35, -0.6), "intensity": 7}},
                  0.8),
                ("late", "heldout", {"sun": {"direction": (-0.75, -0.3, -0.5), "intensity": 4,
                                             "color": (1, 0.75, 0.5)}}, 0.5)])
    return out


def corridor_l():
    purpose = ("A corridor with a bend and a lamp at one end: the other gets only light that has\n"
               "bounced. The irradiance falls by orders of magnitude on the way.")
    solid = Blocks("corridor")
    solid.fill((-0.2, -0.2, -0.2), (8.2, 2.7, 2.0), "plaster")
    solid.fill((6.2, -0.2, 2.0), (8.2, 2.7, 6.8), "plaster")
    solid.carve((0, 0, 0), (8, 2.5, 1.8), floor="linoleum", north="blue", east="orange")
    solid.carve((6.4, 0, 1.8), (8, 2.5, 6.6), floor="linoleum", east="orange")
    solid.fill((3.4, 0, 0), (4.6, 1.1, 0.4), "cabinet", own=True)
    solid.fill((7.6, 0, 3.6), (8, 1.1, 4.8), "cabinet", own=True)
    materials = {"plaster": material(PLASTER), "linoleum": material((0.3, 0.36, 0.3)),
                 "blue": material((0.15, 0.28, 0.6)), "orange": material((0.72, 0.36, 0.12)),
                 "cabinet": material((0.55, 0.5, 0.42))}
    lamps = [lamp("lamp_start", (2.0, 2.1, 1.0), 16.0), lamp("lamp_end", (7.1, 2.1, 5.6), 16.0)]
    out = gltf("corridor_l", purpose, [solid.mesh()], materials, lamps)
    middle = {"position": (4.8, 2.1, 1.2), "intensity": 10}
    out["scene.toml"] = toml(
        purpose, "corridor_l.gltf",
        cameras=[("far end", (6.8, 1.6, 6.1), (7.25, 1.15, 0.6), 62),
                 ("start", (0.4, 1.6, 1.4), (7.0, 1.1, 0.8), 60)],
        seeds=[(2, 1.5, 1), (7.0, 1.5, 4.2)],
        states=[("start", "train", {"lamp_end": off()}, None),
                ("end", "train", {"lamp_start": off()}, None),
                ("middle", "heldout", {"lamp_start": middle, "lamp_end": off()}, None)])
    return out
