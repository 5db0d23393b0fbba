"""Read the packets of Vicon Tracker's UDP object stream; pure, `DataError` alone on bad bytes.

Sources: three public clients that agree on the layout, one of them with Vicon's own structures:
TheWorkshopByGM/Vicon_UDP_Stream, BoB robotics, and a ROS 2 node for Tracker. Little-endian: u32
frame number, u8 number of items; then per item u8 kind (0: an object), u16 size of what follows,
and for an object a name of 24 bytes, position (mm) and rotation (rad) as six doubles. Packets are
padded to 256, 512 or 1024 bytes, as Tracker's settings say. The rotation is about x, then the new
y, then the new z. Nothing tells the time.
"""

import math
import struct
from dataclasses import dataclass

from visavis.lab.errors import DataError

PACKET = struct.Struct("<IB")
ITEM = struct.Struct("<BH")
OBJECT = struct.Struct("<24s6d")
OBJECT_KIND = 0
PADDED_TO = 256
Numbers = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Packet:
    """One packet: objects by name, each with position (mm) and rotation (rad) as sent.

    `is_last` tells that another object would have had room: nothing more comes of this frame.
    """

    number: int
    objects: dict[str, tuple[Numbers, Numbers]]
    is_last: bool


def decode(data: bytes) -> Packet:
    """Read one packet.

    Raises:
        DataError: it is not padded, ends within an item, or an object has an impossible size.
    """
    if not data or len(data) % PADDED_TO:
        raise DataError(f"Vicon packet of {len(data)} bytes")
    number, item_count = PACKET.unpack_from(data)
    at, objects = PACKET.size, {}
    for _ in range(item_count):
        if at + ITEM.size > len(data):
            raise DataError(f"Vicon packet of {len(data)} bytes ends within an item's header")
        kind, size = ITEM.unpack_from(data, at)
        at += ITEM.size
        if at + size > len(data):
            raise DataError(f"Vicon item of {size} bytes runs over the packet's {len(data)}")
        if kind == OBJECT_KIND:
            if size != OBJECT.size:
                raise DataError(f"Vicon object of {size} bytes, where {OBJECT.size} are expected")
            name, *numbers = OBJECT.unpack_from(data, at)
            x, y, z, rx, ry, rz = numbers
            text = name.partition(b"\0")[0].decode("utf-8", "replace")
            objects[text] = ((x, y, z), (rx, ry, rz))
        at += size
    return Packet(number, objects, len(data) - at >= ITEM.size + OBJECT.size)


def is_seen(position_mm: Numbers, rotation_rad: Numbers) -> bool:
    """Tell whether an object's numbers can be a pose; all of them 0 are a lost object's."""
    if not any(position_mm) and not any(rotation_rad):
        return False
    return all(map(math.isfinite, position_mm)) and all(
        abs(angle) <= 2 * math.pi for angle in rotation_rad
    )


def quaternion(rotation_rad: Numbers) -> tuple[float, float, float, float]:
    """Return (w, x, y, z) of the rotations about x, the new y and the new z."""
    (cx, sx), (cy, sy), (cz, sz) = (
        (math.cos(angle / 2), math.sin(angle / 2)) for angle in rotation_rad
    )
    return (
        cx * cy * cz - sx * sy * sz,
        sx * cy * cz + cx * sy * sz,
        cx * sy * cz - sx * cy * sz,
        cx * cy * sz + sx * sy * cz,
    )
