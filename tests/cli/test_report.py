# SPDX-License-Identifier: GPL-3.0-or-later
"""`probelab report`: what the HTML file holds, that names cannot break it, errors, equal bytes."""
import base64
import html.parser
import json
import struct
import unittest

from support import ROOM_CORNERS, ROOM_TRIANGLES, CliTest, write_exr, write_glb

HOSTILE = "</script><script>alert(1)</script>&<!--\u2028"


class PageParser(html.parser.HTMLParser):
    """The scripts of a page by id, its title, and every address in an attribute."""

    def __init__(self, text):
        super().__init__()
        self.scripts, self.addresses, self.tags, self.title = {}, [], [], ""
        self._id, self._in_title = None, False
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.tags.append(tag)
        self._in_title = tag == "title"
        if tag == "script":
            self._id = attributes.get("id", "code")
            self.scripts[self._id] = ""
        self.addresses += [attributes[name] for name in ("src", "href") if name in attributes]

    def handle_endtag(self, tag):
        self._in_title = False
        if tag == "script":
            self._id = None

    def handle_data(self, data):
        if self._id:
            self.scripts[self._id] += data
        if self._in_title:
            self.title += data


def write_cell(folder, name, axes, **members):
    folder.mkdir(parents=True, exist_ok=True)
    cell = {"error": {"nrmse": 0.25, "resolved": {"nrmse": True}}, "speed": {"frame_ms": 2.0},
            "seed": 1, "params": {"rays": 64}, "lattice": [1, 2, 3],
            "provenance": {"version": "1.2.3", "device": "a", "driver": "d", "command": "probelab x"},
            "cell": {"id": name, "axes": axes, "seconds": 3.5}}
    cell.update(members)
    (folder / f"{name}.json").write_text(json.dumps(cell))


class ReportTest(CliTest):
    def page(self, *arguments, output="page.html"):
        self.run_ok("report", *arguments, "-o", output, "--quiet")
        page = PageParser((self.folder / output).read_text())
        return page, json.loads(page.scripts["report-data"])

    def blob(self, page, index):
        return base64.b64decode(page.scripts[f"blob-{index}"], validate=True)


