"""Waving in a headset that stands alone: a variant of the study, for its browser.

It is a study of its own name, never pooled with the published one: the same design, waves, office,
questions and tests, but one stands at the origin of the headset's floor, every wave is baked for
eyes at one height, nobody's eyes follow a head, and faces are still.
"""

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from visavis.experiments.waving.clips import SCENE_SEED, Making, wave_of
from visavis.experiments.waving.judgement import Judgement
from visavis.experiments.waving.participant import WavingParticipant
from visavis.experiments.waving.perception import Evidence, evidence_of
from visavis.experiments.waving.quick_study import quick_trials
from visavis.experiments.waving.study import (
    REALISM,
    Office,
    making_of,
    warp_columns,
    wave_record,
    who_question,
)
from visavis.experiments.waving.study import study as waving
from visavis.lab.errors import DataError
from visavis.people.person import StudyPerson
from visavis.protocol.people.simulated_participant import SimulatedParticipant
from visavis.protocol.plan.steps import FrameView
from visavis.stimuli.dressing.office import office_eyes, office_scene
from visavis.stimuli.dressing.office_view import eye_at
from visavis.stimuli.scenes.office import OfficeScene, Waving, neighbour
from visavis.study.derive import derive
from visavis.study.experiment import StudyExperiment
from visavis.study.films import Film, Lens, LiveFilm
from visavis.study.responses import Response
from visavis.study.scenes import Scene, Staging, places
from visavis.study.source import Fact
from visavis.study.study_functions import TrackerModel
from visavis.study.trial import TrialScript

SCENE: Final = "waving_office"
RATE_HZ: Final = 30
AIM_M: Final = (0.0, 1.1, -5.2)
HALF_HEIGHT_01: Final = 0.5
"""On a flat screen: everything from the floor before the desks to above the plants is seen."""
OF_THE_LAB: Final = ("scene_frames", "eye_height_m", "warp_loop_hz", "warp_late")
"""Columns of the published study that a page cannot fill."""
DIFFERENCES: Final[Mapping[str, tuple[str, str]]] = {
    "loop of warping": (
        "waves are warped for eyes {eye_height_m} m above the floor and as planned",
        "a page shows what was computed before, and corrects nothing for the tracked head",
    ),
    "eyes of the clerk": (
        "led by the same controller with both techniques, to eyes {eye_height_m} m above the floor",
        "a page shows what was computed before, so no eyes follow the tracked head",
    ),
    "headset": (
        "a headset that stands alone, by its browser, no headphones; answers by ray",
        "most headsets today stand alone, and no program of a lab runs on them",
    ),
    "height of the customers' eyes": (
        "1.62 m for virtual customers, {eye_height_m} m for the participant",
        "waves are computed before anybody's height is known",
    ),
    "breaks": (
        "after each of {blocks} parts",
        "nobody stands by to be told that one wants to rest",
    ),
}
"""What is otherwise than in the published study: what this one does, and why."""
OWN_FACTS: Final = (
    Fact(
        "procedure",
        "faces",
        "not said",
        "",
        "nobody blinks or moves the mouth",
        because="figures on pages have no moving faces",
    ),
    Fact(
        "procedure",
        "people while questions are asked",
        "not said",
        "",
        "they stand still, and both questions are asked at once",
        because="the scene was computed to its end, and a page has one board",
    ),
)


def _as_here(fact: Fact) -> Fact:
    """Return a fact of the source beside what is done here."""
    if fact.what not in DIFFERENCES:
        return fact
    here, because = DIFFERENCES[fact.what]
    return replace(fact, here=here, because=because, of="", is_stronger=False)


_source = waving.report.source
assert _source is not None  # noqa: S101  # the published study has one
study = derive(
    waving,
    "waving_page",
    title="Waving at whom? In a headset's own browser",
    on="browser",
    xr="required",
    xr_variant="",
    uses=(),
    calibrate=False,
    views_of=None,
    columns=[c for c in waving.analysis.columns if c.name not in OF_THE_LAB],
    source=replace(_source, facts=(*map(_as_here, _source.facts), *OWN_FACTS)),
    methods=f"""
This is a variant of the study waving for headsets that stand alone, performed in the headset's
browser; its sessions are not pooled with those of waving. Participants stood at the origin of
the headset's floor; the office was drawn round them as seen from one of the three middle places of
a line of five customers. Behind people, plants and furniture that hide more on the right than on
the left, a clerk waved at the participant, at the customer to the left or at the one to the right.
The wave began {{before_s}} s after the scene and lasted {{wave_s}} s; {{after_s}} s later everybody
stood still and participants said on a board, by ray, to whom it was directed, of five places, and
how realistic it was from 1 to 9.

With orientation the whole body was turned towards the addressee. With visual warping the wave
(warp_from: {{warp_from}}) was warped to the addressee's view, {{increment}} more coverage of face
and waving hand, for eyes {{eye_height_m}} m above the floor: no loop corrected it for the tracked
head, and the eyes of the clerk were led to that height, too. Poses were computed {RATE_HZ} times a
second and drawn by the headset's browser. Nobody blinked. Between scenes {{intertrial_s}} s passed
in an empty hall.
""",
).with_changes(folder=Path(__file__).parent, texts="texts_page")


