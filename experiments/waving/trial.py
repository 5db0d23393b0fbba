"""One trial of the waving study, frame by frame: the scene, two questions, the dark before it."""

from collections.abc import Generator
from dataclasses import asdict, dataclass, replace
from typing import Final, TypeAlias

import numpy as np

from experiments.waving.clips import SETTINGS, UNITS, WARPED_PARTS, StudyWave
from experiments.waving.design import WavingParameters
from experiments.waving.pointing import Ray, chosen_by, newer_ray
from experiments.waving.questions import Question, realism_question, who_question
from experiments.waving.scene import DARK, office_eyes, scene_of, wave_of
from lab.clock import NS_PER_MS, NS_PER_S
from lab.geometry import Vector
from protocol.plan import Trial
from protocol.steps import (
    Answered,
    Ask,
    FrameView,
    Mark,
    NextFrame,
    Plan,
    Row,
    Scalar,
    Show,
    Step,
)
from stimuli.gaze.behaviour import EyeBehaviour
from stimuli.scenes.office import STANDING_EYE_M, OfficeFrame, OfficeScene

Frames: TypeAlias = Generator[Step, FrameView | Answered | None, FrameView]
FOLLOW_STEP_M: Final = 0.01
"""The eyes follow the participant's head in steps of this size."""
CONFIRM: Final = ("trigger", "select")
_NEXT = NextFrame()


@dataclass
class _Office:
    """What is on the display; shows anew only what changed."""

    scene: OfficeScene
    eyes: EyeBehaviour
    start_ns: int
    observer_m: Vector

    def at(self, view: FrameView, question: Question | None = None, lit: int | None = None) -> Show:
        """Return the step that shows this moment, with a board where something is asked."""
        if view.head_valid:
            moved = view.head.position_m - self.observer_m
            if float(moved @ moved) > FOLLOW_STEP_M**2:
                self.observer_m = np.array(view.head.position_m, np.float64)
        gaze, openness, _ = self.eyes.at(view.t_ns - self.start_ns, self.observer_m)
        panel = None if question is None else replace(question.panel, highlighted=lit)
        return Show(
            OfficeFrame(self.scene, view.t_ns, gaze, openness, start_ns=self.start_ns, panel=panel)
        )


def _frame() -> Frames:
    view = yield _NEXT
    if not isinstance(view, FrameView):
        raise TypeError(f"a plan that asked for a frame was sent {view!r}")
    return view


def run_trial(trial: Trial, params: WavingParameters) -> Plan:
    """Perform a trial: the wave, then to whom it was and how realistic; times from the onset."""
    wave, scene = wave_of(trial, params), scene_of(trial, params)
    own, target = str(trial.factors["participant_place"]), str(trial.factors["target_place"])
    longest_s = params.scene_s + 2 * params.answer_limit_s + 5.0
    eyes = office_eyes(scene, target, trial.seed, longest_s, params.before_s - 0.3)
    view = yield from _frame()
    office = _Office(scene, eyes, view.t_ns, np.zeros(3))
    yield office.at(view)
    view = yield from _frame()
    start_ns = view.t_ns
    yield Mark("scene_on", {"trial_id": trial.trial_id, "scene_name": scene.name})
    yield Mark("wave", {"trial_id": trial.trial_id, **wave_record(wave, params)})
    frames = 0
    heights: list[float] = []
    until_ns = start_ns + round(params.scene_s * NS_PER_S)
    while view.t_ns < until_ns:
        if view.head_valid:
            heights.append(float(view.head.position_m[1]))
        yield office.at(view)
        view = yield from _frame()
        frames += 1
    row: dict[str, Scalar | None] = {
        "t_start_ns": start_ns,
        "scene_frames": frames,
        "eye_height_m": round(float(np.median(heights)), 4) if heights else None,
        "planned_eye_height_m": STANDING_EYE_M,
    }
    for question in (who_question(own), realism_question()):
        answer = yield from _asked(office, question, params, view)
        yield Mark(
            "answered",
            {
                "trial_id": trial.trial_id,
                "question": question.question_id,
                "answer": answer.meaning,
                "by": answer.by,
                "asked_ns": answer.asked_ns,
                "answered_ns": answer.answered_ns,
            },
        )
        row |= answer.columns(question.question_id)
        view = answer.view
    yield dark_view(view.t_ns)
    told = row["who"]
    return {
        **row,
        "is_right": None if told is None else told == target,
        "wave_sha256": wave.sha256,
        "t_end_ns": view.t_ns,
    }


