"""A small body whose eyes, head and presses are plain functions of time."""

from collections.abc import Iterator

import numpy as np

from visavis.devices.contracts import EYES_DTYPE
from visavis.lab.geometry import direction_from_yaw_pitch_deg, quat_from_yaw_pitch_deg

EYE_X_M = np.array([0.032, 0.0, 0.0])


class FixatingBody:
    """Look at one point (head frame, m), blink on demand, press on a list of times."""

    def __init__(self, yaw_deg=0.0, pitch_deg=0.0, distance_m=2.0, presses=()):
        self.look(yaw_deg, pitch_deg, distance_m)
        self.stretch_number = 0
        self.fit_number = 0
        self.openness_01 = 1.0
        self._presses = list(presses)

    def look(self, yaw_deg, pitch_deg, distance_m=2.0):
        self.direction = direction_from_yaw_pitch_deg(yaw_deg, pitch_deg)
        self.point_m = self.direction * distance_m

    def eyes(self, t_ns):
        values = np.zeros(t_ns.size, EYES_DTYPE)
        for name, eye_m in (("left", -EYE_X_M), ("right", EYE_X_M)):
            ray = self.point_m - eye_m
            values[f"{name}_direction_head"] = ray / np.linalg.norm(ray)
        values["openness_01"] = self.openness_01
        values["pupil_mm"] = 3.5
        return values

    def head(self, t_ns):
        return np.array([0.0, 1.2, 0.0]), quat_from_yaw_pitch_deg(t_ns * 1e-9)

    def stretch(self):
        return self.stretch_number

    def fit(self):
        return self.fit_number

    def presses(self, until_ns) -> Iterator[tuple[int, str, float]]:
        while self._presses and self._presses[0][0] <= until_ns:
            yield self._presses.pop(0)