@dataclass
class BakedOffice(Office):
    """The office as it is computed before: no eyes follow the head of whoever sees it."""

    def follow(self, view: FrameView) -> bool:
        """Stay where eyes were expected."""
        return False


@study.scene(SCENE)
def office_before(
    staging: Staging,
    *,
    eye_height_m: float,
    clerk: str,
    technique: str,
    direction: str,
    participant_place: str,
    **making: Any,
) -> BakedOffice:
    """Return the office with a wave, for eyes at the origin `eye_height_m` above the floor."""
    target = neighbour(participant_place, direction).name
    motion, wave = (
        Making(**making),
        {
            "clerk": clerk,
            "target_place": target,
            "technique": technique,
            "participant_place": participant_place,
        },
    )
    waving_clerk = wave_of(wave, motion, eye_height_m).waving
    scene = office_scene(participant_place, waving_clerk, SCENE_SEED)
    eyes = office_eyes(scene, target, 0, 0.0, motion.before_s - 0.3)
    eye_m = np.array([0.0, eye_height_m, 0.0])
    return BakedOffice(scene, places(scene), eyes, eye_m, start_ns=staging.start_ns)


def film_of(t: TrialScript) -> LiveFilm:
    """Return what a trial shows, seen from where a customer's eyes are."""
    making = making_of(t.settings.parameters)
    scene = Scene(
        SCENE,
        **{name: t.trial.factors[name] for name in ("clerk", "technique", "direction")},
        participant_place=t.participant_place,
        eye_height_m=t.eye_height_m,
        **vars(making),
    )
    lens = Lens((0.0, t.eye_height_m, 0.0), AIM_M, HALF_HEIGHT_01)
    seconds = t.before_s + t.wave_s + t.after_s
    return LiveFilm(Film(scene, seconds, rate_hz=RATE_HZ, lens=lens, may_crop=True))


@study.trial
def trial(t: TrialScript) -> Generator[Any, Any, None]:
    """Show the wave once, then ask to whom it was and how realistic."""
    yield t.dark(t.intertrial_s)
    t.row |= warp_columns(None) | {"planned_eye_height_m": t.eye_height_m}
    if not t.is_read:
        wave = wave_of(t.trial.factors, making_of(t.settings.parameters), t.eye_height_m)
        yield t.mark("wave", **wave_record(wave, t.increment))
        t.row |= {"wave_sha256": wave.sha256, **warp_columns(wave.plan_result)}
    yield t.watch(film_of(t), who_question(t.participant_place), REALISM, replay=False)
    answer = t.row["who"]
    t.row["is_right"] = None if answer is None else answer == t.target_place


@lru_cache(maxsize=64)
def _evidence(waving_clerk: Waving, place: str, gaze: tuple[float, ...]) -> Evidence:
    """Return what can be seen of a wave from a customer's place; rendered once."""
    return evidence_of(waving_clerk, place, eye_at(place), np.array(gaze))


class PageParticipant(StudyPerson):
    """A simulated participant at the page, with the mind of one of the published study's."""

    def __init__(self, index: int, seed: int, effect: bool, responses: Mapping[str, Response]):
        super().__init__(index, seed, effect, responses=responses)
        self.mind = WavingParticipant(index, seed, effect)

    def judges(self, evidence: Evidence, place: str, stretch: int) -> Judgement:
        """Return what this person makes of a wave."""
        return self.mind.judges(evidence, place, stretch)

    def answer(self, question_id: str, prompt: str, options: Sequence[str]) -> str | None:
        """Answer a question about the wave, or about oneself."""
        if question_id not in ("who", "realism"):
            return self.mind.answer(question_id, prompt, options)
        judgement = self._judgement()
        return options[judgement.place if question_id == "who" else judgement.realism - 1]

    def takes_s(self, response: Response | None) -> float:
        """Return how long an answer takes."""
        if response is None or response.name not in ("who", "realism"):
            return super().takes_s(response)
        judgement = self._judgement()
        return judgement.who_s if response.name == "who" else judgement.realism_s

    def _judgement(self) -> Judgement:
        frame = self._last
        if frame is None or not isinstance(frame.scene, OfficeScene):
            raise DataError("a question was asked before anything was seen")
        scene = frame.scene
        if scene.waving is None or scene.waver is None:
            raise DataError("a question was asked about a scene in which nobody waved")
        gaze = tuple(map(float, frame.gaze_direction[scene.waver]))
        evidence = _evidence(scene.waving, scene.participant_place, gaze)
        return self.judges(evidence, scene.participant_place, self.stretch())


@study.person
def person(
    index: int, seed: int, effect: bool, experiment: StudyExperiment
) -> SimulatedParticipant:
    """Return a simulated participant, who knows the two questions by their words."""
    return PageParticipant(index, seed, effect, experiment.words)


@study.quick
def quick(experiment: StudyExperiment, person: PageParticipant, tracker: TrackerModel) -> Any:
    """Return a function that performs a plan in a moment, once each wave has been rendered."""
    return partial(quick_trials, person.mind, making=making_of(experiment.parameters))
