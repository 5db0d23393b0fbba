"""A short path through any study on the kit: the same people, trials and rules without the engine.

It leaves out wires, drivers, recorder, calibration and breaks; the study's own trials, the
simulated person, the ray test, the area of interest, measures and exclusions are the code that
sessions use, and a tracker model handed in makes the errors of the simulated device. Power and
studies of the null hypothesis need hundreds of studies; this is twenty times as fast as sessions.
"""

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from visavis.analysis.gaze.targets import GazeTargets
from visavis.devices.body_contract import MovingBody
from visavis.devices.contracts import GAZE, HearingBody
from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import UsageError
from visavis.lab.geometry import Pose
from visavis.lab.schema import SampleBatch, empty_values
from visavis.people.person import SEED_STEP
from visavis.protocol.people.simulated_participant import STRETCH_AGAIN, SimulatedParticipant
from visavis.protocol.plan.design import SESSION
from visavis.protocol.plan.questionnaires import Questionnaire, read_answers, score
from visavis.protocol.plan.session_plan import Trial
from visavis.protocol.plan.steps import (
    Ask,
    AskReply,
    BodyView,
    EndEarly,
    FrameView,
    Mark,
    NextFrame,
    Plan,
    PlaySound,
    Prompt,
    Repeat,
    Show,
    SoundOnset,
)
from visavis.protocol.session.boards import HAND
from visavis.protocol.session.observation import GazeObserver
from visavis.protocol.session.row_buffer import RowBuffer
from visavis.protocol.session.streams import gaze_targets_schema
from visavis.results.intake import SimulatedStudy, questionnaire
from visavis.results.opened_study import OpenedStudy
from visavis.running.film_store import film_store, require_roles_of_pages
from visavis.running.live_store import LiveStore, page_files
from visavis.running.page.replies import check_reply
from visavis.running.page.steps import PageStep, Reply, ns_of_ms
from visavis.running.page.trial import perform_on_page
from visavis.running.page.visitor import visitor_of
from visavis.running.sound_store import SoundStore
from visavis.stimuli.panels import PanelFrame
from visavis.stimuli.room_areas import ROOM_SHAPE
from visavis.stimuli.room_shape import shape_of
from visavis.stimuli.scene import SceneFrame
from visavis.study.experiment import StudyExperiment
from visavis.study.measures import Measure, TrialRecord, value_of
from visavis.study.pairs import Correlate
from visavis.study.study_functions import MakeTracker, TrackerModel
from visavis.study.trial import TrialScript

DISPLAY_HZ = 45
TRACKER_HZ = 120


_TRACKED = np.ones((1, 1), np.bool_)


def quick_study(
    opened_study: OpenedStudy,
    experiment: StudyExperiment,
    make_tracker: MakeTracker,
    indices: Iterable[int],
    *,
    seed: int,
    effect: float = 1.0,
) -> SimulatedStudy:
    """Simulate a study; `effect` multiplies the effect of what is shown.

    Raises:
        UsageError: the study's people cannot be given such an effect, or a measure needs a
            recording.
    """
    study = opened_study.study
    measures = [m for m in opened_study.measures(experiment) if m.of is not None]
    needs_answers = any(isinstance(of, Correlate) for of in study.analysis.families) or any(
        study.analysis.groups or compare.where or compare.covariates
        for compare in study.analysis.compare
    )
    questionnaires = [
        questionnaire(name, study.folders) for name in study.asks.questionnaires if needs_answers
    ]
    tables, people = [], []
    quick_of = study.simulated.quick_of
    numbers = range(1, len(study.design.sessions or (1,)) + 1)
    sessions = [experiment.of_session(number) for number in numbers]
    for index in indices:
        for number, one in zip(numbers, sessions, strict=True):
            own_seed = seed + SEED_STEP * (number - 1)
            person = _person(opened_study, one, index, own_seed, effect)
            tracker = make_tracker(own_seed, index)
            if quick_of is None:
                rows = quick_rows(one, person, tracker, measures, index=index, seed=seed)
            else:
                trial_rows = quick_of(one, person, tracker)(one.plan(index, seed))
                rows = pd.DataFrame([_row_of(trial, own, index) for trial, own in trial_rows])
            if one.session_name:
                rows[SESSION] = one.session_name
            tables.append(rows)
        person_row: dict[str, Any] = {"participant": _name(index)}
        for questions in questionnaires:
            answers = answers_of(person, questions)
            person_row |= answers
            person_row |= {f"{questions.name}_{k}": v for k, v in score(questions, answers).items()}
        people.append(person_row)
    return SimulatedStudy(pd.concat(tables, ignore_index=True), pd.DataFrame(people))


