"""A session whose scenes are drawn: frame truth in the recording, faults that pause."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import visavis.running.sessions.perform
from tests.faults.sessions import TRIALS, events, lab, path_of, perform
from tests.stage.sessions import NowAndThen, perform_shortest
from visavis.cli.redraw import recorded_frame, redraw
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import DesignError, DeviceError, SessionAborted, UsageError
from visavis.lab.frame import FrameInfo
from visavis.lab.geometry import Pose
from visavis.recording.reader import Recording
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.stage.contracts import GeometryStage, Viewer
from visavis.stage.drawn_stage import Display, default_views
from visavis.stage.errors import StageError
from visavis.stage.fades import FadeTimes
from visavis.stage.renderer import LIGHTEST, Renderer
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.stimuli.scene import Scene, SceneFrame


def test_recorded_frames_redraw_as_they_were(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    try:
        Renderer(quality=LIGHTEST).close()
    except StageError as problem:
        pytest.skip(str(problem))
    made: list[NowAndThen] = []

    def build(
        _: object, __: object, ___: object, clock: Clock, viewers: Sequence[Viewer]
    ) -> NowAndThen:
        stage = NowAndThen(
            picture_of,
            lambda: Renderer(quality=LIGHTEST),
            Display(default_views, lambda: (48, 54), people_count=19),
            clock,
            viewers=viewers,
            fades=FadeTimes(out_ms=1800.0, in_ms=900.0),
        )
        made.append(stage)
        return stage

    monkeypatch.setattr(visavis.running.sessions.perform, "build_stage", build)
    recording = perform_shortest(lab(tmp_path))
    study = find_study("stare")
    assert isinstance(study, OpenedStudy)
    assert recording.status == "complete"
    (stage,) = made
    drawn = recording.stream_arrays("drawn")
    assert len(drawn["frame"]) == len(stage.kept)
    assert drawn["drawn"].all()
    with_people = np.flatnonzero((drawn["level"] >= 0).sum(axis=1) >= 8)
    assert len(with_people) > 3
    stage.close()
    fading = np.flatnonzero((drawn["brightness_01"] > 0) & (drawn["brightness_01"] < 1))
    dimming = fading[np.diff(drawn["brightness_01"], append=0.0)[fading] < 0]
    assert len(dimming) > 1
    assert len(fading) > len(dimming)  # light that comes, too
    for i in {*with_people[[0, len(with_people) // 2, -1]], *fading[:2], *dimming[-2:]}:
        again = redraw(study, recording, int(drawn["frame"][i]))
        for old, new in zip(stage.kept[i][1], again, strict=True):
            assert np.abs(old.astype(int) - new.astype(int)).max() <= 1
    with pytest.raises(UsageError, match="was not drawn"):
        recorded_frame(study, recording, int(drawn["frame"][0]) + 1)


class _Failing(GeometryStage):
    """A stage whose driver fails for two seconds, once."""

    def __init__(self, viewers: Sequence[Viewer], *, by_raising: bool) -> None:
        super().__init__(viewers)
        self._by_raising = by_raising
        self._trouble: DeviceError | None = None

    def draw(self, view: SceneFrame, frame: FrameInfo, head: Pose) -> Sequence[object]:
        super().draw(view, frame, head)
        failing = 20 * NS_PER_S < frame.t_ns < 22 * NS_PER_S
        problem = StageError("the graphics driver reported GL_OUT_OF_MEMORY", remedy="close others")
        self._trouble = problem if failing else None
        if failing and self._by_raising:
            raise problem
        return ()

    def trouble(self) -> DeviceError | None:
        return self._trouble

    def start(self, sink: object) -> None:
        pass


class _Noting(GeometryStage):
    """A stage that notes when it draws and when it hears that the images went."""

    def __init__(self, viewers: Sequence[Viewer], order: list[str]) -> None:
        super().__init__(viewers)
        self._order = order

    def draw(self, view: SceneFrame, frame: FrameInfo, head: Pose) -> Sequence[object]:
        self._order.append("draw")
        return super().draw(view, frame, head)

    def handed_over(self) -> None:
        self._order.append("handed over")


def test_images_go_to_the_headset_before_anything_else_is_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    order: list[str] = []

    def build(_: object, __: object, rig: Any, *arguments: Any) -> _Noting:
        submit = rig.headset.submit

        def submitted(*images: Any) -> None:
            order.append("submit")
            submit(*images)

        monkeypatch.setattr(rig.headset, "submit", submitted)
        return _Noting(arguments[-1], order)

    monkeypatch.setattr(visavis.running.sessions.perform, "build_stage", build)
    perform(lab(tmp_path))
    assert order[:3] * (len(order) // 3) == order
    assert ["draw", "submit", "handed over"] == order[:3]


@pytest.mark.parametrize("by_raising", [True, False])
def test_failing_display_interrupts_the_trial_and_nothing_is_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, by_raising: bool
) -> None:
    def build(*arguments: object) -> _Failing:
        return _Failing(arguments[-1], by_raising=by_raising)

    monkeypatch.setattr(visavis.running.sessions.perform, "build_stage", build)
    recording = perform(lab(tmp_path))
    assert recording.status == "complete"
    done = recording.trials()
    assert {"P1", *TRIALS} == set(done.loc[done["status"] == "complete", "trial_id"])
    faults = [e for e in events(recording, "fault") if e["role"] == "display"]
    assert [e["message"] for e in faults] == ["the graphics driver reported GL_OUT_OF_MEMORY"]
    assert faults[0]["remedy"] == "close others"


def test_scene_that_nothing_dresses_is_dark_but_for_its_mark() -> None:
    mark = np.array([0.0, 1.0, -2.0])
    scene = Scene("blank", (), brightness_01=0.0, mark_m=mark)
    picture = picture_of(SceneFrame(scene, 0, np.zeros((0, 3)), np.zeros(0)))
    assert (picture.cast, picture.room.props, picture.brightness_01) == ((), (), 0.0)
    assert picture.mark_m is mark


def test_scene_whose_dresser_is_not_there_says_so() -> None:
    scene = Scene("own", (), dressed_by="no_such_module:picture")
    with pytest.raises(DesignError, match="no_such_module"):
        picture_of(SceneFrame(scene, 0, np.zeros((0, 3)), np.zeros(0)))


class _Stopped(GeometryStage):
    """A stage in whose frame the session is ended from outside, or by a defect."""

    def __init__(self, viewers: Sequence[Viewer], problem: BaseException) -> None:
        super().__init__(viewers)
        self._problem = problem
        self.frames: list[int] = []

    def draw(self, view: SceneFrame, frame: FrameInfo, head: Pose) -> Sequence[object]:
        if frame.t_ns > 23 * NS_PER_S:
            raise self._problem
        self.frames.append(frame.index)
        return super().draw(view, frame, head)


@pytest.mark.parametrize(
    ("problem", "ends_as"),
    [(KeyboardInterrupt(), SessionAborted), (IndexError("a defect"), IndexError)],
)
def test_session_ended_within_a_frame_keeps_every_frame_before_it(
    problem: BaseException,
    ends_as: type[Exception],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made: list[_Stopped] = []

    def build(*arguments: object) -> _Stopped:
        made.append(_Stopped(arguments[-1], problem))
        return made[0]

    monkeypatch.setattr(visavis.running.sessions.perform, "build_stage", build)
    with pytest.raises(ends_as):
        perform(lab(tmp_path))
    recording = Recording(path_of(lab(tmp_path)))
    frames, states = (recording.stream_arrays(n) for n in ("frames", "scene_states"))
    drawn = [index for index in made[0].frames if index >= 0]
    assert drawn[:-1] == frames["frame_index"][: len(drawn) - 1].tolist()
    assert frames["scene_row"].max() < len(states["scene"])
