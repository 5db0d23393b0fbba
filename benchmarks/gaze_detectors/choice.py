"""Compare the adaptive detectors by rate and noise, on the half of GazeCom used for tuning.

    python -m benchmarks.gaze_detectors.choice FOLDER

What `detector="auto"` chooses by was read off this table: every eighth tuned recording, thinned
and with white noise (RMS from sample to sample), event F1 and kappa of fixations, F1 of pursuit
over samples.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.gaze_detectors.agreement import agreement
from benchmarks.gaze_detectors.rates import noisy, thinned
from benchmarks.gaze_detectors.sets import GAZECOM_RATE_HZ, SETS, TUNING_SET, is_tuned_on
from visavis.analysis.gaze.movements.detect import DETECTOR_NAMES, detect_movements
from visavis.analysis.gaze.movements.kinds import Movement
from visavis.analysis.gaze.movements.parameters import AUTO

STEPS, NOISES_DEG, EVERY = (1, 2, 4, 8), (0.0, 0.1, 0.25, 0.5, 1.0, 2.0), 8


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; return 1 when the folder lacks the set."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path)
    options = parser.parse_args(arguments)
    tuned = [r for r in SETS[TUNING_SET](options.folder) if is_tuned_on(TUNING_SET, r)][::EVERY]
    if not tuned:
        print(f"{options.folder}: no data_gazecom/CLIP/*.csv files")
        return 1
    print("  Hz    noise °  velocity noise °/s  detector             F1  kappa  pursuit  chosen")
    for step in STEPS:
        for noise_deg in NOISES_DEG:
            recordings = [noisy(thinned(r, step), noise_deg, 1) for r in tuned]
            people = [next(iter(r.by.values())) for r in recordings]
            choices = [detect_movements(r.t_ns, r.direction).detector for r in recordings]
            for name, title in DETECTOR_NAMES.items():
                params = replace(AUTO, detector=name)
                found = [detect_movements(r.t_ns, r.direction, params) for r in recordings]
                of = {
                    kind: agreement(
                        [p.movement == kind for p in people], [f.movement == kind for f in found]
                    )
                    for kind in (Movement.FIXATION, Movement.PURSUIT)
                }
                rests = of[Movement.FIXATION]
                print(
                    f"{GAZECOM_RATE_HZ / step:6.1f} {noise_deg:7.2f} "
                    f"{np.median([f.noise_deg_s for f in found]):12.1f}         {title:<18} "
                    f"{rests.f1:.3f}  {rests.kappa:.2f}     {of[Movement.PURSUIT].sample_f1:.2f}  "
                    f"{np.mean([c == name for c in choices]):6.0%}"
                )
    return 0


if __name__ == "__main__":
    sys.exit(main())