def answers_of(person: SimulatedParticipant, questions: Questionnaire) -> dict[str, Any]:
    """Ask a simulated person a whole questionnaire; return the answers as analysis reads them."""
    raw_answers = {
        q.question_id: person.answer(q.question_id, q.prompt, q.options)
        for q in questions.questions()
    }
    return dict(read_answers(questions, raw_answers))


def _person(
    opened_study: OpenedStudy, experiment: StudyExperiment, index: int, seed: int, effect: float
) -> SimulatedParticipant:
    make_person = opened_study.study.simulated.scaled_of
    if make_person is not None:
        return make_person(index, seed, effect, experiment)
    if effect not in (0, 1):
        raise UsageError(
            f"people of {opened_study.name} see what is shown or do not: --effect is published or "
            f"none, not {effect:g}"
        )
    return opened_study.participant(index, seed, effect=effect > 0, experiment=experiment)


def _name(index: int) -> str:
    return f"{index:05d}"


def _row_of(trial: Trial, own: Mapping[str, Any], index: int) -> dict[str, Any]:
    return {
        "participant": _name(index),
        "session": 1,
        "trial_id": trial.trial_id,
        "attempt": 1,
        "is_practice": False,
        "status": "complete",
        "is_simulated": True,
        **trial.factors,
        **own,
    }


def quick_rows(
    experiment: StudyExperiment,
    person: SimulatedParticipant,
    tracker: TrackerModel,
    measures: Sequence[Measure],
    *,
    index: int,
    seed: int,
) -> pd.DataFrame:
    """Perform every trial of a person's plan but practice, and measure it; one row each.

    Raises:
        UsageError: a measure needs more than gaze and the trial's own row.
    """
    rows: list[dict[str, Any]] = []
    if experiment.study.procedure.on == "browser":
        trial_rows = _page_rows(experiment, person, index=index, seed=seed)
        for trial, own, marks in trial_rows:
            row = _row_of(trial, own, index)
            record = TrialRecord(row, None, None, events=marks)
            rows.append(row | {m.column: value_of(m, record) for m in measures if m.of is not None})
        return pd.DataFrame(rows)
    plan = experiment.plan(index, seed)
    ending: Repeat | EndEarly | None = None
    for block in plan.blocks:
        person.wear(block.index + 1)
        if isinstance(ending, EndEarly) and ending.of == "session":
            break
        queue = deque((t, 0) for t in block.trials if not t.is_practice)
        while queue:
            trial, again = queue.popleft()
            row, ending = _row(experiment, person, tracker, measures, trial, index, again)
            if isinstance(ending, Repeat):
                queue.append((trial, again + 1))
                continue
            rows.append(row)
            if ending is not None:
                break
    return pd.DataFrame(rows)


