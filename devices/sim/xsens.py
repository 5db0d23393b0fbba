"""Xsens MVN as seen from the network: the stream its network streamer sends, from a body.

Written from public parsers of the protocol that agree (see `visavis.devices.drivers.xsens.codec`
for the layout). Not modelled: other message types, props and finger segments, MVN's own filters,
TCP.
"""

import struct
from collections.abc import Sequence
from typing import Unpack

import numpy as np

from visavis.devices.contracts import MovingBody
from visavis.devices.sim.body.wire import BodyWire, Streaming
from visavis.lab.clock import NS_PER_MS, Clock
from visavis.lab.geometry import Vector

MVN_ORDER = (
    "hips", "spine", "L3", "chest", "upper_chest", "neck", "head",
    "right_shoulder", "right_upper_arm", "right_lower_arm", "right_hand",
    "left_shoulder", "left_upper_arm", "left_lower_arm", "left_hand",
    "right_upper_leg", "right_lower_leg", "right_foot", "right_toes",
    "left_upper_leg", "left_lower_leg", "left_foot", "left_toes",
)  # fmt: skip
"""MVN's segments in its order, by our names; L3 is set halfway between spine and chest."""


class XsensSimulator(BodyWire):
    """Stream type 02 of a moving body; `items_per_datagram` splits a sample when below 23."""

    usual_rate_hz = 240.0
    epoch_ns = 1_000_000_000

    def __init__(
        self,
        body: MovingBody,
        clock: Clock,
        *,
        items_per_datagram: int = 23,
        message_type: str = "02",
        **streaming: Unpack[Streaming],
    ) -> None:
        segments = tuple(name for name in MVN_ORDER if name != "L3")
        super().__init__(body, clock, segments=segments, **streaming)
        self._per_datagram = items_per_datagram
        self._type = message_type

    def encode(
        self, number: int, device_ns: int, position_m: Vector, turn: Vector, *, tracked: bool
    ) -> Sequence[bytes]:
        """Return the sample's datagrams, in MVN's z-up frame."""
        position_m = np.insert(position_m, 2, (position_m[1] + position_m[2]) / 2, axis=0)
        turn = np.insert(turn, 2, turn[1], axis=0)
        items = []
        for i in range(len(MVN_ORDER)):
            x, y, z = position_m[i]
            w, a, b, c = turn[i] if tracked else (0.0, 0.0, 0.0, 0.0)
            items.append(struct.pack(">i3f4f", i + 1, -z, -x, y, w, -c, -a, b))
        step = self._per_datagram
        groups = [items[i : i + step] for i in range(0, len(items), step)]
        return [
            struct.pack(
                ">6sIBBIBBBBHH",
                b"MXTP" + self._type.encode(),
                number & 0xFFFFFFFF,
                part | (0x80 if part == len(groups) - 1 else 0),
                len(group),
                device_ns // NS_PER_MS & 0xFFFFFFFF,
                0,
                len(MVN_ORDER),
                0,
                0,
                0,
                32 * len(group),
            )
            + b"".join(group)
            for part, group in enumerate(groups)
        ]
