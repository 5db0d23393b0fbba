"""A simulated participant of the waving study: watches, looks, points at an answer, presses.

It receives what the display shows and nothing else. What it does not model: blinks, pursuit,
looking about before the wave, walking, learning over trials.
"""

import zlib
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Final

import numpy as np

from visavis.experiments.waving.judgement import (
    DEFAULT_POPULATION,
    Judgement,
    Population,
    draw_person,
    judge,
)
from visavis.experiments.waving.perception import Evidence, evidence_of
from visavis.lab.chance import generator
from visavis.lab.errors import DataError
from visavis.lab.geometry import Vector
from visavis.people.body import StandingBody
from visavis.people.body_kernels import POINT_S
from visavis.people.person import plain_answer
from visavis.stimuli.motion.warping.track import WarpTrack
from visavis.stimuli.panels import choice_centre_m
from visavis.stimuli.picture import Panel
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes.office import (
    CUSTOMERS,
    STANDING_EYE_M,
    OfficeFrame,
    OfficeScene,
    shift_m,
)

_PERSON, _TRIAL, _BODY, _ANSWER = range(4)
EYE_HEIGHT_SD_M: Final = 0.06
HAND_AT_M: Final = (0.26, 1.12, -0.30)
HAND_REST: Final = (0.30, 0.75, -1.0)
"""Point to which the hand points before a question."""
AHEAD_M: Final = (0.0, 1.35, -5.0)
EYES_ONLY: Final = "I looked at the eyes."
STRATEGIES: Final = (
    "Mostly the eyes, and how the body was turned when they were hard to see.",
    "Eyes first, then the direction of the head and of the hand.",
    "Where the body and the raised hand pointed, and the eyes if they were close enough.",
)
EYES_ONLY_01: Final = 0.25
"""Share of the source's participants who named the eyes alone; all named them."""
COMMENTS: Final = (
    "Some of them were hard to see behind the others.",
    "It felt natural to be waved at.",
    "On the right I could hardly tell.",
)


class WavingParticipant(StandingBody):
    """Implement `protocol.people`'s `SimulatedParticipant` with a hand that points.

    `index` and `seed` make the person, `asked` leads from the words of a board to what it asks
    for. `effect=False` gives somebody who does not attend to the waves: their places are chance,
    their ratings follow their leanings alone.
    """

    def __init__(
        self,
        index: int,
        seed: int,
        effect: bool = True,
        *,
        question_names: Mapping[str, str] = MappingProxyType({}),
        population: Population = DEFAULT_POPULATION,
    ) -> None:
        self.population = population
        self._question_names = question_names
        self._entropy = (seed, index)
        self._effect = effect
        self.person = draw_person(population, self.rng(_PERSON))
        body = self.rng(_BODY)
        eye_m = np.array([0.0, STANDING_EYE_M + EYE_HEIGHT_SD_M * body.standard_normal(), 0.0])
        super().__init__(
            eye_m,
            body.uniform(0.0, 2 * np.pi, 3),
            ahead_m=np.array(AHEAD_M),
            hand_m=np.array(HAND_AT_M),
            rest_m=np.array(HAND_REST),
        )

    def rng(self, *spawn_key: int) -> np.random.Generator:
        """Return the generator of one purpose."""
        return generator(self._entropy, *spawn_key)

    def prepare(self, stretch: int, t_ns: int) -> None:
        """Begin a new stretch of behaviour: look ahead, the hand down, nothing seen."""
        super().prepare(stretch, t_ns)
        self._scene: OfficeScene | None = None
        self._gaze: Vector | None = None
        self._warp: WarpTrack | None = None
        self._panel_text = ""
        self._judgement: Judgement | None = None

    def answer(self, question_id: str, prompt: str, options: Sequence[str]) -> str | None:
        """Answer a question; None when this participant would leave it out."""
        if question_id in ("who", "realism") and self._judgement is not None:
            return options[self._choice(question_id)]
        rng = self.rng(_ANSWER, zlib.crc32(question_id.encode()))
        if question_id == "strategy":
            alone = rng.random() < EYES_ONLY_01
            return EYES_ONLY if alone else STRATEGIES[int(rng.integers(len(STRATEGIES)))]
        if question_id == "comment":
            return None if rng.random() < 0.5 else COMMENTS[int(rng.integers(len(COMMENTS)))]
        return plain_answer(self.person.age, self.person.gender, question_id, options, rng)

    def see(self, view: SceneFrame, t_display_ns: int) -> None:
        """Receive what the display shows from `t_display_ns` on."""
        scene = view.scene
        if not isinstance(scene, OfficeScene) or not isinstance(view, OfficeFrame):
            return
        t_s, waver = self.since_s(t_display_ns), scene.waver
        if scene is not self._scene:
            self._scene = scene
            if scene.waving is not None and waver is not None:
                self.look(t_s + scene.waving.start_s + 0.25, scene.agents[waver].head_centre_m)
        if not view.panels:
            if waver is not None:
                self._gaze = view.gaze_direction[waver]
                # What was shown of a track stays as it was, so its last state tells all of it.
                self._warp = view.warp
        elif view.panels[0].text != self._panel_text and self._gaze is not None:
            self._panel_text = view.panels[0].text
            self._decide(scene, view.panels[0], t_s)

    def judges(self, evidence: Evidence, place: str, stretch: int) -> Judgement:
        """Return what this person, who stands at `place`, makes of a wave seen in a stretch."""
        own = [c.name for c in CUSTOMERS].index(place)
        rng = self.rng(_TRIAL, stretch)
        return judge(evidence, own, self.person, self.population, rng, effect=self._effect)

    def _judgement_of(self, scene: OfficeScene) -> Judgement:
        if self._judgement is None:
            if scene.waving is None or self._gaze is None:
                raise DataError("a question was asked about a scene in which nobody waved")
            eye = self.head(self._origin_ns)[0] - shift_m(scene.participant_place)
            evidence = evidence_of(
                scene.waving, scene.participant_place, eye, self._gaze, self._warp
            )
            self._judgement = self.judges(evidence, scene.participant_place, self.stretch())
        return self._judgement

    def _choice(self, question: str) -> int:
        if self._judgement is None:
            raise DataError("a question was asked before anything was seen")
        return self._judgement.place if question == "who" else self._judgement.realism - 1

    def _decide(self, scene: OfficeScene, panel: Panel, t_s: float) -> None:
        judgement, question = self._judgement_of(scene), self._question_names[panel.text]
        takes_s = judgement.who_s if question == "who" else judgement.realism_s
        choice_m = choice_centre_m(panel, self._choice(question))
        self.answer_at(panel.pose.position_m, choice_m, t_s, max(takes_s, POINT_S + 0.15))
