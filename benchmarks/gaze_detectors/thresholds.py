"""Compare thresholds of the adaptive detector with people: what another value would win and cost.

    python -m benchmarks.gaze_detectors.thresholds FOLDER

FOLDER holds any of the sets that `benchmarks.gaze_detectors.sets` names. Each row is `auto` with
one threshold changed: event F1 of fixations over all labellings of a set together, and events found
for each that is labelled. Of the set that weights were fitted on, only clips not used for that
count.
"""

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.gaze_detectors.agreement import matched, runs_of
from benchmarks.gaze_detectors.sets import SETS, Recording, is_tuned_on
from visavis.analysis.gaze.movements.detect import detect_movements
from visavis.analysis.gaze.movements.kinds import Movement
from visavis.analysis.gaze.movements.parameters import AUTO, STILL, MovementParameters

CHANGES: Mapping[str, MovementParameters] = {
    "auto": AUTO,
    "saccades from 30°/s": MovementParameters(minimum_deg_s=30.0, max_minimum_deg_s=30.0),
    "saccades from 60°/s": MovementParameters(minimum_deg_s=60.0, max_minimum_deg_s=60.0),
    "saccades from 20°/s": MovementParameters(minimum_deg_s=20.0, max_minimum_deg_s=20.0),
    "still pictures": STILL,
    "7 spreads of noise": MovementParameters(noise_multiple=7.0),
    "fixations of 80 ms": MovementParameters(min_fixation_ms=80.0),
}


@dataclass(frozen=True)
class FixationScore:
    """Event F1 of fixations, and events found for each that is labelled."""

    f1: float
    count_ratio: float


def score(recordings: Sequence[Recording], params: MovementParameters) -> FixationScore:
    """Return how fixations agree with all labellings of some recordings together."""
    labels = detections = pairs = 0
    for recording in recordings:
        movement = detect_movements(recording.t_ns, recording.direction, params).movement
        runs = runs_of(movement == Movement.FIXATION)
        for labelling in recording.by.values():
            labels += len(labelling.fixations)
            detections += len(runs)
            pairs += matched(labelling.fixations, runs)
    return FixationScore(2 * pairs / (labels + detections), detections / labels)


def rows_of(folder: Path) -> Iterator[str]:
    """Yield a line for each set in a folder and each change."""
    for name, read in SETS.items():
        recordings = [r for r in read(folder) if not is_tuned_on(name, r)]
        for change, params in CHANGES.items() if recordings else ():
            agreement = score(recordings, params)
            share = f"{agreement.count_ratio:.2f} found for each"
            yield f"{name:14} {change:20} F1 {agreement.f1:.3f}  {share}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print every row."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    for row in rows_of(parser.parse_args(arguments).folder):
        print(row, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
