"""What `t.show` shows and for how long, as a trial says it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal, TypeAlias

import numpy as np

from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DesignError
from visavis.protocol.plan.columns import Column
from visavis.protocol.plan.steps import FrameView
from visavis.stimuli.audible import Audible
from visavis.stimuli.flat import Flat, Panorama
from visavis.stimuli.gaze_window import GazeWindow
from visavis.study.gaze_on import GazeOn
from visavis.study.responses import Keys
from visavis.study.scenes import Scene

Stimulus: TypeAlias = Flat | Audible | Panorama
Stimuli: TypeAlias = Stimulus | Sequence[Stimulus] | Mapping[str, Stimulus]
"""What is shown in a showing: one stimulus, several, or several by name."""
Reveal: TypeAlias = Literal["pointer", "gaze", "around gaze"]
"""What of a picture is seen: what a pointer is on, or gaze; or all but what gaze is on."""
BLUR_OF_WINDOW: Final = 0.125
"""How far a picture is blurred, as a share of the window in it, unless a study says so."""
PAGE_COLUMNS: Final = (
    Column("px_per_deg", "1/deg", "pixels of the page in a degree, in the middle of its screen"),
    Column(
        "size_error_01",
        "1",
        "standard error of sizes in degrees as a share of them: how well the page's screen and the "
        "distance to it were measured",
    ),
    Column("stimuli_outside", "1", "stimuli of the trial that did not fit on the page"),
)
"""Columns that flat stimuli on a page add to a trial's row beside those of each."""


@dataclass(frozen=True)
class Showing:
    """What is shown, and for how long: the frames, or else the seconds. Its columns' name.

    With `window_deg` it is blurred but for a window so wide, which follows the pointer. `sounds`
    begin with it.
    """

    scene: Scene
    seconds: float
    frames: int | None
    name: str
    is_flat: bool = False
    window_deg: float = 0.0
    sounds: tuple[Audible, ...] = ()

    @property
    def is_heard_alone(self) -> bool:
        """Whether there is nothing to see; times then run from the onset of the sound."""
        options = self.scene.options
        return bool(self.sounds) and not options.get("items") and "panorama" not in options

    def calm_until_ns(self, view: FrameView, on_ns: int) -> int:
        """Return until when nothing of it changes, two frames before its end."""
        frame_ns = view.surface.frame_ns
        lasts_ns = self.seconds * NS_PER_S if self.frames is None else self.frames * frame_ns
        return max(0, round(on_ns + lasts_ns - 2 * frame_ns))

    def is_over(self, frames: int, view: FrameView, on_ns: int) -> bool:
        """Tell whether what the next frame shows is no longer this; `frames` were lit so far."""
        if self.frames is not None:
            return frames >= self.frames
        if self.is_heard_alone:  # light comes a frame after it is asked for; sound is not hurried
            return view.t_ns >= on_ns + self.seconds * NS_PER_S
        next_ns = view.t_ns + view.surface.frame_ns
        return next_ns + view.surface.frame_ns / 2 > on_ns + self.seconds * NS_PER_S


@dataclass(frozen=True)
class StimulusParts:
    """What is shown together: what is seen flat, its names, what is heard, and what is around."""

    flats: tuple[Flat, ...] = ()
    names: tuple[str, ...] = ()
    sounds: tuple[Audible, ...] = ()
    panorama: Panorama | None = None

    @property
    def is_empty(self) -> bool:
        """Whether there is none of it."""
        return not (self.flats or self.sounds) and self.panorama is None


