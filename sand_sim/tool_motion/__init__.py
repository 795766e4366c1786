"""Where tools go: single commands, the way between two of them, trajectories of scenes."""