def wave_record(wave: StudyWave, params: WavingParameters) -> dict[str, Scalar | None]:
    """Return what the recording keeps of a wave: enough to make it again and to know it again."""
    found: dict[str, Scalar | None] = {
        "clerk": wave.waving.clerk,
        "wave_sha256": wave.sha256,
        "heading_deg": round(wave.waving.heading_deg, 6),
        "wave_start_s": wave.waving.start_s,
        "wave_s": wave.waving.clip.duration_s,
        "is_warped": wave.record is not None,
    }
    if wave.record is not None:
        found |= {
            "warp_sha256": wave.record.sha256,
            "features": "; ".join(f"coverage of {'+'.join(p)}" for p in WARPED_PARTS),
            "increment": params.increment,
            "units": ",".join(UNITS),
            "wanted": known(wave.record.wanted),
            "reached": known(wave.record.reached),
            "reached_share_01": wave.record.reached_share_01,
            "largest_turn_deg": wave.record.largest_turn_deg,
            **{f"loop_{name}": value for name, value in asdict(SETTINGS).items()},
        }
    return found


def known(value: float) -> float | None:
    """Return None for what is not a number: journals have no NaN."""
    return value if np.isfinite(value) else None


@dataclass(frozen=True)
class _Given:
    """An answer; `meaning` is None when the question was left out."""

    meaning: str | None
    by: str
    asked_ns: int
    answered_ns: int
    view: FrameView

    def columns(self, name: str) -> Row:
        meaning: Scalar | None = self.meaning
        if name == "realism" and self.meaning is not None:
            meaning = int(self.meaning)
        waited = (self.answered_ns - self.asked_ns) / NS_PER_MS
        return {name: meaning, f"{name}_by": self.by, f"{name}_ms": waited}


def _asked(
    office: _Office, question: Question, params: WavingParameters, view: FrameView
) -> Generator[Step, FrameView | Answered | None, _Given]:
    """Ask one question: a choice pointed at and confirmed, a digit, or the terminal.

    A response device may offer "trigger" or "select" (take what is pointed at) and digits.
    """
    asked_ns, choices = view.t_ns, question.panel.choices
    if params.answer_by == "ray":
        yield office.at(view, question)
        view = yield from _frame()
        asked_ns = view.t_ns
        until_ns = asked_ns + round(params.answer_limit_s * NS_PER_S)
        ray: Ray | None = None
        # What was pressed up to this frame was pressed before the board was there.
        view = replace(view, pressed=())
        while view.t_ns < until_ns:
            ray = newer_ray(ray, view)
            lit = chosen_by(None if ray is None else ray.pose, question.panel)
            for control in view.pressed:
                if control in CONFIRM and lit is not None:
                    return _Given(question.meanings[lit], "ray", asked_ns, view.t_ns, view)
                if control.isdigit() and 1 <= int(control) <= len(choices):
                    meaning = question.meanings[int(control) - 1]
                    return _Given(meaning, "keys", asked_ns, view.t_ns, view)
            yield office.at(view, question, lit)
            view = yield from _frame()
    reply = yield Ask(question.question_id, question.panel.text, choices)
    view = yield from _frame()
    said = reply.answer if isinstance(reply, Answered) else None
    told = None if said is None else question.meanings[choices.index(said)]
    by = "operator" if params.answer_by == "ray" else "keyboard"
    return _Given(told, by, asked_ns, view.t_ns, view)


def dark_view(t_ns: int) -> Show:
    """Return the step that makes everything dark."""
    return Show(OfficeFrame(DARK, t_ns, np.zeros((0, 3)), np.zeros(0)))


def intertrial(trial: Trial, params: WavingParameters) -> Plan:
    """Stay dark before a trial, for `intertrial_s`."""
    view = yield from _frame()
    start_ns = view.t_ns
    yield dark_view(start_ns)
    until_ns = start_ns + round(params.intertrial_s * NS_PER_S)
    while view.t_ns < until_ns:
        view = yield from _frame()
    return {"intertrial_ms": (view.t_ns - start_ns) / NS_PER_MS}
