"""Compare the interpolation of key poses with files of reference vectors.

    python -m tests.reference.interpolation_map FILE...

A file holds `meta.kind` (slerp, squad, lineuler, spring, mirror) and `cases`. Every entry of a
case is mapped to a public call of `visavis.stimuli.motion`; one line per failing value, a closing
count, exit status 1 when any value fails or an entry has no meaning here.
"""

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from visavis.lab.errors import LabError
from visavis.stimuli.motion.interpolation import Interpolation, KeyTimes, LinEuler, Slerp, Squad
from visavis.stimuli.motion.rotations import mirrored_quat
from visavis.stimuli.motion.spring import Spring

Case = Mapping[str, Any]
Checks = Mapping[str, Callable[[str, Case], Iterator["Check"]]]
Entries = Mapping[str, set[str]]

ENTRIES = {
    "slerp": {"p", "q", "h", "expected"},
    "squad": {"mode", "keys", "samples", "large_step_trap", "equals_slerp"},
    "lineuler": {"order", "e0", "e1", "h", "expected"},
    "spring": {"x0", "v0", "omega", "zeta", "time_scale", "t_x_v"},
    "mirror": {"axis", "q", "expected"},
}
SAMPLE_ENTRIES = {"segment", "h", "expected", "wrong_if_inner_slerp_flips"}


@dataclass(frozen=True)
class Check:
    """One value: where it stands, what was expected, what came, whether that is right."""

    where: str
    expected: object
    got: object
    passed: bool


def same_rotation(expected: Any, got: Any, tol: float) -> bool:
    """Tell whether quaternions agree in every component, up to their common sign."""
    a, b = np.asarray(expected, dtype=np.float64), np.asarray(got, dtype=np.float64)
    if a.shape != (4,) or b.shape != (4,):
        return False
    return bool(min(np.abs(a - b).max(), np.abs(a + b).max()) <= tol)


def _rotations(where: str, expected: Any, got: Any, tol: float) -> Iterator[Check]:
    if len(expected) != len(got):
        yield Check(where, f"{len(expected)} values", f"{len(got)} values", False)
        return
    for i, (e, g) in enumerate(zip(expected, got, strict=True)):
        yield Check(f"{where}[{i}]", e, np.asarray(g).tolist(), same_rotation(e, g, tol))


def _between(where: str, curve: Interpolation, case: Case) -> Iterator[Check]:
    yield from _rotations(where, case["expected"], curve.at(case["h"]), case["tol"])


def check_slerp(where: str, case: Case) -> Iterator[Check]:
    """Go from p to q in one second, beyond the ends too."""
    times = KeyTimes(np.array([0.0, 1.0]), extrapolate=True)
    yield from _between(where, Slerp(times, np.array([case["p"], case["q"]])), case)


def check_lineuler(where: str, case: Case) -> Iterator[Check]:
    """Blend raw angles from e0 to e1 in one second."""
    times = KeyTimes(np.array([0.0, 1.0]), extrapolate=True)
    keys = np.radians([case["e0"], case["e1"]])
    yield from _between(where, LinEuler(times, keys, case["order"]), case)


def check_squad(where: str, case: Case) -> Iterator[Check]:
    """Pass through keys one second apart; say so where a flipped inner arc would have passed."""
    keys, tol = np.array(case["keys"]), case["tol"]
    period_s = {"open": None, "closed": float(len(keys))}[case["mode"]]
    times = KeyTimes(np.arange(len(keys), dtype=np.float64), period_s)
    curve, arc = Squad(times, keys), Slerp(times, keys)
    inner = range(1, len(keys) - 2) if period_s is None else range(len(keys))
    wrong_values = 0
    for i, sample in enumerate(case["samples"]):
        at = f"{where}.samples[{i}]"
        yield from unknown(at, sample, SAMPLE_ENTRIES)
        got = curve.in_segment(sample["segment"], sample["h"])
        same = same_rotation(sample["expected"], got, tol)
        yield Check(f"{at}.expected", sample["expected"], got.tolist(), same)
        wrong = sample.get("wrong_if_inner_slerp_flips")
        if wrong is not None:
            wrong_values += 1
            away = same_rotation(wrong, sample["expected"], tol) or not same_rotation(
                wrong, got, tol
            )
            yield Check(f"{at}.wrong_if_inner_slerp_flips", f"not {wrong}", got.tolist(), away)
        if case.get("equals_slerp") and sample["segment"] in inner:
            on_arc = arc.in_segment(sample["segment"], sample["h"])
            same = same_rotation(on_arc, got, tol)
            yield Check(f"{at}.equals_slerp", on_arc.tolist(), got.tolist(), same)
    if "large_step_trap" in case:
        trap = bool(case["large_step_trap"])
        fits = trap or wrong_values == 0
        yield Check(f"{where}.large_step_trap", trap, f"{wrong_values} wrong values given", fits)


