"""Figures that are moulded live: who they are; where and how they stand comes with every frame."""

from dataclasses import dataclass

from visavis.stimuli.scene import Scene


@dataclass(frozen=True)
class LiveFigures(Scene):
    """People in a plain room whose pose is each frame's own; `characters` names who they are.

    The room is moved by `room_at_m`. They are no agents: they have no area of interest.
    """

    characters: tuple[str, ...] = ()
    room_at_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    dressed_by: str = "visavis.stimuli.dressing.live_figures:live_figures_picture"