class Studies(ReportTest):
    def test_rows_hold_axes_and_numbers_in_the_order_of_the_columns(self):
        write_cell(self.folder / "s" / "cells", "b", {"probes": "64", "layout": "grid"})
        write_cell(self.folder / "s" / "cells", "a", {"probes": "128", "layout": "poisson"},
                   error={"nrmse": 0.125, "p95": 0.75})
        _, data = self.page("s")
        self.assertEqual([study["name"] for study in data["studies"]], ["s"])
        study = data["studies"][0]
        names = [column["name"] for column in study["columns"]]
        self.assertEqual(names[:5], ["probes", "layout", "error.nrmse", "speed.frame_ms", "seconds"])
        self.assertEqual(sorted(names[5:]), ["error.p95", "error.resolved.nrmse"])
        rows = {row["id"]: dict(zip(names, row["values"])) for row in study["rows"]}
        self.assertEqual(rows["a"], {
            "probes": "128", "layout": "poisson", "error.nrmse": 0.125, "speed.frame_ms": 2.0,
            "seconds": 3.5, "error.p95": 0.75, "error.resolved.nrmse": None})
        self.assertIs(rows["b"]["error.resolved.nrmse"], True)
        units = {column["name"]: column["unit"] for column in study["columns"]}
        self.assertEqual((units["error.nrmse"], units["speed.frame_ms"]), ("1", "ms"))

    def test_provenance_counts_where_cells_differ(self):
        for name, device in (("a", "one"), ("b", "two"), ("c", "two")):
            write_cell(self.folder / "cells", name, {}, provenance={"version": "9", "device": device})
        _, data = self.page(".")
        self.assertEqual(data["studies"][0]["provenance"], [
            ["version", "9"], ["device", "one (1 of 3 cells)"], ["device", "two (2 of 3 cells)"]])

    def test_cells_of_two_versions_are_told_apart(self):
        for name, version in (("a", "1"), ("b", "2")):
            write_cell(self.folder / "cells", name, {"probes": "8"},
                       provenance={"version": version, "device": "one"})
        _, data = self.page(".")
        study, = data["studies"]
        self.assertEqual([c["name"] for c in study["columns"] if c["kind"] == "axis"],
                         ["probes", "version"])
        self.assertEqual([r["values"][:2] for r in study["rows"]], [["8", "1"], ["8", "2"]])

    def test_entries_of_lists_go_by_their_names(self):
        write_cell(self.folder / "cells", "a", {}, rungs=[{"name": "exact", "nrmse": 0.5},
                                                          {"name": "field", "nrmse": 0.75}],
                   scores=[{"scene": "room", "state": s, "settings": [
                       {"setting": "tuned", "heldout": {"nrmse": 0.1}, "blocks": {"0,0,0": 3}}]}
                       for s in ("day", "night")], rounds=[{"cost": 1}], twice=[{"name": "x", "y": 1}] * 2)
        _, data = self.page(".")
        study, = data["studies"]
        names = [column["name"] for column in study["columns"]]
        row = dict(zip(names, study["rows"][0]["values"]))
        self.assertEqual((row["rungs.exact.nrmse"], row["rungs.field.nrmse"]), (0.5, 0.75))
        self.assertEqual(row["scores.room.night.settings.tuned.heldout.nrmse"], 0.1)
        self.assertFalse([n for n in names if "blocks" in n or n.startswith(("rounds", "twice"))])

    def test_failures_are_damaged_cells_and_logs_without_a_cell(self):
        write_cell(self.folder / "cells", "fine", {})
        (self.folder / "cells" / "half.json").write_text('{"error": {"nrm')
        (self.folder / "logs").mkdir()
        (self.folder / "logs" / "fine.txt").write_text("ok\n")
        (self.folder / "logs" / "gone.txt").write_text("one\nprobelab: no light\n\n")
        _, data = self.page(".")
        failures = {f["id"]: f["error"] for f in data["studies"][0]["failures"]}
        self.assertEqual(set(failures), {"half", "gone"})
        self.assertIn("probelab: no light", failures["gone"])
        self.assertIn("half.json", failures["half"])
        self.assertEqual(len(data["studies"][0]["rows"]), 1)

    def test_a_folder_of_studies(self):
        for name in ("two", "one"):
            write_cell(self.folder / "all" / name / "cells", "a", {})
        (self.folder / "all" / "cache").mkdir()
        result = self.run_json("report", "all")
        self.assertEqual((result["studies"], result["rows"]), (2, 2))
        _, data = self.page("all")
        self.assertEqual([study["name"] for study in data["studies"]], ["one", "two"])
        self.assertTrue((self.folder / "all" / "report.html").exists())


class Safety(ReportTest):
    def test_names_stay_text(self):
        write_cell(self.folder / "cells", "a", {HOSTILE: HOSTILE})
        (self.folder / "figures").mkdir()
        (self.folder / "figures" / "f.svg").write_text("<svg xmlns='http://www.w3.org/2000/svg'/>")
        (self.folder / "figures" / "f.txt").write_text(HOSTILE)
        page, data = self.page(".")
        self.assertEqual(data["studies"][0]["rows"][0]["values"][0], HOSTILE)
        self.assertEqual(data["figures"][0]["caption"], HOSTILE)
        self.assertEqual(sorted(page.scripts), ["blob-0", "code", "report-data"])
        self.assertEqual(page.tags.count("script"), 3)
        for mark in "<>&\u2028":
            self.assertNotIn(mark, page.scripts["report-data"])

    def test_the_title_is_escaped(self):
        name = "<b>&\"'"
        write_cell(self.folder / name / "cells", "a", {})
        page, data = self.page(name)
        self.assertEqual((page.title, data["title"]), (name, name))
        self.assertNotIn("b", page.tags)

    def test_bytes_that_are_not_text_are_replaced(self):
        (self.folder / "figures").mkdir()
        (self.folder / "figures" / "f.svg").write_text("<svg/>")
        (self.folder / "figures" / "f.txt").write_bytes(b"a\xffb")
        _, data = self.page(".")
        self.assertEqual(data["figures"][0]["caption"], "a\ufffdb")

    def test_nothing_is_loaded(self):
        write_cell(self.folder / "cells", "a", {})
        page, _ = self.page(".")
        self.assertEqual([a for a in page.addresses if not a.startswith("data:")], [])
        text = (self.folder / "page.html").read_text()
        self.assertIn("default-src 'none'", text)
        self.assertNotRegex(text, r"https?://")

    def test_the_same_inputs_give_the_same_bytes(self):
        write_cell(self.folder / "cells", "a", {"x": "1"})
        (self.folder / "images").mkdir()
        write_exr(self.folder / "images" / "a.exr", [[(0.1, 0.2, 0.3)]])
        write_glb(self.folder / "room.glb")
        self.run_ok("place", "room.glb", "--probes", "8", "-o", "l.json")
        extra = ("--layout", "l.json", "--scene", "room.glb")
        self.page(".", *extra, output="one.html")
        self.page(".", *extra, "--threads", "1", output="two.html")
        one, two = ((self.folder / f"{name}.html").read_bytes() for name in ("one", "two"))
        self.assertEqual(one, two)


