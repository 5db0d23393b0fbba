"""A laboratory's own room: a file beside the study's, and where somebody is in it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from visavis.lab.errors import DesignError
from visavis.lab.kinds import of_kinds
from visavis.lab.screen import PlacedScreen

DRAWN_ROOM: Final = "visavis.stimuli.dressing.own_room:drawn_room"
"""What draws it; it is loaded only for studies with such rooms."""


@dataclass(frozen=True)
@of_kinds(file=str | Path)
class Room:
    """A room of a glTF binary (.glb) beside the study's file, as the place of a scene, or alone.

    Whoever looks stands at `stand_m` of the file, in metres (x, y upwards, z), and faces its −z,
    turned by `yaw_deg` to the right. Meshes with names are things to look at.
    """

    file: str
    stand_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw_deg: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "file", str(self.file))
        x, y, z = map(float, self.stand_m)
        yaw_deg = float(self.yaw_deg)
        if not np.isfinite([x, y, z]).all() or not -360.0 <= yaw_deg <= 360.0:
            raise DesignError(
                f"Room {self.file!r}: stand_m is ({x:g}, {y:g}, {z:g}) and yaw_deg {yaw_deg:g}; "
                "give finite metres, and degrees from -360 to 360"
            )
        object.__setattr__(self, "stand_m", (x, y, z))
        object.__setattr__(self, "yaw_deg", yaw_deg)


@dataclass(frozen=True)
class PlacedRoom:
    """A room as a scene has it: its file as it was when it was read, seen through a `screen` where
    people sit before one.
    """

    room: Room
    path: Path
    modified_ns: int
    screen: PlacedScreen | None = None

    @classmethod
    def of(cls, room: Room, folder: Path, screen: PlacedScreen | None) -> "PlacedRoom":
        """Return a room whose file lies in a folder."""
        path = folder / room.file
        return cls(room, path, path.stat().st_mtime_ns if path.is_file() else 0, screen)

    def of_file(self) -> "PlacedRoom":
        """Return what is the same wherever somebody stands in it."""
        return PlacedRoom(Room(self.room.file), self.path, self.modified_ns)

    def as_drawn(self) -> "PlacedRoom":
        """Return what is drawn alike, through whatever screen."""
        return PlacedRoom(self.room, self.path, self.modified_ns)
