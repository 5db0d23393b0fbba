"""A step of a trial as its study yields it, and what it gives back."""

from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

from visavis.lab.clock import NS_PER_MS
from visavis.protocol.plan.steps import AskReply, FrameView, Step
from visavis.stimuli.audible import Audible
from visavis.stimuli.sound import Waveform
from visavis.study.films import Viewing
from visavis.study.gaze_on import GazeOn
from visavis.study.live import Moulding
from visavis.study.responses import Response
from visavis.study.scenes import Scene
from visavis.study.showing import Showing

Source: TypeAlias = Waveform | Path | Audible
"""What can be played: samples, a file, or a stimulus that is heard."""
Performing: TypeAlias = Generator[Step, FrameView | AskReply | None, Any]
"""The engine's steps of which a step of the kit consists."""


@dataclass(frozen=True)
class ShownScene:
    """The result of showing a scene: onset and end of its light, and its roles."""

    on_ns: int
    off_ns: int
    roles: Mapping[str, int]
    view: FrameView

    @property
    def ms(self) -> float:
        """How long it was shown."""
        return (self.off_ns - self.on_ns) / NS_PER_MS


@dataclass(frozen=True)
class PlayedSound:
    """The result of playing a sound: its onset; None where it was not reported."""

    on_ns: int | None
    seconds: float


@dataclass(frozen=True, eq=False)
class Action:
    """A step of the kit: its `name`, its shortest duration in `seconds`, `perform` runs it.

    `response` is the question, `scene` the scene shown, `sound` the sound played, each with the
    name by which its `column` begins, `role` the armband that vibrates: for reading a trial without
    performing it. `showing` is how flat stimuli are shown where no condition ends them, `gaze_on`
    the gaze that ends a step; `sounds` are heard with what is shown.
    """

    name: str
    perform: Callable[[], Performing] = field(repr=False)
    seconds: float = 0.0
    response: Response | None = None
    scene: Scene | None = None
    viewing: Viewing | None = None
    moulding: Moulding | None = None
    sound: Source | None = None
    column: str = ""
    role: str = ""
    waits_for_end: bool = False
    showing: Showing | None = None
    gaze_on: GazeOn | None = None
    sounds: tuple[Audible, ...] = ()

    @property
    def responses(self) -> tuple[Response, ...]:
        """All questions, in order."""
        if self.viewing is not None:
            return self.viewing.responses
        if self.moulding is not None:
            return self.moulding.sliders
        return () if self.response is None else (self.response,)
