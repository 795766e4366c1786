"""Mending a mesh: cracks, turned faces, holes."""
