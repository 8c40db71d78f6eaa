# SPDX-License-Identifier: GPL-3.0-or-later
"""scripts/figures.py on whole, half-finished and damaged studies.

The figures themselves are drawn by the distribution's Python, which has matplotlib."""
import csv
import json
import math
import subprocess

from figures_support import PYTHON, FiguresTest, cell, count_cells, errors, every_study
from support import SOURCE

import figures_cells
import figures_tables

# Draws all studies of all folders into the last one. Says where a figure's edge is not white (what
# is drawn there is cut), and where a legend lies on a panel or a text is small.
DRAW_AND_CHECK = """
import pathlib, sys
sys.path.insert(0, sys.argv[1])
import figures, figures_cells, figures_panels, figures_tables
pyplot = figures_panels.load_pyplot()
save = figures_panels.save
def save_and_check(figure, folder, stem):
    names = save(figure, folder, stem)
    image = pyplot.imread(folder / f"{stem}.png")[..., :3]
    for edge in (image[0], image[-1], image[:, 0], image[:, -1]):
        if edge.min() < 1:
            print(stem, "is cut")
    for legend in figure.legends:
        box = legend.get_window_extent()
        if any(box.overlaps(panel.get_window_extent()) for panel in figure.axes):
            print(stem, "has its legend on a panel")
    for text in figure.findobj(pyplot.Text):
        if text.get_fontsize() < 7:
            print(stem, "has small text:", text.get_text())
    return names
figures_panels.save = save_and_check
*folders, out = map(pathlib.Path, sys.argv[2:])
for folder in folders:
    for study in figures_cells.load_folder(folder)[0]:
        figures.draw_study(pyplot, study, figures_tables.kind_of(study), out, 0)
"""


