"""A scene as geometry: people's places, sizes and gaze, and the occluders between them.

The stage that draws a scene and the simulated participant that sees it both start from
`SceneFrame`; nothing here knows a study.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector
from visavis.stimuli.gaze_window import WindowPlace
from visavis.stimuli.own_room import PlacedRoom
from visavis.stimuli.picture import PosedPeople


@dataclass(frozen=True)
class Agent:
    """One virtual human.

    `character` names the model that plays the part, `place` where it sits ("left_close"),
    `head_centre_m` (3,) and `head_radius_m` its head as a sphere, `facing` (3,) the unit
    direction of the head's front, all in world; `eye_centre_m` (3,) the midpoint between its
    eyes, from which gaze directions start. Without gaze its eyes cannot turn, and it blinks only
    if it `has_lids`.
    """

    agent_id: str
    character: str
    place: str
    head_centre_m: Vector
    head_radius_m: float
    facing: Vector
    eye_centre_m: Vector
    has_gaze: bool = True
    has_lids: bool = False


@dataclass(frozen=True)
class Capsule:
    """An occluder: all points within `radius_m` of the segment from `start_m` to `end_m`."""

    start_m: Vector
    end_m: Vector
    radius_m: float


@dataclass(frozen=True)
class Scene:
    """The part of a scene that does not change while it is shown.

    `brightness_01` 0 is black (agents are then not visible, the mark still is); `mark_m` (3,) is
    where a small fixation mark stands in world, or None. `dressed_by` names what makes pictures
    of it, as "module:function"; a scene without is dark. `moved_by` likewise names what tells where
    heads are later on (`stimuli.moving_heads`); without it they stay where `agents` has them.
    `room` is drawn in place of the room that the picture would have.
    """

    name: str
    agents: tuple[Agent, ...]
    occluders: tuple[Capsule, ...] = ()
    brightness_01: float = 1.0
    mark_m: Vector | None = None
    dressed_by: str = ""
    moved_by: str = ""
    room: PlacedRoom | None = None

    @property
    def stand_m(self) -> Vector:
        """Places (n, 2) of people who are not agents: x and z on the floor."""
        return np.empty((0, 2))


@dataclass(frozen=True, slots=True)
class SceneFrame:
    """The scene in front of the participant in one frame.

    For n agents in the order of `scene.agents`: `gaze_direction` (n, 3) unit vectors in world;
    `eye_openness_01` (n,) 0 closed; `gaze_distance_m` (n,) from between the eyes to where both
    lines of gaze meet, NaN where they are parallel, None where nobody says; all three are NaN for
    agents without gaze. `people` is everybody's pose when the study computes it itself. `scene` is
    the same object while nothing static changes, so identity tells whether anything must be
    rebuilt. `turned_deg` is how far the view onto a panorama was turned, to the right and upwards;
    `window_at` where a window is that follows gaze, None without one.
    """

    scene: Scene
    t_ns: int
    gaze_direction: npt.NDArray[np.float64]
    eye_openness_01: npt.NDArray[np.float64]
    people: PosedPeople | None = None
    gaze_distance_m: npt.NDArray[np.float64] | None = None
    turned_deg: tuple[float, float] = (0.0, 0.0)
    window_at: WindowPlace | None = None
