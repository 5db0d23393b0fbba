"""Scenes by name: those that come with Visavis, and those that a study adds.

A study writes `Scene("two_people", active="left", eyes="directed")`; a maker turns that into a
`StagedScene`: geometry, roles, and the changes from frame to frame.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from inspect import signature
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np
import numpy.typing as npt

from visavis.lab.errors import DesignError
from visavis.lab.geometry import Vector
from visavis.lab.kinds import takes_kinds, wrong_kind
from visavis.lab.screen import PlacedScreen
from visavis.lab.yaml_lines import did_you_mean
from visavis.protocol.plan.steps import FrameView, GazeView, UpdateAhead
from visavis.stimuli.area_paths import is_gone
from visavis.stimuli.areas import Areas, PictureAreas
from visavis.stimuli.audible import Audible
from visavis.stimuli.dressing.casting import default_casting
from visavis.stimuli.dressing.gathering import agents_of
from visavis.stimuli.dressing.picture_of import named_function
from visavis.stimuli.film_file import FilmFacts, facts_of
from visavis.stimuli.flat import Colour, Flat, Image, Panorama, Video, picture_path, rgb_of
from visavis.stimuli.gaze.behaviour import Course, EyeBehaviour
from visavis.stimuli.gaze.blinks import draw_blinks
from visavis.stimuli.gaze_window import GazeWindow, WindowPlace
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.faces import Face, shape_lacking
from visavis.stimuli.motion.kinds import Sit
from visavis.stimuli.moving_heads import MovingHeads, moving_heads
from visavis.stimuli.own_room import PlacedRoom, Room
from visavis.stimuli.room_shape import areas_of_room
from visavis.stimuli.scene import Scene as StageScene
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes.audience import (
    PARTICIPANT_EYE_M,
    PLACES,
    SPEAKER_EYE_M,
    audience_scene,
)
from visavis.stimuli.scenes.flat import DRESSED_BY, FlatScene
from visavis.stimuli.scenes.gathering import GatheringScene, Standing
from visavis.stimuli.view_turns import ViewTurns
from visavis.study.arguments import argument_names, unknown_argument
from visavis.study.eyes import EYES, NO_GAZE, check_eyes, past_m
from visavis.study.gaze_window import WindowCourse
from visavis.study.named_motions import motion_of, motion_options

FOLLOW_STEP_M: Final = 0.005
"""Eyes that look at the participant follow the head in steps of this size: 0.2° at 1.4 m."""
BEYOND_S: Final = 120.0
"""Blinks are drawn for this time beyond the planned duration, because answers may take longer."""
FLAT: Final = "flat"
"""The scene of flat stimuli, which `t.show(Text(…))` makes."""
OPEN_FILMS: Final = "visavis.stimuli.dressing.flat:open_films"
PICTURE_SIZE: Final = "visavis.stimuli.flat_pixels:picture_size"
AREAS_OF: Final = "visavis.stimuli.dressing.flat:areas_of"
ROOM: Final = "room"
"""The scene of a laboratory's own room with nobody in it, which `t.show(Room(…))` makes."""
PAIR: Final = "pair"
"""The scene that shows two others side by side: `Scene("pair", left=Scene(…), right=Scene(…))`."""
FACE_OPTIONS: Final = ("face", "face_01", "face_from_s", "face_until_s")
"""What a scene of people takes beside its own options: the face of the active person."""
AROUND: Final = ("room", *FACE_OPTIONS)
BESIDE_M: Final = 0.75
"""Distance from the middle of a pair to the middle of each of its scenes."""
STOP_M: Final = 0.5
"""Where somebody who walks towards the participant stops, if the study does not say."""
MIN_WAY_M: Final = 0.5
AUDIENCE: Final = (
    *(f"female_{i:02d}" for i in range(1, 7)),
    *(f"male_{i:02d}" for i in range(1, 6)),
)


