"""Named vibration patterns a contact can be answered with; a lab may add its own here."""

from collections.abc import Mapping
from typing import Final

from visavis.devices.contracts import CONTACT_PATTERN, VibrationPattern

PATTERNS: Final[Mapping[str, VibrationPattern]] = {
    "published": CONTACT_PATTERN,
    "steady": VibrationPattern("steady", 2000, high_hz=90.0),
    "pulses": VibrationPattern("square", 2000, high_hz=126.0, modulation_hz=4.0),
    "swell": VibrationPattern("ramp", 2000),
}
"""`published`: 10 Hz sine between 57 and 126 Hz (Berton et al. 2020); the others are ours."""
