"""Compare the detectors on made-up gaze of people in a headset, whose events are known.

    python -m benchmarks.gaze_detectors.headset [--json]

Heads that do not turn, and that turn by up to 60 and 200°/s; noise of 0.1 to 0.5° from sample to
sample; eyes paired with the head of their own moment, and of 12 and 30 ms later
(`benchmarks.gaze_detectors.worn`). Half of the rows hold fixations alone, half pursuit as well.
Printed are event F1 of fixations, how many are found for each there is, how long they are for
what they last, and the share of resting gaze called pursuit. "Smoothed I-VT" is the best of
`benchmarks.gaze_detectors.smoothed` for each row. `auto without the head` was not given the eye in
the head. Returns 1 where `auto` misses a limit.
"""

import argparse
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product

import numpy as np

from benchmarks.gaze_detectors.agreement import agreement, runs_of
from benchmarks.gaze_detectors.smoothed import SMOOTHED, Labels
from benchmarks.gaze_detectors.smoothed import Detect as OfWorld
from benchmarks.gaze_detectors.worn import Wearing, WornRecording, worn_set
from visavis.analysis.gaze.events import IVT_MOVING_HEAD, IVT_SCREEN, detect_ivt
from visavis.analysis.gaze.movements.detect import detect_movements
from visavis.analysis.gaze.movements.kinds import Movement
from visavis.analysis.gaze.movements.parameters import AUTO

PEOPLE = 6
NOISES_DEG = (0.1, 0.3, 0.5)
HEADS = ((0.0, 0.0), (60.0, 12.0), (200.0, 0.0), (200.0, 12.0), (200.0, 30.0))
PURSUITS_01 = (0.0, 0.4)
MAX_FALSE_PURSUIT_01, COUNTS = 0.05, (0.85, 1.15)
BEST = "smoothed I-VT, best"

Detect = Callable[[WornRecording], Labels]


def _adaptive(name: str) -> Detect:
    params = replace(AUTO, detector=name)  # type: ignore[arg-type]  # names of the table below
    return lambda r: detect_movements(r.t_ns, r.in_world, params, in_head=r.in_head).movement


DETECTORS: Mapping[str, Detect] = {
    "auto": _adaptive("auto"),
    "auto without the head": lambda r: detect_movements(r.t_ns, r.in_world).movement,
    "Nyström-Holmqvist": _adaptive("nystrom_holmqvist"),
    "I2MC": _adaptive("i2mc"),
    "IVT_SCREEN": lambda r: detect_ivt(r.t_ns, r.in_world, IVT_SCREEN).in_fixation.astype("i1"),
    "IVT_MOVING_HEAD": lambda r: detect_ivt(r.t_ns, r.in_world, IVT_MOVING_HEAD).in_fixation.astype(
        "i1"
    ),
}


def _of_world(detect: OfWorld) -> Detect:
    return lambda r: detect(r.t_ns, r.in_world)


@dataclass(frozen=True)
class Row:
    """One detector on one way of wearing; shares of pursuit are NaN where it calls nothing so."""

    pursuit_01: float
    noise_deg: float
    head_deg_s: float
    late_ms: float
    detector: str
    fixation_f1: float
    count_ratio: float
    length_ratio: float
    false_pursuit_01: float
    true_pursuit_01: float


def measured(wearing: Wearing, name: str, recordings: Sequence[WornRecording], of: Detect) -> Row:
    """Return how a detector does on some recordings."""
    called = [of(r) for r in recordings]
    truth = [r.truth.movement for r in recordings]
    fixations = [[x == Movement.FIXATION for x in labels] for labels in (truth, called)]
    fit = agreement(*fixations)
    lengths = [
        np.mean([end - first for one in labels for first, end in runs_of(one)] or [np.nan])
        for labels in fixations
    ]
    true, seen = np.concatenate(truth), np.concatenate(called)
    pursues = seen == Movement.PURSUIT
    is_pursuit = true == Movement.PURSUIT
    return Row(
        wearing.pursuit_01,
        wearing.noise_deg,
        wearing.head_deg_s,
        wearing.late_ms,
        name,
        fit.f1,
        fit.count_ratio,
        float(lengths[1] / lengths[0]),
        float(pursues[true == Movement.FIXATION].mean()),
        float(pursues[is_pursuit].mean()) if is_pursuit.any() else np.nan,
    )


def rows_of(people: int = PEOPLE) -> list[Row]:
    """Return the table."""
    rows = []
    for pursuit_01, noise_deg, (head, late) in product(PURSUITS_01, NOISES_DEG, HEADS):
        wearing = Wearing(head, noise_deg, late, pursuit_01=pursuit_01)
        recordings = worn_set(wearing, people)
        rows += [measured(wearing, name, recordings, of) for name, of in DETECTORS.items()]
        others = [measured(wearing, BEST, recordings, _of_world(of)) for of in SMOOTHED.values()]
        rows.append(max(others, key=lambda row: row.fixation_f1))
    return rows


def missed(rows: Sequence[Row]) -> list[str]:
    """Return where `auto` misses a limit."""
    return [
        f"{r.head_deg_s:.0f}°/s, {r.noise_deg}°, {r.late_ms:.0f} ms, pursuit {r.pursuit_01}"
        for r in rows
        if r.detector == "auto"
        and not (
            r.false_pursuit_01 <= MAX_FALSE_PURSUIT_01 and COUNTS[0] <= r.count_ratio <= COUNTS[1]
        )
    ]


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; return 1 when a limit is missed."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--json", action="store_true", help="print JSON")
    options = parser.parse_args(arguments)
    rows = rows_of()
    if options.json:
        print(json.dumps([asdict(r) for r in rows], indent=1, ensure_ascii=False))
    else:
        heads = ("F1", "found", "length", "false p.", "true p.")
        columns = " ".join(f"{head:>8}" for head in heads)
        print(f"pursuit noise head °/s late ms  {'detector':<25} {columns}")
        for r in rows:
            figures = (
                r.fixation_f1,
                r.count_ratio,
                r.length_ratio,
                r.false_pursuit_01,
                r.true_pursuit_01,
            )
            cells = " ".join("       –" if np.isnan(x) else f"{x:8.3f}" for x in figures)
            print(
                f"{r.pursuit_01:7.1f} {r.noise_deg:5.1f} {r.head_deg_s:8.0f} {r.late_ms:7.0f}  "
                f"{r.detector:<25} {cells}"
            )
    where = missed(rows)
    print(f"auto misses its limits: {'; '.join(where) or 'nowhere'}")
    return 1 if where else 0


if __name__ == "__main__":
    sys.exit(main())
