# SPDX-License-Identifier: GPL-3.0-or-later
"""What evaluate writes and reports beside errors: the field's files, the temporal record, and
--require on every command."""
import unittest

from support import CliTest, SOURCE

FURNACE = SOURCE / "scenes/furnace/scene_090.toml"
CORNELL = SOURCE / "scenes/cornell/scene.toml"
SMALL = ("--count", 64, "--rel-error", 0.2, "--probes", 27, "--rays", 32)


class FieldOutput(CliTest):
    def test_dump_field_writes_atlases_positions_and_parameters(self):
        field = self.folder / "field"
        field.mkdir()
        first = self.run_json("evaluate", CORNELL, *SMALL, "--updates", 4, "--dump-field", field)
        self.assertEqual(sorted(p.name for p in field.iterdir()),
                         ["irradiance.exr", "moments.exr", "params.toml", "probes.csv"])
        self.assertEqual(len((field / "probes.csv").read_text().splitlines()),
                         first["probes"]["stored"] + 1)
        again = self.run_json("evaluate", CORNELL, *SMALL, "--updates", 4, "--params",
                              field / "params.toml")
        self.assertEqual(again["error"], first["error"])

    def test_dump_field_needs_an_existing_folder(self):
        self.assert_refused("evaluate", CORNELL, *SMALL, "--dump-field", "none",
                            words=["no such folder"])

    def test_temporal_record_rises_from_black(self):
        temporal = self.run_json("evaluate", CORNELL, *SMALL, "--mode", "temporal", "--updates",
                                 96, "--set", "hysteresis=0.9")["temporal"]
        self.assertGreaterEqual(temporal["updates_to_90"], 1)
        self.assertLessEqual(temporal["updates_to_90"], temporal["updates_to_95"])
        self.assertLessEqual(temporal["updates_to_95"], temporal["updates_to_99"])
        self.assertLessEqual(temporal["updates_to_99"], 72)
        self.assertGreater(temporal["nrmse_after"]["1"], temporal["nrmse_after"]["64"])
        self.assertGreater(temporal["flicker"], 0)

    def test_a_level_that_light_has_not_settled_at_is_none(self):
        # Albedo 0.9: nine tenths of the light have bounced, and history holds every bounce back.
        def record(updates):
            return self.run_json("evaluate", FURNACE, *SMALL, "--mode", "temporal", "--updates",
                                 updates, "--params", "probelab", "--set", "warm_up=0", "--set",
                                 "change_detector=none", "--set", "hysteresis=0.9")["temporal"]
        self.assertIsNone(record(64)["updates_to_90"])
        # After n updates 0.9 (h + (1 - h) 0.9)^(n - 1) is missing: a tenth after 220.
        self.assertAlmostEqual(record(1000)["updates_to_90"], 220, delta=2)

    def test_threads_of_the_software_device_change_no_byte(self):
        dumps = []
        for threads in ("1", "2"):
            out = self.folder / f"{threads}.csv"
            self.run_ok("evaluate", CORNELL, *SMALL, "--updates", 4, "--dump", out,
                        env={"LP_NUM_THREADS": threads})
            dumps.append(out.read_bytes())
        self.assertEqual(dumps[0], dumps[1])

    def test_require_holds_on_every_command(self):
        self.run_ok("check", CORNELL, "--require", "mesh.welded_vertices>0")
        unmet = self.run_program("check", CORNELL, "--require", "mesh.welded_vertices<=0")
        self.assertEqual(unmet.returncode, 3)
        unknown = self.run_program("check", CORNELL, "--require", "nothing<=0")
        self.assertEqual(unknown.returncode, 2)
        self.assertLess(len(unknown.stderr), 1000)


if __name__ == "__main__":
    unittest.main()
