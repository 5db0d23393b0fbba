"""The published cases of visual motion warping as presets (tables 2.2 to 2.4 of the source).

Who looks from where, past what and in which light is ours: the source shows pictures only.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from visavis.lab.geometry import Pose, Vector, quat_multiply, rotate
from visavis.stimuli.characters.character import Character
from visavis.stimuli.motion.baking import bake
from visavis.stimuli.motion.build import build_of_character
from visavis.stimuli.motion.clip import Clip
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.kinds import Crouch, Kind, Talk, Text, Wave
from visavis.stimuli.motion.people import Person
from visavis.stimuli.motion.skeleton import forward
from visavis.stimuli.motion.warping.control import ControlSettings
from visavis.stimuli.motion.warping.features import FeatureTarget
from visavis.stimuli.motion.warping.outlook import Outlook, looking_at, outlook
from visavis.stimuli.motion.warping.perceived import SeenBody, body_of, holding
from visavis.stimuli.motion.warping.units import WarpingUnit, units_named
from visavis.stimuli.picture import Light, StaticMesh
from visavis.stimuli.rooms.solids import box, cylinder, join_meshes

CLIP_S: Final = 2.0
VIEW_RADIUS_M: Final = 1.05
SIZE_PX: Final = 256
"""Extensions are steered, and a face is small: 128 pixels show both too coarsely."""
EYE_HEIGHT_M: Final = 1.62
SEARCHED: Final = ControlSettings(
    search=True, step_cap_deg=10.0, error_cap=0.4, wide_probe_deg=12.0
)
"""Settings of presets, which may take their time; some steer past an edge or by a few pixels."""
EVERY_FRAME: Final = replace(SEARCHED, rate_hz=30.0)
"""Where an edge or another part passes within a frame: as many keys as the clip has frames."""
STILL: Final = replace(SEARCHED, smoothness=0.1)
"""For who hardly moves: an offset that follows single pixels would be seen as a tremor."""


@dataclass(frozen=True)
class Case:
    """One preset: a motion, where the observer stands, what is wanted and what may move.

    `bearing_deg` is where the observer stands from the character's front, positive to the
    character's left; `things` stand in world with the character at the origin, facing −z;
    `settings` are those of the control loop.
    """

    name: str
    about: str
    kind: Kind
    bearing_deg: float
    distance_m: float
    targets: tuple[FeatureTarget, ...]
    units: tuple[str, ...]
    things: Callable[[], tuple[StaticMesh, ...]] = tuple
    lamps: Callable[[], tuple[Light, ...]] = tuple
    holds_tablet: bool = False
    settings: ControlSettings = SEARCHED


def _cover(parts: tuple[str, ...], change: float) -> FeatureTarget:
    return FeatureTarget("coverage", parts, change)


def _board() -> tuple[StaticMesh, ...]:
    return (box((0.60, 1.15, -1.0), (0.84, 1.05, 0.04), (150, 120, 90)),)


def _slats() -> tuple[StaticMesh, ...]:
    bars = [
        cylinder((x, 0, -1.0), (x, 2.1, -1.0), 0.035, (120, 120, 124), sides=10)
        for x in np.arange(-0.55, 0.75, 0.17)
    ]
    return (join_meshes(*bars),)


def _shade() -> tuple[StaticMesh, ...]:
    return (box((0.72, 2.15, -0.30), (0.62, 0.03, 0.75), (90, 90, 90)),)


def _shade_lamps() -> tuple[Light, ...]:
    down = np.array([0.0, -1.0, 0.0])
    return (
        Light("spot", np.full(3, 5.0), position_m=np.array([0.5, 3.6, -0.9]), direction=down,
              half_angle_deg=70.0),
    )  # fmt: skip


def _low_wall() -> tuple[StaticMesh, ...]:
    return (box((0.0, 0.45, -0.75), (1.6, 0.9, 0.12), (150, 146, 140)),)


CASES: Final[dict[str, Case]] = {
    case.name: case
    for case in (
        Case(
            "view_change",
            "wave with both hands at an observer to the side",
            Wave(hand="both"),
            50.0,
            3.0,
            (_cover(("face", "hands"), 0.25),),
            ("spine", "neck_head", "arms"),
            settings=EVERY_FRAME,
        ),
        Case(
            "near",
            "the same observer in front and near: a smaller gesture will do",
            Wave(hand="both"),
            0.0,
            1.8,
            (FeatureTarget("horizontal_extension", ("arms",), -0.2),),
            ("spine", "neck_head", "arms"),
        ),
        Case(
            "far",
            "the observer far away: a wider gesture",
            Wave(hand="both"),
            0.0,
            9.0,
            (FeatureTarget("horizontal_extension", ("arms",), 0.2),),
            ("spine", "neck_head", "arms"),
        ),
        Case(
            "show_tablet",
            "show a tablet to an observer to the side",
            Text(hand="right"),
            -45.0,
            2.2,
            (_cover(("face",), 0.15), _cover(("held_object",), 0.5)),
            ("spine", "neck_head", "right_arm"),
            holds_tablet=True,
            settings=STILL,
        ),
        Case(
            "past_board",
            "wave past a board that hides the hand",
            Wave(hand="right"),
            0.0,
            3.2,
            (_cover(("face", "right_hand"), 0.25),),
            ("spine", "right_arm"),
            _board,
            settings=replace(EVERY_FRAME, wide_probe_deg=15.0, smoothness=0.03),
        ),
        Case(
            "past_slats",
            "wave past a row of bars",
            Wave(hand="right"),
            0.0,
            3.2,
            (_cover(("face", "right_hand"), 0.2),),
            ("spine", "neck_head", "right_arm"),
            _slats,
            settings=EVERY_FRAME,
        ),
        Case(
            "out_of_shade",
            "wave where a canopy keeps the light from the hand",
            Wave(hand="right"),
            0.0,
            3.2,
            (_cover(("right_hand", "right_forearm"), 0.4), _cover(("face",), 0.0)),
            ("spine", "neck_head", "right_arm"),
            _shade,
            _shade_lamps,
        ),
        Case(
            "hide",
            "hide behind a low wall while the eyes stay visible",
            Crouch(depth_01=0.45),
            0.0,
            3.0,
            (_cover(("torso", "arms"), -0.4), FeatureTarget("coverage", ("eyes",), 0.0, 0.3)),
            ("spine_bend", "head_nod", "arms"),
            _low_wall,
            settings=STILL,
        ),
        Case(
            "introvert",
            "talk with smaller gestures",
            Talk(),
            15.0,
            2.6,
            (
                _cover(("face",), -0.1),
                FeatureTarget("horizontal_extension", ("arms",), -0.15),
                FeatureTarget("vertical_extension", ("arms",), -0.1),
            ),
            ("spine", "neck_head", "arms"),
            settings=replace(SEARCHED, rest_pull=0.003),
        ),
        Case(
            "extravert",
            "talk with larger gestures",
            Talk(),
            15.0,
            2.6,
            (
                _cover(("face",), 0.05),
                FeatureTarget("horizontal_extension", ("arms",), 0.25),
                FeatureTarget("vertical_extension", ("arms",), 0.15),
            ),
            ("spine", "neck_head", "arms"),
        ),
    )
}


@dataclass(frozen=True, eq=False)
class StagedCase:
    """A case ready to be warped and drawn: the clip, the body with what it holds, the view."""

    case: Case
    character: Character
    clip: Clip
    body: SeenBody
    view: Outlook
    units: tuple[WarpingUnit, ...]


def case_named(name: str) -> Case:
    """Return a preset.

    Raises:
        MotionError: there is none of that name.
    """
    if name not in CASES:
        raise MotionError(f"there is no case {name!r}; choose from {', '.join(CASES)}")
    return CASES[name]


def observer_eye_m(case: Case) -> Vector:
    """Return where the observer's eyes are (3,)."""
    bearing = np.radians(case.bearing_deg)
    x, z = -np.sin(bearing) * case.distance_m, -np.cos(bearing) * case.distance_m
    return np.array([x, EYE_HEIGHT_M, z])


