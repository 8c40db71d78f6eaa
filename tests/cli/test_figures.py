# SPDX-License-Identifier: GPL-3.0-or-later
"""scripts/figures.py: the numbers of its tables and captions against sums by hand."""
import json
import math

from figures_support import FiguresTest, cell, count_cells, errors, every_study
from support import SOURCE

import figures_captions
import figures_cells
import figures_points
import figures_tables


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
