"""The entities of a recording are those that ``docs/python.md`` tells of."""

import re
from pathlib import Path
from types import SimpleNamespace

import pytest
from scenes import write_small_scene

from sand_sim import World, load_scene

pytest.importorskip("rerun")

from sand_sim.sinks.drawing import Drawing

DOCUMENT = Path(__file__).parents[1] / "docs" / "python.md"


def test_all_that_is_drawn_is_told_of(tmp_path):
    press = {"type": "plunger", "name": "press", "material": "steel", "point": [0, 0, 0.2], "normal": [0, 0, -1], "velocity": 0.0}
    path = write_small_scene(tmp_path)
    scene = path.read_text()
    path.write_text(scene.replace("boundaries:\n", f"boundaries:\n- {press}\n"))
    world, drawn = World(load_scene(path)), set()
    stream = SimpleNamespace(
        log=lambda entity, *_, **__: drawn.add(entity), set_time=lambda *_, **__: None, send_blueprint=lambda *_, **__: None
    )
    Drawing(world, stream, particles=True).write(world.observe())
    table = DOCUMENT.read_text().partition("| entity | |")[2]
    told = {name for row in re.findall(r"^\| (`.*?`) \|", table, re.MULTILINE) for name in re.findall(r"`([^`]+)`", row)}
    named = {name.replace("TOOL", "plate").replace("PLUNGER", "press") for name in told}
    walls = {name for name in drawn if name.startswith("world/walls/")}
    assert walls == {"world/walls/press"}, "planes have no end"
    assert drawn - walls - {"world"} == named - {"world/walls/WALL"}
