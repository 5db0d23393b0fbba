"""What the height of eyes above the floor says of a person, and of how a head was measured."""

from typing import Final

MAX_SEATED_EYE_M: Final = 1.35
MIN_EYE_M: Final = 0.5
"""A head lower than that is measured from somewhere else than the floor: shifted, not scaled."""
