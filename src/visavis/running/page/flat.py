"""Flat stimuli on a page: what it is sent, what it says of their light, and the columns of both.

A page gets what is shown one after another as one step, so that no network stands between two
stimuli: until a key is waited for, or something else is asked for. A step's `parts` are what is
shown, each for some `seconds` or `frames`, or until the key, which is timed from the part `from`.
"""

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from itertools import takewhile
from pathlib import Path
from typing import Any, Final, get_args

import numpy as np

from visavis.lab.clock import NS_PER_MS
from visavis.lab.errors import DesignError
from visavis.lab.geometry import Pose
from visavis.lab.screen import FlatScreen, PlacedScreen
from visavis.protocol.plan.steps import Mark
from visavis.running.page.panorama import (
    check_turns,
    frame_ms_of,
    panorama_on_page,
    read_panorama,
    read_turns_of_part,
)
from visavis.running.page.steps import (
    WAYS,
    FilmPlayback,
    PageError,
    PageStep,
    Reply,
    count,
    mapping,
    number,
    read_film,
)
from visavis.stimuli.areas import areas_text
from visavis.stimuli.audible import Audible, Sound, Tone
from visavis.stimuli.flat import Dots, Flat, Grating, Image, Shape, Text, Video, rgb_of
from visavis.stimuli.panels import Surface
from visavis.stimuli.scenes.flat import DRESSED_BY, FlatScene
from visavis.stimuli.view_turns import VIEW_TURNED, Turn, ViewTurns
from visavis.study.actions import Action
from visavis.study.area_measures import POINTER_WINDOW
from visavis.study.dry_run import still_view
from visavis.study.lit_trial import shown_event
from visavis.study.responses import Keys
from visavis.study.scenes import FLAT, Scene, StagedFlat, areas_of
from visavis.study.showing import BLUR_OF_WINDOW, sound_columns

MAX_PARTS: Final = 1000
MAX_VIEW_PX: Final = 100_000
BY_CARD: Final = "card"
TYPED: Final = "typed"
ASSUMED: Final = "assumed"
USUAL_PX_PER_MM: Final = 96 / 25.4
"""Size of a CSS pixel by its standard, where nobody held a card against the screen."""
USUAL_DISTANCE_MM: Final = 570.0
"""Distance from the eyes to a screen where nobody said theirs: there a centimetre is a degree."""
MIN_DISTANCE_MM: Final = 150.0
MAX_DISTANCE_MM: Final = 3000.0
CARD_ERROR_01: Final = 0.02
"""A card is set to within some two millimetres of its 85.6."""
TYPED_ERROR_01: Final = 0.10
"""People guess their distance, and lean."""
ASSUMED_SIZE_ERROR_01: Final = 0.25
ASSUMED_DISTANCE_ERROR_01: Final = 0.25
"""Screens and habits differ: a size in degrees is then little more than an order of magnitude."""
MAX_PATH: Final = 20_000
"""Places of a pointer in one part; more than five minutes of frames."""


@dataclass(frozen=True)
class PageScreen:
    """The screen that a page shows on: CSS pixels in a millimetre, the eyes' distance, and whether
    each was measured (`BY_CARD`, `TYPED`) or `ASSUMED`.
    """

    px_per_mm: float
    distance_mm: float
    size_by: str
    distance_by: str

    @property
    def px_per_deg(self) -> float:
        """CSS pixels in a degree at the middle of the screen."""
        return self.px_per_mm * self.distance_mm * math.pi / 180

    @property
    def size_error_01(self) -> float:
        """Standard error of sizes in degrees, as a share: what the ways of measuring allow."""
        of_size = CARD_ERROR_01 if self.size_by == BY_CARD else ASSUMED_SIZE_ERROR_01
        of_distance = TYPED_ERROR_01 if self.distance_by == TYPED else ASSUMED_DISTANCE_ERROR_01
        return round(math.hypot(of_size, of_distance), 3)


def measured_screen(px_per_mm: float | None, distance_mm: float | None) -> PageScreen:
    """Return the screen that somebody measured; None stands for what they could not tell."""
    return PageScreen(
        USUAL_PX_PER_MM if px_per_mm is None else px_per_mm,
        USUAL_DISTANCE_MM if distance_mm is None else distance_mm,
        ASSUMED if px_per_mm is None else BY_CARD,
        ASSUMED if distance_mm is None else TYPED,
    )


