"""The types of a study file's functions, except those of the report (`sections`)."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from visavis.lab.clock import NS_PER_S
from visavis.lab.geometry import Pose, Vector, quat_conjugate, rotate
from visavis.protocol.people.simulated_participant import SimulatedParticipant
from visavis.protocol.plan.experiment import Demands
from visavis.protocol.plan.session_plan import SessionPlan, Trial
from visavis.protocol.plan.shown_scene import RecordedScene
from visavis.protocol.plan.steps import Step
from visavis.stimuli.flat import Flat, Panorama
from visavis.stimuli.room_shape import areas_of_room, seen_of_room
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes.audience import PARTICIPANT_EYE_M
from visavis.stimuli.scenes.flat import FlatScene
from visavis.stimuli.sound import Waveform
from visavis.study.responses import Response
from visavis.study.scenes import areas_of
from visavis.study.sections import AnalysisOfStudy, ExperimentOfStudy
from visavis.study.trial import TrialScript

if TYPE_CHECKING:
    import pandas as pd

    from visavis.study.live import Live, LiveScene
    from visavis.study.moving_camera import FilmSeen


@dataclass(frozen=True)
class Seen:
    """What a person has seen since the trial began; the input of `answer`.

    `first` and `last` are the first and the last lit frame (None: none was), `seconds` the time
    between them; for the n agents of the last scene `looked_at_me_01` (n,) is the share of that
    time in which their gaze met the person's eyes, NaN of one without gaze. `effect` is False for
    somebody to whom what the stimuli make no difference: answers should then not depend on them.
    """

    first: SceneFrame | None
    last: SceneFrame | None
    seconds: float
    looked_at_me_01: npt.NDArray[np.float64]
    effect: bool
    leaning: float
    """A standard normal number of this person: the tendency towards high or low answers."""
    felt: tuple[str, ...] = ()
    """The armbands (roles) that vibrated since the trial began, in order of time."""
    experience_01: float = 0.0
    """This person's experience, from which questionnaire answers about experience follow."""
    films: "Mapping[str, FilmSeen]" = field(default_factory=dict)
    """Films by moving cameras that ran on a page, by where they stood ("film", "left", "right")."""
    live: "Live | None" = None
    """The live figure that is being moulded."""
    caption: str = ""
    """What stands above it."""
    figures: "LiveScene | None" = None
    """The live figures that are watched."""
    visit: int = 1
    """Which session of this person it is, counted from 1: what lies between two sessions happened
    to the person, not to what is shown. Nobody tells people what a study calls a session."""
    sounds: tuple[Waveform, ...] = ()
    """What reached both ears since the trial began, one sound after another: `pitch_hz` and
    `level_db` say what it was like, `samples` are all of it so far."""

    @property
    def stimuli(self) -> tuple[Flat | Panorama, ...]:
        """The texts, pictures, shapes, gratings and dots that are shown, the panorama before them;
        () where a scene is.
        """
        scene = None if self.first is None else self.first.scene
        if not isinstance(scene, FlatScene):
            return ()
        return scene.items if scene.panorama is None else (scene.panorama, *scene.items)

    @property
    def areas(self) -> dict[str, tuple[float, float]]:
        """The areas of interest of these, or the things seen in a `Room`, each with degrees to the
        right and upwards of its middle from straight ahead; of a film those that are there after so
        many `seconds`.
        """
        scene = None if self.first is None else self.first.scene
        if scene is not None and scene.room is not None:
            areas = areas_of_room(scene.room).areas
            return {
                areas[one.area].name: direction_deg(one.place_m - PARTICIPANT_EYE_M, None)
                for one in seen_of_room(scene.room, PARTICIPANT_EYE_M)
            }
        if not isinstance(scene, FlatScene):
            return {}
        screen = scene.surface.screen
        eyes = screen.place if screen is not None else scene.head
        now_ns = scene.moves_since_ns + round(self.seconds * NS_PER_S)
        return {
            area.name: direction_deg(one.place_m(*area.middle()), eyes)
            for one in areas_of(scene)
            for area in one.areas_now(now_ns)
            if area is not None
        }


def direction_deg(place_m: Vector, eyes: Pose | None) -> tuple[float, float]:
    """Return degrees to the right and upwards of a place, for eyes that look straight ahead."""
    offset = place_m
    if eyes is not None:
        offset = rotate(quat_conjugate(eyes.orientation_wxyz), place_m - eyes.position_m)
    x, y, z = offset.tolist()
    return float(np.degrees(np.arctan2(x, -z))), float(np.degrees(np.arctan2(y, -z)))


class TrackerModel(Protocol):
    """Measure true eye states as an eye tracker would."""

    def measure(
        self, eyes: npt.NDArray[np.void], *, first_sample: int, stretch: int, fit: int
    ) -> tuple[Vector, npt.NDArray[np.bool_]]:
        """Return combined directions in the head frame (n, 3) and validity (n,).

        `first_sample` counts the stretch's samples before these.
        """
        ...

    @property
    def delay_ns(self) -> int:
        """Time from a sample to its arrival."""
        ...


MakeTracker: TypeAlias = Callable[[int, int], TrackerModel]
"""Makes the tracker of a participant, given the study's seed and the place in the order."""

IntertrialPlan: TypeAlias = Callable[[TrialScript], Iterator[Step]]
"""What happens before a trial: a generator over its script."""
CheckOf: TypeAlias = Callable[[Mapping[str, Any]], None]
"""Raises DesignError for parameters that do not fit each other."""
DemandsOf: TypeAlias = Callable[[Mapping[str, Any]], Demands]
"""The demands of a study on a lab, given its parameters."""
RolesOf: TypeAlias = Callable[[Mapping[str, Any]], Sequence[str]]
"""Roles of devices, or names of questionnaires, given the parameters."""
PeopleOf: TypeAlias = Callable[[Mapping[str, Any]], int]
"""At most how many people are seen at once, given the parameters."""
PrepareOf: TypeAlias = Callable[[ExperimentOfStudy], Sequence[Callable[[], object]]]
"""Calls that load or compute something before a session."""
AnswerOf: TypeAlias = Callable[[Seen, Response, np.random.Generator], Any]
"""The answer of a simulated person: an option (or text), a `Race` for one with a time,
`WhenNear` for one at a distance, or `WhenGazeOn` for one after a look; None leaves the question
out."""
PersonOf: TypeAlias = Callable[[int, int, bool, ExperimentOfStudy], SimulatedParticipant]
"""The simulated participant at a place in the order, for a seed, with or without an effect."""
ScaledOf: TypeAlias = Callable[[int, int, float, ExperimentOfStudy], SimulatedParticipant]
"""The same with a multiple of the usual effect."""
QuickOf: TypeAlias = Callable[
    [ExperimentOfStudy, Any, TrackerModel],
    Callable[[SessionPlan], Iterator[tuple[Trial, Mapping[str, Any]]]],
]
"""Performs a plan for a person and a tracker without the engine: trials with their rows."""
ViewsOf: TypeAlias = Callable[[RecordedScene, ExperimentOfStudy], Iterator[SceneFrame]]
"""The views that a recorded frame may have shown, the likeliest first."""
FactsOf: TypeAlias = Callable[["pd.DataFrame"], "pd.DataFrame"]
"""The facts about each participant, from all trials."""
FurtherOf: TypeAlias = Callable[[AnalysisOfStudy], Any]
"""The further results of a study's analysis."""
