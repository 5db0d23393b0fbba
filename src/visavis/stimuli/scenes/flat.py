"""Flat stimuli as a scene: before a screen in its plane, in a headset on sheets around the head."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from visavis.lab.geometry import Pose
from visavis.stimuli.audible import Audible
from visavis.stimuli.flat import Dots, Flat, Panorama, Video, films_among
from visavis.stimuli.gaze_window import GazeWindow
from visavis.stimuli.panels import IN_HEADSET, Surface
from visavis.stimuli.scene import Scene
from visavis.stimuli.view_turns import ViewTurns

DRESSED_BY: Final = "visavis.stimuli.dressing.flat:picture_of_flat"


@dataclass(frozen=True, eq=False)
class FlatScene(Scene):
    """Flat stimuli, from the back to the front, before a head that was at `head` at the onset.

    `background_srgb` fills what they leave free; pictures lie in `folder`. `answered_by` names the
    response for which somebody presses a key while this is shown, as their instruction says.
    `names` (one for each item, or none) make areas of interest of whole stimuli. `sounds` are heard
    with them, or alone. What moves began to at `moves_since_ns`. A `panorama` is behind them all;
    before a monitor the view onto it `turns`. With a `gaze_window` not all of it is seen.
    """

    items: tuple[Flat, ...] = ()
    background_srgb: tuple[int, int, int] = (0, 0, 0)
    head: Pose | None = None
    surface: Surface = IN_HEADSET
    folder: Path = Path()
    answered_by: str = ""
    names: tuple[str, ...] = ()
    sounds: tuple[Audible, ...] = ()
    moves_since_ns: int = 0
    panorama: Panorama | None = None
    turns: ViewTurns = field(default_factory=lambda: ViewTurns(1))
    gaze_window: GazeWindow | None = None

    @property
    def moves(self) -> bool:
        """Whether one of the stimuli moves by itself."""
        return bool(self.films) or any(isinstance(item, Dots) for item in self.items)

    @property
    def films(self) -> tuple[Video | Panorama, ...]:
        """Its films, the one all around first."""
        return films_among((self.panorama, *self.items))

    # A scene is what is shown at one time; two with the same content are two.
    __eq__ = object.__eq__
    __hash__ = object.__hash__
