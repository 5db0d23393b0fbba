"""A body that stands still and looks about, for simulated devices while no study runs.

Not modelled: walking, presses, saccades, and any answer to what it feels.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from visavis.devices.contracts import EYES_DTYPE, OneStretch
from visavis.lab.geometry import Vector, direction_from_yaw_pitch_deg, quat_from_yaw_pitch_deg

EYE_X_M = 0.032
EYE_HEIGHT_M = 1.63
HIPS_HEIGHT_M = 0.95
LOOKS_AT_M = 2.0
SWAY_M = 0.01
SWAY_S = 7.0
GAZE_S = 5.0
GAZE_YAW_DEG, GAZE_PITCH_DEG = 12.0, 6.0
PUPIL_MM = 3.5


class IdleBody(OneStretch):
    """Follow the `MovingBody` contract in functions of time; `levels_01` is what it last felt."""

    def __init__(self) -> None:
        # Late: it loads scipy and numba, which listing devices does without.
        from visavis.stimuli.motion.skeleton import canonical_skeleton

        skeleton = canonical_skeleton()
        self._rest_m = skeleton.rest_m
        self._index = skeleton.index_of
        self.levels_01: dict[str, tuple[float, ...]] = {}

    def eyes(self, t_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.void]:
        """Return eyes that follow a point two metres away on a slow ellipse."""
        values = np.zeros(t_ns.size, EYES_DTYPE)
        turn = 2 * np.pi * t_ns * 1e-9 / GAZE_S
        yaw, pitch = GAZE_YAW_DEG * np.sin(turn), GAZE_PITCH_DEG * np.cos(turn)
        point_m = LOOKS_AT_M * direction_from_yaw_pitch_deg(yaw, pitch)
        for name, x_m in (("left", -EYE_X_M), ("right", EYE_X_M)):
            ray = point_m - np.array([x_m, 0.0, 0.0])
            length = np.linalg.norm(ray, axis=-1, keepdims=True)
            values[f"{name}_direction_head"] = ray / length
        values["openness_01"] = 1.0
        values["pupil_mm"] = PUPIL_MM
        return values

    def head(self, t_ns: int) -> tuple[Vector, Vector]:
        """Return a head that sways by a centimetre."""
        sway_m = float(self._sway_m(np.array([t_ns]))[0])
        return np.array([sway_m, EYE_HEIGHT_M, 0.0]), quat_from_yaw_pitch_deg(100 * sway_m)

    def segments(
        self, names: Sequence[str], t_ns: npt.NDArray[np.int64]
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Return the rest pose, swaying; a name the skeleton does not know stands at the hips."""
        at = self._rest_m[[self._index.get(name, 0) for name in names]]
        positions = np.repeat(at[None], t_ns.size, axis=0)
        positions[..., 0] += self._sway_m(t_ns)[:, None]
        positions[..., 1] += HIPS_HEIGHT_M
        turns = np.zeros((t_ns.size, len(names), 4))
        turns[..., 0] = 1.0
        return positions, turns

    def feel(self, role: str, amplitudes_01: Sequence[float], t_ns: int) -> None:
        """Remember the levels of the motors."""
        self.levels_01[role] = tuple(amplitudes_01)

    def _sway_m(self, t_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
        sway: npt.NDArray[np.float64] = SWAY_M * np.sin(2 * np.pi * t_ns * 1e-9 / SWAY_S)
        return sway
