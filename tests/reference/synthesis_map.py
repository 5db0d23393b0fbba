"""Compare the synthesis of motion, and the camera, with files of reference values.

    python -m tests.reference.synthesis_map FILE...

A file holds `meta.kind` and `cases`; what a kind's numbers mean stands in its `meta.definition`.
One line per failing value, a closing count, exit status 1 when any value fails or an entry has no
meaning here.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.optimize import brentq

from tests.reference import interpolation_map, synthesis_camera
from tests.reference.interpolation_map import Case, Check, Checks, Entries, unknown
from visavis.stimuli.motion.interpolation import KeyTimes, Squad
from visavis.stimuli.motion.rotations import quat_about
from visavis.stimuli.motion.spring import Spring
from visavis.stimuli.motion.synthesis.gap_filling import Hold, best_segment, fill_gap
from visavis.stimuli.motion.synthesis.hybrid import Controls, pose_counts
from visavis.stimuli.motion.synthesis.phrase_posture import CLASSES, Habits, Phrase, strongest
from visavis.stimuli.motion.synthesis.pose_distance import pose_distance
from visavis.stimuli.motion.synthesis.style_weights import fit_weights

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
    values = {
        "peak_s": peak_s,
        "overshoot": weight(peak_s) - 1.0,
        "max_weight": weight(peak_s),
        "second_undershoot": 1.0 - weight(undershoot_s),
        "half_way_s": half_s,
    }
    for name, got in values.items():
        yield Check(f"{where}.{name}", case[name], got, abs(case[name] - got) <= tol)


def _increments(where: str, case: Case) -> Iterator[Check]:
    counts = [pose_counts(case["clip"], i) for i in range(len(case["keys_by_increment"]))]
    values = {
        "keys_by_increment": [c.keys for c in counts],
        "segments_by_increment": [c.segments for c in counts],
        "authored_by_increment": [c.authored for c in counts],
        "old_keys_at": [list(c.kept) for c in counts],
    }
    for name, got in values.items():
        yield Check(f"{where}.{name}", case[name], got, case[name] == got)


GAP_ENTRIES = {
    "clip": {
        "mode", "source", "before", "after", "gap_frames", "window", "best_start", "distance",
        "second_best_gap", "fill",
    },
    "hold": {
        "mode", "p_end", "v_end", "p_next", "gap_s", "hold_value", "hold_from_s", "hold_to_s",
        "t_y",
    },
}  # fmt: skip


def check_gapfill(where: str, case: Case) -> Iterator[Check]:
    """Compare the filling of a gap by a piece of a source or by a hold."""
    mode = case["mode"]
    if mode not in GAP_ENTRIES:
        yield Check(f"{where}.mode", f"one of {sorted(GAP_ENTRIES)}", mode, False)
        return
    yield from unknown(where, case, GAP_ENTRIES[mode] | {"name", "tol"})
    values: dict[str, Any]
    if mode == "clip":
        source, before, after = (np.array(case[n]) for n in ("source", "before", "after"))
        gap = case["gap_frames"]
        best = best_segment(source, before, after, gap, case["window"])
        values = {
            "best_start": best.start,
            "distance": best.distance,
            "second_best_gap": best.runner_up,
            "fill": fill_gap(source, before, after, gap, best.start),
        }
    else:
        hold = Hold(case["p_end"], case["v_end"], case["p_next"], case["gap_s"])
        values = {
            "hold_value": hold.value,
            "hold_from_s": hold.from_s,
            "hold_to_s": hold.to_s,
            "t_y": [[t, float(hold.at(t))] for t, _ in case["t_y"]],
        }
    yield from _close(where, case, values)


def check_matching(where: str, case: Case) -> Iterator[Check]:
    """Compare how far made motions are from their targets."""
    apart = pose_distance(np.array(case["target"]), np.array(case["made"]))
    limits = {n: apart.matches(float(n.rsplit("_", 1)[1])) for n in case if "matches_at_" in n}
    values = {"mean_m": apart.mean_m, "sum_m": apart.sum_m, "samples": apart.samples, **limits}
    yield from _close(where, case, values)


POSTURE_ASKED = {
    "initial_com",
    "initial_yaw",
    "lexeme",
    "hand",
    "markov_com",
    "rules_com",
    "confidence_com",
    "p_com",
    "p_yaw",
    "p_joint",
}


def check_posture(where: str, case: Case) -> Iterator[Check]:
    """Compare what a speaker's posture does with the next phrase."""
    habits = Habits(
        tuple(Phrase(*p) for p in case["phrases"]),
        case["beta"],
        case["least_support"],
        case["least_confidence"],
    )
    for i, question in enumerate(case["ask"]):
        at = f"{where}.ask[{i}]"
        yield from unknown(at, question, POSTURE_ASKED)
        com, yaw = question["initial_com"], question["initial_yaw"]
        gesture = question["hand"], question["lexeme"]
        rules = habits.rules("com", *gesture)
        kept = {r.posture for r in rules}
        best = strongest("com", rules).tolist()
        values = {
            "rules_com": [list(rule) for rule in rules],
            "confidence_com": [
                b if c in kept else None for b, c in zip(best, CLASSES["com"], strict=True)
            ],
            "markov_com": habits.chain("com", com),
            "p_com": habits.probability("com", com, *gesture),
            "p_yaw": habits.probability("yaw", yaw, *gesture),
            "p_joint": habits.joint(com, yaw, *gesture),
        }
        yield from _close(at, {**question, "tol": case["tol"]}, values)


