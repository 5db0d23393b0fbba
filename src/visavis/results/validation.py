"""Judge a validation of the eye tracker: accuracy, precision and loss per target and eye."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from visavis.analysis.gaze.quality import validate
from visavis.analysis.gaze.turned_gaze import TurnedGaze, turned_gaze
from visavis.protocol.plan.experiment import ValidationPoint, ValidationVerdict
from visavis.protocol.plan.steps import known

EYES: Final = ("combined", "left", "right")


def judge_validation(points: Sequence[ValidationPoint], rate_hz: float) -> ValidationVerdict:
    """Decide a validation by the combined eye; rows hold every point and eye."""
    rows: list[dict[str, str | int | float | bool | None]] = []
    summaries = {}
    for eye in EYES:
        measured = [(p.target, p.t_ns, getattr(p, eye)) for p in points]
        summary = validate(measured, nominal_rate_hz=rate_hz)
        summaries[eye] = summary
        for point, found in zip(points, summary.points, strict=True):
            rows.append(
                {
                    "point": point.name,
                    "eye": eye,
                    "accuracy_deg": known(found.accuracy.of_mean_deg),
                    "mean_of_samples_deg": known(found.accuracy.mean_of_samples_deg),
                    "right_deg": known(found.accuracy.right_deg),
                    "up_deg": known(found.accuracy.up_deg),
                    "rms_s2s_deg": known(found.precision.rms_s2s_deg),
                    "std_deg": known(found.precision.std_deg),
                    "usable_ms": found.usable_ms,
                    "lost_01": found.lost_01,
                }
            )
    combined = summaries["combined"]
    turned = turned_gaze([p.aim_head for p in points], [p.combined_head for p in points])
    return ValidationVerdict(
        accepted=combined.passed,
        reason=""
        if combined.passed
        else _why_not(combined.accuracy_deg, combined.worst_deg, turned),
        is_turned=turned is not None and turned.kind in ("mirrored", "rolled"),
        accuracy_deg=known(combined.accuracy_deg),
        worst_point_deg=known(combined.worst_deg),
        precision_deg=known(combined.rms_s2s_deg),
        lost_01=combined.lost_01 if np.isfinite(combined.lost_01) else 1.0,
        rows=tuple(rows),
    )


def _why_not(accuracy_deg: float, worst_deg: float, turned: TurnedGaze | None) -> str:
    if not np.isfinite(accuracy_deg):
        return "too little valid gaze at every target"
    if turned is not None:
        return f"mean error {accuracy_deg:.2f}°, {turned.sentence()}"
    return f"mean error {accuracy_deg:.2f}°, worst target {worst_deg:.2f}°, or too little gaze"
