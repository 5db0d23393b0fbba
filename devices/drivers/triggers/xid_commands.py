"""Output lines of Cedrus' XID units: c-pod, m-pod, StimTracker.

Compared with the vendor's own client pyxid2, which packs the same bytes.
"""

import struct

PULSE_WIDTH = struct.Struct("<2sI")
"""`mp`, and milliseconds."""
LINES = struct.Struct("<2sH")
"""`mh`, and a bit for each of sixteen lines."""


def pulse_width(width_ms: int) -> bytes:
    """Return the command after which every raised line falls again after this time."""
    return PULSE_WIDTH.pack(b"mp", width_ms)


def raise_lines(code: int) -> bytes:
    """Return the command that raises the lines of a code, 0 to 65535, and lowers the others."""
    return LINES.pack(b"mh", code)
