"""Pupil Capture's headset calibration: its messages and its verdict."""

from collections.abc import Callable, Mapping
from typing import Any

from visavis.devices.contracts import CalibrationOutcome
from visavis.devices.drivers.pupil import codec
from visavis.lab.geometry import Vector


class HmdCalibration:
    """Run 3-D headset calibrations, one at a time; `notify` sends a notification to Capture.

    `outcome` is the verdict on the latest calibration; None until it came.
    """

    def __init__(
        self, notify: Callable[..., None], eye_distance_mm: float, reference_distance_m: float
    ) -> None:
        self._notify = notify
        self._half_eyes_mm = eye_distance_mm / 2
        self._reference_distance_m = reference_distance_m
        self._references: list[dict[str, Any]] = []
        self.outcome: CalibrationOutcome | None = None

    @property
    def has_succeeded(self) -> bool:
        """Tell whether Capture accepted it."""
        return self.outcome is not None and self.outcome.succeeded

    def begin(self) -> None:
        """Let Capture collect; targets follow."""
        self._references = []
        self.outcome = None
        half_mm = self._half_eyes_mm
        self._notify("start_plugin", name="HMD3DChoreographyPlugin", args={})
        self._notify(
            "calibration.should_start",
            translation_eye0=[half_mm, 0.0, 0.0],
            translation_eye1=[-half_mm, 0.0, 0.0],
            record=True,
        )

    def add(self, direction_head: Vector, device_ns: int) -> None:
        """Keep a target by Capture's time; they are sent at the end."""
        self._references.append(
            codec.encode_reference(direction_head, device_ns, self._reference_distance_m)
        )

    def finish(self) -> None:
        """Send the targets and let Capture compute the calibration."""
        self._notify("calibration.add_ref_data", ref_data=self._references)
        self._notify("calibration.should_stop")

    def take(self, notification: Mapping[str, Any]) -> bool:
        """Take a notification; tell whether it was a verdict."""
        subject = notification["subject"]
        if subject == "calibration.successful":
            self.outcome = CalibrationOutcome(succeeded=True, message="successful")
        elif subject == "calibration.failed":
            reason = str(notification.get("reason", "no reason given"))
            self.outcome = CalibrationOutcome(succeeded=False, message=reason)
        else:
            return False
        return True
