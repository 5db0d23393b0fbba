"""Questions on a board: by gaze, by ray, by key, and the same answers as at the terminal."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from tests.faults.sessions import events, lab, perform
from visavis.lab.clock import NS_PER_MS
from visavis.lab.geometry import Pose, quat_from_yaw_pitch_deg, unit, yaw_pitch_deg_of
from visavis.protocol.plan.steps import FrameView, GazeView
from visavis.protocol.session.boards import DwellRule, GazeDwell
from visavis.protocol.session.frame_loop import FrameLoop
from visavis.protocol.session.panel_questions import LEAVE_OUT, PanelRespondent
from visavis.recording.writer import Recorder
from visavis.stimuli.panels import IN_HEADSET, PanelFrame, choice_centre_m
from visavis.stimuli.scene import Scene, SceneFrame

HEAD = Pose(np.array([0.0, 1.6, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))
OPTIONS = ("not at all", "somewhat", "very much")
FRAME_NS = 11 * NS_PER_MS


class _Loop:
    """Frames in which somebody does something: looks, points, presses."""

    def __init__(self, act: Callable[[PanelFrame, int], dict[str, Any]]) -> None:
        self.head, self.t_ns, self.surface = HEAD, 0, IN_HEADSET
        self.views: list[SceneFrame] = []
        self.events: list[tuple[str, dict[str, Any]]] = []
        self.keys: list[str] = []
        self._act = act

    def show(self, view: SceneFrame) -> None:
        self.views.append(view)

    def show_scene(self, scene: Scene) -> None:
        self.views.append(SceneFrame(scene, self.t_ns, np.zeros((0, 3)), np.zeros(0)))

    def event(self, name: str, _: int, **payload: Any) -> None:
        self.events.append((name, payload))

    def take_keys(self) -> Sequence[str]:
        keys, self.keys = self.keys, []
        return keys

    def next(self) -> FrameView:
        self.t_ns += FRAME_NS
        nothing = GazeView(
            np.array([self.t_ns]),
            np.array([False]),
            np.full((1, 3), np.nan),
            HEAD.position_m[None],
            np.zeros((1, 0)),
            np.zeros((1, 0)),
            np.zeros((1, 0)),
            np.array([-1], np.int16),
        )
        view = FrameView(self.t_ns // FRAME_NS, self.t_ns, HEAD, True, nothing)
        shown = self.views[-1]
        done = self._act(shown, self.t_ns) if isinstance(shown, PanelFrame) else {}
        self.keys += done.pop("keys", [])
        return view._replace(**done)


def looking(view: PanelFrame, choice: int, t_ns: int) -> GazeView:
    to = unit(choice_centre_m(view.panels[0], choice) - HEAD.position_m)
    none = np.zeros((1, 0))
    return GazeView(
        np.array([t_ns]),
        np.array([True]),
        to[None],
        HEAD.position_m[None],
        none,
        none,
        none,
        np.array([-1], np.int16),
    )


def pointing(view: PanelFrame, choice: int) -> tuple[Pose, ...]:
    hand_m = np.array([0.3, 1.1, -0.2])
    yaw, pitch = yaw_pitch_deg_of(unit(choice_centre_m(view.panels[0], choice) - hand_m))
    return (Pose(hand_m, quat_from_yaw_pitch_deg(float(yaw), float(pitch))),)


class _Typist:
    def answer(self, question_id: str, prompt: str, options: Sequence[str]) -> str | None:
        return f"typed {question_id}"


def ask(
    act: Callable[[PanelFrame, int], dict[str, Any]], options: Sequence[str] = OPTIONS
) -> tuple[str | None, _Loop]:
    loop = _Loop(act)
    respondent = PanelRespondent(
        cast(FrameLoop, loop),
        cast(Recorder, loop),
        loop.next,
        loop.take_keys,
        _Typist(),
        lambda: Scene("dark", (), brightness_01=0.0),
        limit_s=10.0,
    )
    return respondent.answer("q1", "How real?", options), loop


def test_choice_looked_at_long_enough_is_the_answer_and_is_lit_before() -> None:
    answer, loop = ask(lambda view, t_ns: {"gaze": looking(view, 2, t_ns)})
    assert answer == "very much"
    assert loop.t_ns == pytest.approx(1200 * NS_PER_MS, abs=3 * FRAME_NS)
    boards = [v.panels[0] for v in loop.views if isinstance(v, PanelFrame)]
    assert [b.highlighted for b in boards] == [None, 2]
    assert [payload.get("by") for _, payload in loop.events] == [None, "gaze"]


def test_wandering_gaze_answers_nothing_and_the_question_goes_to_the_terminal() -> None:
    answer, loop = ask(lambda view, t_ns: {"gaze": looking(view, t_ns // 10**9 % 3, t_ns)})
    assert answer == "typed q1"
    assert loop.events[-1][1]["by"] == "nothing in time"


def test_ray_and_trigger_take_what_is_pointed_at_not_what_is_looked_at() -> None:
    def act(view: PanelFrame, t_ns: int) -> dict[str, Any]:
        pressed = ("trigger",) if t_ns > 500 * NS_PER_MS else ()
        gaze = looking(view, 0, t_ns)
        return {"pointers": pointing(view, 1), "gaze": gaze, "pressed": pressed}

    answer, loop = ask(act)
    assert answer == "somewhat"
    assert loop.events[-1][1]["by"] == "ray"


def test_key_is_the_number_of_the_choice_and_zero_leaves_it_out() -> None:
    assert ask(lambda *_: {"keys": ["2"]})[0] == "somewhat"
    assert ask(lambda *_: {"pressed": ("3",)})[0] == "very much"
    assert ask(lambda *_: {"keys": ["0"]})[0] is None
    assert ask(lambda *_: {"keys": ["9"]})[0] == "typed q1"


def test_questions_that_fit_no_board_are_asked_at_the_terminal() -> None:
    assert ask(lambda *_: {}, ())[0] == "typed q1"
    assert ask(lambda *_: {}, tuple("abcdefghij"))[0] == "typed q1"


def test_board_offers_to_leave_the_question_out() -> None:
    answer, loop = ask(lambda view, t_ns: {"gaze": looking(view, 3, t_ns)})
    assert answer is None
    board = next(v for v in loop.views if isinstance(v, PanelFrame)).panels[0]
    assert board.choices == (*OPTIONS, LEAVE_OUT)


def test_what_was_done_before_the_board_was_there_answers_nothing() -> None:
    def act(view: PanelFrame, t_ns: int) -> dict[str, Any]:
        if t_ns > FRAME_NS:
            return {}
        many = np.arange(t_ns - 2000 * NS_PER_MS, t_ns, 8 * NS_PER_MS)
        one, n = looking(view, 1, t_ns), len(many)
        gaze = one._replace(
            t_ns=many,
            valid=np.ones(n, bool),
            origin_world_m=np.tile(HEAD.position_m, (n, 1)),
            direction_world=np.tile(one.direction_world, (n, 1)),
        )
        return {"gaze": gaze, "pressed": ("2", "trigger"), "pointers": pointing(view, 0)}

    answer, loop = ask(act)
    assert "typed q1" == answer
    assert "nothing in time" == loop.events[-1][1]["by"]


def test_dwell_begins_anew_where_no_sample_came_for_long() -> None:
    dwell = GazeDwell(DwellRule(dwell_ms=1000, gap_ms=150))
    taken = [dwell.take(1, t_ms * NS_PER_MS) for t_ms in (5000, 5100, 8000, 8100)]
    assert [None] * 4 == taken
    assert 1 == [dwell.take(1, t_ms * NS_PER_MS) for t_ms in range(8200, 9001, 100)][-1]


def test_dwell_outlives_a_blink_and_not_a_look_elsewhere() -> None:
    rule = DwellRule(dwell_ms=1000, gap_ms=150)
    for away_ms, taken in ((100, True), (300, False)):
        dwell = GazeDwell(rule)
        chosen = [dwell.take(1, t * NS_PER_MS) for t in range(0, 501, 10)]
        chosen += [dwell.take(None, (500 + t) * NS_PER_MS) for t in range(10, away_ms, 10)]
        chosen += [dwell.take(1, t * NS_PER_MS) for t in range(500 + away_ms, 1100, 10)]
        assert (1 in chosen) is taken


def test_simulated_participant_answers_on_boards_as_at_the_terminal(tmp_path: Path) -> None:
    def answers(where: str) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
        config = lab(tmp_path / where)
        display = config.display.model_copy(update={"questions": where})
        recording = perform(config.model_copy(update={"display": display}), trial_s=1.0)
        keys = ("questionnaire", "question", "answer")
        told = [{k: e[k] for k in keys} for e in events(recording, "answer")]
        return told, [dict(e) for e in events(recording, "panel_answered")]

    typed, no_boards = answers("terminal")
    on_boards, boards = answers("headset")
    assert typed == on_boards
    assert not no_boards
    assert len(boards) > 20
    assert {"gaze"} == {b["by"] for b in boards}
