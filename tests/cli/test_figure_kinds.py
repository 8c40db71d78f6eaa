# SPDX-License-Identifier: GPL-3.0-or-later
"""scripts/figures.py: which cells of one study can be compared."""
from figures_support import FiguresTest, cell, errors

import figures_cells


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
