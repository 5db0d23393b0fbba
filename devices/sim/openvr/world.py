"""The devices of a simulated OpenVR runtime: headset, controllers, base stations, trackers."""

import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from visavis.devices.contracts import Body, MovingBody
from visavis.devices.faults import FaultSchedule
from visavis.devices.sim.foresight import Foresight
from visavis.lab.geometry import rotate

HMD, CONTROLLER, TRACKER, BASE_STATION = 1, 2, 3, 4
SLOTS = 64
BASE_STATIONS_M = ((-2.0, 2.3, -2.0), (2.0, 2.3, 2.0))
HANDS = ("left_hand", "right_hand")
CONTROLLER_OFFSETS_M = ((-0.25, -0.45, -0.3), (0.25, -0.45, -0.3))
TRACKING_LOST = 201
_POSE = struct.Struct("<12f 3f 3f i ? ? 2x")
_LOST_POSE = _POSE.pack(*[0.0] * 18, TRACKING_LOST, False, True)
_GONE_POSE = _POSE.pack(*[0.0] * 18, 1, False, False)
_GARBAGE_POSE = _POSE.pack(*[float("nan")] * 18, 200, True, True)

POSE_BYTES = _POSE.size

PoseAt = Callable[[int, int], tuple[Sequence[float], Sequence[float]] | None]
"""Returns a pose as it is known at a session time for that or a later one."""


@dataclass
class SimulatedVrDevice:
    """One slot of the runtime; `pose_at` gives position and (w, x, y, z), None when not seen."""

    kind: int
    serial: str
    model: str
    pose_at: PoseAt
    role: int = 0
    is_connected: bool = True
    battery_01: float | None = None


class SimulatedVrWorld:
    """Every slot of the runtime, and its place; `base_offset_m` displaces base stations.

    `trackers` maps serial numbers to the segments of a moving body they are worn on.
    """

    def __init__(
        self, body: Body, trackers: Mapping[str, str], faults: FaultSchedule, *, seed: int
    ) -> None:
        self._body = body
        self._foresight = Foresight(body)
        self._faults = faults
        self._rng = np.random.default_rng([seed, 0x0B])
        self.base_offset_m = np.zeros((len(BASE_STATIONS_M), 3))
        self.devices = self._make_devices(dict(trackers))

    def device(self, slot: int) -> SimulatedVrDevice | None:
        """Return what is at a slot; None when it is empty."""
        return self.devices[slot] if slot < len(self.devices) else None

    def class_of(self, slot: int) -> int:
        """Return the kind of device at a slot, 0 for none."""
        device = self.device(slot)
        return 0 if device is None else device.kind

    def is_connected(self, slot: int) -> bool:
        """Tell whether the device at a slot is connected."""
        device = self.device(slot)
        return device is not None and device.is_connected

    def role_of(self, slot: int) -> int:
        """Return which hand the controller at a slot is for: 1 left, 2 right, 0 neither."""
        device = self.device(slot)
        return 0 if device is None else device.role

    def wear(self, trackers: Mapping[str, str]) -> None:
        """Put more trackers on segments of the body: serial number -> segment."""
        for serial, segment in trackers.items():
            device = SimulatedVrDevice(
                TRACKER, serial, "Simulated tracker", self._segment_pose(segment)
            )
            self.devices.append(device)

    def _make_devices(self, trackers: dict[str, str]) -> list[SimulatedVrDevice]:
        devices = [SimulatedVrDevice(HMD, "LHR-HMD00001", "Simulated HMD", self._head)]
        for i, side in enumerate(("left", "right")):
            devices.append(
                SimulatedVrDevice(
                    CONTROLLER,
                    f"LHR-CTRL000{i + 1}",
                    f"Simulated {side} controller",
                    self._hand(i),
                    role=i + 1,
                    battery_01=0.8,
                )
            )
        for i, place in enumerate(BASE_STATIONS_M):
            devices.append(
                SimulatedVrDevice(
                    BASE_STATION,
                    f"LHB-BASE000{i + 1}",
                    "Simulated base station",
                    self._base(i, place),
                )
            )
        for serial, segment in trackers.items():
            devices.append(
                SimulatedVrDevice(
                    TRACKER,
                    serial,
                    "Simulated tracker",
                    self._segment_pose(segment),
                    battery_01=0.9,
                )
            )
        return devices

    def _head(self, now_ns: int, t_ns: int) -> tuple[Sequence[float], Sequence[float]]:
        position, orientation = self._foresight.at(now_ns, t_ns)
        return position.tolist(), orientation.tolist()

    def _hand(self, i: int) -> PoseAt:
        def at(now_ns: int, t_ns: int) -> tuple[Sequence[float], Sequence[float]]:
            if isinstance(self._body, MovingBody):
                return self._segment(HANDS[i], now_ns)
            position, orientation = self._foresight.at(now_ns, t_ns)
            offset = rotate(orientation, np.array(CONTROLLER_OFFSETS_M[i]))
            return (position + offset).tolist(), orientation.tolist()

        return at

    def _segment_pose(self, segment: str) -> PoseAt:
        return lambda now_ns, _: self._segment(segment, now_ns)

    def _base(self, i: int, place: Sequence[float]) -> PoseAt:
        return lambda _, __: ((np.array(place) + self.base_offset_m[i]).tolist(), (1.0, 0, 0, 0))

    def _segment(self, name: str, t_ns: int) -> tuple[Sequence[float], Sequence[float]]:
        assert isinstance(self._body, MovingBody)  # noqa: S101 - trackers need limbs
        positions, orientations = self._body.segments((name,), np.array((t_ns,), np.int64))
        return positions[0, 0].tolist(), orientations[0, 0].tolist()

    def poses(self, now_ns: int, t_ns: int, since_ns: int, *, asleep: bool) -> bytes:
        """Return the poses of all 64 slots for `t_ns` as known now, `since_ns` after the start.

        The head, and hands that go with it, are foreseen; limbs of a body are where they are now.
        `asleep` is a headset in standby.
        """
        faults = self._faults
        loss, garbage = faults.active("loss", since_ns), faults.active("garbage", since_ns)
        dark = faults.active("silence", since_ns) is not None
        parts = []
        for device in self.devices:
            if not device.is_connected:
                parts.append(_GONE_POSE)
                continue
            is_asleep = device.kind == HMD and asleep
            is_dropped = loss is not None and self._rng.random() < loss.amount
            spoilt = garbage is not None and self._rng.random() < garbage.amount
            pose = None if dark or is_asleep or is_dropped else device.pose_at(now_ns, t_ns)
            if spoilt:
                parts.append(_GARBAGE_POSE)
            elif pose is None:
                parts.append(_LOST_POSE)
            else:
                parts.append(packed_pose(*pose))
        return b"".join(parts) + _GONE_POSE * (SLOTS - len(parts))


def packed_pose(position: Sequence[float], turn: Sequence[float]) -> bytes:
    """Return a tracked pose as the runtime's own structure holds it; `turn` is (w, x, y, z)."""
    w, i, j, k = turn
    x, y, z = position
    return _POSE.pack(
        1 - 2 * (j * j + k * k), 2 * (i * j - w * k), 2 * (i * k + w * j), x,
        2 * (i * j + w * k), 1 - 2 * (i * i + k * k), 2 * (j * k - w * i), y,
        2 * (i * k - w * j), 2 * (j * k + w * i), 1 - 2 * (i * i + j * j), z,
        0, 0, 0, 0, 0, 0, 200, True, True,
    )  # fmt: skip
