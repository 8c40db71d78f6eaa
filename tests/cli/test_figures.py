# SPDX-License-Identifier: GPL-3.0-or-later
"""scripts/figures.py: numbers against sums by hand, whole and half-finished studies, damaged cells.

The figures themselves are drawn by the distribution's Python, which has matplotlib."""
import csv
import json
import math
import subprocess
import sys

from support import PROGRAM, SOURCE, CliTest

sys.path.insert(0, str(SOURCE / "scripts"))
import figures_captions  # noqa: E402
import figures_cells  # noqa: E402
import figures_points  # noqa: E402
import figures_tables  # noqa: E402

PYTHON = "/usr/bin/python3"  # the distribution's: scripts/setup installs its matplotlib
FLOOR = {"nrmse": 0.01, "light_leak": 1e-4, "shadow_leak": 1e-4, "bias": 0.001}
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


def cell(study, scene="room", state="day", seed=1, options=None, command="evaluate", result=None,
         **axes):
    """A cell as `probelab run` writes them; `axes` with underscores for blanks."""
    axes = {name.replace("_", " "): str(value) for name, value in axes.items()}
    return {"strategy": "grid", "layout": {"asked": 64}, "mode": "converged", "device": "a device",
            "tracer": "embree", "version": "1.2.3", "params": {"rays": 16},
            "receivers": {"count": 99, "split": "heldout"}, **(result or {}),
            "cell": {"study": study, "command": command, "options": options or {},
                     "axes": {"scene": scene, "state": state, **axes, "seed": str(seed)}}}


def errors(nrmse, light=0.0, shadow=0.0, bias=0.0, **more):
    return {"error": {"nrmse": nrmse, "light_leak": light, "shadow_leak": shadow, "bias": bias,
                      "noise_floor": FLOOR}, **more}


def count_cells(layout="grid", seeds=(1, 2)):
    """Errors against N whose means and slope are plain: see test_states_and_seeds."""
    cells = []
    for probes, stored, scale in ((128, 100, 1.0), (512, 400, 0.5)):
        for seed in seeds:
            for state, error in (("day", 0.3), ("night", 0.4)):
                result = errors(error * seed * scale, light=0.02 * seed * scale, shadow=0.1,
                                probes={"stored": stored, "active": stored})
                cells.append(cell("by_count", state=state, seed=seed, probes=probes, layout=layout,
                                  result=result))
    return cells


class FiguresTest(CliTest):
    def write(self, cells, name="results"):
        folder = self.folder / name / "cells"
        folder.mkdir(parents=True, exist_ok=True)
        for i, one in enumerate(cells):
            one["cell"]["id"] = f"{i:016x}"
            (folder / f"{i:016x}.json").write_text(json.dumps(one))
        return folder.parent

    def study(self, cells):
        return figures_cells.load_folder(self.write(cells))[0][0]

    def figures(self, *arguments):
        return subprocess.run([PYTHON, "-B", SOURCE / "scripts/figures.py", *arguments],
                              capture_output=True, text=True, timeout=300)

    def row(self, rows, **where):
        found = [r for r in rows if all(r.get(k) == v for k, v in where.items())]
        self.assertEqual(len(found), 1, where)
        return found[0]