class Images(ReportTest):
    def setUp(self):
        super().setUp()
        (self.folder / "images").mkdir()
        self.pixels = [[(0.5, 1.0, -2.0), (65504.0, 2.0 ** -24, 0.1)]]
        write_exr(self.folder / "images" / "a.exr", self.pixels)
        write_exr(self.folder / "images" / "reference.exr", self.pixels)

    def test_half_floats_are_the_nearest(self):
        page, data = self.page(".")
        images = data["image_sets"][0]
        self.assertEqual((images["width"], images["height"], images["precision"]), (2, 1, "half"))
        values = struct.unpack("<6e", self.blob(page, images["images"][0]["blob"]))
        # Python's own rounding to half precision.
        wanted = [struct.unpack("<e", struct.pack("<e", v))[0] for p in self.pixels[0] for v in p]
        self.assertEqual(list(values), wanted)

    def test_floats_are_exact(self):
        page, data = self.page(".", "--precision", "float")
        blob = self.blob(page, data["image_sets"][0]["images"][0]["blob"])
        self.assertEqual(blob, struct.pack("<6f", *self.pixels[0][0], *self.pixels[0][1]))

    def test_the_reference(self):
        _, data = self.page(".")
        self.assertEqual(data["image_sets"][0]["reference"], 1)
        _, data = self.page(".", "--reference", "a")
        self.assertEqual(data["image_sets"][0]["reference"], 0)
        _, data = self.page(".", "--image", "b=images/a.exr", "--reference", "b")
        names = [image["name"] for image in data["image_sets"][0]["images"]]
        self.assertEqual(names[data["image_sets"][0]["reference"]], "b")
        self.assert_refused("report", ".", "--reference", "referenec",
                            words=("--reference referenec", "did you mean 'reference'?"))

    def test_folders_of_images_are_sets_of_their_own(self):
        (self.folder / "images" / "other").mkdir()
        write_exr(self.folder / "images" / "other" / "x.exr", [[(1.0, 1.0, 1.0)]])
        _, data = self.page(".")
        self.assertEqual([(s["name"], s["width"], len(s["images"])) for s in data["image_sets"]],
                         [("images", 2, 2), ("other", 1, 1)])

    def test_pixels_that_are_not_finite_are_kept_and_counted(self):
        write_exr(self.folder / "images" / "a.exr",
                  [[(float("nan"), 0.0, 0.0), (float("inf"), float("-inf"), 1.0)]])
        page, data = self.page(".")
        self.assertEqual(data["image_sets"][0]["images"][0]["not_finite"], 2)
        values = struct.unpack("<6e", self.blob(page, 0))
        self.assertEqual(str(values), "(nan, 0.0, 0.0, inf, -inf, 1.0)")

    def test_refusals(self):
        for arguments, words in (
                (("--image", "x"), ("--image x", "NAME=FILE.exr")),
                (("--image", "x=missing.exr"), ("missing.exr",)),
                (("--image", "a=images/a.exr"), ("images/a.exr", "'a'")),
                (("--layer", "depth"), ("images/a.exr", "depth"))):
            with self.subTest(arguments=arguments):
                self.assert_refused("report", ".", *arguments, words=words)
        write_exr(self.folder / "wide.exr", [[(0.0, 0.0, 0.0)] * 3])
        self.assert_refused("report", ".", "--image", "w=wide.exr",
                            words=("a.exr: is 2 x 1", "wide.exr is 3 x 1"))
        write_exr(self.folder / "bright.exr", [[(7e4, 0.0, 0.0)] * 2])
        self.assert_refused("report", ".", "--image", "b=bright.exr",
                            words=("bright.exr", "--precision float"))
        self.page(".", "--image", "b=bright.exr", "--precision", "float")

    def test_a_page_that_is_too_large_is_refused(self):
        write_exr(self.folder / "images" / "a.exr", [[(0.0, 0.0, 0.0)] * 200] * 100)
        (self.folder / "images" / "reference.exr").unlink()
        # 20,000 pixels of 6 bytes in base64: 160,000 bytes, 156.25 KiB.
        self.assert_refused("report", ".", "--max-mib", "0.15",
                            words=("images/a.exr", "156.2 KiB", "153.6 KiB", "--max-mib"))
        self.page(".", "--max-mib", "0.16")


