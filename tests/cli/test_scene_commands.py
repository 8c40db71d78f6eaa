# SPDX-License-Identifier: GPL-3.0-or-later
"""info, check, init, reference and receivers on a room small enough to know everything about."""
import json
import struct
import unittest

from support import CliTest, ROOM_CORNERS, ROOM_TRIANGLES, SOURCE, write_glb

# Enough for numbers to be finite; nothing here is about noise.
QUICK = ("--spp", 32)


def read_exr_header(path):
    """Channel names and string attributes."""
    data = path.read_bytes()
    assert data[:4] == struct.pack("<i", 20000630)
    at, channels, attributes = 8, [], {}
    while data[at] != 0:
        name, at = read_name(data, at)
        kind, at = read_name(data, at)
        size = struct.unpack_from("<i", data, at)[0]
        value, at = data[at + 4:at + 4 + size], at + 4 + size
        if kind == "string":
            attributes[name] = value.decode()
        if kind == "chlist":
            inner = 0
            while value[inner] != 0:
                channel, inner = read_name(value, inner)
                channels.append(channel)
                inner += 16
    return channels, attributes


def read_name(data, at):
    end = data.index(b"\0", at)
    return data[at:end].decode(), end + 1


class Info(CliTest):
    def test_json_names(self):
        info = self.run_json("info")
        for name in ("version", "compiler", "build_type", "threads", "libraries", "tracers",
                     "devices"):
            self.assertIn(name, info)
        self.assertIn("embree", info["tracers"])
        self.assertEqual(sum(device["chosen"] for device in info["devices"]), 1)

    def test_table(self):
        self.assertIn("ray query", self.run_ok("info").stdout)


class Check(CliTest):
    def setUp(self):
        super().setUp()
        write_glb(self.folder / "room.glb", emission=(1.0, 1.0, 1.0))

    def test_a_closed_room(self):
        report = self.run_json("check", "room.glb")
        self.assertEqual(report["triangles"], 12)
        self.assertEqual(report["mesh"]["boundary_edges"], 0)
        self.assertTrue(report["mesh"]["closed"])
        self.assertEqual(report["features"]["emission"], True)
        self.assertEqual(report["features"]["textures"], False)
        self.assertEqual([camera["name"] for camera in report["cameras"]], ["eye"])
        self.assertEqual(len(report["states"]), 1)
        # Geometry of 4 x 3 x 4 m, grown by 1 % of its diagonal sqrt(41) m.
        margin = 0.01 * 41 ** 0.5
        for axis, (low, high) in enumerate(((-2, 2), (0, 3), (-2, 2))):
            self.assertAlmostEqual(report["bounds"]["min"][axis], low - margin, delta=1e-5)
            self.assertAlmostEqual(report["bounds"]["max"][axis], high + margin, delta=1e-5)
        reachable = [region for region in report["regions"] if region["reachable"]]
        self.assertEqual(len(reachable), 1)
        self.assertEqual(reachable[0]["cameras"], ["eye"])

    def test_a_missing_wall_is_a_warning(self):
        write_glb(self.folder / "open.glb", triangles=ROOM_TRIANGLES[2:])
        report = self.run_json("check", "open.glb")
        self.assertEqual(report["mesh"]["boundary_edges"], 4)
        self.assertTrue(any("open" in warning for warning in report["warnings"]))

    def test_an_unlit_scene_is_a_warning(self):
        write_glb(self.folder / "dark.glb")
        warnings = self.run_json("check", "dark.glb")["warnings"]
        self.assertTrue(any("probelab init" in warning for warning in warnings))

    def test_table(self):
        text = self.run_ok("check", "room.glb").stdout
        for word in ("triangles", "suggested volume", "thinnest wall", "Free space"):
            self.assertIn(word, text)

    def test_every_shipped_scene(self):
        for scene in sorted((SOURCE / "scenes").glob("*/scene*.toml")):
            if "_turned_" in scene.name:  # the same mesh
                continue
            with self.subTest(scene=scene.parent.name + "/" + scene.name):
                report = self.run_json("check", scene)
                self.assertEqual(report["mesh"]["degenerate_triangles"], 0)


