"""Compare the synthesis of motion, and the camera, with files of reference values.

    python -m tests.reference.synthesis_map FILE...

A file holds `meta.kind` and `cases`; what a kind's numbers mean stands in its `meta.definition`.
One line per failing value, a closing count, exit status 1 when any value fails or an entry has no
meaning here.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.optimize import brentq

from stimuli.motion.hybrid import Controls, pose_counts
from stimuli.motion.interpolation import KeyTimes, Squad
from stimuli.motion.rotations import quat_about
from stimuli.motion.spring import Spring
from tests.reference import interpolation_map, synthesis_camera
from tests.reference.interpolation_map import Case, Check, Checks, Entries, unknown

HYBRID_ENTRIES = {
    "one_axis": {"mode", "axis", "angles_deg", "closed", "even_times", "samples"},
    "crouch": {
        "mode", "omega", "zeta", "time_scale", "peak_s", "overshoot", "max_weight",
        "second_undershoot", "half_way_s",
    },
    "increments": {
        "mode", "clip", "keys_by_increment", "segments_by_increment", "authored_by_increment",
        "old_keys_at",
    },
}  # fmt: skip
VARIANTS: dict[str, Controls] = {"squad_deg": "shoemake", "thesis_deg": "neighbours"}
SAMPLE_ENTRIES = {"segment", "h", "squad_deg", "thesis_deg", "skip"}
KEY_S = 1.0


def check_hybrid(where: str, case: Case) -> Iterator[Check]:
    """Compare a motion of few poses by the case's mode."""
    mode = case["mode"]
    if mode not in HYBRID_ENTRIES:
        yield Check(f"{where}.mode", f"one of {sorted(HYBRID_ENTRIES)}", mode, False)
        return
    yield from unknown(where, case, HYBRID_ENTRIES[mode] | {"name", "tol"})
    yield from {"one_axis": _one_axis, "crouch": _crouch, "increments": _increments}[mode](
        where, case
    )


def _one_axis(where: str, case: Case) -> Iterator[Check]:
    angles = np.radians(case["angles_deg"])
    if not (case["closed"] and case["even_times"]):
        yield Check(where, "a closed round of even times", "another", False)
        return
    times = KeyTimes(np.arange(len(angles)) * KEY_S, len(angles) * KEY_S)
    keys = quat_about(case["axis"], angles)
    for name, controls in VARIANTS.items():
        curve = Squad(times, keys[:, None], controls=controls)
        for i, sample in enumerate(case["samples"]):
            at = f"{where}.samples[{i}]"
            yield from unknown(at, sample, SAMPLE_ENTRIES)
            if sample.get(name) is None:
                continue
            got = curve.in_segment(sample["segment"], sample["h"])[0]
            wanted = quat_about(case["axis"], np.radians(sample[name]))
            # By the chord, since a cosine near 1 holds no more than 1e-6 degrees.
            chord = min(np.linalg.norm(got - wanted), np.linalg.norm(got + wanted))
            off_deg = float(np.degrees(4 * np.arcsin(chord / 2)))
            yield Check(f"{at}.{name}", sample[name], f"{off_deg} deg away", off_deg <= case["tol"])


def _crouch(where: str, case: Case) -> Iterator[Check]:
    spring = Spring(case["omega"], case["zeta"], case["time_scale"])

    def weight(t_s: float) -> float:
        return 1.0 - float(spring.at(t_s)[0])

    def speed(t_s: float) -> float:
        return float(spring.at(t_s)[1])

    tol = case["tol"]
    peak_s = brentq(speed, 0.01, 0.9, xtol=1e-14)
    undershoot_s = brentq(speed, peak_s + 0.01, 2 * peak_s + 0.1, xtol=1e-14)
    half_s = brentq(lambda t_s: weight(t_s) - 0.5, 0.01, peak_s, xtol=1e-14)
    found = {
        "peak_s": peak_s,
        "overshoot": weight(peak_s) - 1.0,
        "max_weight": weight(peak_s),
        "second_undershoot": 1.0 - weight(undershoot_s),
        "half_way_s": half_s,
    }
    for name, got in found.items():
        yield Check(f"{where}.{name}", case[name], got, abs(case[name] - got) <= tol)


def _increments(where: str, case: Case) -> Iterator[Check]:
    counts = [pose_counts(case["clip"], i) for i in range(len(case["keys_by_increment"]))]
    found = {
        "keys_by_increment": [c.keys for c in counts],
        "segments_by_increment": [c.segments for c in counts],
        "authored_by_increment": [c.authored for c in counts],
        "old_keys_at": [list(c.kept) for c in counts],
    }
    for name, got in found.items():
        yield Check(f"{where}.{name}", case[name], got, case[name] == got)


CHECKS: Checks = {"hybrid": check_hybrid, "camera": synthesis_camera.check_camera}
ENTRIES: Entries = {
    "hybrid": set().union(*HYBRID_ENTRIES.values()),
    "camera": synthesis_camera.ENTRIES,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the comparison and return the exit status."""
    return interpolation_map.main(arguments, CHECKS, ENTRIES)


if __name__ == "__main__":
    raise SystemExit(main())