class ComingScene:
    """The result of a showing before the page has shown it: its times follow with the next answer.

    Raises:
        DesignError: a trial reads a time that nobody knows yet.
    """

    def __init__(self) -> None:
        self.roles: Mapping[str, int] = {}
        self.view = still_view()

    def __getattr__(self, name: str) -> Any:
        if name not in ("on_ns", "off_ns", "ms"):
            raise AttributeError(name)
        raise DesignError(
            f"{name} of what t.show showed is not known yet on a page, which shows all up to the "
            "next key or question without a break; read it after that, or from the trial's columns"
        )


@dataclass(frozen=True)
class _Part:
    """What is shown at one time, and the prefix of its columns ("" where it has none); `source`
    is the scene that the study gave.
    """

    content: Mapping[str, Any]
    name: str = ""
    scene: ComingScene | None = None
    source: Scene | None = None

    @property
    def is_heard_alone(self) -> bool:
        """Whether there is nothing to see; times then run from the onset of the sound."""
        return bool(self.content.get("sounds")) and not is_seen(self.content)

    @property
    def is_limited(self) -> bool:
        """Whether it ends by itself."""
        return self.content["seconds"] is not None or self.content["frames"] is not None


@dataclass
class Sequence:
    """What a trial shows until its page is asked for an answer or for something else."""

    parts: list[_Part] = field(default_factory=list)

    def show(self, action: Action, name: str, files: Callable[[Any], Mapping[str, Any]]) -> Any:
        """Add what `t.show` shows, without its keys; return the showing's result."""
        showing, scene = action.showing, ComingScene()
        assert showing is not None  # noqa: S101 - whoever calls this has looked
        options = showing.scene.options
        content: dict[str, Any] = {
            "items": [item_on_page(item, files) for item in options["items"]],
            "background": colour_on_page(options["background"]),
            "seconds": None if showing.frames is not None else showing.seconds,
            "frames": showing.frames,
        }
        if showing.sounds:
            content["sounds"] = [sound_on_page(one, files) for one in showing.sounds]
        if "names" in options:
            content["names"] = list(options["names"])
        if "panorama" in options:
            content["panorama"] = panorama_on_page(options["panorama"], files)
        if showing.window_deg:
            blur_deg = showing.window_deg * BLUR_OF_WINDOW
            content["reveal"] = {"window_deg": showing.window_deg, "blur_deg": blur_deg}
        if isinstance(action.response, Keys) and showing.seconds >= action.response.limit_s:
            content["seconds"] = None  # until the key, or its limit
        self.parts.append(_Part(content, name, scene, showing.scene))
        return scene

    def add_dark(self, seconds: float | None) -> None:
        """Add darkness for some seconds, or until the key."""
        nothing: Mapping[str, Any] = {"items": [], "background": "#000000", "frames": None}
        self.parts.append(_Part({**nothing, "seconds": seconds}))

    def add_wait(self, seconds: float | None) -> None:
        """Add more time of what was shown last."""
        content = {name: v for name, v in self.parts[-1].content.items() if name != "sounds"}
        again = {"seconds": seconds, "frames": None, "goes_on": True}
        self.parts.append(_Part(content | again))

    def step(self, keys: Keys | None, since: int | None) -> PageStep:
        """Return the step for a page; a key is timed from the last part that has columns, and
        heard from the part `since` on (None: from that one).
        """
        timed = max(k for k, part in enumerate(self.parts) if part.name)
        content: dict[str, Any] = {"parts": [part.content for part in self.parts], "keys": None}
        if keys is not None:
            content["keys"] = {
                "options": list(map(str, keys.options)),
                "limit_s": keys.limit_s,
                "from": timed,
                "since": timed if since is None else since,
                "question": keys.name,
            }
        return PageStep("show", content)


def is_seen(part: Mapping[str, Any]) -> bool:
    """Tell whether there is something to see in a part of a step."""
    return bool(part["items"]) or "panorama" in part


