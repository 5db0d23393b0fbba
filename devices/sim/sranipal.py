"""SRanipal for its caller, in memory.

Written from the vendor's public header. Not modelled: the runtime, its calibration and its
filter, expressions, convergence, advice on tracking.
"""

import struct

from visavis.devices.sim.gaze.source import EYE_X_M, GazePeer, Shot
from visavis.devices.transports import Frames
from visavis.lab.clock import NS_PER_MS

ONE_EYE = struct.Struct("<Q3f3fff2f")
ALL_VALID, ONLY_OPENNESS = 0x1F, 0x08


class SranipalSimulator(GazePeer):
    """Deliver frames of a body's eyes; `is_pro_eye` is what the library says of the headset."""

    driver = "sranipal"
    usual_epoch_ns = 10**12
    is_pro_eye = True

    def to_message(self, shot: Shot) -> Frames:
        """Return one frame, as the library fills it in."""
        return (eye_data(shot) if shot.garbage is None else shot.garbage,)

    def answer(self, frames: Frames, t_ns: int) -> Frames | None:
        """Answer whether it is a Vive Pro Eye."""
        return frames[0], bytes((self.is_pro_eye,))


def eye_data(shot: Shot) -> bytes:
    """Return `EyeData_v2` of a shot, member by member as the header lists them."""
    left = _eye(shot.left, -EYE_X_M, shot, is_seen=shot.left_seen)
    right = _eye(shot.right, EYE_X_M, shot, is_seen=shot.right_seen)
    middle = tuple((a + b) / 2 for a, b in zip(shot.left, shot.right, strict=True))
    both = _eye(middle, 0.0, shot, is_seen=shot.left_seen and shot.right_seen)
    head = struct.pack("<?3xii4x", False, shot.number, shot.t_device_ns // NS_PER_MS)
    convergence, advice, expressions = bytes(8), bytes(48), bytes(24)
    return head + left + right + both + convergence + advice + expressions


def _eye(ray: tuple[float, ...], x_m: float, shot: Shot, *, is_seen: bool) -> bytes:
    if not is_seen:
        return ONE_EYE.pack(ONLY_OPENNESS, *(0.0,) * 7, shot.openness_01, 0.0, 0.0)
    x, y, z = ray
    place = (-1e3 * x_m, 0.0, 0.0)
    return ONE_EYE.pack(ALL_VALID, *place, -x, y, -z, shot.pupil_mm, shot.openness_01, 0.5, 0.5)
