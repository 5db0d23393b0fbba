"""Films as stimuli: a scene of some duration seen by a camera; one alone, or two side by side.

A film is data. The path of a moving camera is computed from the scene, the camera's settings and a
seed. In a browser the film is a file, drawn once and the same for everybody; a headset or a monitor
shows its scene itself.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, Literal, TypeAlias

import numpy as np

from visavis.lab.errors import DesignError
from visavis.lab.geometry import Vector, quat_from_yaw_pitch_deg, unit, yaw_pitch_deg_of
from visavis.lab.kinds import of_kinds
from visavis.protocol.plan.columns import Column
from visavis.stimuli.camera.shots import ShotSize
from visavis.study.live import LiveScene
from visavis.study.responses import Response
from visavis.study.scenes import PAIR, Scene

MAX_FILM_S: Final = 600.0
MAX_SIDE_PX: Final = 1920
CODEC: Final = "vp09.00.31.08"
"""Codec to ask browsers for, before they play our films: VP9, profile 0, level 3.1, 8 bit."""
MIME: Final = f'video/webm; codecs="{CODEC}"'
SOUND_MIME: Final = f'video/webm; codecs="{CODEC}, opus"'
SOUND_COLUMNS: Final = (
    Column(
        "sound_on_ns",
        "ns",
        "session time at which the film's sound began: on a page by the film's own clock (what the "
        "sound card adds is not in it); empty if it was not heard",
    ),
    Column("volume_01", "1", "volume of the film in the browser, 0 where it was muted"),
)
"""Beside `FILM_COLUMNS` where films have a voice."""
FILM_COLUMNS: Final = (
    Column("wait_ms", "ms", "from the page's step to the first picture that was presented"),
    Column(
        "first_at_ms",
        "ms",
        "where in the film that picture stood (of a pair: the later one): those before it were not "
        "presented, or the browser said so late, and times from it are so much shorter",
    ),
    Column("rounds", "1", "whole rounds that were shown (of a pair: of the one with fewer)"),
    Column("frames_dropped", "1", "pictures of the film that the browser did not present"),
    Column("stalls", "1", "times the film stood still because the browser waited for it"),
    Column("hidden_ms", "ms", "time for which the page could not be seen"),
    Column("apart_ms", "ms", "most that the two films of a pair were apart; empty for one"),
    Column("sha256", "", "file that was played; of a pair left, right; none in simulations"),
)
"""Columns that a page adds to a trial's row beside `film_on_ns`, `film_off_ns`, `film_frames`.

The film's name goes before each of these.
"""


@dataclass(frozen=True)
@of_kinds()
class Lens:
    """A camera that stands still, in metres of the scene: the eye, the point it aims at, and half
    the height of the picture one metre away.
    """

    eye_m: tuple[float, float, float] = (0.75, 1.25, 0.0)
    aim_m: tuple[float, float, float] = (0.0, 1.08, -2.6)
    half_height_01: float = 0.36

    def __post_init__(self) -> None:
        if self.eye_m == self.aim_m or not 0.01 <= self.half_height_01 <= 3.0:
            raise DesignError(
                f"{self} sees nothing; aim_m must not be eye_m, half_height_01 is 0.01 to 3"
            )

    @property
    def turn_wxyz(self) -> Vector:
        """The camera's orientation: it looks along −z, its top up."""
        towards = np.subtract(self.aim_m, self.eye_m)
        yaw_deg, pitch_deg = yaw_pitch_deg_of(unit(towards))
        return quat_from_yaw_pitch_deg(float(yaw_deg), float(pitch_deg))


@dataclass(frozen=True)
@of_kinds()
class Directed:
    """A director films whoever plays the `subject`: on the `tracks` that the room's own topology
    gives, or between places `scattered` in it at random; with `cuts`, and moving or standing still
    between them. `seed` draws the lengths of shots, and the scattered places.
    """

    over: Literal["tracks", "scattered"] = "tracks"
    shot: ShotSize = ShotSize.LONG
    cuts: bool = True
    moves: bool = True
    fov_v_deg: float = 40.0
    seed: int = 0
    subject: str = "active"

    def __post_init__(self) -> None:
        _check_view(self.fov_v_deg)
        if self.over not in ("tracks", "scattered"):
            raise DesignError(f"a director films over {self.over!r}; give tracks or scattered")


