"""From contacts of the arms to orders for the bands: which band, which motors, when to stop."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from visavis.devices.contracts import VibrationPattern
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.geometry import Vector, quat_conjugate, rotate
from visavis.stimuli.contact.body import ARM_JOINTS, CapsuleBody, capsule_body
from visavis.stimuli.contact.touch import Touch, TouchSensor, pose_capsules
from visavis.stimuli.scenes.station_crowd import Crowd

BAND_OF_SEGMENT: Final = {
    "left_upper_arm": "armband_left_upper_arm",
    "left_lower_arm": "armband_left_forearm",
    "left_hand": "armband_left_forearm",
    "right_upper_arm": "armband_right_upper_arm",
    "right_lower_arm": "armband_right_forearm",
    "right_hand": "armband_right_forearm",
}
"""Contact on a forearm or hand drives the forearm's band, on an upper arm the upper arm's."""

BAND_ROLES: Final = tuple(dict.fromkeys(BAND_OF_SEGMENT.values()))
MOTORS: Final = (0, 1, 2, 3)
RENEW_BEFORE_NS: Final = 150 * NS_PER_MS
"""A pattern that runs out while the contact lasts is started anew this long before its end, or
before the last look at contact that comes sooner."""
MOTOR_HOLD_NS: Final = 100 * NS_PER_MS


@dataclass(frozen=True)
class BandOrder:
    """One thing a band shall do because of the sample at `t_contact_ns`.

    `begin` starts the pattern on `motors`, `renew` starts it again while contact goes on, `end`
    silences. `segment`, `person`, `depth_m` describe the deepest contact that asked for it.
    """

    kind: Literal["begin", "renew", "end"]
    role: str
    t_contact_ns: int
    motors: tuple[int, ...] = ()
    segment: str = ""
    person: int = -1
    depth_m: float = float("nan")


class ContactAnswer:
    """Watch the arms sample by sample and return orders for the bands; knows no device.

    `segments` names the tracked joints. Samples with a lost arm segment ask for nothing on it.
    """

    def __init__(
        self,
        crowd: Crowd,
        segments: Sequence[str],
        pattern: VibrationPattern,
        *,
        nearest_motor: bool = False,
        update_hz: float = 0.0,
    ) -> None:
        self._sensor = TouchSensor(crowd)
        self._body: CapsuleBody = capsule_body(1.75, ARM_JOINTS)
        self._index = np.array([list(segments).index(name) for name in ARM_JOINTS])
        self._starts, self._ends = np.empty((6, 3)), np.empty((6, 3))
        self._segments = list(segments)
        self._pattern_ns = pattern.duration_ms * NS_PER_MS
        self._nearest_motor = nearest_motor
        self._period_ns = round(NS_PER_S / update_hz) if update_hz else 0
        self._renewed_after_ns = max(0, self._pattern_ns - RENEW_BEFORE_NS - self._period_ns)
        self._next_ns = 0
        self._running: dict[str, tuple[int, tuple[int, ...]]] = {}

    @property
    def is_silent(self) -> bool:
        """Whether no band is driven."""
        return not self._running

    def fit(self, position_m: Vector) -> None:
        """Take the length of the arms from a sample (segments, 3); keep the default where lost."""
        upper, lower, hand = (
            position_m[self._segments.index(f"left_{part}")]
            for part in ("upper_arm", "lower_arm", "hand")
        )
        length_m = np.linalg.norm(lower - upper) + np.linalg.norm(hand - lower)
        if np.isfinite(length_m) and 0.3 < length_m < 0.9:
            self._body = capsule_body(round(float(length_m) / 0.332, 3), ARM_JOINTS)

    def sample(
        self, t_ns: int, crowd_t_s: float, position_m: Vector, orientation_wxyz: Vector
    ) -> list[BandOrder]:
        """Compare one sample, (segments, 3) and (segments, 4), with the crowd."""
        if t_ns < self._next_ns:
            return []
        if self._period_ns:
            self._next_ns = t_ns + self._period_ns
        starts, ends, body = self._starts, self._ends, self._body
        pose_capsules(
            position_m, orientation_wxyz, self._index, body.start_m, body.end_m, 1.0, starts, ends
        )
        touches = self._sensor.touches(starts, ends, self._body.radius_m, crowd_t_s)
        if not touches and not self._running:
            return []
        at, turn = position_m[self._index], orientation_wxyz[self._index]
        return list(self._orders(t_ns, touches, at, turn))

    def silence(self, t_ns: int) -> list[BandOrder]:
        """Return the orders that end everything."""
        orders = [BandOrder("end", role, t_ns) for role in self._running]
        self._running.clear()
        return orders

    def _orders(
        self, t_ns: int, touches: tuple[Touch, ...], at: Vector, turn: Vector
    ) -> Iterable[BandOrder]:
        deepest: dict[str, Touch] = {}
        for touch in touches:
            role = BAND_OF_SEGMENT[ARM_JOINTS[touch.part]]
            if role not in deepest or touch.depth_m > deepest[role].depth_m:
                deepest[role] = touch
        for role in [r for r in self._running if r not in deepest]:
            del self._running[role]
            yield BandOrder("end", role, t_ns)
        for role, touch in deepest.items():
            motors = self._motors(touch, at, turn)
            running = self._running.get(role)
            if running is None:
                kind: Literal["begin", "renew"] = "begin"
            else:
                age_ns = t_ns - running[0]
                has_new_motors = motors != running[1] and age_ns >= MOTOR_HOLD_NS
                if not has_new_motors and age_ns < self._renewed_after_ns:
                    continue
                kind = "renew"
            self._running[role] = (t_ns, motors)
            segment = ARM_JOINTS[touch.part]
            yield BandOrder(kind, role, t_ns, motors, segment, touch.person, touch.depth_m)

    def _motors(self, touch: Touch, at: Vector, turn: Vector) -> tuple[int, ...]:
        if not self._nearest_motor:
            return MOTORS
        # motors sit evenly round the limb: 0 thumb side (−z at rest), 1 above, 2 behind, 3 below
        aside = rotate(quat_conjugate(turn[touch.part]), np.array(touch.point_m) - at[touch.part])
        return (round(np.arctan2(aside[1], -aside[2]) / (np.pi / 2)) % 4,)
