"""Judge a validation of the eye tracker: accuracy, precision and loss per target and eye."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from visavis.analysis.gaze.quality import validate
from visavis.analysis.gaze.turned_gaze import TurnedGaze, turned_gaze
from visavis.protocol.plan.experiment import ValidationPoint, ValidationVerdict
from visavis.protocol.plan.steps import finite_or_none

EYES: Final = ("combined", "left", "right")


def judge_validation(points: Sequence[ValidationPoint], rate_hz: float) -> ValidationVerdict:
    """Decide a validation by the combined eye; the verdict's rows hold every point and eye."""
    rows: list[dict[str, str | int | float | bool | None]] = []
    summaries = {}
    for eye in EYES:
        samples = [(p.target, p.t_ns, getattr(p, eye)) for p in points]
        summary = validate(samples, nominal_rate_hz=rate_hz)
        summaries[eye] = summary
        for point, result in zip(points, summary.points, strict=True):
            rows.append(
                {
                    "point": point.name,
                    "eye": eye,
                    "accuracy_deg": finite_or_none(result.accuracy.of_mean_deg),
                    "mean_of_samples_deg": finite_or_none(result.accuracy.mean_of_samples_deg),
                    "right_deg": finite_or_none(result.accuracy.right_deg),
                    "up_deg": finite_or_none(result.accuracy.up_deg),
                    "rms_s2s_deg": finite_or_none(result.precision.rms_s2s_deg),
                    "std_deg": finite_or_none(result.precision.std_deg),
                    "usable_ms": result.usable_ms,
                    "lost_01": result.lost_01,
                }
            )
    combined_eye = summaries["combined"]
    gaze_turn = turned_gaze([p.aim_head for p in points], [p.combined_head for p in points])
    return ValidationVerdict(
        accepted=combined_eye.passed,
        reason=""
        if combined_eye.passed
        else _why_not(combined_eye.accuracy_deg, combined_eye.worst_deg, gaze_turn),
        is_turned=gaze_turn is not None and gaze_turn.kind in ("mirrored", "rolled"),
        accuracy_deg=finite_or_none(combined_eye.accuracy_deg),
        worst_point_deg=finite_or_none(combined_eye.worst_deg),
        precision_deg=finite_or_none(combined_eye.rms_s2s_deg),
        lost_01=combined_eye.lost_01 if np.isfinite(combined_eye.lost_01) else 1.0,
        rows=tuple(rows),
    )


def _why_not(accuracy_deg: float, worst_deg: float, gaze_turn: TurnedGaze | None) -> str:
    if not np.isfinite(accuracy_deg):
        return "too little valid gaze at every target"
    if gaze_turn is not None:
        return f"mean error {accuracy_deg:.2f}°, {gaze_turn.sentence()}"
    return f"mean error {accuracy_deg:.2f}°, worst target {worst_deg:.2f}°, or too little gaze"