def check_weights(where: str, case: Case) -> Iterator[Check]:
    """Compare the weights of examples at points."""
    fitted = fit_weights(np.array(case["examples"]))
    yield from _close(where, case, {"condition": fitted.condition})
    for i, query in enumerate(case["queries"]):
        at = f"{where}.queries[{i}]"
        yield from unknown(at, query, {"p", "raw", "weights"})
        p = np.array(query["p"])
        values = {"raw": fitted.raw(p), "weights": fitted.at(p)}
        yield from _close(at, {**query, "tol": case["tol"]}, values)


def _close(where: str, case: Case, values: Mapping[str, Any]) -> Iterator[Check]:
    """Compare what a case states with what was found, within its tolerance."""
    for name, value in values.items():
        if name in case:
            got = value.tolist() if isinstance(value, np.ndarray) else value
            yield Check(f"{where}.{name}", case[name], got, _same(case[name], got, case["tol"]))


def _same(expected: Any, got: Any, tol: float) -> bool:
    """Tell whether nested lists are alike: numbers within tol, all else equal."""
    if isinstance(expected, list) and isinstance(got, list):
        pairs = zip(expected, got, strict=False)
        return len(expected) == len(got) and all(_same(e, g, tol) for e, g in pairs)
    if isinstance(expected, bool) or not isinstance(expected, int | float):
        return bool(expected == got)
    return isinstance(got, int | float) and abs(expected - got) <= tol


CHECKS: Checks = {
    "hybrid": check_hybrid,
    "gapfill": check_gapfill,
    "matching": check_matching,
    "posture": check_posture,
    "weights": check_weights,
    "camera": synthesis_camera.check_camera,
}
ENTRIES: Entries = {
    "hybrid": set().union(*HYBRID_ENTRIES.values()),
    "gapfill": set().union(*GAP_ENTRIES.values()),
    "matching": {"target", "made", "mean_m", "sum_m", "samples", "matches_at_0.06"},
    "posture": {"phrases", "beta", "least_support", "least_confidence", "ask"},
    "weights": {"examples", "condition", "queries"},
    "camera": synthesis_camera.ENTRIES,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the comparison and return the exit status."""
    return interpolation_map.main(arguments, CHECKS, ENTRIES)


if __name__ == "__main__":
    raise SystemExit(main())
