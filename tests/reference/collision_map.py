"""Compare collision volumes, collisions over time, cells and Dice with files of known answers.

    python -m tests.reference.collision_map FILE...

Every entry is mapped to public calls; one line per failing value, a closing count, exit status 1
when any value fails, an entry has no call or lacks what it needs, or a file holds no entry. Fields
that nothing is compared with are named. The README beside the files tells their format.
"""

import argparse
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tests.reference.cells_map import ANGLE_FIELDS, check_cells, check_dice
from tests.reference.stats_compare import Failure, Outcome, total
from visavis.analysis.collisions import (
    ClosedMesh,
    Settings,
    box,
    capsule,
    common_volume,
    find_collisions,
    inside_out,
    mesh_in_pose,
    sphere,
    union,
)
from visavis.lab.errors import LabError

EXACT_REL = 1e-9
DEFAULT_REL = 0.04
DEFAULT_REL_SMALL = 0.10
SMALL_M3 = 5e-6
"""What rule `volume` promises as shipped, beside what an exact integration must reach."""
ZERO_M3 = 1e-12
MESH_REL = 0.01
"""Of inscribed meshes with 96 segments and 24 rings, where a case names no tolerance."""
SERIES_REL = 5e-3
SERIES_TIME_S = 1e-9
SEGMENTS, RINGS = 96, 24
SERIES_SEGMENTS, SERIES_RINGS = 256, 64
SERIES = Settings(cell_m=0.01, refine_below_m3=1.0, fine_columns=8000)
"""Columns fine enough that a time series of thousands of pairs takes seconds."""
DESCRIPTIONS = {"id", "family", "how", "note", "gap", "angle_deg", "degenerate", "tie_rule"}
"""Fields that tell about a case; nothing is compared with them."""
FIELDS = {
    "volume": {
        "a", "b", "volume", "volume_mesh_96x48", "tol_rel_mesh_96x48", "even_odd_wrong", "contact",
        "voxel", "voxels_touching_both", "voxel_centres_in_both", "reported_voxels",
    },
    "events": {
        "participant", "dt", "samples", "threshold", "min_duration", "characters", "events",
        "n_counted",
    },
    "cells": {
        "characters", "path", "cells", "crossings", "cell_set_size", "shoulder_axis",
        "alpha_sa_deg",
    },
    "dice": {"a", "b", "dice"},
}  # fmt: skip
"""Fields that are read, by the field that tells a case's kind."""


def run_file(path: Path) -> Outcome:
    """Compare all entries of one file."""
    try:
        file = json.loads(path.read_text(encoding="utf-8"))
        cases = [*file.get("cases", ()), *file.get("dice", ())]
    except (OSError, ValueError, AttributeError, TypeError) as error:
        return Outcome(1, (Failure(path.name, "a file of cases", _said(error)),))
    if not cases:
        return Outcome(1, (Failure(path.name, "a file of cases", "none in it"),))
    return total(_run(f"{path.stem} {_name(case, i)}", case) for i, case in enumerate(cases))


def not_compared(path: Path) -> tuple[str, ...]:
    """Return the fields of a readable file's cases that this runner compares nothing with."""
    file = json.loads(path.read_text(encoding="utf-8"))
    cases = [*file.get("cases", ()), *file.get("dice", ())]
    known = {k: FIELDS.get(_kind(case) or "", set()) for k, case in enumerate(cases)}
    return tuple(sorted({f for k, c in enumerate(cases) for f in set(c) - DESCRIPTIONS - known[k]}))


def without_angles(path: Path) -> tuple[str, ...]:
    """Return the names of cases of cells that lack the shoulders or the angles to them."""
    cases = json.loads(path.read_text(encoding="utf-8")).get("cases", ())
    return tuple(
        _name(case, i)
        for i, case in enumerate(cases)
        if _kind(case) == "cells" and not ANGLE_FIELDS <= case.keys()
    )


def _name(case: Any, i: int) -> str:
    return str(case.get("id", i)) if isinstance(case, Mapping) else str(i)


def _kind(case: Any) -> str | None:
    return next((kind for kind in FIELDS if kind in case), None)