class Numbers(FiguresTest):
    def test_states_and_seeds(self):
        study = self.study(count_cells())
        self.assertEqual(figures_tables.kind_of(study), "error_vs_n")
        rows = figures_tables.tables_error_vs_n(study)[""]
        # Seed s at N = 100: sqrt((0.3^2 + 0.4^2) / 2) s = 0.353553 s, and half of it at N = 400.
        first = self.row(rows, metric="nrmse", probes="128")
        for key, value in (("value", 1.5), ("low", 1), ("high", 2)):
            self.assertAlmostEqual(first[key], value * math.sqrt(0.125), places=12)
        self.assertEqual((first["stored"], first["seeds"], first["floor"]), (100, 2, 0.01))
        leak = self.row(rows, metric="light leak", probes="512")
        self.assertAlmostEqual(leak["value"], 0.015)  # a mean over states, not a root
        # Half the error at four times the probes: a slope of -1/2 in every seed.
        slope = self.row(rows, metric="slope")
        for key in ("value", "low", "high"):
            self.assertAlmostEqual(slope[key], -0.5)

    def test_seed_without_all_states_is_left_out(self):
        cells = [c for c in count_cells()
                 if (c["cell"]["axes"]["state"], c["cell"]["axes"]["seed"]) != ("night", "2")]
        row = self.row(figures_tables.tables_error_vs_n(self.study(cells))[""], metric="nrmse",
                       probes="128")
        self.assertEqual(row["seeds"], 1)
        self.assertAlmostEqual(row["value"], math.sqrt(0.125))

    def test_null_numbers_are_no_points(self):
        cells = count_cells(seeds=(1,))
        for one in cells[:2]:
            one["error"]["nrmse"] = None
        rows = figures_tables.tables_error_vs_n(self.study(cells))[""]
        self.assertEqual([r["probes"] for r in rows if r["metric"] == "nrmse"], ["512"])

    def test_thin_wall_geometry(self):
        # Spacings of 8.05 / 7.1, 2.6 / 2.1 and 4 / 4.1 m.
        wall = figures_tables.wall_geometry(0.05, [8, 3, 5])
        along = math.hypot(2.6 / 2.1, 4 / 4.1) / 2
        self.assertAlmostEqual(wall["ratio"], 0.05 / along)
        self.assertAlmostEqual(wall["d"] * math.sin(math.radians(wall["theta_deg"])), along)
        self.assertEqual(wall["joins"], 1)
        self.assertEqual(figures_tables.wall_geometry(0.05, [7, 3, 5])["joins"], 0)
        # 9.4 m / 7.1 = 1.32 m: no cell spans a wall of 1.4 m.
        self.assertEqual(figures_tables.wall_geometry(1.4, [8, 3, 5])["joins"], 0)

    def test_thin_wall_law_is_the_presets(self):
        # 7.97 degrees for cos^50; nearly a Gaussian of variance 1 / (n + 2) for sharper ones.
        self.assertAlmostEqual(math.degrees(figures_tables.lobe_width(50)), 7.97, delta=0.005)
        self.assertAlmostEqual(figures_tables.lobe_width(2000), 2002 ** -0.5, delta=1e-5)
        params = {"visibility": True, "distance_exponent": 50.0, "chebyshev_power": 3.0}
        self.assertAlmostEqual(figures_tables.thin_wall_law(params), 0.182, delta=5e-4)
        # Half of the width; (1 + x^2)^-7 is 0.05 at x = 0.7309.
        params.update(distance_exponent=200.0, chebyshev_power=7.0)
        self.assertAlmostEqual(figures_tables.thin_wall_law(params),
                               0.7309 * figures_tables.lobe_width(200), delta=1e-4)
        self.assertIsNone(figures_tables.thin_wall_law({**params, "visibility": False}))

    def test_thin_wall_spacing_is_the_grids(self):
        for scene, thickness, probes in (("05cm", 0.05, 128), ("50cm", 0.5, 256)):
            self.run_ok("place", SOURCE / f"scenes/thin_wall/scene_{scene}.toml", "--strategy",
                        "grid", "--probes", probes, "-o", "layout.json", "--quiet")
            layout = json.loads((self.folder / "layout.json").read_text())
            wall = figures_tables.wall_geometry(thickness, layout["lattice"]["count"])
            for axis, name in enumerate("xyz"):
                places = sorted({round(p[axis], 4) for p in self.positions(layout)})
                gaps = [b - a for a, b in zip(places, places[1:])]
                # Positions are floats of a few metres, rounded to 0.1 mm.
                self.assertAlmostEqual(min(gaps), wall["spacing_" + name], delta=3e-4)

    @staticmethod
    def positions(layout):
        return [p["position"] if isinstance(p, dict) else p for p in layout["probes"]]

    def test_pareto_and_means_over_scenes(self):
        self.assertEqual(figures_points.pareto([(3, 1.0), (1, 5.0), (2, 6.0), (2, 2.0)]), [1, 3, 0])
        found = figures_points.geometric_interval([[1.0, 1.0], [4.0, 4.0]])
        for key in ("value", "low", "high"):
            self.assertAlmostEqual(found[key], 2.0)
        wide = figures_points.geometric_interval([[1.0, 3.0]])  # draws of (1, 1) and (3, 3) exist
        for key, value in (("low", 1.0), ("high", 3.0), ("value", 2.0)):
            self.assertAlmostEqual(wide[key], value)
        self.assertIsNone(figures_points.geometric_interval([[1.0, 0.0]]))

    def test_time_to_error(self):
        cells = []
        for rays, update_ms, after in ((32, 1.0, {"1": 0.9, "4": 0.45, "16": 0.28}),
                                       (128, 3.0, {"1": 0.4, "4": 0.15, "16": 0.12})):
            result = errors(min(after.values()), temporal={"nrmse_after": after}, updates=20,
                            speed={"update_ms": update_ms, "frame_ms": update_ms + 1},
                            work={"rays": 64 * rays}, memory_bytes=1000, probes={"stored": 64},
                            receivers={"count": 1000, "seconds": 4.0})
            cells.append(cell("speed_error", params="p", probes=64, rays=rays, layout="grid",
                              texels="8, 16", result=result))
        tables = figures_tables.tables_speed_error(self.study(cells))
        times = tables["time_to_error"]
        # 0.5: 4 updates of 1 ms or one of 3 ms; 0.3: 16 of 1 ms or 4 of 3 ms; 0.2: 4 of 3 ms.
        for wanted, time, rays in ((0.5, 3, "128"), (0.3, 12, "128"), (0.2, 12, "128")):
            row = self.row(times, nrmse=wanted)
            self.assertEqual((row["time_ms"], row["rays"]), (time, rays))
        self.assertNotIn("time_ms", self.row(times, nrmse=0.05))
        self.assertEqual([r["front_frame_ms"] for r in tables[""]], [1, 1])
        # A floor of 0.01 after 4 ms a point; 1 s a frame is 1 / 2,073,600 s a point.
        self.assertAlmostEqual(tables["path_tracing"][0]["value"],
                               0.01 * math.sqrt(0.004 * 2073600))

    def test_updates_to_a_level_that_one_seed_did_not_settle_at_are_left_out(self):
        cells = [cell("rays_hysteresis", seed=seed, rays=64, hysteresis="0.99", **{"warm-up": 0},
                      result=errors(0.1, temporal={"flicker": 0.1, "updates_to_95": 10 * seed,
                                                   "updates_to_99": to_99}))
                 for seed, to_99 in ((1, 50), (2, None))]
        rows = figures_tables.tables_rays_hysteresis(self.study(cells))[""]
        self.assertEqual(self.row(rows, metric="updates to 95 %")["value"], 15)
        self.assertEqual([r for r in rows if r["metric"] == "updates to 99 %"], [])

    def test_budget_rungs(self):
        cells = [cell("why", command="budget", seed=s, result={"rungs": [
            {"name": "exact", "nrmse": 0.1 * s, "light_leak": 0.0, "share": 0.25},
            {"name": "field", "nrmse": 0.2 * s, "light_leak": 0.01, "share": 0.75}]})
            for s in (1, 2)]
        study = self.study(cells)
        self.assertEqual(figures_tables.kind_of(study), "budget")
        row = self.row(figures_tables.tables_budget(study)[""], name="field", metric="nrmse")
        self.assertAlmostEqual(row["value"], 0.3)
        self.assertEqual((row["low"], row["high"], row["rung"]), (0.2, 0.4, 1))

    def test_the_exact_rung_stands_beside_the_terms(self):
        cells = [cell("visibility_terms", terms="all", result=errors(0.3, light=0.02)),
                 cell("visibility_terms", terms="exact", command="budget", result={
                     **errors(0.3), "rungs": [{"name": "exact", "nrmse": 0.1, "light_leak": 0.01,
                                               "shadow_leak": 0.0}]})]
        study = self.study(cells)
        self.assertEqual(figures_tables.kind_of(study), "visibility_terms")
        rows = figures_tables.tables_visibility_terms(study)[""]
        self.assertEqual(self.row(rows, terms="exact", metric="nrmse")["value"], 0.1)
        self.assertEqual(self.row(rows, terms="all", metric="nrmse")["value"], 0.3)

    def test_spread_over_offsets_and_angles(self):
        cells = [cell("grid_robustness", scene=scene, offset=offset, result=errors(error))
                 for scene, offset, error in (("room", 0, 0.2), ("room", 0.5, 0.1),
                                              ("room/scene_turned_30", 0, 0.4))]
        tables = figures_tables.tables_grid_robustness(self.study(cells))
        turned = self.row(tables[""], turn_deg=30, metric="nrmse")
        self.assertEqual((turned["room"], turned["value"]), ("room", 0.4))
        row = self.row(tables["spread"], metric="nrmse")
        self.assertEqual((row["least"], row["median"], row["most"], row["unmoved"]),
                         (0.1, 0.2, 0.4, 0.2))

    def test_tuned_and_untuned_layouts(self):
        scores = [{"state": s, "lights": "train", "settings": [
            {"setting": "tuned", "heldout": {"nrmse": e, "light_leak": e / 10}}]}
            for s, e in (("day", 0.3), ("night", 0.4))]
        parameters = [{"key": "normal_bias", "unit": "x s_i", "from": 0.1, "tuned": 0.2}]
        study = self.study([cell("mine", command="tune", layout="grid", seed=s, result={
            "scores": scores, "parameters": parameters}) for s in (1, 2)])
        self.assertEqual(figures_tables.kind_of(study), "layout_tuning")
        tables = figures_tables.tables_layout_tuning(study)
        row = self.row(tables[""], setting="tuned", metric="nrmse", lights="train")
        self.assertAlmostEqual(row["value"], math.sqrt(0.125))
        self.assertAlmostEqual(self.row(tables[""], metric="light leak")["value"], 0.035)
        tuned = self.row(tables["parameters"], parameter="normal_bias")
        self.assertEqual((tuned["preset"], tuned["tuned"], tuned["seeds"]), (0.1, 0.2, 2))

    def test_counts_are_those_of_the_program(self):
        for name in figures_tables.AXES:
            path = figures_cells.study_file(name)
            for size in [None, *figures_cells.load_sizes(path)]:
                listed = self.run_json("run", path, "--list", "--results", self.folder / "none",
                                       *(["--size", size] if size else []))["list"]
                expanded = figures_cells.expand(path, size)
                self.assertEqual(len(expanded), len(listed), (name, size))
                for axes, one in zip(expanded, listed):  # a diff of whole lists takes minutes
                    self.assertEqual(dict(axes), one["axes"], (name, size))


