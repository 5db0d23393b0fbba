"""FoveClient for its caller, in memory.

Written from FOVE SDK 1.4.0's names, types and codes. Not modelled: gaze depth, presence, attention
shift, the compositor, the picture of the calibration, licences; the calibration follows its
states in steps of 0.5 s and judges by the wearer's open eyes alone.
"""

import struct
from typing import Unpack

from visavis.devices.contracts import Body
from visavis.devices.sim.gaze.source import EYE_X_M, GazePeer, Measuring, Shot
from visavis.devices.transports import Frames
from visavis.lab.clock import NS_PER_S

FRAME = struct.Struct("<QQ" + 2 * "i3fiiif" + "i3f3f")
ANSWER = struct.Struct("<ii")
STEP_NS = NS_PER_S // 2
STEPS = (1, 2, 3, 4)
FAILED = 9
SUCCEEDED_HIGH = 5
OPEN_SHARE = 0.5


class FoveSimulator(GazePeer):
    """Deliver eye frames of a body and answer the calls that the driver makes.

    `low_accuracy` and `unreliable` make the runtime return 1007 or 1006 with every vector.
    """

    driver = "fove"

    def __init__(
        self,
        body: Body,
        *,
        vector_code: int = 0,
        quality: int = SUCCEEDED_HIGH,
        **measuring: Unpack[Measuring],
    ) -> None:
        super().__init__(body, **measuring)
        self._vector_code = vector_code
        self._quality = quality
        self._started_ns: int | None = None
        self._open = self._closed = 0

    @property
    def is_busy(self) -> bool:
        """Tell whether it calibrates."""
        return self._started_ns is not None

    def to_message(self, shot: Shot) -> Frames:
        """Return one eye frame."""
        if self._started_ns is not None:
            self._open += shot.left_seen and shot.right_seen
            self._closed += not (shot.left_seen and shot.right_seen)
        return (eye_frame(shot, self._vector_code) if shot.garbage is None else shot.garbage,)

    def answer(self, frames: Frames, t_ns: int) -> Frames | None:
        """Answer as the library's functions return."""
        question = frames[0]
        if question == b"versions":
            version = self.source.claimed_version(t_ns, "1.4.0")
            code = 0 if version.startswith("1.") else 4
            text = f"client 1.4.0, runtime {version}"
            return question, ANSWER.pack(code, 0), text.encode()
        if question in (b"hardware", b"present"):
            return question, ANSWER.pack(0, 1)
        if question == b"calibrated":
            return question, ANSWER.pack(0, int(self.source.calibrated_fit is not None))
        if question == b"start_calibration":
            self._started_ns, self._open, self._closed = t_ns, 0, 0
            return question, ANSWER.pack(0, 0)
        if question == b"calibration_state":
            return question, ANSWER.pack(0, self._state(t_ns))
        return question, ANSWER.pack(104, 0)

    def _state(self, t_ns: int) -> int:
        if self._started_ns is None:
            return 0
        step = (t_ns - self._started_ns) // STEP_NS
        if step < len(STEPS):
            return STEPS[step]
        self._started_ns = None
        if self._open * OPEN_SHARE <= self._closed:
            return FAILED
        self.source.calibrated_fit = self.source.body.fit()
        return self._quality


def eye_frame(shot: Shot, vector_code: int = 0) -> bytes:
    """Return the values of the getters for a sample: +z forward, radii in metres."""
    values: list[float] = [shot.number, shot.t_device_ns // 1000]
    for ray, is_seen in ((shot.left, shot.left_seen), (shot.right, shot.right_seen)):
        state = 1 if is_seen else (2 if shot.openness_01 < OPEN_SHARE else 0)
        values += [vector_code, ray[0], ray[1], -ray[2]]
        values += [0, state, 0, shot.pupil_mm * 0.5e-3 if is_seen else 0.0]
    mean = [(a + b) / 2 for a, b in zip(shot.left, shot.right, strict=True)]
    if shot.left_seen != shot.right_seen:
        mean = list(shot.left if shot.left_seen else shot.right)
    x_m = EYE_X_M if shot.right_seen else -EYE_X_M
    origin_m = 0.0 if shot.left_seen == shot.right_seen else x_m
    length = sum(v * v for v in mean) ** 0.5
    values += [vector_code, origin_m, 0.0, 0.0]
    values += [mean[0] / length, mean[1] / length, -mean[2] / length]
    return FRAME.pack(*values)