def _run(where: str, case: Any) -> Outcome:
    calls: dict[str, Callable[[str, Mapping[str, Any]], Outcome]] = {
        "volume": check_volume,
        "events": check_series,
        "cells": check_cells,
        "dice": check_dice,
    }
    kind = _kind(case) if isinstance(case, Mapping) else None
    if kind is None:
        got = sorted(case) if isinstance(case, Mapping) else case
        return Outcome(1, (Failure(where, "a known kind of case", got),))
    try:
        return calls[kind](where, case)
    except (LabError, KeyError, TypeError, ValueError, IndexError) as error:
        return Outcome(1, (Failure(where, "a result", _said(error)),))


def _said(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"


def check_volume(where: str, case: Mapping[str, Any]) -> Outcome:
    """Compare a pair of bodies by every rule the case has an answer for."""
    a, b = body_of(case["a"]), body_of(case["b"])
    is_boxes = all(shape["type"] == "box" for shape in (*case["a"], *case["b"]))
    tolerance = case.get("tol_rel_mesh_96x48", EXACT_REL if is_boxes else MESH_REL)
    exact = common_volume(a, b, settings=Settings(always_exact=True))
    shipped = common_volume(a, b)
    expected = case["volume"]
    seen = [
        _near(f"{where}.volume", expected, exact.volume_m3, tolerance),
        _near(
            f"{where}.volume by default settings",
            exact.volume_m3,
            shipped.volume_m3,
            DEFAULT_REL if exact.volume_m3 > SMALL_M3 else DEFAULT_REL_SMALL,
        ),
    ]
    if "volume_mesh_96x48" in case:
        meshed = case["volume_mesh_96x48"]
        seen.append(_near(f"{where}.volume_mesh", meshed, exact.volume_m3, tolerance))
    if is_boxes:
        seen.append(_near(f"{where}.volume of boxes", expected, exact.volume_m3, EXACT_REL))
    if "even_odd_wrong" in case:
        wrong = case["even_odd_wrong"]
        nearer = abs(exact.volume_m3 - expected) < abs(exact.volume_m3 - wrong)
        seen.append(_same(f"{where}.nearer to winding than even-odd", True, nearer))
    if "voxel" in case:
        seen += _check_cubes(where, case, a, b)
    elif "contact" in case:
        seen.append(_same(f"{where}.contact", case["contact"], exact.contact))
    return total(seen)


def _check_cubes(
    where: str, case: Mapping[str, Any], a: ClosedMesh, b: ClosedMesh
) -> list[Outcome]:
    side = case["voxel"]
    published = common_volume(a, b, "published", settings=Settings(cell_m=side))
    loose = Settings(cell_m=side, require_contact=False)
    touching = common_volume(a, b, "published", settings=loose)
    centres = common_volume(a, b, "centres", settings=Settings(cell_m=side))
    cube = side**3
    return [
        _same(f"{where}.voxels_touching_both", case["voxels_touching_both"], touching.n_cells),
        _same(f"{where}.voxel_centres_in_both", case["voxel_centres_in_both"], centres.n_cells),
        _same(f"{where}.reported_voxels", case["reported_voxels"], published.n_cells),
        _same(f"{where}.contact", case["contact"], published.contact),
        _near(
            f"{where}.published volume",
            case["reported_voxels"] * cube,
            published.volume_m3,
            EXACT_REL,
        ),
        _near(
            f"{where}.centres volume",
            case["voxel_centres_in_both"] * cube,
            centres.volume_m3,
            EXACT_REL,
        ),
    ]


def check_series(where: str, case: Mapping[str, Any]) -> Outcome:
    """Move a sphere past others and compare the collisions found."""
    mover = case["participant"]
    participant = _round(mover["start"], mover["r"])
    others = [_round(c["c"], c["r"]) for c in case["characters"]]
    steps = np.arange(case["samples"])
    places = np.asarray(mover["velocity"]) * (steps * case["dt"])[:, None]
    volumes = np.zeros((len(steps), len(others)))
    for j, (character, other) in enumerate(zip(case["characters"], others, strict=True)):
        apart = np.linalg.norm(np.asarray(mover["start"]) + places - character["c"], axis=1)
        for i in np.flatnonzero(apart < mover["r"] + character["r"] + 0.01):
            moved = mesh_in_pose(participant, participant.vertices_m + places[i])
            volumes[i, j] = common_volume(moved, other, settings=SERIES).volume_m3
    t_ns = np.rint(steps * case["dt"] * 1e9).astype(np.int64)
    found = find_collisions(
        t_ns,
        volumes,
        "volume",
        threshold_m3=case["threshold"],
        min_duration_ns=round(case["min_duration"] * 1e9),
    )
    seen = [
        _same(f"{where}.n_counted", case["n_counted"], sum(c.counted for c in found)),
        _same(f"{where}.events", len(case["events"]), len(found)),
    ]
    order = sorted(case["events"], key=lambda e: (e["start"], e["character"]))
    for i, (event, got) in enumerate(zip(order, found, strict=False)):
        at = f"{where}.events[{i}]"
        seen += [
            _same(f"{at}.character", event["character"], got.character),
            _close(f"{at}.start", event["start"], got.start_ns / 1e9, SERIES_TIME_S),
            _close(f"{at}.end", event["end"], got.end_ns / 1e9, SERIES_TIME_S),
            _same(f"{at}.samples", event["samples"], got.n_steps),
            _close(f"{at}.duration", event["duration"], got.duration_s, SERIES_TIME_S),
            _same(f"{at}.counted", event["counted"], got.counted),
            _near(f"{at}.max_volume", event["max_volume"], got.max_volume_m3, SERIES_REL),
        ]
    return total(seen)


def body_of(shapes: Sequence[Mapping[str, Any]]) -> ClosedMesh:
    """Tessellate a body as the files prescribe."""
    parts = []
    for shape in shapes:
        if shape["type"] == "box":
            part = box(shape["c"], shape["half"], np.asarray(shape.get("R", np.eye(3))))
        elif shape["type"] == "sphere":
            part = sphere(shape["c"], shape["r"], segments=SEGMENTS, rings=RINGS)
        elif shape["type"] == "capsule":
            part = capsule(shape["p"], shape["q"], shape["r"], segments=SEGMENTS, rings=RINGS)
        else:
            raise LabError(f"unknown shape {shape['type']!r}; the map needs a call for it")
        parts.append(inside_out(part) if shape.get("inverted") else part)
    return union(parts)


def _round(centre: Sequence[float], radius: float) -> ClosedMesh:
    """Return a fine sphere whose surface lies within and without the true one in equal parts."""
    bulge = 1 - 2 / 3 * (np.pi / SERIES_SEGMENTS) ** 2  # facets lie deeper, on average
    return sphere(
        np.asarray(centre, float), radius / bulge, segments=SERIES_SEGMENTS, rings=SERIES_RINGS
    )


def _near(where: str, expected: float, got: float, relative: float) -> Outcome:
    return _close(where, expected, got, max(relative * abs(expected), ZERO_M3))


def _close(where: str, expected: float, got: float, allowed: float) -> Outcome:
    return Outcome(1, () if abs(got - expected) <= allowed else (Failure(where, expected, got),))


def _same(where: str, expected: object, got: object) -> Outcome:
    return Outcome(1, () if expected == got else (Failure(where, expected, got),))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the comparison and return the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("files", nargs="+", type=Path)
    options = parser.parse_args(arguments)
    outcomes = []
    for path in options.files:
        outcomes.append(run_file(path))
        for failure in outcomes[-1].failures:
            sys.stdout.write(f"{failure}\n")
        if outcomes[-1].compared > len(outcomes[-1].failures):
            for field in not_compared(path):
                sys.stdout.write(f"{path.stem}: nothing is compared with field {field!r}\n")
            for name in without_angles(path):
                sys.stdout.write(f"{path.stem} {name}: no angles to the shoulders compared\n")
    summed = total(outcomes)
    sys.stdout.write(
        f"{summed.compared} values compared in {len(outcomes)} files, "
        f"{len(summed.failures)} failed\n"
    )
    return 1 if summed.failures else 0


if __name__ == "__main__":
    raise SystemExit(main())
