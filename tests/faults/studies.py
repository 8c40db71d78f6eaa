# SPDX-License-Identifier: GPL-3.0-or-later
"""Studies of many tiny cells, and their results without times and paths."""
import json

TIMES = ("speed", "provenance", "layout_build_s", "seconds", "rays_per_s", "from_cache",
         "build_s", "output")
# Cells of a tenth of a second on the host.
PLACE = """about = "random layouts"
command = "place"
scenes = ["room.toml"]
seeds = [{seeds}]
[options]
output = "l.json"
[[axis]]
name = "strategy"
option = "strategy"
values = ["jittered", "poisson"]
[[axis]]
name = "probes"
option = "probes"
values = [8, 27]
"""
# Cells with a device, of half a second.
EVALUATE = """about = "tiny fields"
command = "evaluate"
scenes = ["room.toml"]
states = "all"
seeds = [{seeds}]
[options]
count = 16
spp = 4
rays = 16
updates = 2
tracer = "embree"
probes = 8
"""
SCENE = """gltf = "room.glb"
[[state]]
name = "day"
[[state]]
name = "night"
sky_scale = 0.5
"""


def write_study(folder, text, seeds):
    (folder / "room.toml").write_text(SCENE)
    listed = ", ".join(str(s + 1) for s in range(seeds))
    (folder / "study.toml").write_text(text.format(seeds=listed))


def without_times(json_object):
    if isinstance(json_object, dict):
        return {k: without_times(v) for k, v in json_object.items()
                if k not in TIMES}
    return json_object


def left_over(folder):
    """What runs write first and rename or remove when they are done: whole studies have none."""
    return sorted(str(p.relative_to(folder)) for p in folder.rglob(".*"))


def results(folder):
    """{relative path: content without times} of the cells and of what they wrote."""
    found = {}
    for path in sorted(p for p in folder.rglob("*.json") if not p.name.startswith(".")):
        found[str(path.relative_to(folder))] = without_times(json.loads(path.read_text()))
    return found