def colour_on_page(colour: Any) -> str:
    """Return a colour as "#rrggbb"."""
    return "#{:02x}{:02x}{:02x}".format(*rgb_of(colour))


def item_on_page(item: Flat, files: Callable[[Any], Mapping[str, Any]]) -> dict[str, Any]:
    """Return a flat stimulus as a page draws it; `files` describes pictures."""
    content = {**asdict(item), "kind": type(item).__name__.lower(), "at_deg": list(item.at_deg)}
    match item:
        case Text() | Shape() | Dots():
            content |= {"rgb": colour_on_page(item.colour)}
            return content | ({"shape": item.kind} if isinstance(item, Shape) else {})
        case Grating():
            return content
        case Image() | Video():
            return content | dict(files(item))


def sound_on_page(audible: Audible, files: Callable[[Any], Mapping[str, Any]]) -> dict[str, Any]:
    """Return a tone or sound as a page plays it; `files` describes its samples."""
    return {**asdict(audible), "kind": type(audible).__name__.lower(), **files(audible)}


def read_sound_item(content: Mapping[str, Any]) -> Audible:
    """Return the tone or sound of which a page was told."""
    kind = Tone if content["kind"] == "tone" else Sound
    return kind(**{f.name: content[f.name] for f in fields(kind)})


def read_item(content: Mapping[str, Any]) -> Flat:
    """Return the flat stimulus of which a page was told."""
    kind = next(kind for kind in get_args(Flat) if kind.__name__.lower() == content["kind"])
    own = {f.name: content[f.name] for f in fields(kind) if f.name != "kind" and f.name in content}
    own = {name: tuple(v) if isinstance(v, list) else v for name, v in own.items()}
    item: Flat = kind(**own, **({"kind": content["shape"]} if kind is Shape else {}))
    return item


def flat_scene(part: Mapping[str, Any], folder: Path) -> FlatScene:
    """Return a part of a step as the scene that it is elsewhere; pictures lie in `folder`."""
    return FlatScene(
        name=FLAT,
        agents=(),
        dressed_by=DRESSED_BY,
        items=tuple(read_item(item) for item in part["items"]),
        background_srgb=rgb_of(part["background"]),
        folder=folder,
        names=tuple(part.get("names", ())),
        sounds=tuple(map(read_sound_item, part.get("sounds", ()))),
        panorama=read_panorama(part["panorama"]) if "panorama" in part else None,
    )


CLOCKS: Final = ("output_timestamp", "output_latency", "current_time", "simulated")
"""What a browser's audio time was placed on the page's clock by, from the surest on."""
COURSES: Final = {"pointer": "reveal", "turns": "panorama"}
"""What a page reports of the course of a part that shows something."""
SILENT: Final[Mapping[str, Any]] = {
    "on_ms": 0.0,
    "error_ms": 0.0,
    "latency_ms": 0.0,
    "by": "simulated",
}
"""What a page would say of a sound."""


@dataclass(frozen=True)
class SoundOnset:
    """When the first sample of a part's sounds left the browser, in milliseconds of the page's
    clock; half the range in which the browser said so, its `latency_ms`, and by what it knew.
    """

    on_ms: float
    error_ms: float
    latency_ms: float
    by: str


@dataclass(frozen=True)
class Lit:
    """The light of one part, in milliseconds of the page's clock: from its first frame to the
    first without it, with the frames that it had and those that its browser left out; and its
    sounds and films, if it has any.
    """

    on_ms: float
    off_ms: float
    frames: int
    frames_dropped: int
    sound_onset: SoundOnset | None = None
    films: tuple[FilmPlayback, ...] = ()


def read_lit(content: Mapping[str, Any]) -> list[Lit]:
    """Read what a page says of the light of every part.

    Raises:
        PageError: the content is malformed.
    """
    parts = content.get("parts")
    if not isinstance(parts, list) or not 1 <= len(parts) <= MAX_PARTS:
        raise PageError("parts are what was shown")
    return [
        Lit(
            number(mapping(part, "a part").get("on_ms"), "on_ms"),
            number(part.get("off_ms"), "off_ms"),
            count(part.get("frames"), "frames"),
            count(part.get("dropped"), "dropped"),
            None if part.get("sound") is None else _read_sound_onset(part["sound"]),
            tuple(map(read_film, part.get("films", ()))),
        )
        for part in parts
    ]