@dataclass(frozen=True)
@of_kinds()
class Following:
    """A camera that follows whoever plays the `subject` at fixed distances behind them, above their
    head and to their right, and never cuts.
    """

    back_m: float = 2.6
    above_m: float = 0.35
    right_m: float = 0.45
    shot: ShotSize = ShotSize.LONG
    fov_v_deg: float = 40.0
    subject: str = "active"

    def __post_init__(self) -> None:
        _check_view(self.fov_v_deg)
        if not 0.5 <= self.back_m <= 20.0:
            raise DesignError(f"a camera follows {self.back_m} m behind; give 0.5 to 20 m")


@dataclass(frozen=True)
@of_kinds()
class Placed:
    """Cameras at places (x, y, z) in metres that turn to whoever plays the `subject`; the film
    cuts to the one that shows them best.
    """

    places_m: tuple[tuple[float, float, float], ...]
    shot: ShotSize = ShotSize.LONG
    fov_v_deg: float = 40.0
    min_shot_s: float = 2.0
    subject: str = "active"

    def __post_init__(self) -> None:
        _check_view(self.fov_v_deg)
        if not self.places_m:
            raise DesignError("no camera was placed; name at least one place (x, y, z) in metres")


def _check_view(fov_v_deg: float) -> None:
    if not 5.0 <= fov_v_deg <= 120.0:
        raise DesignError(f"a camera sees {fov_v_deg} degrees up and down; give 5 to 120")


@dataclass(frozen=True)
@of_kinds(file=str | Path)
class Voice:
    """The sound of a film: a recording (WAV) beside the study, from `from_s` seconds on.

    Below 0 there is silence until it begins.
    Before a headset or a monitor it comes from the head of whoever plays the role `speaker`.
    """

    file: str
    from_s: float = 0.0
    speaker: str = "active"

    def __post_init__(self) -> None:
        if not self.file or not abs(self.from_s) < MAX_FILM_S:
            raise DesignError(
                f"{self} is no sound; name a WAV file, and a time of less than {MAX_FILM_S:g} s"
            )


Moving: TypeAlias = Directed | Following | Placed
"""Cameras that follow the person they film; any other camera is a `Lens`."""


@dataclass(frozen=True)
@of_kinds(scene=Any)
class Film:
    """A scene from its onset on, `seconds` long, at `rate_hz` pictures a second.

    `lens` is the camera: one that stands still, or one that films somebody wherever they go.
    `seed` is its chance (blinks): a film is the same for everybody and in every trial.
    """

    scene: Scene
    seconds: float
    size_px: tuple[int, int] = (720, 720)
    rate_hz: int = 60
    seed: int = 0
    lens: Lens | Moving = Lens()
    may_crop: bool = field(default=False, repr=False)
    """Whether a still camera may cut off people who move; else such a film is not built."""
    voice: Voice | None = field(default=None, repr=False)
    """What is heard with it; of a pair one film alone is heard (`voiced_film`)."""

    def __post_init__(self) -> None:
        if not isinstance(self.scene, Scene):
            raise DesignError(
                f'a film shows a Scene and not {self.scene!r}; write Film(Scene("NAME"), seconds)'
            )
        if not 1 <= self.rate_hz <= 120:
            raise DesignError(f"a film of {self.rate_hz} pictures a second; give 1 to 120")
        if not 1 / self.rate_hz <= self.seconds <= MAX_FILM_S:
            raise DesignError(f"a film of {self.seconds} s; give up to {MAX_FILM_S:g} s")
        if any(not 64 <= side <= MAX_SIDE_PX or side % 2 for side in self.size_px):
            raise DesignError(
                f"a film of {self.size_px[0]} x {self.size_px[1]} pixels; give even numbers from "
                f"64 to {MAX_SIDE_PX}"
            )

    @property
    def frame_count(self) -> int:
        """How many pictures it has."""
        return max(1, round(self.seconds * self.rate_hz))


