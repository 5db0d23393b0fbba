"""Figures moulded before a monitor by keys and in a headset by a ray, from plan to values."""

import shutil
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from tests.sessions import STUDIES, opened
from tests.study.simulated_study import quick_targets
from visavis.cli.app import app
from visavis.cli.recorded_trial import recorded_trial
from visavis.devices.registry import OPTION_MODELS
from visavis.lab.clock import NS_PER_S
from visavis.lab.config import LabConfig, parse_config
from visavis.lab.config_files import EXAMPLE, SCREEN_EXAMPLE
from visavis.lab.errors import DesignError
from visavis.lab.geometry import Pose, turn_towards, unit
from visavis.protocol.plan.steps import FrameView, Mark, NextFrame, Show
from visavis.recording.cached import CachedRecording
from visavis.recording.reader import Recording
from visavis.recording.sharing import EVENT_CLASSES
from visavis.results.moves import moves_of
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import simulated_request
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.stimuli.motion.skeleton import forward
from visavis.stimuli.panels import choice_centre_m, place_m, track_01, track_boxes_01
from visavis.study.dry_run import still_view
from visavis.study.information import facts_in_lab_event, information_at_devices
from visavis.study.live import Live, Moulding, Near, Slider, walks
from visavis.study.moulding import (
    FIGURE_ON,
    FIGURE_TURNED,
    SLIDER_MOVED,
    BoardWords,
    MouldingEnd,
    MouldingFrame,
    moulded,
    press_step,
)

WORDS = BoardWords("Make it happy.", ("active",), "turn", "Continue", "keys", "ray")
LABS = {"monitor": SCREEN_EXAMPLE, "headset": EXAMPLE}
FRAME_NS = NS_PER_S // 60


def lab(where: str, data_root: Path) -> LabConfig:
    """Return a lab with a monitor or a headset, all simulated, nothing drawn."""
    config = parse_config(LABS[where].read_text("utf-8"), LABS[where], OPTION_MODELS)
    display = config.display.model_copy(update={"show": "none"})
    roots = {"data_root": data_root, "key_root": data_root.with_name(f"{data_root.name}-keys")}
    return config.model_copy(update={**roots, "display": display})


def performed(where: str, data_root: Path) -> Recording:
    """Return the simulated session of a participant."""
    study = opened("moulding_lab")
    request = simulated_request(
        study,
        study.experiment({}),
        lab(where, data_root),
        label="S01",
        index=0,
        seed=1,
        effect=True,
    )
    return Recording(perform_new(request))


