# SPDX-License-Identifier: GPL-3.0-or-later
"""The report's page in a real browser: it loads without a message on the console, and every control
changes what is shown. Needs chromium, chromium-driver and python3-selenium; skipped without them."""
import json
import pathlib
import shutil
import struct
import sys
import tempfile
import unittest
import zlib

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "cli"))
from support import PROGRAM, write_exr, write_glb  # noqa: E402
import subprocess  # noqa: E402

try:
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys
    from selenium.webdriver.support.ui import Select
except ImportError:
    webdriver = None

CHROMIUM = shutil.which("chromium")
DRIVER = shutil.which("chromedriver")
HOSTILE = "</script><img src=x onerror=\"window.hacked=1\">"
FLAGS = ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--use-gl=angle",
         "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--window-size=1366,768")

# (probes, layout, nrmse, bias); one number is missing.
ROWS = [("64", "grid", 0.4, -0.1), ("64", "poisson", 0.05, 0.2), ("256", "grid", 0.09, None),
        ("1024", HOSTILE, 0.2, 0.3)]


def write_cell(folder, name, probes, layout, nrmse, bias):
    error = {"nrmse": nrmse, "smape": 2 * nrmse, "bias": bias, "light_leak": 0.001,
             "shadow_leak": 0.25, "resolved": {"nrmse": nrmse > 0.08}}
    cell = {"error": error, "speed": {"frame_ms": 12.5, "update_ms": 2.5},
            "probes": {"stored": 60}, "memory_bytes": 4096, "seed": 1,
            "provenance": {"version": "1.2.3", "device": "some device", "driver": "some driver",
                           "command": f"probelab evaluate --probes {probes}"},
            "cell": {"id": name, "axes": {"probes": probes, "layout": layout}, "seconds": 1.5}}
    (folder / f"{name}.json").write_text(json.dumps(cell))


def write_png(path, width, height):
    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))
    rows = b"".join(b"\0" + b"\x20\x60\xa0" * width for _ in range(height))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" +
                     chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)) +
                     chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


def write_inputs(folder):
    """A study of four cells and one that failed, a figure, three images of 8 x 4, a layout."""
    for name in ("cells", "logs", "figures", "images"):
        (folder / name).mkdir()
    for i, row in enumerate(ROWS):
        write_cell(folder / "cells", f"cell{i}", *row)
    (folder / "logs" / "cell9.txt").write_text("working\nprobelab: it broke\n")
    write_png(folder / "figures" / "error.png", 20, 10)
    (folder / "figures" / "error.txt").write_text("Error against N, 3 seeds.\n")
    left, right = (0.25,) * 3, (0.5,) * 3
    reference = [[left] * 4 + [right] * 4 for _ in range(4)]
    write_exr(folder / "images" / "reference.exr", reference)
    write_exr(folder / "images" / "brighter.exr",
              [[tuple(v + 0.25 for v in p) for p in row] for row in reference])
    write_exr(folder / "images" / "darker.exr",
              [[tuple(v - 0.25 for v in p) for p in row] for row in reference])
    write_glb(folder / "room.glb")
    for arguments in (["place", "room.glb", "--probes", "27", "-o", "layout.json", "--quiet"],
                      ["report", ".", "--layout", "layout.json", "--scene", "room.glb", "--quiet"]):
        subprocess.run([PROGRAM, *arguments], cwd=folder, check=True, capture_output=True,
                       timeout=120)


@unittest.skipUnless(webdriver and CHROMIUM and DRIVER,
                     "needs chromium, chromium-driver and python3-selenium")