@dataclass(frozen=True)
@of_kinds()
class Pair:
    """Two films side by side that begin together."""

    left: Film
    right: Film

    def __post_init__(self) -> None:
        for film in (self.left, self.right):
            if not isinstance(film, Film):
                raise DesignError(
                    f"a pair is of two films and not of {film!r}; write Pair(Film(…), …)"
                )


@dataclass(frozen=True)
class LiveFilm:
    """A film that is no file: a page draws its scene live, people and things as they move in it.

    On a flat page it is seen by the film's camera; in a headset one stands below the camera's eye,
    turned to where it aims, and may look about. Who moves in it does so as was computed before: it
    answers nobody, eyes that look at the participant look at the camera's eye. Faces are still.

    Raises:
        DesignError: the camera of the film moves, or the film has a voice.
    """

    film: Film

    def __post_init__(self) -> None:
        if not isinstance(self.film, Film) or not isinstance(self.film.lens, Lens):
            raise DesignError("a live film is of a Film by a camera that stands still: lens=Lens()")
        if self.film.voice is not None:
            raise DesignError("a live film is silent; leave voice out, or watch the film itself")

    @property
    def lens(self) -> Lens:
        """The camera."""
        assert isinstance(self.film.lens, Lens)  # noqa: S101  # as was checked
        return self.film.lens


Stimulus: TypeAlias = Film | Pair | LiveScene | LiveFilm


@dataclass(frozen=True)
class Viewing:
    """What is watched with questions below it: answers count after `min_rounds` whole rounds.

    Without `replay` a page shows one round and then stays at the last picture.
    """

    stimulus: Stimulus
    responses: tuple[Response, ...]
    caption: str = ""
    min_rounds: int = 1
    replay: bool = True

    def __post_init__(self) -> None:
        if not 0 <= self.min_rounds <= 100:
            raise DesignError(f"min_rounds is {self.min_rounds}; give 0 to 100")
        if not self.replay and self.min_rounds > 1:
            raise DesignError(f"min_rounds is {self.min_rounds} without replay; give 0 or 1")
        if not self.replay and isinstance(self.stimulus, LiveScene):
            raise DesignError("live figures go on moving; replay=False is for films")


def films_of(stimulus: Stimulus) -> Mapping[str, Film]:
    """Return films by their place: "film", or "left" and "right"; none of what is drawn live."""
    match stimulus:
        case Film():
            return {"film": stimulus}
        case Pair(left=left, right=right):
            return {"left": left, "right": right}
        case _:
            return {}


def scene_of(stimulus: Film | Pair) -> Scene:
    """Return the scene that shows the same in a headset or on a monitor.

    Two films of one scene by different cameras show that scene.
    """
    if isinstance(stimulus, Film):
        return stimulus.scene
    if stimulus.left.scene == stimulus.right.scene and stimulus.left.lens != stimulus.right.lens:
        return stimulus.left.scene
    return Scene(PAIR, left=stimulus.left.scene, right=stimulus.right.scene)


def voiced_film(stimulus: Stimulus) -> Film | None:
    """Return the film that is heard: of a pair the left one if it has a voice, else the right."""
    return next((film for film in films_of(stimulus).values() if film.voice is not None), None)


def seconds_of(stimulus: Stimulus) -> float:
    """Return how long one round takes."""
    if isinstance(stimulus, LiveScene):
        return stimulus.cycle_s
    if isinstance(stimulus, LiveFilm):
        return stimulus.film.seconds
    return max(film.seconds for film in films_of(stimulus).values())


def film_columns(films: int, *, heard: bool = False) -> dict[str, Column]:
    """Return descriptions of the columns of this number of films (or pairs) in a trial, by name;
    `heard` where films have a voice.
    """
    of = (*FILM_COLUMNS, *SOUND_COLUMNS) if heard else FILM_COLUMNS
    names = ["film", *(f"film{k}" for k in range(2, films + 1))][:films]
    columns = (replace(c, name=f"{name}_{c.name}") for name in names for c in of)
    return {c.name: c for c in columns}
