"""Error against run time: runs of a scene with its choices varied, compared with a reference."""