class PageTest(unittest.TestCase):
    """The page, opened from disk, in a browser of its own."""

    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        write_inputs(cls.folder)
        options = webdriver.ChromeOptions()
        for flag in FLAGS:
            options.add_argument(flag)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        options.binary_location = CHROMIUM
        cls.browser = webdriver.Chrome(service=Service(DRIVER), options=options)
        cls.addClassCleanup(cls.browser.quit)

    def setUp(self):
        self.browser.get((self.folder / "report.html").as_uri())

    def tearDown(self):
        self.assertEqual(self.browser.get_log("browser"), [], "something is on the console")

    def find(self, selector):
        return self.browser.find_element(By.CSS_SELECTOR, selector)

    def find_all(self, selector):
        return self.browser.find_elements(By.CSS_SELECTOR, selector)

    def run_script(self, script, *arguments):
        return self.browser.execute_script(script, *arguments)

    def press(self, label):
        self.browser.find_element(By.XPATH, f"//button[normalize-space()='{label}']").click()

    def slide(self, selector, value):
        """Moves a slider or fills a number as a user's input does."""
        self.run_script("arguments[0].value = arguments[1];"
                        "arguments[0].dispatchEvent(new Event('input', {bubbles: true}));",
                        self.find(selector), value)


class Loading(PageTest):
    def test_all_parts_are_there_and_nothing_is_loaded(self):
        titles = [node.text for node in self.find_all("h2")]
        self.assertEqual(titles, ["Studies", "Figures", "Images", "Layout"])
        self.assertEqual(self.find_all(".notice:not(.failures)"), [])
        names = self.run_script("return performance.getEntriesByType('resource').map(e => e.name)")
        self.assertEqual([name for name in names if not name.startswith("data:")], [])

    def test_hostile_names_stay_text(self):
        self.assertIsNone(self.run_script("return window.hacked ?? null"))
        cells = [cell.text for cell in self.find_all("tbody td")]
        self.assertIn(HOSTILE, cells)

    def test_the_page_fits_a_laptop(self):
        width, window = self.run_script(
            "return [document.documentElement.scrollWidth, window.innerWidth]")
        self.assertLessEqual(width, window)

    def test_both_themes(self):
        colors = []
        for theme in ("light", "dark"):
            self.browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {
                "features": [{"name": "prefers-color-scheme", "value": theme}]})
            colors.append([self.run_script(
                f"return getComputedStyle(document.body).{name}.match(/[0-9]+/g).map(Number)")[0]
                for name in ("backgroundColor", "color")])
        (light, light_ink), (dark, dark_ink) = colors
        self.assertGreater(light - light_ink, 150)
        self.assertGreater(dark_ink - dark, 150)

    def test_controls_have_names(self):
        unnamed = self.run_script("""
          return [...document.querySelectorAll('button, input, select, canvas.view')].filter(
            (e) => !e.textContent.trim() && !e.getAttribute('aria-label') && !e.labels?.length &&
                   !e.querySelector('img[alt]')).map((e) => e.outerHTML);""")
        self.assertEqual(unnamed, [])


