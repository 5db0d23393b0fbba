"""What a frame costs the card: told later by itself or not at all, never zero, never waited for."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import moderngl
import numpy as np
import pytest

from tests.stage import figures
from tests.stage.test_drawn_stage import HEAD, SIZE, _scene
from visavis.lab.clock import Clock, SimClock, SystemClock
from visavis.lab.frame import FrameInfo
from visavis.lab.schema import SampleBatch
from visavis.stage.card.context import offscreen_context, release_offscreen
from visavis.stage.card.gl_calls import GlCalls
from visavis.stage.card.timer import GL_QUERY_RESULT_AVAILABLE, MAX_OPEN, CardTimer
from visavis.stage.drawn_stage import Display, DrawnStage, default_views
from visavis.stage.errors import StageError
from visavis.stage.frame_truth import DRAWN_GPU
from visavis.stage.renderer import LIGHTEST, Renderer
from visavis.stimuli.picture import Picture
from visavis.stimuli.scene import SceneFrame


@pytest.fixture
def context() -> Iterator[moderngl.Context]:
    try:
        made = offscreen_context()
    except StageError as problem:
        pytest.skip(str(problem))
    yield made
    release_offscreen(made)


def _draw(context: moderngl.Context, timer: CardTimer, index: int) -> None:
    target = context.simple_framebuffer((64, 64))
    with timer.time_frame(FrameInfo(index, index, 10 * index)):
        target.use()
        target.clear(0.5)


class _Driver:
    """Answers for the driver's timers as it is told to, and lets every other question through."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, **answers: int) -> None:
        self._answers, self._asked = answers, GlCalls.query
        self.waited = False
        monkeypatch.setattr(GlCalls, "query", lambda calls, *a: self._query(calls, *a))

    def _query(self, calls: GlCalls, name: str, *arguments: Any) -> None:
        if name == "glGetQueryiv" and "bits" in self._answers:
            arguments[-1].value = self._answers["bits"]
        elif name == "glGetQueryObjectuiv" and "available" in self._answers:
            assert arguments[1] == GL_QUERY_RESULT_AVAILABLE
            arguments[-1].value = self._answers["available"]
        elif name == "glGetQueryObjectui64v" and "elapsed_ns" in self._answers:
            arguments[-1].value = self._answers["elapsed_ns"]
        else:
            self.waited |= name == "glGetQueryObjectui64v"
            self._asked(calls, name, *arguments)


def test_every_frame_s_time_is_told_once_the_card_has_done_it(context: moderngl.Context) -> None:
    timer, told = CardTimer(context), []
    for index in range(3 * MAX_OPEN):
        _draw(context, timer, index)
        context.finish()
        told += timer.results()
    timer.release()
    assert list(range(3 * MAX_OPEN)) == [frame.index for frame, _ in told]
    assert min(gpu_ms for _, gpu_ms in told) > 0.0
    assert context.error == "GL_NO_ERROR"


def test_a_driver_without_timers_tells_nothing(
    context: moderngl.Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    _Driver(monkeypatch, bits=0)
    timer = CardTimer(context)
    for index in range(2 * MAX_OPEN):
        _draw(context, timer, index)
        context.finish()
        assert timer.results() == []
    timer.release()
    assert context.error == "GL_NO_ERROR"


def test_a_card_that_is_behind_is_not_waited_for_and_its_times_are_missing(
    context: moderngl.Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    driver = _Driver(monkeypatch, available=0)
    timer = CardTimer(context)
    for index in range(3 * MAX_OPEN):
        _draw(context, timer, index)
        assert timer.results() == []
    timer.release()
    assert not driver.waited
    assert context.error == "GL_NO_ERROR"


def test_no_time_at_all_is_missing_and_never_zero(
    context: moderngl.Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    _Driver(monkeypatch, available=1, elapsed_ns=0)
    timer = CardTimer(context)
    _draw(context, timer, 0)
    assert timer.results() == []
    timer.release()


def _rows(clock: Clock) -> tuple[DrawnStage, list[SampleBatch]]:
    rows: list[SampleBatch] = []

    def dressed(view: SceneFrame) -> Picture:
        return replace(figures.picture(2), t_ns=view.t_ns)

    def opened() -> Renderer:
        try:
            return Renderer(quality=LIGHTEST)
        except StageError as problem:
            pytest.skip(str(problem))

    stage = DrawnStage(dressed, opened, Display(default_views, lambda: SIZE, 3), clock)
    stage.start(lambda batch: rows.append(batch) if batch.schema is DRAWN_GPU else None)
    for i in range(6):
        stage.draw(_scene(), FrameInfo(i, i, 1000 * i), HEAD)
        stage.images()
    return stage, rows


def test_a_session_records_what_its_frames_cost_the_card() -> None:
    stage, rows = _rows(SystemClock())
    stage.close()
    assert DRAWN_GPU in stage.schemas
    frame = np.concatenate([batch.values["frame"] for batch in rows])
    gpu_ms = np.concatenate([batch.values["gpu_ms"] for batch in rows])
    seq = np.concatenate([batch.seq for batch in rows])
    assert len(frame) >= 4
    assert list(range(len(frame))) == frame.tolist() == seq.tolist()
    assert (gpu_ms > 0.0).all()
    shown_ns = np.concatenate([batch.t_device_ns for batch in rows])
    assert (1000 * frame).tolist() == shown_ns.tolist()


def test_on_the_virtual_clock_no_card_s_time_is_recorded() -> None:
    stage, rows = _rows(SimClock())
    stage.close()
    assert DRAWN_GPU not in stage.schemas
    assert rows == []