def sized(probes, layout="grid", version="1.2.3", **options):
    """A cell of error against N whose layout an axis sets, with these options of its study."""
    options = {"probes": probes, "strategy": layout, "count": 64, **options}
    return cell("mine", probes=probes, layout=layout,
                options={name: [str(value)] for name, value in options.items()},
                result=errors(0.1, probes={"stored": probes}, version=version))


class Kinds(FiguresTest):
    """Which cells of a study without a file in experiments/studies can be compared."""

    def kept(self, cells, listed=()):
        folder = self.write(cells, f"results{len(self.files())}")
        ids = "".join(f"{i:016x}\n" for i in listed)
        (folder / "mine.csv").write_text("id\n" + ids)
        study, = figures_cells.load_folder(folder)[0]
        return sorted((int(c.axes["probes"]), c.axes.get("layout"),
                       *c.result["cell"]["options"]["count"])
                      for c in study.cells), study.left_out

    def test_an_option_of_a_size_makes_another_kind(self):
        cells = [sized(8), sized(16), sized(32), sized(8, count=512)]
        for last in ([3], [0, 1, 2], []):  # whichever was run last
            kept, left_out = self.kept(cells, last)
            self.assertEqual(kept, [(n, "grid", "64") for n in (8, 16, 32)])
            self.assertEqual(left_out, ["1 cell with another count left out"])

    def test_the_kind_that_was_run_last_where_both_are_as_common(self):
        cells = [sized(8), sized(16), sized(8, count=512), sized(16, count=512)]
        for last, count in (([0, 1], "64"), ([2, 3], "512")):
            self.assertEqual(self.kept(cells, last)[0], [(8, "grid", count), (16, "grid", count)])

    def test_sizes_that_share_no_cell_do_not_mix(self):
        kept, left_out = self.kept([sized(8), sized(16), sized(32, count=512)])
        self.assertEqual(kept, [(8, "grid", "64"), (16, "grid", "64")])
        self.assertEqual(left_out, ["1 cell with another count left out"])

    def test_options_that_only_a_size_sets(self):
        cells = [sized(8), sized(16), sized(8, spp=4, set="hysteresis=0.5")]
        self.assertEqual(self.kept(cells)[1],
                         ["1 cell with another set hysteresis or spp left out"])
        cells = [cell("bias_map", command="tune", scene=s, options={"probes": ["64"], **o})
                 for s, o in (("a", {}), ("b", {}), ("a", {"rounds": ["1"]}))]
        study = figures_cells.load_folder(self.write(cells, "shipped"))[0][0]
        self.assertEqual((len(study.cells), study.left_out),
                         (2, ["1 cell with another rounds left out"]))

    def test_what_an_axis_sets_is_no_other_kind(self):
        cells = [sized(n, layout, count=c) for n in (8, 16)
                 for layout, c in (("grid", 64), ("sparse", 512))]
        self.assertEqual(self.kept(cells)[1], [])
        # What an axis of numbers, which is named as the option is, sets beside it shows in a run.
        cells = [sized(8), sized(16, count=512)]
        self.assertEqual(self.kept(cells, [0, 1]), ([(8, "grid", "64"), (16, "grid", "512")], []))

    def test_a_file_is_the_same_from_wherever_the_study_was_started(self):
        cells = [sized(8, params="tuned.toml"), sized(16, params="/home/me/tuned.toml")]
        self.assertEqual(self.kept(cells)[1], [])

    def test_what_differs_is_said(self):
        cells = [sized(8), sized(8, version="1.2.4")]
        self.assertEqual(self.kept(cells, [1])[1], ["1 cell of another version left out"])
        cells = [sized(8), sized(8)]
        cells[1]["device"] = "another device"
        self.assertEqual(self.kept(cells, [1])[1],
                         ["1 cell of the same axes but another device left out"])
        self.assertEqual(self.kept([sized(8), sized(8)], [1])[1],
                         ["1 cell of the same axes but another input file left out"])

    def test_seeds_of_two_versions_make_no_point(self):
        old = [sized(n, version="1.2.4") for n in (8, 16, 32)]
        self.assertEqual(self.kept([*old, sized(8), sized(16)]),
                         ([(n, "grid", "64") for n in (8, 16, 32)],
                          ["2 cells of another version left out"]))
        self.assertEqual(self.kept([*old, sized(8), sized(16)], [3, 4]),
                         ([(n, "grid", "64") for n in (8, 16)],
                          ["3 cells of another version left out"]))

    def test_cells_from_before_an_axis_was_added(self):
        cells = [sized(8), sized(16), sized(32)]
        del cells[2]["cell"]["axes"]["layout"]
        self.assertEqual(self.kept(cells)[1], ["1 cell with other axes left out"])
        self.assertEqual(self.kept(cells, [2])[1], ["2 cells with other axes left out"])

    def test_scene_and_state_are_one_axis(self):
        cells = [cell("mine", scene=scene, state=state, probes=n, layout="grid",
                      result=errors(0.1, probes={"stored": n}))
                 for scene, state in (("room", "day"), ("hall", "lamp"), ("hall", "sky"))
                 for n in (8, 16)]
        for of, says in ((cells, "6 of 6 cells"), (cells[1:], "5 of 6 cells")):
            study = figures_cells.load_folder(self.write(of, str(len(of))))[0][0]
            self.assertIn(says, figures_cells.completeness(study))