@pytest.fixture(scope="module", params=list(LABS))
def recording(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Recording:
    return performed(request.param, tmp_path_factory.mktemp(request.param))


def test_a_simulated_person_moulds_by_what_the_lab_has_and_every_movement_is_recorded(
    recording: Recording,
) -> None:
    rows, moves = recording.trials(), moves_of(recording)
    by = "keys" if "keyboard" in str(recording.manifest.configuration["devices"]) else "ray"
    assert {by} == set(rows["activeness_by"]) == set(rows["likeness_by"])
    assert list(rows["mould_ended_by"]) == ["button"] * 2
    assert list(rows["reached"]) == ["near"] * 2
    assert (rows["mould2_distance_m"] < 0.03).all()
    assert list(rows["tries"]) == list(rows["mould_moves"])
    for row in rows.to_dict("records"):
        own = moves[(moves["trial_id"] == row["trial_id"]) & (moves["what"] == "activeness")]
        assert len(own) == row["mould_moves"]
        assert own["value"].iloc[-1] == row["activeness"]
        last_ms = (own["t_ns"].iloc[-1] - row["mould_on_ns"]) / 1e6
        assert row["activeness_ms"] == pytest.approx(last_ms)
        assert row["mould_on_ns"] < own["t_ns"].min()
        assert own["t_ns"].max() <= row["mould_off_ns"]
    happy = rows.set_index("mood")["activeness"]
    assert happy["sad"] < happy["happy"]


def test_people_were_told_of_all_that_is_recorded_and_each_field_has_its_class(
    recording: Recording,
) -> None:
    events = recording.events()
    made = opened("moulding_lab").experiment({})
    lines = information_at_devices(made, ()).lines
    facts = frozenset().union(*map(facts_in_lab_event, set(events["name"])))
    assert "moulding_in_lab" in facts
    assert made.texts.get("recorded.moulding_in_lab") in lines
    for name in (FIGURE_ON, SLIDER_MOVED):
        fields = set(events[events["name"] == name]["payload"].iloc[0])
        assert fields == set(EVENT_CLASSES[name])


def test_a_figure_is_seen_again_as_it_was_moulded(recording: Recording) -> None:
    study = opened("moulding_lab")
    trial = recorded_trial(CachedRecording(recording.path), "T01")
    row = recording.trials().iloc[0]
    (again,) = study.views_of(trial.shown_at(int(row["mould_off_ns"]) - FRAME_NS))
    assert isinstance(again, MouldingFrame)
    assert tuple(person.name for person in picture_of(again).cast) == ("anna",)
    board, knob = again.panels[0], again.panels[1]
    begin, end, down = track_01(board, 0)
    place = place_m(board, begin + row["activeness"] * (end - begin), down)
    assert np.allclose(place, knob.pose.position_m)


@cache
def moulding(
    camera: str = "free", limit_s: float = 5.0, *, until: Near | None = None, is_blind: bool = False
) -> Moulding:
    names = ("slouch", "plain", "march")
    at = {name: [0.5 * i] for i, name in enumerate(names)}
    live = Live(walks("set_a", *names), at=at, camera=camera, beside="female_01")  # type: ignore[arg-type]
    return Moulding(live, (Slider("active"),), until, limit_s, is_blind=is_blind)


class Before:
    """Somebody before a figure; `frame` brings presses and a controller's ray."""

    def __init__(self, what: Moulding, *, head_points: bool) -> None:
        self._head_points, self._t_ns = head_points, 0
        self.marks: list[Mark] = []
        self.shown: list[MouldingFrame] = []
        self.end: MouldingEnd | None = None
        self._steps = moulded(what, WORDS, {"trial_id": "T01", "figure": "mould"}, self._view())
        self._go_on(None)

    def frame(self, *pressed: str, at_m: Any = None) -> None:
        """Let a frame pass."""
        eye = np.array([0.2, 1.0, 0.0])
        pointers = () if at_m is None else (Pose(eye, turn_towards(unit(at_m - eye))),)
        self._t_ns += FRAME_NS
        self._go_on(self._view()._replace(pressed=pressed, pointers=pointers))

    def _view(self) -> FrameView:
        return still_view(self._t_ns)._replace(head_points=self._head_points)

    def _go_on(self, value: FrameView | None) -> None:
        try:
            while not isinstance(step := self._steps.send(value), NextFrame):
                value = None
                if isinstance(step, Mark):
                    self.marks.append(step)
                elif isinstance(step, Show) and isinstance(step.view, MouldingFrame):
                    self.shown.append(step.view)
        except StopIteration as end:
            self.end = end.value


def test_keys_go_from_row_to_row_and_a_button_ends_it() -> None:
    person = Before(moulding(), head_points=False)
    person.frame()
    for key in ("right", "right", "left", "down", "right", "down"):
        person.frame(key)
    person.frame("trigger")
    assert person.end is not None
    assert [(change.slider, change.value) for change in person.end.changes] == [
        (0, 0.55),
        (0, 0.6),
        (0, 0.55),
        (None, 15.0),
    ]
    assert (person.end.ended_by, person.end.by, person.end.values) == ("button", "keys", (0.55,))
    (turned,) = (mark.payload for mark in person.marks if mark.name == FIGURE_TURNED)
    x, z = (float(turned[axis] or 0.0) for axis in ("x_m", "z_m"))
    eye = moulding().live.eye_m
    assert np.hypot(x, z) == pytest.approx(np.hypot(eye[0], eye[2]))
    assert np.degrees(np.arctan2(eye[0], eye[2]) - np.arctan2(x, z)) == pytest.approx(15.0)


def test_a_slider_moves_in_the_next_frame_and_no_farther_than_its_end() -> None:
    person = Before(moulding(), head_points=False)
    person.frame()
    knob = person.shown[-1].panels[1].pose.position_m
    person.frame("right")
    assert not np.allclose(knob, person.shown[-1].panels[1].pose.position_m)
    for _ in range(30):
        person.frame("right")
    assert sum(mark.name == SLIDER_MOVED for mark in person.marks) == 10


def test_a_controller_puts_a_slider_where_it_points_and_takes_the_button() -> None:
    person = Before(moulding(), head_points=True)
    person.frame()
    board = person.shown[-1].panels[0]
    begin, end, down = track_01(board, 0)
    person.frame("trigger", at_m=place_m(board, begin + 0.82 * (end - begin), down))
    _, top, _, bottom = track_boxes_01(board)[1]
    person.frame("trigger", at_m=place_m(board, 0.2, (top + bottom) / 2))  # a name, no track
    person.frame("trigger", at_m=choice_centre_m(board, 0))
    assert person.end is not None
    assert (person.end.values, person.end.ended_by, person.end.by) == ((0.82,), "button", "ray")
    assert len(person.end.changes) == 1


def test_the_time_ends_it_where_nobody_presses_and_a_still_camera_has_no_row_that_turns() -> None:
    person = Before(moulding("still", 1.0), head_points=False)
    person.frame()
    assert person.shown[-1].panels[0].tracks == ("active",)
    for _ in range(61):
        if person.end is None:
            person.frame()
    assert person.end is not None
    assert (person.end.ended_by, person.end.by, person.end.changes) == ("limit", "limit", ())


def test_who_reaches_the_target_sees_it_and_is_then_done_without_a_button() -> None:
    target = Near({"march": 1.0}, within_m=0.02)
    person = Before(moulding("still", until=target), head_points=False)
    person.frame()
    board, *_ = person.shown[-1].panels
    assert ((), 2) == (board.choices, len(person.shown[-1].people.root_m))  # type: ignore[union-attr]
    person.frame("down")
    person.frame("trigger")
    while person.end is None:
        person.frame("right")
    shown = person.shown[-1].people
    assert shown is not None
    assert person.end.ended_by == "near"
    assert (person.end.distance_m or 1.0) < 0.02
    own, target_turns = shown.orientation_wxyz[:, 1:]
    assert np.abs(own - target_turns).max() < 0.1


def test_who_guesses_sees_the_target_alone_and_ends_by_the_button() -> None:
    target = Near({"march": 1.0}, within_m=0.5)  # anything is near enough, and ends nothing
    person = Before(moulding("still", until=target, is_blind=True), head_points=False)
    person.frame()
    people = person.shown[-1].people
    assert people is not None
    assert len(people.root_m) == 1
    for key in ("right", "down", "trigger"):
        person.frame(key)
    assert person.end is not None
    assert (person.end.ended_by, person.end.values) == ("button", (0.55,))
    assert (person.end.distance_m or 0.0) > 0


def test_figures_stand_where_the_camera_of_a_page_would_see_them() -> None:
    person = Before(moulding(), head_points=True)
    people = person.shown[-1].people
    assert people is not None
    x, _, z = moulding().live.eye_m
    assert people.root_m[0, 2] == pytest.approx(-np.hypot(x, z), abs=0.1)
    assert people.root_m[0, 0] == pytest.approx(0.0, abs=0.1)
    # A figure that faces −z has its right side at +x, where the camera of a page stands.
    skeleton = moulding().live.examples.skeleton
    body = forward(skeleton, people.root_m[0], people.orientation_wxyz[0])
    left, right = (
        body.position_m[skeleton.index(f"{side}_upper_arm"), 2] for side in ("left", "right")
    )
    assert x > 0
    assert left < right


@pytest.mark.parametrize(
    ("slider", "step"), [(Slider("a"), 0.05), (Slider("a", low=0, high=10, step=3, start=3), 3)]
)
def test_a_press_goes_a_twentieth_in_whole_steps(slider: Slider, step: float) -> None:
    assert press_step(slider) == pytest.approx(step)


def test_a_study_is_planned_simulated_and_analysed_before_a_monitor(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = str(shutil.copy(STUDIES / "moulding_lab.py", tmp_path / "moulding_lab.py"))
    (tmp_path / "lab_config.yaml").write_text(SCREEN_EXAMPLE.read_text("utf-8"), "utf-8")
    monkeypatch.chdir(tmp_path)

    def command(*words: str) -> None:
        done = CliRunner().invoke(app, list(words), catch_exceptions=False)
        assert done.exit_code == 0, done.output

    command("plan", file)
    with quick_targets():
        command("simulate", file, "--participants", "5", "--processes", "1", "--output", "out")
    command("analyse", "out/simulated/moulding_lab", "--processes", "1")
    trials = pd.read_csv(next(tmp_path.rglob("trials.csv")))
    mean = trials.groupby("mood")["activeness"].mean()
    assert mean["sad"] + 0.2 < mean["happy"]
    assert {"keys"} == set(trials["activeness_by"])


def test_examples_for_another_body_are_refused_before_anything_is_recorded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = (STUDIES / "moulding_lab.py").read_text("utf-8")
    file = tmp_path / "moulding_lab.py"
    file.write_text(text.replace("LIVE = Live(WALKS, ", 'LIVE = Live(WALKS, character="male_01", '))
    (tmp_path / "lab_config.yaml").write_text(SCREEN_EXAMPLE.read_text("utf-8"), "utf-8")
    monkeypatch.chdir(tmp_path)
    for verb in (["plan"], ["run", "--participant", "1", "--fast"]):
        words = [verb[0], str(file), *verb[1:], "--devices", "sim"]
        result = CliRunner().invoke(app, words)
        assert isinstance(result.exception, DesignError), result.output
        assert "not for the body of male_01" in str(result.exception)
    assert not list(tmp_path.rglob("manifest.json"))