class Init(CliTest):
    def setUp(self):
        super().setUp()
        write_glb(self.folder / "room.glb", camera=None)

    def test_writes_a_scene_that_loads_and_is_lit(self):
        result = self.run_ok("init", "room.glb", "-o", "scene.toml")
        self.assertIn("probelab check scene.toml", result.stdout)
        report = self.run_json("check", "scene.toml")
        self.assertEqual(len(report["cameras"]), 1)
        position = report["cameras"][0]["position"]
        self.assertTrue(all(low < p < high for low, p, high in
                            zip((-2, 0, -2), position, (2, 3, 2))), position)
        self.assertTrue(report["lights"])
        self.assertFalse(any("nothing emits" in warning for warning in report["warnings"]))
        self.assertEqual(self.files(), ["room.glb", "scene.toml"])

    def test_a_camera_is_not_put_into_a_block_in_the_middle(self):
        # A solid block of 2 x 2 x 2 m around eye level, its faces outward.
        block = [(x, y, z) for x in (-1, 1) for y in (0.2, 2.2) for z in (-1, 1)]
        first = len(ROOM_CORNERS)
        outward = [tuple(first + i for i in reversed(t)) for t in ROOM_TRIANGLES]
        write_glb(self.folder / "block.glb", positions=ROOM_CORNERS + block,
                  triangles=ROOM_TRIANGLES + outward, camera=None)
        self.run_ok("init", "block.glb", "-o", "scene.toml")
        report = self.run_json("check", "scene.toml")
        x, y, z = report["cameras"][0]["position"]
        self.assertFalse(abs(x) <= 1 and 0.2 <= y <= 2.2 and abs(z) <= 1, (x, y, z))
        self.assertTrue(abs(x) < 2 and 0 < y < 3 and abs(z) < 2, (x, y, z))
        region, = [r for r in report["regions"] if r["reachable"]]
        self.assertEqual(region["cameras"], [report["cameras"][0]["name"]])

    def test_a_house_gets_its_camera_in_the_hall_and_not_in_a_closet(self):
        # mixed_scale has a sealed closet, and a hall that is open to the outside.
        self.run_ok("init", SOURCE / "scenes/mixed_scale/mixed_scale.gltf", "-o", "scene.toml")
        regions = self.run_json("check", "scene.toml")["regions"]
        largest = max(regions, key=lambda region: region["cells"])
        self.assertEqual(len(largest["cameras"]), 1)

    def test_does_not_overwrite(self):
        (self.folder / "scene.toml").write_text("mine")
        self.assert_refused("init", "room.glb", "-o", "scene.toml", words=("scene.toml", "--force"))
        self.assertEqual((self.folder / "scene.toml").read_text(), "mine")
        self.run_ok("init", "room.glb", "-o", "scene.toml", "--force")
        self.assertIn("gltf", (self.folder / "scene.toml").read_text())

    def test_same_input_same_bytes(self):
        self.run_ok("init", "room.glb", "-o", "a.toml")
        self.run_ok("init", "room.glb", "-o", "b.toml", "--threads", 1)
        self.assertEqual((self.folder / "a.toml").read_text(), (self.folder / "b.toml").read_text())


class Reference(CliTest):
    def setUp(self):
        super().setUp()
        write_glb(self.folder / "room.glb", emission=(1.0, 0.5, 0.25))

    def test_layers_attributes_and_picture(self):
        result = self.run_json("reference", "room.glb", "-o", "r.exr", "--spp", 8,
                               "--width", 24, "--height", 16)
        self.assertEqual((result["width"], result["height"], result["samples"]), (24, 16, 8))
        channels, attributes = read_exr_header(self.folder / "r.exr")
        for channel in ("R", "direct.R", "irradiance.G", "albedo.B", "normal.X", "depth.Z",
                        "variance.R"):
            self.assertIn(channel, channels)
        for name in ("version", "scene_hash", "seed", "samples", "command", "seconds", "compiler"):
            self.assertIn("probelab:" + name, attributes)
        self.assertIn("--spp 8", attributes["probelab:command"])
        self.assertEqual(self.files(), ["r.exr", "r.png", "room.glb"])

    def test_the_same_seed_gives_the_same_image_on_any_threads(self):
        for name, options in (("a", ("--threads", 1)), ("b", ("--threads", 2)),
                              ("c", ("--seed", 2))):
            self.run_ok("reference", "room.glb", "-o", f"{name}.exr", "--spp", 8,
                        "--width", 24, "--height", 16, *options)
        # Layer by layer: against the main one, compare rounds the mean of the halves differently.
        for layer in ("half_a", "half_b", "irradiance", "variance"):
            same = self.run_json("compare", "a.exr", "b.exr", "--layer", layer)["error"]
            self.assertEqual((same["rmse"], same["relmse"]), (0, 0), layer)
        self.assertGreater(self.run_json("compare", "a.exr", "c.exr")["error"]["rmse"], 0)

    def test_compare_uses_the_halves_of_a_reference(self):
        self.run_ok("reference", "room.glb", "-o", "r.exr", "--spp", 8, "--width", 24,
                    "--height", 16)
        self.assertIsNotNone(self.run_json("compare", "r.exr", "r.exr")["error"]["nrmse"])