def _page_rows(
    experiment: StudyExperiment, person: SimulatedParticipant, *, index: int, seed: int
) -> Iterator[tuple[Trial, Mapping[str, Any], tuple[tuple[str, Mapping[str, Any]], ...]]]:
    """Perform every trial of a person's plan but practice; yield each with its row and events."""
    require_roles_of_pages(experiment)
    store = film_store(experiment)
    visitor = visitor_of(person, experiment, store)
    sounds = SoundStore(experiment.settings.sound_of)
    describe = page_files(store, LiveStore(experiment.lives), is_simulated=True, sounds=sounds)
    ended_blocks: set[int] = set()
    queue = deque((t, 0) for t in experiment.plan(index, seed).trials if not t.is_practice)
    while queue:
        trial, again = queue.popleft()
        if trial.block in ended_blocks:
            continue
        script = TrialScript(trial, experiment.settings)
        performing = perform_on_page(script, experiment.study.trial_plan, describe)
        reply: Reply | None = None
        marks: list[tuple[str, Mapping[str, Any]]] = []
        trial_position = {"trial": trial.number, "is_practice": False, "again": again}
        try:
            while True:
                out = performing.send(reply)
                reply = None
                if isinstance(out, Mark):
                    marks.append((out.name, out.payload))
                else:
                    step = PageStep(out.kind, {**out.content, **trial_position})
                    content = visitor.reply(step)
                    check_reply(step, content)
                    moves = tuple(visitor.moves)
                    visitor.moves.clear()
                    reply = Reply(content, ns_of_ms(visitor.now_ms), ns_of_ms, moves)
        except StopIteration as end:
            row = dict(end.value or {})
            script.remember(row)
            if isinstance(script.wish, Repeat):  # at the end of its block
                own = sum(t.block == trial.block for t, _ in queue)
                queue.insert(own, (trial, again + 1))
                continue
            yield trial, row, tuple(marks)
            if script.wish is not None and script.wish.of == "session":
                return
            ended_blocks |= {trial.block} if script.wish is not None else set()


def _row(
    experiment: StudyExperiment,
    person: SimulatedParticipant,
    tracker: TrackerModel,
    measures: Sequence[Measure],
    trial: Trial,
    index: int,
    again: int,
) -> tuple[dict[str, Any], Repeat | EndEarly | None]:
    """Perform a trial, `again` for so many times; return its row and what it asks for."""
    frames = _Frames(experiment, person, tracker, trial.number + STRETCH_AGAIN * again)
    frames.run(experiment.intertrial(trial))
    own = frames.run(experiment.run_trial(trial))
    row, gaze = _row_of(trial, own, index), frames.gaze()
    for looks in experiment.study.analysis.looks:
        rules = looks.rules({"parameters": experiment.parameters})
        never = np.zeros(gaze.t_ns.size, np.bool_)  # a model's samples do not freeze
        row |= looks.columns(TrialRecord(row, None, gaze), never, rules)
    record = TrialRecord(row, None, gaze, events=tuple(frames.marks))
    values = {m.column: value_of(m, record) for m in measures if m.of_cell is None}
    return row | values, frames.wish