def films_of_part(part: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the films that begin with a part of a step."""
    items = () if part.get("goes_on") else part["items"]
    return [item for item in items if item["kind"] == "video"]


def of_part_unseen(part: Mapping[str, Any], at_ms: float = 0.0, seconds: float = 0.0) -> Any:
    """Return what a page would say of a part's sounds, films, window and view, which nobody heard,
    saw and turned.
    """
    films = [
        {
            "first_ms": at_ms,
            "frames": max(1, round(film["pictures"] * min(1.0, seconds / film["lasts_s"]))),
            "dropped": 0,
            "rounds": 0,
            "stalls": 0,
        }
        for film in films_of_part(part)
    ]
    sound = {"sound": {**SILENT, "on_ms": at_ms}} if part.get("sounds") else {}
    courses = {name: list[Any]() for name, what in COURSES.items() if what in part}
    return sound | ({"films": films} if films else {}) | courses


def _read_sound_onset(content: Any) -> SoundOnset:
    onset = mapping(content, "a sound")
    if onset.get("by") not in CLOCKS:
        raise PageError(f"a sound was timed by {str(onset.get('by'))[:40]!r}")
    on_ms, error_ms, latency_ms = (
        number(onset.get(name), name) for name in ("on_ms", "error_ms", "latency_ms")
    )
    if error_ms < 0:
        raise PageError(f"error_ms is {error_ms}")
    return SoundOnset(on_ms, error_ms, latency_ms, onset["by"])


def read_screen(content: Any) -> PageScreen:
    """Read the screen on which a page says that it showed something.

    Raises:
        PageError: it is none.
    """
    screen = mapping(content, "a screen")
    read = measured_screen(screen.get("px_per_mm"), screen.get("distance_mm"))
    number(read.px_per_mm, "px_per_mm")
    check_distance(read.distance_mm)
    return read


def screen_of(content: Mapping[str, Any], usual_view_px: tuple[int, int] = (0, 0)) -> FlatScreen:
    """Return the screen that a page was, from its reply: as large as its window, which is usual
    where it did not say.
    """
    page, (wide, high) = read_screen(content.get("screen")), content.get("view_px", usual_view_px)
    m_per_px = 1 / (1000 * page.px_per_mm)
    return FlatScreen(wide * m_per_px, high * m_per_px, wide, high, page.distance_mm / 1000)


def before_eyes(screen: FlatScreen) -> Surface:
    """Return a page's screen where it stands: upright before eyes that are at the origin."""
    return Surface(PlacedScreen(screen, Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))))


def check_distance(distance_mm: Any) -> None:
    """Refuse an impossible distance.

    Raises:
        PageError: it is one.
    """
    if not MIN_DISTANCE_MM <= number(distance_mm, "distance_mm") <= MAX_DISTANCE_MM:
        raise PageError(f"distance_mm is {distance_mm}")


def check_shown(step: PageStep, content: Mapping[str, Any]) -> None:
    """Refuse a reply that does not tell how a step's parts were shown.

    Raises:
        PageError: saying what is wrong.
    """
    if content.get("failed") is not None:
        mapping(content["failed"], "what failed")
        return
    lit, asked = read_lit(content), step.content["keys"]
    parts = len(step.content["parts"])
    if len(lit) > parts or (asked is None and len(lit) < parts):
        raise PageError(f"{len(lit)} parts were shown, not {parts}")
    if asked is not None and len(lit) <= asked["from"]:
        raise PageError("what the key answers to was not shown")
    for one, part in zip(lit, step.content["parts"], strict=False):
        if (one.sound_onset is None) == bool(part.get("sounds")):
            raise PageError("every part with sounds says when they began, and no other")
        if len(one.films) != len(films_of_part(part)):
            raise PageError("every part with films says how they were presented, and no other")
    if any(not one.on_ms <= one.off_ms for one in lit):
        raise PageError("a part was gone before it was there")
    read_screen(content.get("screen"))
    count(content.get("outside"), "outside")
    if "view_px" in content:
        _check_view(content["view_px"])
    for part, asked_part in zip(content["parts"], step.content["parts"], strict=False):
        if "reveal" in asked_part:
            read_path(part)
            _check_view(content.get("view_px"))
        if "panorama" in asked_part:
            frame_ms_of(content)
            _check_view(content.get("view_px"))
    check_turns(step.content["parts"], content["parts"])
    answer = content.get("answer")
    if answer is None:
        return
    if asked is None:
        raise PageError("no key was asked for")
    pressed = mapping(answer, "the answer")
    number(pressed.get("at_ms"), "at_ms")
    if pressed.get("option") not in asked["options"] or pressed.get("by") not in WAYS:
        raise PageError(f"{str(pressed.get('option'))[:40]!r} is none of its keys")


