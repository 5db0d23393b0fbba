"""Check Pupil Capture's answers while a driver opens, and count the eyes in its rows."""

from collections.abc import Mapping
from typing import Any

from visavis.devices.contracts import GAZE
from visavis.devices.drivers.pupil import codec
from visavis.lab.errors import ProtocolViolation

OLDEST_VERSION = (2, 0)
"""The first version whose headset calibration takes 3-D references (HMD3DChoreographyPlugin)."""

ROW_BYTES = GAZE.dtype.itemsize
_GAZE_FIELDS: Mapping[str, Any] = GAZE.dtype.fields or {}
_LEFT_VALID_AT, _RIGHT_VALID_AT = (_GAZE_FIELDS[f"{eye}_valid"][1] for eye in ("left", "right"))


def check_version(text: str, *, role: str) -> None:
    """Raise ProtocolViolation unless this version of Capture can be driven."""
    version = codec.decode_version(text)
    if version is None or version < OLDEST_VERSION:
        oldest = ".".join(str(part) for part in OLDEST_VERSION)
        raise ProtocolViolation(
            f"Pupil Capture says it is version {text!r}; this driver needs {oldest} or newer",
            role=role,
            remedy="install a current Pupil Capture",
        )


def read_port(text: str, name: str, *, role: str, remedy: str) -> int:
    """Return the port that Capture answered when asked for `name`; raises ProtocolViolation."""
    if not text.isascii() or not text.isdigit() or not 0 < int(text) < 2**16:
        raise ProtocolViolation(
            f"answered {text[:40]!r} when asked for {name}", role=role, remedy=remedy
        )
    return int(text)


def eyes_seen(rows: bytes) -> tuple[int, int]:
    """Return the numbers of rows of `GAZE` with a valid left and a valid right eye."""
    return sum(rows[_LEFT_VALID_AT::ROW_BYTES]), sum(rows[_RIGHT_VALID_AT::ROW_BYTES])