class _Frames:
    """One trial, frame after frame, for a person and a tracker; nothing is recorded."""

    def __init__(
        self,
        experiment: StudyExperiment,
        person: SimulatedParticipant,
        tracker: TrackerModel,
        stretch: int,
    ) -> None:
        self._person, self._tracker, self._stretch = person, tracker, stretch
        # Asked once: to look for a protocol's methods takes longer than a frame.
        self._body = person if isinstance(person, MovingBody) else None
        self._batches: list[SampleBatch] = []
        schema = gaze_targets_schema(experiment.agent_count, TRACKER_HZ)
        targets = RowBuffer(
            schema, self._batches.append, hold_ns=NS_PER_S * 3600, capacity=TRACKER_HZ * 20
        )
        self._targets = targets
        self._observer = GazeObserver(targets)
        self._in_head: list[npt.NDArray[np.float32]] = []
        self._index = 0
        self._samples = 0
        self._view: SceneFrame | None = None
        self._sounds: list[tuple[PlaySound, int]] = []
        """What began since the last frame, and when."""
        self.wish: Repeat | EndEarly | None = None
        """What the trial asks for: its repetition, or an early end."""
        self.marks: list[tuple[str, Mapping[str, Any]]] = []
        """The events that would be recorded."""
        person.prepare(stretch, 0)

    def run(self, plan: Plan) -> dict[str, Any]:
        """Perform a plan to its end; return its row."""
        reply: FrameView | AskReply | None = None
        try:
            while True:
                step = plan.send(reply)
                reply = None
                if isinstance(step, NextFrame):
                    reply = self._next()
                elif isinstance(step, Show):
                    self._view = step.view
                    self._observer.show(step.view.scene)
                    if (room := step.view.scene.room) is not None:
                        self.marks.append((ROOM_SHAPE, shape_of(room).event))
                elif isinstance(step, Mark):
                    self.marks.append((step.name, step.payload))
                elif isinstance(step, PlaySound):
                    self._sounds.append((step, self._t_ns))
                elif isinstance(step, Ask):
                    answer = self._person.answer(step.question_id, step.prompt, step.options)
                    reply = AskReply(answer, self._t_ns)
                elif isinstance(step, Prompt):
                    reply = AskReply(None, self._t_ns)
                elif isinstance(step, Repeat | EndEarly):
                    self.wish = step
        except StopIteration as end:
            return dict(end.value or {})

    def gaze(self) -> GazeTargets:
        """Return every gaze sample of the trial with where it fell."""
        self._targets.flush()
        names = (
            "t_sample_ns",
            "valid",
            "direction_world",
            "origin_world_m",
            "angle_deg",
            "radius_deg",
            "pad_limit_deg",
            "hit",
            "gaze_seq",
        )
        columns = {n: np.concatenate([b.values[n] for b in self._batches]) for n in names}
        columns["direction_head"] = np.concatenate(self._in_head)[columns["gaze_seq"]]
        return GazeTargets.from_columns(columns)

    @property
    def _t_ns(self) -> int:
        return self._index * NS_PER_S // DISPLAY_HZ

    def _next(self) -> FrameView:
        if self._view is not None:
            self._person.see(self._view, (self._index + 1) * NS_PER_S // DISPLAY_HZ)
        self._index += 1
        t_ns = self._t_ns
        position, turn = self._person.head(t_ns)
        head = Pose(position, turn)
        self._observer.heads.add_measured(t_ns, head)
        self._sample(t_ns - self._tracker.delay_ns)
        gaze = self._observer.observe(self._index, t_ns)
        sounds = tuple(SoundOnset(step.key, at_ns) for step, at_ns in self._sounds)
        for step, at_ns in self._sounds:
            if isinstance(self._person, HearingBody):
                self._person.hear(step.sound.at_both_ears(step.gain_db), step.sound.rate_hz, at_ns)
        self._sounds.clear()
        downs = [(at_ns, c) for at_ns, c, value in self._person.presses(t_ns) if value > 0.5]
        return FrameView(
            self._index,
            t_ns,
            head,
            True,
            gaze,
            tuple(c for _, c in downs),
            self._hand(t_ns),
            pressed_ns=tuple(at_ns for at_ns, _ in downs),
            sound_onsets=sounds,
        )

    def _hand(self, t_ns: int) -> BodyView | None:
        """Return the hand that answers a board; None while no board is shown."""
        is_asked = isinstance(self._view, PanelFrame) and self._view.panels
        if self._body is None or not is_asked:
            return None
        at_ns = np.array((t_ns,), np.int64)
        return BodyView((HAND,), at_ns, *self._body.segments((HAND,), at_ns), _TRACKED)

    def _sample(self, until_ns: int) -> None:
        """Take the samples that have arrived by now."""
        last = max(until_ns, 0) * TRACKER_HZ // NS_PER_S
        n = last - self._samples
        if n <= 0:
            return
        numbers = np.arange(self._samples, last, dtype=np.int64)
        t_ns = numbers * NS_PER_S // TRACKER_HZ
        eyes = self._person.eyes(t_ns)
        direction, valid = self._tracker.measure(
            eyes, first_sample=self._samples, stretch=self._stretch, fit=self._person.fit()
        )
        values = empty_values(GAZE, n)
        values["direction_head"], values["valid"] = direction, valid
        self._in_head.append(np.where(valid[:, None], direction, np.nan).astype(np.float32))
        arrival_ns = t_ns + self._tracker.delay_ns
        self._observer.take(SampleBatch(GAZE, numbers, t_ns, arrival_ns, values))
        self._samples = last