def read_path(part: Mapping[str, Any]) -> list[tuple[float, float, float]]:
    """Return where the window of a part was: since when, in ms, and its middle in pixels from the
    page's top left.

    Raises:
        PageError: the content is malformed.
    """
    path = part.get("pointer")
    if not isinstance(path, list) or len(path) > MAX_PATH:
        raise PageError("a pointer's path is a list of [ms, x, y]")
    if any(not isinstance(row, list) or len(row) != 3 for row in path):
        raise PageError("a pointer's path has rows of ms, x and y")
    return [(number(ms, "ms"), number(x, "x"), number(y, "y")) for ms, x, y in path]


def pointer_events(sequence: Sequence, reply: Reply, folder: Path, trial_id: str) -> Iterator[Mark]:
    """Yield what is recorded of every part that was seen through a window after the pointer: where
    that was, and where the areas of interest were, on the page's screen.
    """
    for part, lights in _with_what_stayed(sequence, reply):
        if "reveal" not in part.content:
            continue
        rows = [row for light in lights for row in read_path(light)]
        screen, (wide, high) = read_screen(reply.content.get("screen")), reply.content["view_px"]
        surface = before_eyes(screen_of(reply.content))
        areas = areas_of(replace(flat_scene(part.content, folder), surface=surface))
        path = [(reply.t_ns_of(ms), round(x, 1), round(y, 1)) for ms, x, y in rows]
        yield Mark(
            POINTER_WINDOW,
            {
                "trial_id": trial_id,
                "name": part.name,
                "window_deg": part.content["reveal"]["window_deg"],
                "width_px": wide,
                "height_px": high,
                "px_per_mm": screen.px_per_mm,
                "distance_mm": screen.distance_mm,
                "path": json.dumps(path, separators=(",", ":")),
                "areas": areas_text(areas),
            },
        )


def panorama_events(
    sequence: Sequence, reply: Reply, folder: Path, trial_id: str
) -> Iterator[Mark]:
    """Yield what is recorded of every panorama, as before a monitor: how it stood before the screen
    of the page, and every turn of the view.
    """
    for part, lights in _with_what_stayed(sequence, reply):
        if "panorama" not in part.content or part.source is None:
            continue
        on_ns = reply.t_ns_of(number(lights[0]["on_ms"], "on_ms"))
        surface = before_eyes(screen_of(reply.content))
        scene = replace(flat_scene(part.content, folder), surface=surface, moves_since_ns=on_ns)
        staged_scene = StagedFlat(scene, areas=areas_of(scene))
        about = shown_event(trial_id, part.name, part.source, staged_scene, on_ns)
        yield Mark("shown", about)
        turns = view_turns(lights, reply)
        for turn in turns.turns:
            values = turn.as_event(turns.frame_ns)
            yield Mark(VIEW_TURNED, {"trial_id": trial_id, "name": part.name, **values})


def view_turns(lights: Iterable[Mapping[str, Any]], reply: Reply) -> ViewTurns:
    """Return how the view turned while a page showed a panorama, in session time; `lights` are what
    it says of the parts that did.
    """
    turns = [turn for light in lights for turn in read_turns_of_part(light)]
    frame_ns = round(frame_ms_of(reply.content) * NS_PER_MS)
    return ViewTurns(frame_ns, [Turn(reply.t_ns_of(t.at_ms), t.from_deg, t.to_deg) for t in turns])