class Tables(PageTest):
    def ids(self):
        return [row.get_attribute("data-id") for row in self.find_all("tbody tr[data-id]")]

    def sort(self, column):
        self.find(f"button.sort[data-column='{column}']").click()

    def test_rows_come_by_axes_as_numbers(self):
        self.assertEqual(self.ids(), ["cell0", "cell1", "cell2", "cell3"])

    def test_headings_sort_up_and_down(self):
        self.sort("error.nrmse")
        self.assertEqual(self.ids(), ["cell1", "cell2", "cell3", "cell0"])
        self.assertEqual(self.find("th[aria-sort='ascending']").text.split()[0], "nrmse")
        self.sort("error.nrmse")
        self.assertEqual(self.ids(), ["cell0", "cell3", "cell2", "cell1"])

    def test_what_is_missing_comes_last_both_ways(self):
        self.sort("error.bias")
        self.assertEqual(self.ids(), ["cell0", "cell1", "cell3", "cell2"])
        self.sort("error.bias")
        self.assertEqual(self.ids(), ["cell3", "cell1", "cell0", "cell2"])

    def test_number_filters(self):
        field = self.find("input[data-filter='error.nrmse']")
        for text, wanted in (("< 0.1", ["cell1", "cell2"]), (">=0.2", ["cell0", "cell3"]),
                             ("0.06 .. 0.3", ["cell2", "cell3"]), ("0.4", ["cell0"])):
            field.clear()
            field.send_keys(text)
            self.assertEqual(self.ids(), wanted, text)
        self.assertEqual(self.find(".row-count").text, "1 of 4 rows")
        field.clear()
        field.send_keys("much")
        self.assertEqual(field.get_attribute("aria-invalid"), "true")
        self.assertEqual(len(self.ids()), 4)

    def test_axis_filter_search_and_reset(self):
        Select(self.find("select[data-filter='layout']")).select_by_visible_text("grid")
        self.assertEqual(self.ids(), ["cell0", "cell2"])
        search = self.find("input[type='search']")
        search.send_keys("256")
        self.assertEqual(self.ids(), ["cell2"])
        self.press("Reset")
        self.assertEqual(len(self.ids()), 4)
        search.send_keys("POISSON")
        self.assertEqual(self.ids(), ["cell1"])

    def test_other_columns_can_be_shown(self):
        before = len(self.find_all("thead tr:first-child th"))
        self.find("details.columns summary").click()
        boxes = self.find_all("details.columns input:not(:checked)")
        boxes[0].click()
        self.assertEqual(len(self.find_all("thead tr:first-child th")), before + 1)

    def test_a_row_shows_its_command(self):
        self.find("tr[data-id='cell2'] button").click()
        self.assertEqual(self.find(".study pre").text, "probelab evaluate --probes 256")
        self.find("tr[data-id='cell2'] button").click()
        self.assertEqual(self.find_all(".study pre"), [])

    def test_units_provenance_noise_and_failures(self):
        head = self.find(".study thead").text
        for text in ("nrmse [1]", "frame [ms]", "memory [bytes]"):
            self.assertIn(text, head)
        self.assertIn("some driver", self.find(".provenance").text)
        self.assertIn("it broke", self.find(".failures").text)
        self.assertEqual([cell.text for cell in self.find_all("td.unresolved")], ["0.05"])


class Figures(PageTest):
    def test_figure_caption_and_width(self):
        image = self.find("figure img")
        self.assertEqual(self.run_script("return arguments[0].naturalWidth", image), 20)
        self.assertIn("Error against N, 3 seeds.", self.find("figcaption").text)
        narrow = image.size["width"]
        self.find("figure button").click()
        self.assertGreater(image.size["width"], narrow)


