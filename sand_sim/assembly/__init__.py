"""From a checked Scene to arrays: meshes of tools, bodies and terrains, walls, the domain, and what puts them together."""