@dataclass(frozen=True, init=False)
class Scene:
    """A scene by name with its options, which its maker checks."""

    name: str
    options: Mapping[str, Any] = field(default_factory=dict)

    def __init__(self, name: str, **options: Any) -> None:
        if wrong := wrong_kind("name", name, str):
            raise DesignError(f"Scene: {wrong}")
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "options", options)

    def __hash__(self) -> int:
        return hash((self.name, tuple(sorted(self.options.items()))))


class StagedScene(Protocol):
    """A scene ready to be shown, frame by frame."""

    @property
    def scene(self) -> StageScene:
        """The part that does not change, whose agents are recorded."""
        ...

    @property
    def roles(self) -> Mapping[str, int]:
        """The index of the agent that plays each role ("active")."""
        ...

    def frame(self, view: FrameView, elapsed_ns: int) -> SceneFrame | None:
        """Return what to show from the next frame on; None while nothing changes."""
        ...


@dataclass
class WithEyes:
    """Agents whose eyes move: to targets, to the participant, and in blinks.

    `observer_m` is where those look who look at the participant, (3,), or (m, 3) for m agents who
    move, as if their eyes were still where they were at the onset.
    """

    scene: StageScene
    roles: Mapping[str, int]
    eyes: EyeBehaviour
    observer_m: Vector = field(default_factory=lambda: np.array(PARTICIPANT_EYE_M))
    step_m: float = FOLLOW_STEP_M
    areas: tuple[Areas, ...] = ()
    _was_moving: bool = True
    _is_shown: bool = False

    @cached_property
    def _heads(self) -> MovingHeads | None:
        return moving_heads(self.scene)

    def look(self, eyes: EyeBehaviour) -> None:
        """Change what the eyes do from the next frame on."""
        self.eyes, self._is_shown = eyes, False

    def frame(self, view: FrameView, elapsed_ns: int) -> SceneFrame | None:
        """Return a frame if eyes moved, or if the participant moved and eyes follow; else None."""
        has_changed = self.follow(view) or not self._is_shown
        gaze, openness, moving = self.eyes.at(elapsed_ns, self.observer_m)
        if not (has_changed or moving or self._was_moving):
            return None
        self._was_moving, self._is_shown = moving, True
        distance_m = self.eyes.distance_m(elapsed_ns, self.observer_m)
        return SceneFrame(self.scene, view.t_ns, gaze, openness, gaze_distance_m=distance_m)

    def ahead(
        self, t_ns: Sequence[int], elapsed_ns: npt.NDArray[np.int64], heads_m: Vector
    ) -> "EyesAhead | None":
        """Return what `frame` will return for coming frames in which the head is tracked, at
        `heads_m` (n, 3); None for a scene in which more than eyes changes.
        """
        if type(self).frame is not WithEyes.frame or type(self).follow is not WithEyes.follow:
            return None
        heads_m = heads_m[:, None]
        if (moved_m := self._moved_m(np.asarray(t_ns))) is not None:
            heads_m = heads_m - moved_m
        course = self.eyes.course(
            elapsed_ns,
            heads_m,
            self.observer_m,
            self.step_m,
            is_shown=self._is_shown,
            was_moving=self._was_moving,
        )
        return EyesAhead(self.scene, t_ns, course)

    def pass_frames(self, pictures: "EyesAhead", n: int) -> None:
        """Take the first n of the frames that were told as if `frame` had returned them."""
        course = pictures.course
        observer_m = course.observer_m[n - 1]
        self.observer_m = (observer_m[0] if self._heads is None else observer_m).copy()
        if course.is_new[:n].any():
            self._was_moving, self._is_shown = bool(course.is_moving[n - 1]), True

    def follow(self, view: FrameView) -> bool:
        """Take the participant's head position; tell whether it moved by at least a step."""
        if not view.head_valid:
            return False
        moved_m = self._moved_m(np.array([view.t_ns]))
        now_m = np.array(view.head.position_m, np.float64)
        if moved_m is not None:
            now_m = now_m - moved_m[0]
        steps_m = np.atleast_2d(now_m - self.observer_m).tolist()
        if all(x * x + y * y + z * z < self.step_m**2 for x, y, z in steps_m):
            return False
        self.observer_m = now_m
        return True

    def _moved_m(self, t_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.float64] | None:
        """Return how far (n, m, 3) agents have moved since the onset, zero while nobody looks at
        the participant; None where they stay in their places.
        """
        if self._heads is None:
            return None
        first_m = np.array([a.head_centre_m for a in self.scene.agents])
        if not self.eyes.follows_observer.any():
            return np.zeros((len(t_ns), *first_m.shape))
        moved_m: npt.NDArray[np.float64] = self._heads.centres_m(t_ns) - first_m
        return moved_m