def _with_what_stayed(
    sequence: Sequence, reply: Reply
) -> Iterator[tuple[_Part, list[Mapping[str, Any]]]]:
    """Yield every part that has columns, and what a page says of its light: of its own, and of what
    `t.wait` left there.
    """
    parts = list(zip(sequence.parts, reply.content["parts"], strict=False))
    for k, (part, light) in enumerate(parts):
        if part.name:
            later = takewhile(lambda one: one[0].content.get("goes_on"), parts[k + 1 :])
            yield part, [light, *(more for _, more in later)]


def sound_events(sequence: Sequence, reply: Reply, trial_id: str) -> Iterator[Mark]:
    """Yield what is recorded of every sound: which it was, and how its onset is known."""
    for part, lighting in zip(sequence.parts, read_lit(reply.content), strict=False):
        if lighting.sound_onset is None:
            continue
        for sound in part.content["sounds"]:
            yield Mark(
                "sound",
                {
                    "trial_id": trial_id,
                    "name": part.name,
                    "sound": sound.get("title", ""),
                    "sound_sha256": sound.get("sound_sha256", ""),
                    "seconds": sound.get("length_s"),
                    "gain_db": sound.get("gain_db"),
                    "on_ns": reply.t_ns_of(lighting.sound_onset.on_ms),
                    "error_ms": lighting.sound_onset.error_ms,
                    "latency_ms": lighting.sound_onset.latency_ms,
                    "by": lighting.sound_onset.by,
                },
            )


def _check_view(view_px: Any) -> None:
    if not isinstance(view_px, list) or len(view_px) != 2:
        raise PageError("view_px are width and height of the page")
    for px in view_px:
        if not 1 <= count(px, "view_px") <= MAX_VIEW_PX:
            raise PageError(f"view_px is {px}")


def shown_columns(sequence: Sequence, reply: Reply) -> dict[str, Any]:
    """Return the columns of a trial's row that follow from what a page showed.

    What a key ended before its turn has no columns. What `t.wait` left there ends with that.
    """
    row: dict[str, Any] = {}
    lit = read_lit(reply.content)
    screen = read_screen(reply.content.get("screen"))
    for k, (part, light) in enumerate(zip(sequence.parts, lit, strict=False)):
        if not part.name:
            continue
        last, frames, dropped = light, light.frames, light.frames_dropped
        for later, more in zip(sequence.parts[k + 1 :], lit[k + 1 :], strict=False):
            if not later.content.get("goes_on"):
                break
            last, frames, dropped = more, frames + more.frames, dropped + more.frames_dropped
        row |= {
            f"{part.name}_on_ns": reply.t_ns_of(light.on_ms),
            f"{part.name}_off_ns": reply.t_ns_of(last.off_ms),
            f"{part.name}_frames": frames,
            f"{part.name}_frames_dropped": dropped,
        }
        if light.sound_onset is not None:
            onsets = sound_columns(part.name, len(part.content["sounds"]))
            row |= dict.fromkeys(onsets, reply.t_ns_of(light.sound_onset.on_ms))
            row[f"{part.name}_sound_error_ms"] = light.sound_onset.error_ms
        if light.films:
            onsets_ns = [reply.t_ns_of(film.first_ms) for film in light.films]
            places_ms = [f.first_at_ms for f in light.films if f.first_at_ms is not None]
            row |= {
                f"{part.name}_film_on_ns": min(onsets_ns),
                f"{part.name}_film_first_at_ms": max(places_ms, default=None),
                f"{part.name}_film_pictures": sum(film.frames for film in light.films),
                f"{part.name}_film_dropped": sum(film.frames_dropped for film in light.films),
            }
        if part.scene is not None:
            on_ns, off_ns = row[f"{part.name}_on_ns"], row[f"{part.name}_off_ns"]
            part.scene.__dict__.update(on_ns=on_ns, off_ns=off_ns, ms=(off_ns - on_ns) / 1e6)
    if not any(is_seen(part.content) for part in sequence.parts):
        return row
    row |= {
        "px_per_deg": round(screen.px_per_deg, 3),
        "size_error_01": screen.size_error_01,
        "stimuli_outside": count(reply.content.get("outside"), "outside"),
    }
    return row