class ReceiverFiles(CliTest):
    def setUp(self):
        super().setUp()
        write_glb(self.folder / "room.glb", emission=(1.0, 0.5, 0.25))

    def test_file_and_summary(self):
        result = self.run_json("receivers", "room.glb", "-o", "r.json", "--count", 64, *QUICK,
                               "--cache", "cache")
        self.assertEqual(result["receivers"], 64)
        self.assertEqual(result["train"] + result["heldout"], 64)
        self.assertEqual(result["from_cache"], False)
        receivers = json.loads((self.folder / "r.json").read_text())["receivers"]
        self.assertEqual(len(receivers), 64)
        for name in ("position", "normal", "view", "area", "kind", "region", "split", "a", "b"):
            self.assertIn(name, receivers[0])
        weights = {"surface": 0.0, "volume": 0.0}
        for receiver in receivers:
            weights[receiver["kind"]] += receiver["area"]
        self.assertAlmostEqual(weights["surface"], 0.7, delta=1e-5)
        self.assertAlmostEqual(weights["volume"], 0.3, delta=1e-5)

    def test_truth_comes_from_the_cache_the_second_time(self):
        arguments = ("receivers", "room.glb", "--count", 32, *QUICK, "--cache", "cache")
        self.run_ok(*arguments, "-o", "a.json")
        again = self.run_json(*arguments, "-o", "b.json")
        self.assertEqual(again["from_cache"], True)
        self.assertEqual((self.folder / "a.json").read_bytes(),
                         (self.folder / "b.json").read_bytes())
        other_seed = self.run_json(*arguments, "-o", "c.json", "--seed", 2)
        self.assertEqual(other_seed["from_cache"], False)
        write_glb(self.folder / "room.glb", emission=(0.5, 0.5, 0.5))
        self.assertEqual(self.run_json(*arguments, "-o", "d.json")["from_cache"], False)

    def test_a_damaged_cache_entry_is_computed_again(self):
        arguments = ("receivers", "room.glb", "--count", 32, *QUICK, "--cache", "cache")
        self.run_ok(*arguments, "-o", "a.json")
        entry, = (self.folder / "cache").iterdir()
        entry.write_bytes(entry.read_bytes()[:100])
        self.assertEqual(self.run_json(*arguments, "-o", "b.json")["from_cache"], False)
        points = [json.loads((self.folder / name).read_text())["receivers"]
                  for name in ("a.json", "b.json")]
        self.assertEqual(points[0], points[1])

    def test_given_points(self):
        (self.folder / "points.csv").write_text(
            "x,y,z,nx,ny,nz\n0,1.5,0,0,1,0\n# a comment\n1,1,1,0,0,-2\n")
        result = self.run_json("receivers", "room.glb", "-o", "r.json", "--points", "points.csv",
                               *QUICK, "--cache", "cache")
        self.assertEqual((result["receivers"], result["points"], result["heldout"]), (2, 2, 2))
        first, second = json.loads((self.folder / "r.json").read_text())["receivers"]
        self.assertEqual(first["position"], [0, 1.5, 0])
        self.assertEqual(second["normal"], [0, 0, -1])
        self.assertEqual(second["view"], [0, 0, 1])

    def test_nothing_is_written_outside_output_and_cache(self):
        self.run_ok("receivers", "room.glb", "-o", "r.json", "--count", 16, *QUICK,
                    "--cache", "deep/cache")
        written = [name for name in self.files() if not name.startswith("deep")]
        self.assertEqual(written, ["r.json", "room.glb"])


if __name__ == "__main__":
    unittest.main()
