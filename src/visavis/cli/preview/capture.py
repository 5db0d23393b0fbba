"""What a trial shows, frame by frame: a simulated participant performs it on the virtual clock.

The trial is performed as a session would, with its devices and its time before the trial, but
without calibration; nothing is kept of the recording.
"""

import tempfile
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from visavis.lab.clock import NS_PER_S
from visavis.lab.config import LabConfig
from visavis.lab.errors import UsageError
from visavis.lab.frame import FrameInfo
from visavis.lab.geometry import Pose
from visavis.protocol.plan.experiment import Experiment
from visavis.protocol.plan.session_plan import SessionPlan, Trial
from visavis.recording.cached import CachedRecording
from visavis.results.opened_study import OpenedStudy
from visavis.running.sessions.perform import of_no_session, perform_new
from visavis.running.sessions.session_request import Request, simulated_request
from visavis.stage.contracts import GeometryStage, Stage, Viewer
from visavis.stage.movie import picture_times_ns
from visavis.stimuli.scene import SceneFrame
from visavis.study.experiment import StudyExperiment


@dataclass(frozen=True, eq=False)
class CapturedFrame:
    """One frame: what was shown, when its light left the display, where the head was."""

    view: SceneFrame
    t_ns: int
    head: Pose


def is_lit(view: SceneFrame) -> bool:
    """Tell whether anything but boards can be seen."""
    return view.scene.brightness_01 > 0


def has_board(view: SceneFrame) -> bool:
    """Tell whether a question is put."""
    return bool(getattr(view, "panels", ()))


class _EnoughError(Exception):
    """Ends a performance when enough frames are there."""


class _CapturingStage(GeometryStage):
    """A stage that draws nothing; it stores the frames to show, from light to darkness."""

    def __init__(
        self, viewers: Sequence[Viewer], frames: list[CapturedFrame], enough: Callable[[], bool]
    ) -> None:
        super().__init__(viewers)
        self._frames, self._enough = frames, enough
        self._dark: list[CapturedFrame] = []

    def draw(self, view: SceneFrame, frame: FrameInfo, head: Pose) -> Sequence[object]:
        """Keep the frame and tell every viewer."""
        if self._enough():
            raise _EnoughError
        self._dark.append(CapturedFrame(view, frame.predicted_display_ns, head))
        if is_lit(view) or (self._frames and has_board(view)):
            self._frames += self._dark if self._frames else self._dark[-1:]
            self._dark.clear()
        return super().draw(view, frame, head)


@dataclass(frozen=True, eq=False)
class _FewTrials(StudyExperiment):
    """An experiment whose plan has only these trials, without calibration."""

    trial_ids: frozenset[str] = frozenset()

    def plan(self, participant_index: int, seed: int, group: str = "") -> SessionPlan:
        """Return the plan with those trials only."""
        plan = super().plan(participant_index, seed, group)
        blocks = tuple(
            replace(
                block,
                trials=tuple(t for t in block.trials if t.trial_id in self.trial_ids),
                questionnaires=(),
                calibrate=False,
            )
            for block in plan.blocks
            if any(t.trial_id in self.trial_ids for t in block.trials)
        )
        return replace(plan, blocks=blocks, questionnaires=())


def trial_of(experiment: Experiment, number: int, index: int, seed: int, group: str = "") -> Trial:
    """Return a trial of somebody's plan by its number; 0 is the first practice trial.

    Raises:
        UsageError: the plan has no such trial.
    """
    trials = experiment.plan(index, seed, group).trials
    candidates = [t for t in trials if t.is_practice] if number == 0 else trials
    for trial in candidates:
        if number == 0 or (not trial.is_practice and trial.number == number):
            return trial
    last = max((t.number for t in trials if not t.is_practice), default=0)
    raise UsageError(f"there is no trial {number}; the plan has 1 to {last}, and 0 for practice")