class Files(FiguresTest):
    def test_table_and_caption_say_what_the_cells_do(self):
        results = self.write(count_cells() + count_cells("poisson"))
        run = self.figures(results)
        self.assertEqual((run.returncode, run.stderr), (0, ""))
        written = {p.rsplit("/", 1)[1] for p in run.stdout.splitlines()}
        self.assertEqual(written, {"by_count.csv"} | {
            f"by_count{part}.{end}" for part in ("", "_leaks") for end in ("pdf", "png", "txt")})
        figures = results / "figures"
        self.assertEqual((figures / "by_count.pdf").read_bytes()[:5], b"%PDF-")
        self.assertEqual((figures / "by_count.png").read_bytes()[:4], b"\x89PNG")
        with open(figures / "by_count.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        row = self.row(rows, layout="poisson", metric="nrmse", probes="512")
        self.assertAlmostEqual(float(row["value"]), 0.75 * math.sqrt(0.125), places=8)
        caption = (figures / "by_count.txt").read_text()
        for words in ("16 of 16 cells", "seeds: 1, 2", "device: a device, tracer embree",
                      "version: 1.2.3", "room (day, night)", "100 to 400 stored",
                      "the least and the most of the seeds"):
            self.assertIn(words, caption)
        before = {p.name: p.read_bytes() for p in figures.iterdir()}
        self.figures(results)
        self.assertEqual({p.name: p.read_bytes() for p in figures.iterdir()}, before)

    def test_half_finished_and_damaged(self):
        cells = count_cells(seeds=(1,))
        results = self.write(cells[:3])
        damaged = results / "cells" / "00000000000000aa.json"
        damaged.write_text('{"error": {"nrm')
        run = self.figures(results)
        self.assertEqual(run.returncode, 1)
        self.assertEqual(len(run.stderr.splitlines()), 1)
        self.assertIn(str(damaged), run.stderr)
        caption = (results / "figures" / "by_count.txt").read_text()
        for words in ("3 of 4 cells", "1 damaged cell left out", "no intervals"):
            self.assertIn(words, caption)
        damaged.write_text('{"no": "cell"}')
        self.assertIn(str(damaged), self.figures(results).stderr)

    def break_cell(self, results, change):
        """Damages the first cell; the figures' stderr and the caption of by_count."""
        path = results / "cells" / f"{0:016x}.json"
        whole = path.read_text()
        result = json.loads(whole)
        change(result)
        path.write_text(json.dumps(result))
        run = self.figures(results)
        path.write_text(whole)
        self.assertEqual(run.returncode, 1, run.stderr)
        self.assertEqual(len(run.stderr.splitlines()), 1, run.stderr)
        self.assertIn(f"{path}: not a", run.stderr)
        return run.stderr, (results / "figures/by_count.txt").read_text()

    def test_one_damaged_cell_is_left_out(self):
        results = self.write(count_cells())
        for change, says in ((lambda r: r["cell"].update(study=5), "no text 'study'"),
                             (lambda r: r["cell"].update(study="../x"), "no file's name"),
                             (lambda r: r["cell"].update(options=3), "no table 'options'"),
                             (lambda r: r["cell"].update(options={"rays": 3}), "no list 'rays'"),
                             (lambda r: r.update(probes=None), "no number 'probes.stored'"),
                             (lambda r: r["error"].update(nrmse=None), "no number 'error.nrmse'")):
            stderr, caption = self.break_cell(results, change)
            self.assertIn(says, stderr)
            for words in ("7 of 8 cells", "1 damaged cell left out"):
                self.assertIn(words, caption)

    def test_a_damaged_tuning_is_left_out(self):
        cells = every_study()["layout_tuning"]
        cells[0]["scores"][0]["settings"][1]["heldout"] = None
        results = self.write(cells)
        run = self.figures(results)
        self.assertEqual((run.returncode, len(run.stderr.splitlines())), (1, 1), run.stderr)
        self.assertIn(f"{0:016x}.json: not a whole result", run.stderr)
        self.assertIn("1 damaged cell left out",
                      (results / "figures/layout_tuning.txt").read_text())
        results = self.write(every_study()["bias_map"], "maps")
        for i in range(4):
            report = results / "files" / f"{i:016x}" / "report"
            report.mkdir(parents=True)
            (report / "bias_map.csv").write_text(BIAS_MAP[:-9] if i == 0 else BIAS_MAP)
        run = self.figures(results)
        self.assertEqual((run.returncode, len(run.stderr.splitlines())), (1, 1), run.stderr)
        self.assertIn(f"{0:016x}.json: not a whole result", run.stderr)

    def test_a_scene_without_light_is_named(self):
        dark = [cell("by_count", scene="dark", state="off", probes=n, layout="grid", seed=s,
                     result=errors(None, light=None, shadow=None, probes={"stored": n}))
                for n in (128, 512) for s in (1, 2)]
        results = self.write(count_cells() + dark)
        run = self.figures(results)
        says = "dark (off) left out for lack of a number"
        self.assertEqual(run.returncode, 0)
        self.assertEqual(run.stderr, f"figures.py: {results}: by_count: {says}\n")
        caption = (results / "figures/by_count.txt").read_text()
        for words in ("12 of 12 cells", "scenes (states): room (day, night);", says):
            self.assertIn(words, caption)

    def test_folders_without_cells_among_others(self):
        results, empty = self.write(count_cells()), self.folder / "cache"
        empty.mkdir()
        run = self.figures(empty, results, "-o", self.folder / "out", "--only", "error_vs_n")
        self.assertEqual((run.returncode, run.stderr),
                         (0, f"figures.py: {empty}: no cells; left out\n"))
        self.assertIn("by_count.pdf", run.stdout)
        other = self.folder / "other"
        other.mkdir()
        for folders, says in (((empty, other), f"{empty}, {other}: no cells in any of them"),
                              ((results, self.folder / "typo"), "typo: no such folder")):
            run = self.figures(*folders)
            self.assertEqual((run.returncode, run.stdout, len(run.stderr.splitlines())), (2, "", 1))
            self.assertIn(says, run.stderr)

    def test_cells_of_another_size_are_left_out(self):
        axes = {"format": "rgba16f", "gamma": 5, "rounding": "nearest"}
        cells = [cell("formats", hysteresis=h, options={"updates": [u]}, result=errors(0.1, bias=b),
                      **axes) for h, u, b in ((0.97, "64", -0.9), (0.97, "512", -0.2),
                                              (0.85, "512", -0.1))]
        study = self.study(cells)
        self.assertEqual([c.value("error.bias") for c in study.cells].count(-0.9), 0)
        self.assertEqual(study.left_out, ["1 cell with another updates left out"])

    def test_errors_are_clear(self):
        empty = self.folder / "empty"
        empty.mkdir()
        run = self.figures(empty)
        self.assertEqual((run.returncode, run.stdout), (2, ""))
        self.assertIn(f"{empty}: no cells", run.stderr)
        results = self.write(count_cells())
        run = self.figures(results, "--only", "texels")
        self.assertEqual(run.returncode, 2)
        self.assertIn("no study named texels", run.stderr)
        for lacking in (None, 0.5):  # no error, no bytes
            mixed = self.write([cell("texels", irradiance_texels=4, moment_texels=8, fixed="probes",
                                     result=errors(lacking))], "lacking")
            run = self.figures(results, mixed, "-o", self.folder / "out")
            self.assertEqual(run.returncode, 1)
            self.assertIn(f"{mixed}: ", run.stderr)
            self.assertEqual(len(run.stderr.splitlines()), 1)
            self.assertIn("by_count.pdf", run.stdout)
        unknown = self.write([cell("mine", strange="1", result=errors(0.1))], "other")
        run = self.figures(unknown)
        self.assertEqual(run.returncode, 2)
        self.assertIn("no figure is known for study 'mine'", run.stderr)
        twice = self.figures(results, self.write(count_cells(), "again"), "-o", self.folder / "out")
        self.assertEqual(twice.returncode, 2)
        self.assertIn("separate output folders", twice.stderr)

    def test_every_figure_holds_its_texts(self):
        folders = [self.write(cells, name) for name, cells in every_study().items()]
        for i in range(4):  # the maps of bias_map
            report = self.folder / "bias_map" / "files" / f"{i:016x}" / "report"
            report.mkdir(parents=True)
            (report / "bias_map.csv").write_text(BIAS_MAP)
        run = subprocess.run([PYTHON, "-B", "-c", DRAW_AND_CHECK, SOURCE / "scripts", *folders,
                              self.folder / "out"], capture_output=True, text=True, timeout=300)
        self.assertEqual((run.returncode, run.stdout, run.stderr), (0, "", ""))
        parameters = (self.folder / "out/layout_tuning_parameters.md").read_text()
        self.assertIn("| normal_bias ", parameters)
        for name in figures_tables.TABLES:
            self.assertTrue((self.folder / "out" / f"{name}.pdf").is_file(), name)


BIAS_MAP = "normal_bias,view_bias,cost,nrmse,light_leak\n" + "".join(
    f"{n},{v},1,{0.1 + n + v},{n * v / 10}\n" for v in (0, 0.5, 1) for n in (0, 0.2, 0.4))