def check_spring(where: str, case: Case) -> Iterator[Check]:
    """Follow the spring in closed form."""
    spring = Spring(case["omega"], case["zeta"], case["time_scale"])
    rows = np.array(case["t_x_v"])
    x, v = spring.at(rows[:, 0], case["x0"], case["v0"])
    for i, (_, *expected) in enumerate(rows.tolist()):
        for name, e, g in zip("xv", expected, (float(x[i]), float(v[i])), strict=True):
            yield Check(f"{where}.t_x_v[{i}].{name}", e, g, abs(e - g) <= case["tol"])


def check_mirror(where: str, case: Case) -> Iterator[Check]:
    """Reflect across the plane square to the axis."""
    got = mirrored_quat(np.array(case["q"]), case["axis"])
    yield from _rotations(where, [case["expected"]], [got], case["tol"])


CHECKS: Checks = {
    "slerp": check_slerp,
    "squad": check_squad,
    "lineuler": check_lineuler,
    "spring": check_spring,
    "mirror": check_mirror,
}


def unknown(where: str, entries: Case, known: set[str]) -> Iterator[Check]:
    for name in entries.keys() - known:
        yield Check(f"{where}.{name}", "a known entry", "no call for this entry", False)


def run_file(path: Path, checks_of: Checks = CHECKS, entries: Entries = ENTRIES) -> list[Check]:
    """Compare all cases of one file; an error counts as a failure of its case.

    `checks_of` leads from a kind to what compares its cases, `entries` to what they may hold.
    """
    try:
        file = json.loads(path.read_text(encoding="utf-8"))
        kind, cases = file["meta"]["kind"], list(file["cases"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        return [Check(path.name, "a file of cases", f"{type(error).__name__}: {error}", False)]
    if kind not in checks_of:
        return [Check(path.stem, f"a kind of {sorted(checks_of)}", kind, False)]
    checks: list[Check] = []
    if not cases:
        checks.append(Check(path.stem, "at least one case", "none", False))
    for i, case in enumerate(cases):
        if not isinstance(case, Mapping):
            checks.append(Check(f"{path.stem} [{i}]", "a case", case, False))
            continue
        where = f"{path.stem} {case.get('name', i)}"
        checks += unknown(where, case, entries[kind] | {"name", "tol"})
        try:
            checks += checks_of[kind](where, case)
        except (LabError, KeyError, TypeError, ValueError, IndexError) as error:
            checks.append(Check(where, "a result", f"{type(error).__name__}: {error}", False))
    return checks


def main(
    arguments: Sequence[str] | None = None, checks_of: Checks = CHECKS, entries: Entries = ENTRIES
) -> int:
    """Run the comparison and return the exit status."""
    parser = argparse.ArgumentParser(description="Compare files of reference values with ours.")
    parser.add_argument("files", nargs="+", type=Path)
    files = parser.parse_args(arguments).files
    checks = [check for path in files for check in run_file(path, checks_of, entries)]
    failed = [check for check in checks if not check.passed]
    for check in failed:
        sys.stdout.write(f"FAIL {check.where}: expected {check.expected}, got {check.got}\n")
    sys.stdout.write(f"{len(checks)} values compared in {len(files)} files, {len(failed)} failed\n")
    return 1 if failed else 0


if __name__ == "__main__":
    raise SystemExit(main())