class EyesAhead:
    """Coming frames of a scene in which only eyes move (`visavis.protocol.plan.steps.Pictures`)."""

    def __init__(self, scene: StageScene, t_ns: Sequence[int], course: Course) -> None:
        n, m = course.state.shape[0], course.state.shape[1] // 5
        self.course = course
        self.is_new = course.is_new
        self.gaze_direction = course.state[:, : 3 * m].reshape(n, m, 3)
        self.eye_openness_01 = course.state[:, 3 * m : 4 * m]
        self.gaze_distance_m = course.state[:, 4 * m :]
        self._scene, self._t_ns = scene, t_ns
        self._frames: dict[int, SceneFrame] = {}

    def after(self, i: int) -> SceneFrame:
        """Return what is new after frame i, the same object each time."""
        frame = self._frames.get(i)
        if frame is None:
            frame = self._frames[i] = SceneFrame(
                self._scene,
                self._t_ns[i],
                self.gaze_direction[i],
                self.eye_openness_01[i],
                gaze_distance_m=self.gaze_distance_m[i],
            )
        return frame


@dataclass
class PassingScene(UpdateAhead):
    """The `update` of quiet frames that show a staged scene, which came on at `onset_ns`.

    It counts `frames`, and collects their `gazes` unless that is None.
    """

    staged_scene: StagedScene
    onset_ns: int
    gazes: list[GazeView] | None = None
    frames: int = 0
    last: SceneFrame | None = None
    """The last frame that this showed; those that were told ahead are left out."""

    def __call__(self, view: FrameView) -> SceneFrame | None:
        """Return what to show after a frame; None without a change."""
        self._count((view.gaze,))
        coming = self.staged_scene.frame(view, view.t_ns - self.onset_ns)
        self.last = coming or self.last
        return coming

    def ahead(self, t_ns: Sequence[int], heads_m: Vector) -> EyesAhead | None:
        """Return what is shown after coming frames; None where that is not known."""
        scene = self.staged_scene
        if not isinstance(scene, WithEyes):
            return None
        return scene.ahead(t_ns, np.array(t_ns) - self.onset_ns, heads_m)

    def pass_frames(self, pictures: EyesAhead, gazes: Sequence[GazeView]) -> None:
        """Take as many frames as there are gazes."""
        self._count(gazes)
        if isinstance(self.staged_scene, WithEyes):
            self.staged_scene.pass_frames(pictures, len(gazes))

    def _count(self, gazes: Sequence[GazeView]) -> None:
        self.frames += len(gazes)
        if self.gazes is not None:
            self.gazes += gazes


@dataclass(frozen=True)
class Staging:
    """The input of a maker beside the scene's options: random numbers, duration and onset.

    `folder` is the study file's, from which relative paths start; `start_ns` the session time of
    the frame before the onset; `screen` is what people sit before, None in a headset. Without
    `heads_move` everything looks for heads where they were at the onset, as older versions did.
    What is read of a recording alone `may_lack_files` of pictures and films.
    """

    rng: np.random.Generator
    duration_s: float
    start_ns: int = 0
    folder: Path = Path()
    screen: PlacedScreen | None = None
    heads_move: bool = True
    may_lack_files: bool = False


Maker = Callable[..., StagedScene]
"""Makes a staged scene: called with a `Staging` and the scene's options by name."""