def tablet() -> StaticMesh:
    """Return a tablet computer, upright, its screen to +z."""
    return join_meshes(
        box((0, 0, 0), (0.18, 0.25, 0.009), (40, 42, 46), chamfer_m=0.002),
        box((0, 0, 0.005), (0.16, 0.22, 0.001), (120, 170, 220)),
    )


def grip_of_tablet(character: Character, clip: Clip) -> Pose:
    """Return how the right hand holds the tablet: its screen to the holder's front at the start."""
    place = forward(character.skeleton, clip.root_m[0], clip.orientation_wxyz[0])
    hand = character.skeleton.index("right_hand")
    turn = place.orientation_wxyz[hand]
    inverse = turn * np.array([1.0, -1.0, -1.0, -1.0])
    facing_front = np.array([0.0, 0.0, 1.0, 0.0])  # half a turn about y: the screen to −z
    before_fingers = rotate(inverse, np.array([0.0, 0.02, -0.07]))
    palm = np.array([0.10, -0.03, -0.02])
    return Pose(palm + before_fingers, quat_multiply(inverse, facing_front))


def stage_case(case: Case, character: Character, *, size_px: int = SIZE_PX) -> StagedCase:
    """Return a case with a character in it."""
    person = Person(build_of_character(character), case.kind, seed=5)
    clip = bake(person, CLIP_S)
    eye = observer_eye_m(case)
    centre = clip.root_m.mean(axis=0) + np.array([0.0, 0.30, 0.0])
    body = body_of(character)
    if case.holds_tablet:
        body = holding(body, tablet(), "right_hand", grip_of_tablet(character, clip))
    view = outlook(
        looking_at(eye, centre, VIEW_RADIUS_M),
        size_px,
        occluders=case.things(),
        lights=case.lamps(),
        lit_centre_m=centre,
        ambient_01=0.08,
    )
    return StagedCase(case, character, clip, body, view, units_named(case.units))