class Layouts(ReportTest):
    def setUp(self):
        super().setUp()
        write_glb(self.folder / "room.glb", base_color=(1.0, 0.0, 0.0, 1.0))
        self.run_ok("place", "room.glb", "--probes", "64", "-o", "l.json")
        self.view = ("--layout", "l.json", "--scene", "room.glb")

    def floats(self, page, index):
        blob = self.blob(page, index)
        return struct.unpack(f"<{len(blob) // 4}f", blob)

    def test_triangles_and_probes(self):
        page, data = self.page(".", *self.view)
        triangles, probes = data["layout"]["triangles"], data["layout"]["probes"]
        self.assertEqual((triangles["shown"], triangles["all"], triangles["one_sided"]),
                         (12, 12, 12))
        positions = self.floats(page, triangles["positions"])
        self.assertEqual(len(positions), 12 * 9)
        # The box of 4 x 3 x 4 m about its centre.
        for axis, half in enumerate((2.0, 1.5, 2.0)):
            self.assertEqual((min(positions[axis::3]), max(positions[axis::3])), (-half, half))
        self.assertEqual(data["layout"]["origin"], [0.0, 1.5, 0.0])
        self.assertEqual(self.blob(page, triangles["colors"]), b"\xff\0\0" * 12)
        stored = json.loads((self.folder / "l.json").read_text())["probes"]
        self.assertEqual(probes["count"], len(stored))
        found = self.floats(page, probes["positions"])
        for i, probe in enumerate(stored):
            for axis in range(3):
                self.assertAlmostEqual(found[3 * i + axis] + data["layout"]["origin"][axis],
                                       probe["position"][axis], places=5)
        self.assertEqual(sum(probes["counts"]), len(stored))
        self.assertEqual(len(self.blob(page, probes["states"])), len(stored))

    def test_of_too_many_triangles_the_largest_are_shown(self):
        # A cloth of 1 m x 1 m, its cells cut along both diagonals; the room's own triangles come
        # last, and must not be left out.
        side = 225
        cloth = [(x / side, 1.0, z / side) for z in range(side) for x in range(side)]
        cells = [8 + x + side * z for z in range(side - 1) for x in range(side - 1)]
        right, below, across = 1, side, side + 1
        write_glb(self.folder / "room.glb", ROOM_CORNERS + cloth,
                  [t for i in cells for t in ((i, i + below, i + right),
                                              (i + right, i + below, i + across),
                                              (i, i + below, i + across),
                                              (i, i + across, i + right))] + ROOM_TRIANGLES)
        self.run_ok("place", "room.glb", "--probes", "8", "-o", "l.json")
        page, data = self.page(".", *self.view)
        triangles = data["layout"]["triangles"]
        self.assertEqual((triangles["shown"], triangles["all"]), (200_000, 4 * 224 * 224 + 12))
        last = self.floats(page, triangles["positions"])[-9 * 12:]
        self.assertEqual((min(last[::3]), max(last[::3])), (-2.0, 2.0))
        self.assertGreater(min(max(map(abs, last[9 * i:9 * i + 9])) for i in range(12)), 1.0)
        note = self.run_ok("report", ".", *self.view).stderr
        self.assertIn("200000 largest of 200716", note)

    def test_values_from_a_file(self):
        (self.folder / "v.csv").write_text("probe,error,x\n1,0.5,9\n0,-2,9\n")
        page, data = self.page(".", *self.view, "--probe-values", "v.csv")
        value = data["layout"]["probes"]["values"][-1]
        self.assertEqual(value["name"], "error")
        self.assertEqual(self.floats(page, value["blob"])[:2], (-2.0, 0.5))
        self.assertEqual(str(self.floats(page, value["blob"])[2]), "nan")

    def test_refusals(self):
        for text, words in (("", ("v.csv", "is empty")), ("a,b\n", ("line 1", "'probe'")),
                            ("probe,a\n0\n", ("line 2", "1 columns")),
                            ("probe,a\n0,1\n99,1\n", ("line 3", "no probe 99")),
                            ("probe,a\n0,much\n", ("line 2", "'much'"))):
            with self.subTest(text=text):
                (self.folder / "v.csv").write_text(text)
                self.assert_refused("report", ".", *self.view, "--probe-values", "v.csv",
                                    words=words)
        self.assert_refused("report", ".", "--layout", "l.json", words=("--scene",))
        self.assert_refused("report", ".", "--probe-values", "v.csv", words=("--layout",))
        self.assert_refused("report", ".", *self.view, "--params", "probelab",
                            words=("--params probelab", "neither moves"))

    def test_states(self):
        """In the room's air, behind its wall of single faces, in a solid cube of 1 m."""
        cube = [(x - 0.5, y + 0.5, z - 0.5) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
        outward = [(a + 8, c + 8, b + 8) for a, b, c in ROOM_TRIANGLES]
        write_glb(self.folder / "room.glb", ROOM_CORNERS + cube, ROOM_TRIANGLES + outward)
        (self.folder / "p.csv").write_text("x,y,z\n-1.5,2.5,1.5\n1.5,1.5,0\n0,2.5,0\n")
        self.run_ok("place", "room.glb", "--strategy", "file", "--option", "path=p.csv",
                    "--option", "visibility=off", "-o", "l.json")
        layout = json.loads((self.folder / "l.json").read_text())
        layout["probes"][1]["position"] = [2.3, 1.5, 0.0]  # no strategy would put them there
        layout["probes"][2]["position"] = [0.0, 1.0, 0.0]
        (self.folder / "l.json").write_text(json.dumps(layout))
        page, data = self.page(".", *self.view)
        self.assertEqual(self.blob(page, data["layout"]["probes"]["states"]), bytes([0, 0, 2]))
        self.assertIsNone(data["layout"]["probes"]["params"])
        (self.folder / "p.toml").write_text('preset = "majercik2021"\nrelocation = false\n')
        page, data = self.page(".", *self.view, "--params", "p.toml")
        self.assertEqual(self.blob(page, data["layout"]["probes"]["states"]), bytes([0, 1, 2]))
        self.assertEqual(data["layout"]["probes"]["counts"], [1, 1, 1])
        self.assertEqual(data["layout"]["probes"]["moved"], 0)
        # Relocation takes the second one back through the wall.
        page, data = self.page(".", *self.view, "--params", "majercik2021")
        probes = data["layout"]["probes"]
        self.assertEqual((probes["params"], self.blob(page, probes["states"])[1]),
                         ("majercik2021", 0))
        self.assertGreaterEqual(probes["moved"], 1)
        self.assertLess(self.floats(page, probes["positions"])[3], 2.0)


class Errors(ReportTest):
    def test_refusals(self):
        self.assert_refused("report", "missing", words=("missing", "no folder", "probelab run"))
        (self.folder / "empty").mkdir()
        self.assert_refused("report", "empty", words=("empty", "no study", "--image"))
        write_cell(self.folder / "cells", "a", {})
        self.assert_refused("report", ".", "-o", "page.txt", words=("page.txt", ".html"))
        self.assert_refused("report", ".", "-o", "no/page.html", words=("no/page.html",))
        self.assert_refused("report", ".", "--max-mib", "0", words=("--max-mib",))
        (self.folder / "figures").mkdir()
        (self.folder / "figures" / "f.png").write_text("no picture")
        result = self.run_ok("report", ".")
        self.assertIn("f.png: left out, it is no PNG", result.stderr)
        self.assertTrue((self.folder / "report.html").exists())
        (self.folder / "figures" / "f.png").unlink()
        self.assert_refused("report", ".", "--layer", "x", words=("--layer", "no images"))


if __name__ == "__main__":
    unittest.main()