@takes_kinds("scene two_people")
def two_people(
    staging: Staging,
    *,
    active: str = "left",
    eyes: str = "directed",
    distance_m: float = 1.6,
    apart_deg: float = 32.0,
    left: str = "female_01",
    right: str = "male_01",
) -> StagedScene:
    """Return two people who sit beside each other and face the participant.

    The `active` one ("left" or "right") looks at the participant ("directed") or past them
    ("averted"); the other always looks past. Of one without gaze `eyes` says "none".

    Raises:
        DesignError: an option is none of these.
    """
    sides = ("left", "right")
    _one_of("two_people", "active", active, sides)
    _one_of("two_people", "eyes", eyes, (*EYES, NO_GAZE))
    people = []
    for side, character, sign in zip(sides, (left, right), (-1.0, 1.0), strict=True):
        bearing = np.radians(sign * apart_deg / 2)
        x, z = distance_m * float(np.sin(bearing)), -distance_m * float(np.cos(bearing))
        turn = 180.0 - sign * apart_deg / 2
        people.append(Standing(character, side, x, z - 0.16, turn, Sit(hands="lap"), 11))
    return scene_of_people(staging, "two_people", tuple(people), active, eyes)


@takes_kinds("scene person")
def person(
    staging: Staging,
    *,
    motion: str = "idle",
    character: str = "female_01",
    distance_m: float = 2.6,
    bearing_deg: float = 0.0,
    turn_deg: float = 0.0,
    eyes: str = "averted",
    stop_m: float | None = None,
    **how: Any,
) -> StagedScene:
    """Return one person who does something: a motion by name with its settings, or a clip's path.

    `bearing_deg` is to the participant's right; with `turn_deg` 0 the person faces them. `eyes`
    look at the participant ("directed") or past them ("averted"); a figure without gaze has "none".
    A walk
    begins `distance_m` from the participant; towards them it ends `stop_m` before the point where
    they are at first (left out: 0.5), any other way it has no end.

    Raises:
        DesignError: an option is none of these, or there is no way to walk.
        MotionError: the clip cannot be read, or a setting is out of range.
    """
    _one_of("person", "eyes", eyes, (*EYES, NO_GAZE))
    bearing = np.radians(bearing_deg)
    x, z = distance_m * float(np.sin(bearing)), -distance_m * float(np.cos(bearing))
    if motion == "walk" and (turn_deg == 0.0 or stop_m is not None):
        how = {**how, "distance_m": _way_m(distance_m, turn_deg, stop_m)}
    elif stop_m is not None:
        raise DesignError(f"scene person: {motion} does not come nearer; stop_m is for walk")
    does = motion_of(motion, how, staging.folder, character)
    one = Standing(character, "person", x, z, 180.0 - bearing_deg + turn_deg, does, 7)
    return scene_of_people(staging, f"person_{motion}", (one,), "person", eyes)


def _way_m(distance_m: float, turn_deg: float, stop_m: float | None) -> float:
    """Return how far somebody walks who comes from a distance and stops before the participant."""
    if turn_deg != 0.0:
        raise DesignError(
            f"scene person: with turn_deg {turn_deg:g} nobody walks towards the participant; leave "
            "out stop_m, or turn_deg"
        )
    stop_m = STOP_M if stop_m is None else stop_m
    if not 0.0 <= stop_m <= distance_m - MIN_WAY_M:
        raise DesignError(
            f"scene person: from distance_m {distance_m:g} to stop_m {stop_m:g} there is no way to "
            f"walk; it takes {MIN_WAY_M:g} m at least"
        )
    return distance_m - stop_m


