"""Mesh files of all kinds, where they lie and what is refused of them."""