def parts_of(what: object) -> StimulusParts:
    """Return the parts of what is shown; nothing of a scene.

    Raises:
        DesignError: there are two panoramas.
    """
    names: tuple[str, ...] = ()
    if isinstance(what, Mapping):
        names = tuple(str(name) for name, one in what.items() if isinstance(one, Flat))
        what = list(what.values())
    elif isinstance(what, Stimulus):
        what = [what]
    if not isinstance(what, Sequence) or not all(isinstance(one, Stimulus) for one in what):
        return StimulusParts()
    panoramas = [one for one in what if isinstance(one, Panorama)]
    if len(panoramas) > 1:
        raise DesignError("t.show: two panoramas cannot be around somebody at a time; show one")
    return StimulusParts(
        tuple(one for one in what if isinstance(one, Flat)),
        names,
        tuple(one for one in what if isinstance(one, Audible)),
        next(iter(panoramas), None),
    )


def sound_columns(prefix: str, count: int) -> list[str]:
    """Return the columns of the onsets of so many sounds that begin together."""
    return [f"{prefix}_sound{k if k > 1 else ''}_on_ns" for k in range(1, count + 1)]


def awaited_keys(
    until: Callable[[FrameView], bool] | GazeOn | Keys | None, limit_s: float | None
) -> Keys | None:
    """Return the keys that end what is shown, with how long they are waited for.

    Raises:
        DesignError: they name no keys, or there are none to wait for.
    """
    if not isinstance(until, Keys):
        if limit_s is not None:
            raise DesignError("t.show: limit_s is how long keys are waited for: until=Keys(…)")
        return None
    if until.names_no_keys:
        raise DesignError(
            f'Keys("{until.name}") names an answer; say which keys: Keys("answer", '
            f'["{until.name}"]), or two at least: Keys("f", "j")'
        )
    return until if limit_s is None else replace(until, limit_s=limit_s)


def shown_seconds(
    seconds: float | None,
    frames: int | None,
    keys: Keys | None,
    until: object,
) -> float:
    """Return how long something is shown at most.

    Raises:
        DesignError: nothing says so, or two things do.
    """
    if seconds is not None and frames is not None:
        raise DesignError("t.show: give seconds or frames, not both")
    if frames is not None:
        if isinstance(frames, bool) or not isinstance(frames, int) or frames < 1:
            raise DesignError(f"t.show(frames={frames!r}): give a whole number from 1")
        return frames / 60.0
    if seconds is None:
        if keys is None:
            how = "seconds=, which is the longest it is shown" if until else "seconds= or frames="
            raise DesignError(f"t.show: say how long: {how}, or until=Keys(…)")
        return keys.limit_s
    return duration("show", seconds)


def duration(step: str, seconds: float) -> float:
    """Return how long a step lasts, in seconds.

    Raises:
        DesignError: nothing lasts so long.
    """
    if not 0 <= seconds < np.inf:
        raise DesignError(f"t.{step}({seconds}): give seconds from 0")
    return float(seconds)


def window_of(
    reveal: Reveal | None, window_deg: float, edge_deg: float, blur_deg: float | None
) -> GazeWindow | None:
    """Return the window through which something is seen, after gaze or pointer; None without one.

    Raises:
        DesignError: it is none.
    """
    if reveal is None:
        return None
    if not 0.1 <= window_deg <= 60:
        raise DesignError(f"t.show: window_deg is {window_deg:g}; from 0.1 to 60 degrees")
    if not 0 <= edge_deg <= window_deg:
        raise DesignError(f"t.show: edge_deg is {edge_deg:g}; from 0 to {window_deg:g}, window_deg")
    if blur_deg is not None and not 0 <= blur_deg <= 60:
        raise DesignError(f"t.show: blur_deg is {blur_deg:g}; from 0 (covered) to 60 degrees")
    if reveal == "pointer" and (edge_deg or blur_deg is not None):
        raise DesignError(
            "t.show: a window after the pointer has a sharp edge, and what is around it a blur of "
            "its own; leave out edge_deg and blur_deg"
        )
    is_around = reveal == "around gaze"
    if blur_deg is None:
        blur_deg = 0.0 if is_around else window_deg * BLUR_OF_WINDOW
    return GazeWindow(float(window_deg), float(edge_deg), float(blur_deg), is_around)
