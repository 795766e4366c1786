"""Make ``gate.stl``, the plate that holds the column of ``column.yaml`` back: a closed box, in metres, its frame in its middle.

Run it with ``python config/meshes/make_gate.py``.
"""

from pathlib import Path

import trimesh

SIZE = (0.006, 0.068, 0.2)  # x, y, z; reaches a little into the side walls, so that no grain slips past

if __name__ == "__main__":
    trimesh.creation.box(SIZE).export(Path(__file__).with_name("gate.stl"))