class Capture:
    """A trial of somebody's plan, and `following` more, to be performed; `frames` grow while it
    is. `index` counts people from 0; without an `experiment` the study is as it stands.

    Raises:
        UsageError: the plan has no such trial.
    """

    def __init__(
        self,
        study: OpenedStudy,
        config: LabConfig,
        *,
        number: int,
        index: int,
        seed: int,
        group: str = "",
        following: int = 0,
        experiment: StudyExperiment | None = None,
    ) -> None:
        self._study, self._config, self._index, self._seed = study, config, index, seed
        self._group = group
        self._experiment = study.experiment({}) if experiment is None else experiment
        self.trial = trial_of(self._experiment, number, index, seed, group)
        trials = self._experiment.plan(index, seed, group).trials
        first = trials.index(self.trial)
        self._trial_ids = frozenset(t.trial_id for t in trials[first : first + 1 + following])
        self.frames: list[CapturedFrame] = []
        self.is_whole = False
        self._is_stopped = threading.Event()

    def perform(self, until_s: float | None = None) -> list[CapturedFrame]:
        """Perform the trial, or its first `until_s` seconds of light; return its frames."""

        def enough() -> bool:
            if self._is_stopped.is_set():
                return True
            if until_s is None or not self.frames:
                return False
            return self.frames[-1].t_ns - self.frames[0].t_ns >= until_s * NS_PER_S

        with tempfile.TemporaryDirectory(prefix="preview") as folder:

            def stage_for(viewers: Sequence[Viewer]) -> Stage:
                return _CapturingStage(viewers, self.frames, enough)

            try:
                request = self._request(Path(folder))
                with of_no_session():
                    perform_new(replace(request, stage_for=stage_for, on="lab"))
            except _EnoughError:
                return self.frames
        self.is_whole = True
        return self.frames

    @contextmanager
    def on_page(self) -> Iterator[CachedRecording]:
        """Perform the trial on a page; its recording is there until the context ends."""
        with tempfile.TemporaryDirectory(prefix="preview") as folder:
            request = self._request(Path(folder))
            yield CachedRecording(perform_new(replace(request, on="browser")))

    def _request(self, folder: Path) -> Request:
        return simulated_request(
            self._study,
            _FewTrials(
                self._experiment.study,
                self._experiment.overrides,
                self._trial_ids,
                session=self._experiment.session,
            ),
            self._config.model_copy(update={"data_root": folder}),
            label=f"{self._index:02d}",
            index=self._index,
            seed=self._seed,
            group=self._group,
            session=self._experiment.session,
        )

    def stop(self) -> None:
        """Stop the performance; called from another thread than the one that performs."""
        self._is_stopped.set()


class BackgroundPerformance:
    """Perform a trial in a thread of its own, while its first frames are shown already."""

    def __init__(self, capture: Capture) -> None:
        self.capture = capture
        self._problem: Exception | None = None
        self._news = threading.Event()
        self._thread = threading.Thread(target=self._run, name="preview", daemon=True)

    def __enter__(self) -> "BackgroundPerformance":
        """Begin, and wait for the first frame."""
        self._thread.start()
        while not self.capture.frames and self._thread.is_alive():
            self._thread.join(0.01)
        self.check()
        return self

    def __exit__(self, *_: object) -> None:
        self.capture.stop()
        self._thread.join()

    def check(self) -> None:
        """Raise what the performance ended with, if it failed."""
        if self._problem is not None:
            raise self._problem

    def _run(self) -> None:
        try:
            self.capture.perform()
        except Exception as problem:  # handed to the thread that shows
            self._problem = problem


def spread(frames: Sequence[CapturedFrame], rate_hz: int, most_s: float) -> list[CapturedFrame]:
    """Return one frame for every picture of a film of `rate_hz`, at most `most_s` long."""
    if not frames:
        return []
    start = frames[0].t_ns
    until = min(frames[-1].t_ns, start + round(most_s * NS_PER_S))
    pictures, k = [], 0
    for t in picture_times_ns(start, until, rate_hz):
        while k + 1 < len(frames) and frames[k + 1].t_ns <= t:
            k += 1
        pictures.append(replace(frames[k], t_ns=t))
    return pictures