class Tuned(FiguresTest):
    def test_captions_say_probes_and_receivers(self):
        cells = every_study()["layout_tuning"]
        for one, stored in zip(cells, range(22, 30), strict=True):
            for name in ("probes", "layout", "receivers"):
                one.pop(name)
            one["scenes"] = [{"receivers": 1024, "probes": {"stored": stored},
                              "layout": {"asked": 32}}]
        study = self.study(cells)
        caption = figures_captions.caption("layout_tuning", "", study,
                                           figures_tables.tables_layout_tuning(study), 0)
        for words in ("N: 32 probes asked for, 22 to 29 stored", "receivers a scene: 1,024;"):
            self.assertIn(words, caption)

    def test_the_state_is_all_that_was_tuned_on(self):
        older = cell("mine", command="tune", layout="grid", state="day")
        named = cell("mine", command="tune", layout="sparse", state="night",
                     options={"state": ["night"]})
        study = self.study([older, named])
        self.assertEqual(sorted(c.state for c in study.cells), ["night", "train"])


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


def every_study():
    """Small studies of all kinds, with zeros, several seeds and scenes."""
    scenes, cells = ("two_rooms_door", "thin_wall/scene_05cm"), {}

    def add(name, i, scene, seed, **axes):
        rays = float(axes.get("rays", 64))
        error = 0.3 * (1 + 0.1 * seed) / (1 + i) ** 0.5
        after = {"1": 0.9, "4": error}
        result = errors(
            error, light=0.0 if i == 0 else 10.0 ** -(3 + i % 5), shadow=0.01 / (1 + i),
            bias=-0.1 * (i % 7), probes={"stored": 60 + 37 * i}, lattice=[6 + i % 3, 3, 4],
            memory={"atlas_per_probe": 400 + 100 * i}, memory_bytes=10000 * (1 + i), updates=64,
            temporal={"nrmse_after": after, "updates_to_95": 1 + i, "updates_to_99": 5 + 9 * i,
                      "flicker": 0.3 / rays ** 0.5},
            speed={"update_ms": 2.0 + i, "frame_ms": 300.0 + 9 * i * seed,
                   "query_ns_per_point": 200 + i}, work={"rays": rays * (60 + 37 * i)},
            rungs=[{"name": n, "nrmse": error * s, "light_leak": 1e-4 * (s - 1), "share": s / 6}
                   for n, s in (("exact", 1), ("moments", 2), ("field", 3))])
        result.update(
            bias_map={"places": [{"name": n, "normal_bias": b, "view_bias": 2 * b}
                                 for n, b in (("from", 0.1), ("rtxgi", 0.04), ("tuned", 0.3))]},
            parameters=[{"key": "normal_bias", "unit": "x s_i", "from": 0.1, "tuned": 0.2}],
            scores=[{"state": "day", "lights": l, "settings": [
                {"setting": s, "heldout": {"nrmse": error * f, "light_leak": 0.0,
                                           "shadow_leak": 0.01}}
                for s, f in (("from", 1), ("tuned", 0.8), ("rtxgi", 1.1))]}
                for l in ("train", "heldout")])
        commands = {"budget": "budget", "bias_map": "tune", "layout_tuning": "tune"}
        cells.setdefault(name, []).append(cell(
            name, scene=scene, seed=seed, command=commands.get(name, "evaluate"), result=result,
            **axes))

    for seed in (1, 2):
        for scene in scenes:
            i = 0
            for a in (64, 256, 1024):
                for b in ("grid", "a_long_name_of_a_layout"):
                    add("error_vs_n", i, scene, seed, probes=a, layout=b)
                    add("interpolants", i, scene, seed, layout=b, interpolant=f"kind{a}")
                    add("rays_hysteresis", i, scene, seed, rays=a, hysteresis=0.85 + 0.1 * (i % 2),
                        **{"warm-up": 8 * (i == 1)})
                    add("texels", i, scene, seed, irradiance_texels=4 + 4 * (i % 2),
                        moment_texels=a // 8, fixed="probes" if i % 3 else f"bytes: {a} probes")
                    add("formats", i, scene, seed, format=f"r11g11b10f{a}", gamma=1 + 4 * (i % 2),
                        hysteresis=0.97, rounding="nearest")
                    add("speed_error", i, scene, seed, params=b, probes=a, rays=32,
                        layout="grid" if i % 2 else "poisson", texels=f"{4 + 4 * (i % 2)}, 16")
                    add("visibility_terms", i, scene, seed, terms=f"{b} {a}")
                    for turn in ("", "_turned_30"):
                        place = scene if not turn else scene + (turn if "/" in scene
                                                                else "/scene" + turn)
                        if i < 3:
                            add("grid_robustness", i, place, seed, offset=(i - 1) / 2)
                    if i < 2:
                        add("layout_tuning", i, scene, seed, layout=b)
                    i += 1
            add("budget", 0, scene, seed)
            add("bias_map", 0, scene, seed)
        for cm in ("01", "05", "50"):
            for i, a in enumerate((64, 256, 1024)):
                add("thin_wall", i, f"thin_wall/scene_{cm}cm", seed, probes=a, params="probelab")
    return cells