@takes_kinds("scene audience")
def audience(
    staging: Staging, *, active: str = "centre_middle", eyes: str = "directed"
) -> StagedScene:
    """Return the seated audience of eleven; `active` names the place of the one whose eyes count.

    Everyone else looks at the speaker, behind the participant on the left.

    Raises:
        DesignError: an option is none of these.
    """
    _one_of("audience", "active", active, PLACES)
    _one_of("audience", "eyes", eyes, EYES)
    order = staging.rng.permutation(len(AUDIENCE))
    scene = audience_scene(tuple(AUDIENCE[i] for i in order))
    blinks = draw_blinks(staging.rng, len(PLACES), staging.duration_s + BEYOND_S)
    behaviour = EyeBehaviour.of_scene(scene, target_m=SPEAKER_EYE_M, blinks=blinks)
    who = PLACES.index(active)
    behaviour = behaviour.staring(who) if eyes == "directed" else behaviour
    return WithEyes(scene, {"active": who, **places(scene)}, behaviour)


@dataclass
class StagedRoom:
    """A laboratory's own room with nobody in it."""

    scene: StageScene
    areas: tuple[Areas, ...]
    roles: Mapping[str, int] = field(default_factory=dict)
    _is_shown: bool = False

    def frame(self, view: FrameView, elapsed_ns: int) -> SceneFrame | None:
        """Return the first frame; None after it."""
        if self._is_shown:
            return None
        self._is_shown = True
        return SceneFrame(self.scene, view.t_ns, np.zeros((0, 3)), np.zeros(0))


def empty_room(staging: Staging, *, room: object) -> StagedScene:
    """Return a laboratory's own room with nobody in it.

    Raises:
        DesignError: its file cannot be read, or is no such room.
    """
    room_place = _place_of(ROOM, room, staging)
    return StagedRoom(StageScene(ROOM, (), room=room_place), (areas_of_room(room_place),))


def _place_of(name: str, room: object, staging: Staging) -> PlacedRoom:
    if not isinstance(room, Room):
        raise DesignError(f"scene {name}: room is {room!r}; write room=Room({str(room)!r})")
    return PlacedRoom.of(room, staging.folder, staging.screen)


def _in_room(staged_scene: StagedScene, scene: Scene, staging: Staging) -> StagedScene:
    """Return a scene in a laboratory's own room."""
    room_place = _place_of(scene.name, scene.options["room"], staging)
    areas = areas_of_room(room_place)
    if not isinstance(staged_scene, WithEyes):
        raise DesignError(f"scene {scene.name} has a place of its own; leave out room")
    for area in areas.areas:
        if area.name in staged_scene.roles:
            raise DesignError(
                f"{room_place.path}: a mesh is called {area.name!r}, like a role or place of scene "
                f"{scene.name}; call it otherwise"
            )
    staged_scene.scene = replace(staged_scene.scene, room=room_place)
    staged_scene.areas = (areas,)
    return staged_scene


@takes_kinds("a scene's face")
def _with_face(
    staged_scene: StagedScene,
    scene: Scene,
    face: str = "",
    face_01: float = 1.0,
    face_from_s: float = 0.0,
    face_until_s: float = np.inf,
) -> StagedScene:
    """Return a scene whose active person makes a face, so much of it, from then on until then."""
    gathering = staged_scene.scene
    if (
        not isinstance(staged_scene, WithEyes)
        or not isinstance(gathering, GatheringScene)
        or "active" not in staged_scene.roles
    ):
        raise DesignError(f"nobody in scene {scene.name} makes faces; leave out face")
    if not face:
        raise DesignError(
            f"scene {scene.name}: {', '.join(FACE_OPTIONS[1:])} are of a face; name it"
        )
    try:
        expression = Face(face, face_01, face_from_s, face_until_s)
    except MotionError as error:
        raise DesignError(f"scene {scene.name}: {error}") from error
    people, who = list(gathering.people), staged_scene.roles["active"]
    character = people[who].character
    if lacking := shape_lacking(default_casting(character), face):
        raise DesignError(
            f"scene {scene.name}: {character} cannot make the face {face}: its file has no shape "
            f"such as {lacking}; leave out face, or let somebody else play this part"
        )
    people[who] = replace(people[who], face=expression)
    staged_scene.scene = replace(gathering, people=tuple(people))
    return staged_scene


