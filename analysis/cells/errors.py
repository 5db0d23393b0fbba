"""Name what is wrong with positions, paths and sets of cells."""

from visavis.lab.errors import DataError


class CellError(DataError):
    """Positions or paths that cannot be triangulated or walked; base of the named errors below."""


class MalformedPositions(CellError):
    """Positions are not an (n, 2) array of finite numbers within a kilometre."""


class SamePlace(CellError):
    """Two people stand at the same place."""


class AllInLine(CellError):
    """All people stand on one line, so there is no cell."""


class Cocircular(CellError):
    """Four people stand on one circle, so the triangulation is not unique."""


class TooFewPeople(CellError):
    """There are too few participants, or not the same ones, for a comparison."""
