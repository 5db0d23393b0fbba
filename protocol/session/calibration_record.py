"""The calibration in force: what the last accepted validation measured."""

from dataclasses import dataclass

from visavis.lab.clock import NS_PER_S
from visavis.protocol.plan.experiment import ValidationVerdict


@dataclass(frozen=True)
class CalibrationInForce:
    """The calibration that every trial row names, with its accuracy."""

    calibration_id: str
    t_ns: int
    verdict: ValidationVerdict

    def columns(self, t_ns: int) -> dict[str, str | int | float | bool | None]:
        """Return the columns of a trial row."""
        return {
            "calibration_id": self.calibration_id,
            "calibration_accepted": self.verdict.accepted,
            "calibration_accuracy_deg": self.verdict.accuracy_deg,
            "calibration_worst_point_deg": self.verdict.worst_point_deg,
            "calibration_precision_deg": self.verdict.precision_deg,
            "calibration_lost_01": self.verdict.lost_01,
            "calibration_age_s": (t_ns - self.t_ns) / NS_PER_S,
        }


NO_CALIBRATION: dict[str, str | int | float | bool | None] = {
    "calibration_id": None,
    "calibration_accepted": None,
    "calibration_accuracy_deg": None,
    "calibration_worst_point_deg": None,
    "calibration_precision_deg": None,
    "calibration_lost_01": None,
    "calibration_age_s": None,
}
"""The same columns before any validation."""