@dataclass
class StagedFlat:
    """Flat stimuli, which stand where the participant is at their first frame."""

    scene: FlatScene
    roles: Mapping[str, int] = field(default_factory=dict)
    areas: tuple[PictureAreas, ...] = ()
    course: WindowCourse = field(default_factory=WindowCourse)
    """The course of the window that follows gaze, if there is one."""
    _last: SceneFrame | None = None
    _report_count: int = 0

    @property
    def films(self) -> tuple[FilmFacts, ...]:
        """The films among them, the one all around first."""
        return tuple(facts_of(film, self.scene.folder) for film in self.scene.films)

    @property
    def stays(self) -> bool:
        """Whether neither gaze nor keys change what a frame shows, nor a class that says so itself
        frame by frame.
        """
        follows = self.scene.gaze_window is not None or self.scene.panorama is not None
        return not follows and type(self).frame is StagedFlat.frame

    def open_films(self, view: FrameView) -> None:
        """Decode the first pictures of films, as large as they will stand there."""
        decode = named_function(OPEN_FILMS, "decodes films")
        decode(replace(self.scene, head=view.head, surface=view.surface))

    def frame(self, view: FrameView, elapsed_ns: int) -> SceneFrame | None:
        """Return the first frame; after it one where the view turned or the window moved, or None:
        nothing else changes.
        """
        place = None if self.scene.gaze_window is None else self.course.take(view)
        if self._last is not None:
            return self._next(self._last, view, place)
        since_ns = view.t_ns + view.surface.frame_ns
        self.scene = replace(
            self.scene,
            head=view.head,
            surface=view.surface,
            moves_since_ns=since_ns,
            turns=ViewTurns(view.surface.frame_ns),
        )
        if self.areas:
            self.areas = areas_of(self.scene)
        nobody = np.zeros((0, 3)), np.zeros(0)
        self._last = SceneFrame(self.scene, view.t_ns, *nobody, window_at=place)
        return self._last

    def new_turns(self) -> Sequence[Mapping[str, float]]:
        """Return what events say of what turned the view since the last call."""
        new = self.scene.turns.turns[self._report_count :]
        self._report_count += len(new)
        return [turn.as_event(self.scene.turns.frame_ns) for turn in new]

    def _next(
        self, last: SceneFrame, view: FrameView, place: WindowPlace | None
    ) -> SceneFrame | None:
        """Return a frame where it differs from the last one."""
        turned_deg = self._turned_deg(view)
        if turned_deg == last.turned_deg and place is last.window_at:
            return None
        self._last = replace(last, t_ns=view.t_ns, turned_deg=turned_deg, window_at=place)
        return self._last

    def _turned_deg(self, view: FrameView) -> tuple[float, float]:
        """Return how far arrow keys turned the view: onto a panorama, before a monitor."""
        if self.scene.panorama is None or self.scene.surface.screen is None:
            return 0.0, 0.0
        turns = self.scene.turns
        for control in view.pressed:
            turns.press(control, view.t_ns)
        return turns.at(view.t_ns + turns.frame_ns)


def flat(
    staging: Staging,
    *,
    items: tuple[Flat, ...] = (),
    background: Colour = "black",
    answered_by: str = "",
    names: tuple[str, ...] = (),
    sounds: tuple[Audible, ...] = (),
    panorama: Panorama | None = None,
    gaze_window: GazeWindow | None = None,
) -> StagedScene:
    """Return flat stimuli before a background, the last in front; those with names are areas.
    The `sounds` are heard meanwhile. A `panorama` is behind everything. With a `gaze_window` not
    all is seen.

    Raises:
        DesignError: there is none, a colour does not exist, or a picture or its areas cannot be
            read.
    """
    if not items and not sounds and panorama is None:
        raise DesignError("t.show: there is nothing to show; give a stimulus, or several in a list")
    all_items, folder = (*items, *((panorama,) if panorama else ())), staging.folder
    losses = [x for x in all_items if staging.may_lack_files and is_gone(x, folder)]
    for item in (item for item in items if item not in losses):
        if isinstance(item, Image):
            picture_size(picture_path(item, staging.folder))
        elif isinstance(item, Video):
            facts_of(item, staging.folder)
    scene = FlatScene(
        name=FLAT,
        agents=(),
        dressed_by=DRESSED_BY,
        items=items,
        background_srgb=rgb_of(background),
        folder=staging.folder,
        answered_by=answered_by,
        names=names,
        sounds=sounds,
        panorama=panorama,
        gaze_window=gaze_window,
    )
    return StagedFlat(scene, areas=areas_of(_without(losses, scene) if losses else scene))


