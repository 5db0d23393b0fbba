"""Names of the joints that every body has: simulated, tracked or drawn."""

from typing import Final

BODY_JOINTS: Final[tuple[str, ...]] = (
    "hips",
    "spine",
    "chest",
    "upper_chest",
    "neck",
    "head",
    *(
        f"{side}_{part}"
        for side in ("left", "right")
        for part in (
            "shoulder",
            "upper_arm",
            "lower_arm",
            "hand",
            "upper_leg",
            "lower_leg",
            "foot",
            "toes",
        )
    ),
)
"""Joints of the canonical skeleton that carry a body's shape; parents before children."""