class Images(PageTest):
    """Images in the order brighter, darker, reference; luminance 0.25 or 0.5 in the reference."""

    def setUp(self):
        super().setUp()
        self.slide("#exposure-0", 0)

    def color(self, x, y, canvas=0):
        """The colour at a share of the canvas."""
        return self.run_script("""
          const canvas = document.querySelectorAll('.comparer canvas.view')[arguments[2]];
          const copy = new OffscreenCanvas(1, 1).getContext('2d');
          copy.drawImage(canvas, -Math.floor(arguments[0] * canvas.width),
                         -Math.floor(arguments[1] * canvas.height));
          return [...copy.getImageData(0, 0, 1, 1).data].slice(0, 3);""", x, y, canvas)

    def assert_color(self, found, wanted, within=1):
        # One step of a byte for rounding, here and in the tables of colours.
        for a, b in zip(found, wanted):
            self.assertLessEqual(abs(a - b), within, f"{found} is not {wanted}")

    def hover(self, x, y):
        canvas = self.find(".comparer canvas.view")
        size = canvas.size
        ActionChains(self.browser).move_to_element_with_offset(
            canvas, (x - 0.5) * size["width"], (y - 0.5) * size["height"]).perform()

    def test_exposure_and_srgb(self):
        # The sRGB curve at 0.25, 0.5 and 1: 1.055 v^(1 / 2.4) - 0.055, in bytes.
        self.assert_color(self.color(0.2, 0.5), [137] * 3)
        self.assert_color(self.color(0.8, 0.5), [188] * 3)
        self.slide("#exposure-0", 1)
        self.assert_color(self.color(0.2, 0.5), [188] * 3)
        self.assert_color(self.color(0.8, 0.5), [255] * 3)

    def test_flip(self):
        self.press("brighter")
        self.assert_color(self.color(0.2, 0.5), [188] * 3)
        self.press("darker")
        self.assert_color(self.color(0.2, 0.5), [0] * 3)
        canvas = self.find(".comparer canvas.view")
        canvas.send_keys("3")  # the reference
        self.assert_color(self.color(0.2, 0.5), [137] * 3)
        canvas.send_keys(" ")  # the other one: brighter
        self.assert_color(self.color(0.2, 0.5), [188] * 3)

    def test_split_slider(self):
        self.press("Split")  # the reference on the left, brighter on the right
        self.assert_color(self.color(0.2, 0.5), [137] * 3)
        self.assert_color(self.color(0.8, 0.5), [224] * 3, within=1)  # 0.75
        self.slide("#split-0", 0.1)
        self.assert_color(self.color(0.2, 0.5), [188] * 3)
        self.slide("#split-0", 0.9)
        self.assert_color(self.color(0.8, 0.5), [188] * 3)

    def test_signed_error(self):
        self.press("Signed error")
        self.slide("#error-scale-0", 0.25)
        self.assert_color(self.color(0.2, 0.5), [255] * 3, within=2)  # the reference itself
        self.press("brighter")
        self.assert_color(self.color(0.2, 0.5), [103, 0, 31])
        self.press("darker")
        self.assert_color(self.color(0.8, 0.5), [5, 48, 97])
        self.slide("#error-scale-0", 0.5)
        self.assert_color(self.color(0.8, 0.5), [67, 147, 195], within=2)  # half way
        self.assertIn("0.5", self.find(".legendbox").text)

    def test_false_colour(self):
        self.press("False colour")
        self.slide("#false-most-0", 0.5)
        self.assert_color(self.color(0.8, 0.5), [253, 231, 37])
        self.assert_color(self.color(0.2, 0.5), [33, 144, 141], within=2)
        self.press("darker")
        self.assert_color(self.color(0.2, 0.5), [68, 1, 84])
        self.assertEqual(self.find(".legendbox").text.split(), ["0", "0.25", "0.5"])

    def test_zoom_is_linked_and_fits_again(self):
        self.press("Side by side")
        self.assertEqual(len(self.find_all(".comparer canvas.view")), 3)
        self.assert_color(self.color(0.05, 0.5, 2), [137] * 3)
        self.assert_color(self.color(0.9, 0.5, 2), [188] * 3)
        self.hover(0.05, 0.5)
        canvas = self.find(".comparer canvas.view")
        for _ in range(4):  # four times as large, about the cursor: the right half is gone
            canvas.send_keys("+")
        for pane, wanted in ((0, 188), (1, 0), (2, 137)):
            self.assert_color(self.color(0.9, 0.9, pane), [wanted] * 3)
        canvas.send_keys("0")
        self.assert_color(self.color(0.9, 0.9, 2), [188] * 3)

    def test_dragging_pans_and_the_wheel_zooms(self):
        canvas = self.find(".comparer canvas.view")
        self.assert_color(self.color(0.4, 0.5), [137] * 3)
        ActionChains(self.browser).move_to_element(canvas).click_and_hold().move_by_offset(
            -canvas.size["width"] // 4, 0).release().perform()
        self.assert_color(self.color(0.4, 0.5), [188] * 3)
        canvas.send_keys("0")
        self.hover(0.9, 0.5)
        self.run_script("""
          const box = arguments[0].getBoundingClientRect();
          arguments[0].focus();
          arguments[0].dispatchEvent(new WheelEvent('wheel', {deltaY: -600, cancelable: true,
            clientX: box.left + 0.9 * box.width, clientY: box.top + 0.5 * box.height}));""", canvas)
        self.assert_color(self.color(0.1, 0.5), [188] * 3)

    def test_values_under_the_cursor(self):
        self.hover(0.9, 0.1)
        self.assertIn("Pixel 7, 0", self.find(".pixel-values caption").text)
        rows = [[cell.text for cell in row.find_elements(By.CSS_SELECTOR, "td")]
                for row in self.find_all(".pixel-values tbody tr")]
        self.assertEqual(rows, [
            ["brighter", "0.75", "0.75", "0.75", "0.75", "0.25", "50 %"],
            ["darker", "0.25", "0.25", "0.25", "0.25", "-0.25", "-50 %"],
            ["reference", "0.5", "0.5", "0.5", "0.5", "0", "0 %"]])
        self.find(".comparer canvas.view").send_keys(Keys.ARROW_DOWN, Keys.ARROW_LEFT)
        self.assertIn("Pixel 6, 1", self.find(".pixel-values caption").text)


class Scene(PageTest):
    def picture(self):
        return self.run_script("return document.getElementById('scene-canvas').toDataURL()")

    def colors(self):
        """How many pixels have each colour."""
        return self.run_script("""
          const gl = document.getElementById('scene-canvas').getContext('webgl');
          const {drawingBufferWidth: w, drawingBufferHeight: h} = gl, data = new Uint8Array(4 * w * h);
          gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, data);
          let green = 0, ground = 0;
          for (let i = 0; i < 4 * w * h; i += 4) {
            if (data[i + 1] > 1.3 * data[i] && data[i + 1] > data[i + 2]) ++green;
            if (data[i] === 223 && data[i + 1] === 228) ++ground;
          }
          return {green, ground, all: w * h};""")

    def assert_changes(self, action, what):
        before = self.picture()
        action()
        self.assertNotEqual(self.picture(), before, what)

    def test_the_view_shows_a_room_and_probes(self):
        colors = self.colors()
        self.assertGreater(colors["green"], 200)
        self.assertLess(colors["ground"], 0.95 * colors["all"])

    def test_controls_change_the_view(self):
        color = Select(self.find("#probe-color"))
        self.assert_changes(lambda: color.select_by_value("clearance"), "colour by clearance")
        self.assertIn("distance to the nearest surface", self.find(".probe-legend").text)
        self.assert_changes(lambda: color.select_by_value("state"), "colour by state")
        for label, action in (
                ("size", lambda: self.slide("#probe-size", 1)),
                ("cut", lambda: self.slide("#cut", 0.4)),
                ("scene", self.find("#show-scene").click),
                ("scene again", self.find("#show-scene").click),
                ("back faces", self.find("#cull-faces").click),
                ("from above", self.find("#top-camera").click),
                ("through walls", self.find("#show-through").click),
                ("reset", self.find("#reset-camera").click),
                ("probes", self.find("#show-probes").click)):
            self.assert_changes(action, label)
        self.assertEqual(self.colors()["green"], 0)

    def test_states_can_be_hidden(self):
        self.find("#state-0").click()
        self.assertEqual(self.colors()["green"], 0)

    def test_keys_and_dragging_move_the_camera(self):
        canvas = self.find("#scene-canvas")
        start = self.picture()
        for keys in ((Keys.ARROW_LEFT,), (Keys.ARROW_UP,), (Keys.SHIFT, Keys.ARROW_RIGHT), ("+",)):
            self.assert_changes(lambda: canvas.send_keys(*keys), keys)
        canvas.send_keys("0")
        self.assertEqual(self.picture(), start)
        self.assert_changes(lambda: ActionChains(self.browser).move_to_element(canvas)
                            .click_and_hold().move_by_offset(60, 20).release().perform(), "drag")

    def test_a_probe_can_be_picked(self):
        self.find("#top-camera").click()
        self.slide("#probe-size", 2)
        canvas = self.find("#scene-canvas")
        size = canvas.size
        # Seen from above, somewhere along a line through the room's middle there is a probe.
        for step in range(-10, 11):
            ActionChains(self.browser).move_to_element_with_offset(
                canvas, step * size["height"] // 50, step * size["height"] // 50).click().perform()
            if self.find_all(".probe-info h3"):
                break
        text = self.find(".probe-info").text
        self.assertRegex(text, r"Probe \d+")
        for word in ("position", "active", "spacing", "clearance"):
            self.assertIn(word, text)


if __name__ == "__main__":
    unittest.main()