def _without(losses: Sequence[Flat | Panorama], scene: FlatScene) -> FlatScene:
    """Return a scene without the stimuli whose files are gone."""
    there = [i for i, item in enumerate(scene.items) if item not in losses]
    return replace(
        scene,
        items=tuple(scene.items[i] for i in there),
        names=tuple(scene.names[i] for i in there) if scene.names else (),
        panorama=None if scene.panorama in losses else scene.panorama,
    )


def areas_of(scene: FlatScene) -> tuple[PictureAreas, ...]:
    """Return the areas of interest of flat stimuli; their reader is loaded only where there are.
    Of a panorama it tells where it stands, even without areas.

    Raises:
        DesignError: they cannot be read.
    """
    has_areas = scene.names or any(getattr(item, "areas", "") for item in scene.items)
    if not has_areas and scene.panorama is None:
        return ()
    sheets: tuple[PictureAreas, ...] = named_function(AREAS_OF, "places areas of interest")(scene)
    return sheets


def picture_size(path: Path) -> tuple[int, int]:
    """Return width and height of a picture in pixels; its reader is loaded only for such studies.

    Raises:
        DesignError: it cannot be shown.
    """
    read = named_function(PICTURE_SIZE, "reads pictures")
    wide, high = read(path, path.stat().st_mtime_ns if path.is_file() else 0)
    return wide, high


SCENES: Final[Mapping[str, Maker]] = {
    "two_people": two_people,
    "person": person,
    "audience": audience,
    FLAT: flat,
    ROOM: empty_room,
}
"""The scenes that come with Visavis."""


def stage(scene: Scene, staging: Staging, own: Mapping[str, Maker]) -> StagedScene:
    """Make a scene; the study's `own` makers, by name, come before those of Visavis.

    Raises:
        DesignError: there is no such scene, or it does not take such options.
    """
    makers = {**SCENES, **own}
    name = scene.name
    if name == PAIR:
        for option, half in scene.options.items():
            if not isinstance(half, Scene):
                raise DesignError(f"a pair takes scenes and no {option}; give it to one of them")
        sides = {side: stage(half, staging, own) for side, half in scene.options.items()}
        return _beside(staging, sides)
    maker = makers.get(name)
    if maker is None and name.endswith((".glb", ".gltf")):
        raise DesignError(
            f"a room is no scene by its name: show Room({name!r}), or give a scene its place: "
            f'Scene("person", room=Room({name!r}))'
        )
    if maker is None:
        names = tuple(n for n in makers if n not in (FLAT, ROOM))
        raise DesignError(f"there is no scene {name!r}{_nearest_of(name, names)}")
    option_names = _option_names(name, maker, scene.options)
    # What holds for scenes of any maker, where the maker does not take it itself.
    outer = ("room",) if option_names is None else AROUND
    inner = option_names or ()
    around = {k: v for k, v in scene.options.items() if k in outer and k not in inner}
    own_options = {k: v for k, v in scene.options.items() if k not in around}
    if option_names is not None:
        for option in own_options:
            if option not in option_names:
                choices = (*option_names, *(AROUND if maker in (person, two_people) else outer[:1]))
                raise DesignError(unknown_argument(f"scene {name}", option, choices))
    try:
        staged_scene = maker(staging, **own_options)
        if faces := {k: v for k, v in around.items() if k in FACE_OPTIONS}:
            staged_scene = _with_face(staged_scene, scene, **faces)
        return _in_room(staged_scene, scene, staging) if "room" in around else staged_scene
    except TypeError as error:
        raise DesignError(f"scene {name}: {str(error).partition('() ')[2] or error}") from error


