"""The one error of this package."""


class MeshError(ValueError):
    """A mesh that cannot become a body; the message names the file, the reason and the way out."""
