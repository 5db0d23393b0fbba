"""Compare cells, crossings and Dice with the known answers of one case."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from tests.reference.stats_compare import Failure, Outcome, total
from visavis.analysis.cells import gap_angles_deg, group_dice, triangulate, walk

PLACE_M = 1e-9
ANGLE_DEG = 1e-6
ANGLE_FIELDS = frozenset({"shoulder_axis", "alpha_sa_deg"})
"""Angles to the shoulders are compared where a case holds both; it is named where it holds one."""


def check_cells(where: str, case: Mapping[str, Any]) -> Outcome:
    """Walk the path and compare cells, crossings, set size and angles."""
    triangulation = triangulate(case["characters"])
    path = walk(triangulation, case["path"])
    cells = [None if c is None else list(c) for c in path.cells]
    expected = [None if c is None else sorted(c) for c in case["cells"]]
    seen = [
        _same(f"{where}.cells", expected, cells),
        _same(f"{where}.cell_set_size", case["cell_set_size"], len(path.cell_set)),
        _same(f"{where}.crossings", len(case["crossings"]), len(path.crossings)),
    ]
    for i, (wanted, got) in enumerate(zip(case["crossings"], path.crossings, strict=False)):
        at = f"{where}.crossings[{i}]"
        seen += [
            _same(f"{at}.edge", sorted(wanted["edge"]), list(got.edge)),
            _close(f"{at}.at", wanted["at"], got.at_m, PLACE_M),
            _close(f"{at}.s", wanted["s"], got.s, PLACE_M),
            _same(f"{at} leaves the cell entered last", path.cells[i], got.before),
        ]
    if ANGLE_FIELDS <= case.keys():
        gap, _ = gap_angles_deg(triangulation, path.crossings, case["shoulder_axis"])
        seen.append(_close(f"{where}.alpha_sa_deg", case["alpha_sa_deg"], gap, ANGLE_DEG))
    return total(seen)


def check_dice(where: str, case: Mapping[str, Any]) -> Outcome:
    """Compare Dice's coefficient of two groups of paths, by the union of their cells."""
    a, b = ([frozenset(map(_hashable, path)) for path in case[side]] for side in ("a", "b"))
    got = group_dice(a, b)
    return _close(f"{where}.dice", case["dice"], got, 1e-12)


def _hashable(cell: Any) -> Any:
    """Return a cell as it can stand in a set: corners in rising order, or as it is."""
    return tuple(sorted(cell)) if isinstance(cell, list) else cell


def _close(where: str, expected: Any, got: Any, allowed: float) -> Outcome:
    fits = np.shape(expected) == np.shape(got) and np.allclose(got, expected, rtol=0, atol=allowed)
    return Outcome(1, () if fits else (Failure(where, expected, got),))


def _same(where: str, expected: object, got: object) -> Outcome:
    return Outcome(1, () if expected == got else (Failure(where, expected, got),))