def _nearest_of(name: str, names: tuple[str, ...]) -> str:
    """Return the nearest name, and all that there are, each once."""
    near = did_you_mean(name, names)
    return near if all(n in near for n in names) else f"{near}; there are {', '.join(names)}"


def _option_names(name: str, maker: Maker, options: Mapping[str, Any]) -> tuple[str, ...] | None:
    """Return the options that a scene takes; None if its maker takes any option."""
    option_names = argument_names(maker)[1:]
    passes_on = any(q.kind is q.VAR_KEYWORD for q in signature(maker).parameters.values())
    if not passes_on:
        return option_names
    if maker is not person:
        return None
    of_motion = motion_options(str(options.get("motion", "idle")))
    return tuple(dict.fromkeys((*option_names, *of_motion)))


def scene_of_people(
    staging: Staging,
    name: str,
    people: tuple[Standing, ...],
    active: str,
    eyes: str,
    *,
    room_by: str = "",
) -> WithEyes:
    """Return people in a room; `eyes` is the gaze of the person at the place `active`, "none" where
    a figure without gaze plays them. Others without gaze stand by.

    `room_by` names what makes the room ("module:function"); a plain one is made without.

    Raises:
        DesignError: the person's eyes cannot turn, or could.
    """
    agents = agents_of(people)
    who = [p.place for p in people].index(active)
    check_eyes(name, agents[who], eyes)
    scene = GatheringScene(
        name=name, agents=agents, people=people, start_ns=staging.start_ns, room_by=room_by
    )
    if not staging.heads_move:
        scene = replace(scene, moved_by="")
    past = np.array([past_m(a.eye_centre_m, a.facing) for a in agents])
    blinks = draw_blinks(staging.rng, len(agents), staging.duration_s + BEYOND_S)
    behaviour = EyeBehaviour.of_scene(scene, target_m=np.zeros(3), blinks=blinks)
    behaviour.targets_m[:] = past
    behaviour = behaviour.staring(who) if eyes == "directed" else behaviour
    return WithEyes(scene, {"active": who, **places(scene)}, behaviour)


def _beside(staging: Staging, sides: Mapping[str, StagedScene]) -> StagedScene:
    """Return two scenes of one person each as one scene, the first on the participant's left."""
    people = []
    for sign, (side, gathering) in zip((-1.0, 1.0), sides.items(), strict=True):
        alone: tuple[Standing, ...] = getattr(gathering.scene, "people", ())
        if len(alone) != 1:
            raise DesignError(f"a pair shows one person on each side; {side} has {len(alone)}")
        people.append(replace(alone[0], place=side, x_m=alone[0].x_m + sign * BESIDE_M))
    first = next(iter(sides.values())).scene.agents[0]
    eyes = "averted" if first.has_gaze else NO_GAZE
    pair = scene_of_people(staging, PAIR, tuple(people), people[0].place, eyes)
    rooms = {gathering.scene.room for gathering in sides.values()}
    if len(rooms) > 1:
        raise DesignError("a pair stands in one room; give both sides the same room, or neither")
    pair.scene = replace(pair.scene, room=rooms.pop())
    pair.areas = tuple(getattr(next(iter(sides.values())), "areas", ()))
    return pair


def places(scene: StageScene) -> dict[str, int]:
    """Return each person's index by place."""
    return {agent.place: i for i, agent in enumerate(scene.agents)}


def _one_of(scene: str, option: str, value: str, values: tuple[str, ...]) -> None:
    if value not in values:
        raise DesignError(f"scene {scene}: {option} is {value!r}{did_you_mean(value, values)}")
