# SPDX-License-Identifier: GPL-3.0-or-later
"""What the tests of scripts/figures.py share: cells made by hand, and studies of them."""
import json
import subprocess
import sys

from support import SOURCE, CliTest

sys.path.insert(0, str(SOURCE / "scripts"))
import figures_cells  # noqa: E402

PYTHON = "/usr/bin/python3"  # the distribution's: scripts/setup installs its matplotlib
FLOOR = {"nrmse": 0.01, "light_leak": 1e-4, "shadow_leak": 1e-4, "bias": 0.001}


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
