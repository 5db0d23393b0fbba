"""Name what is wrong with meshes and series; every message says which and what to do."""

from visavis.lab.errors import DataError


class CollisionError(DataError):
    """Meshes or series that cannot be measured; base of the named errors below."""


class NonFiniteMesh(CollisionError):
    """A vertex is NaN or infinite."""


class MalformedMesh(CollisionError):
    """Arrays have the wrong shape, or a face names a vertex that is not there."""


class OpenMesh(CollisionError):
    """The surface has a hole too large to close without inventing a body."""


class NotOrientable(CollisionError):
    """No choice of sides makes neighbouring faces agree."""


class TooLargeForVoxels(CollisionError):
    """The common box of two meshes holds more voxels than memory allows."""


class MalformedSeries(CollisionError):
    """Times and volumes of a series do not fit each other."""
