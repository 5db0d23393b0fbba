"""One trial of the waving study, frame by frame, without devices."""

import json
from dataclasses import replace

import numpy as np
import pytest

from visavis.experiments.waving.clips import (
    SCENE_SEED,
    UNITS,
    Making,
    StudyWave,
    base_clip,
    study_wave,
)
from visavis.experiments.waving.study import study, track_shown, warp_columns, wave_record
from visavis.lab.clock import NS_PER_S
from visavis.lab.geometry import Pose, angle_deg, rotate, turn_towards, unit
from visavis.protocol.plan.steps import Ask, AskReply, FrameView, Mark, NextFrame, Show
from visavis.results.opened_study import OpenedStudy
from visavis.stimuli.dressing.office import office_picture, office_scene, pose_of_waver
from visavis.stimuli.motion.skeleton import forward
from visavis.stimuli.motion.warping.track import Reached, WarpTrack, key_record
from visavis.stimuli.motion.warping.units import units_named
from visavis.stimuli.panels import choice_centre_m
from visavis.stimuli.scenes.office import OfficeFrame, OfficeScene

QUICK = {"before_s": 0.3, "wave_s": 0.4, "after_s": 0.1, "increment": 0.0}
MAKING = Making(0.3, 0.4, 0.0)
FRAME_NS = NS_PER_S // 90


def first_trial(experiment):
    return next(t for t in experiment.plan(0, 1).trials if not t.is_practice)


def plan(**changed):
    """Return the plan of the first trial that counts."""
    experiment = OpenedStudy(study).experiment({**QUICK, **changed})
    return experiment.run_trial(first_trial(experiment))


def target(**changed):
    return first_trial(OpenedStudy(study).experiment({**QUICK, **changed})).factors["target_place"]


class Answering:
    """Perform a plan; after some frames of a question, press or point as told."""

    def __init__(self, plan, *, point_at=None, press=(), operator="me"):
        self.marks, self.shown, self.asked = [], [], []
        self.row = None
        self._point_at, self._press, self._operator = point_at, press, operator
        self._t_ns = self._waited = 0
        self._perform(plan)

    def _perform(self, plan):
        step = next(plan)
        try:
            while True:
                step = plan.send(self._reply(step))
        except StopIteration as end:
            self.row = end.value

    def _reply(self, step):
        if isinstance(step, Show):
            self.shown.append(step.view)
        elif isinstance(step, Mark):
            self.marks.append(step)
        elif isinstance(step, Ask):
            self.asked.append(step)
            return AskReply(self._operator if len(step.options) == 5 else "7", self._t_ns)
        elif isinstance(step, NextFrame):
            return self._frame()
        return None

    def _frame(self):
        self._t_ns += FRAME_NS
        panels = getattr(self.shown[-1], "panels", ()) if self.shown else ()
        panel = panels[0] if panels else None
        self._waited = 0 if panel is None else self._waited + 1
        eye = np.array([0.0, 1.6, 0.0])
        turn = np.array([1.0, 0.0, 0.0, 0.0])
        pressed = ()
        if panel is not None and self._waited > 5:
            if self._point_at is not None:
                turn = turn_towards(unit(choice_centre_m(panel, self._point_at) - eye))
            if self._waited > 10:
                pressed, self._waited = tuple(self._press), 0
        return FrameView(self._t_ns, self._t_ns, Pose(eye, turn), True, None, pressed)


def test_a_pointed_choice_is_taken_by_the_trigger():
    done = Answering(plan(), point_at=2, press=("trigger",))
    assert ("place_3", 3, "ray", "ray") == (
        done.row["who"],
        done.row["realism"],
        done.row["who_by"],
        done.row["realism_by"],
    )
    assert done.row["is_right"] == (target() == "place_3")


def test_digits_of_a_response_device_answer_directly():
    done = Answering(plan(), press=("5",))
    assert ("place_5", 5, "keys") == (done.row["who"], done.row["realism"], done.row["who_by"])


def test_a_trigger_that_points_at_nothing_answers_nothing_and_the_operator_is_asked():
    done = Answering(plan(answer_limit_s=0.5), press=("trigger",))
    assert ["who", "realism"] == [ask.question_id for ask in done.asked]
    assert ("operator", 7) == (done.row["who_by"], done.row["realism"])


def test_with_the_keyboard_questions_go_to_the_terminal_at_once():
    done = Answering(plan(answer_by="keyboard"))
    assert "keyboard" == done.row["who_by"]
    chosen = first_trial(OpenedStudy(study).experiment(QUICK))
    assert done.row["who"] == chosen.factors["participant_place"]


class Impatient(Answering):
    """Press a digit with every frame, also while the board is not there yet."""

    def _frame(self):
        return super()._frame()._replace(pressed=("4",))


def test_what_was_pressed_before_a_board_was_there_is_no_answer_to_it():
    done = Impatient(plan())
    assert ("place_4", 4) == (done.row["who"], done.row["realism"])
    assert done.row["who_ms"] == done.row["realism_ms"] == pytest.approx(1000 / 90, abs=0.01)


def test_the_scene_lasts_as_planned_and_nothing_is_asked_before():
    done = Answering(plan(), press=("1",))
    lit = [v for v in done.shown if isinstance(v.scene, OfficeScene)]
    first = next(i for i, v in enumerate(lit) if v.panels)
    assert 0.8 == pytest.approx((lit[first].t_ns - lit[1].t_ns) / NS_PER_S, abs=0.03)


def test_it_is_dark_after_the_last_answer():
    done = Answering(plan(), press=("1",))
    assert 0.0 == done.shown[-1].scene.brightness_01


def test_the_record_holds_what_the_wave_was_made_of():
    done = Answering(plan(), press=("1",))
    wave = next(m for m in done.marks if m.name == "wave").payload
    assert wave["wave_sha256"] == done.row["wave_sha256"]
    assert {"clerk", "heading_deg", "wave_start_s", "wave_s", "is_warped"} <= set(wave)


def test_the_whole_body_is_turned_towards_the_addressee():
    wave = study_wave("clerk_left", "place_5", "orientation", MAKING).waving
    assert 180 + 43.26 == pytest.approx(wave.heading_deg, abs=0.1)
    assert np.array_equal(
        wave.clip.orientation_wxyz, base_clip("clerk_left", MAKING.wave_s).orientation_wxyz
    )


@pytest.mark.parametrize(("warp_from", "is_same"), [("oriented", True), ("front", False)])
def test_a_wave_already_turned_is_the_same_with_both_techniques_without_an_increment(
    warp_from, is_same
):
    making = replace(MAKING, warp_from=warp_from)
    one, other = (
        study_wave("clerk_left", "place_2", t, making) for t in ("orientation", "warping")
    )
    assert is_same == (one.waving.heading_deg == other.waving.heading_deg)
    assert is_same == (one.sha256 == other.sha256)


def test_the_planned_eye_height_of_a_row_is_the_one_that_was_set():
    done = Answering(plan(eye_height_m=1.5), press=("1",))
    assert (1.6, 1.5) == (done.row["eye_height_m"], done.row["planned_eye_height_m"])


def test_eye_height_is_kept_beside_the_one_the_waves_were_made_for():
    done = Answering(plan(), press=("1",))
    assert (1.6, 1.62) == (done.row["eye_height_m"], done.row["planned_eye_height_m"])


def test_a_row_tells_what_the_warp_of_its_wave_wanted_reached_and_could_reach():
    assert {None} == set(warp_columns(None).values())
    expected = {
        "coverage_wanted": 1.25,
        "coverage_reached": 1.11,
        "target_met_01": 0.05,
        "target_reachable_01": 0.5,
    }
    assert expected == warp_columns(Reached(1.25, 1.11, 0.05, 0.5))
    unseen = warp_columns(Reached(np.nan, np.nan, 0.0))
    assert (None, 0.0) == (unseen["coverage_wanted"], unseen["target_met_01"])


def test_the_wave_goes_on_until_the_arm_sinks():
    waving = study_wave("clerk_left", "place_2", "orientation", MAKING).waving
    assert MAKING.before_s + MAKING.wave_s == pytest.approx(waving.end_s)
    hand = waving.clip.skeleton.index("right_lower_arm")
    late, end = (pose_of_waver(waving, t)[1][hand] for t in (waving.end_s - 0.1, waving.end_s))
    assert np.abs(late - end).max() > 1e-3


def test_the_eyes_of_a_warped_clerk_stay_on_the_addressee():
    skeleton = base_clip("clerk_left", MAKING.wave_s).skeleton
    units = units_named(("spine", "neck_head"))
    track = WarpTrack(units, MAKING.before_s, 0.1, np.full((5, len(units)), 0.1), 0.5)
    waving = replace(study_wave("clerk_left", "place_3", "orientation", MAKING).waving, warp=track)
    scene = office_scene("place_3", waving, SCENE_SEED)
    ahead_m = scene.agents[0].facing
    gaze = np.tile(ahead_m, (len(scene.agents), 1))
    posed = office_picture(OfficeFrame(scene, NS_PER_S // 2, gaze, np.ones(len(gaze)))).people
    body = forward(skeleton, posed.root_m[0], posed.orientation_wxyz[0])
    ahead = np.array([0.0, 0.0, -1.0])
    for eye in ("left_eye", "right_eye"):
        looks = rotate(body.orientation_wxyz[skeleton.index(eye)], ahead)
        assert angle_deg(ahead_m, looks) < 0.5  # they drift, as eyes do that fixate


def test_a_wave_is_warped_again_exactly_as_the_record_says():
    plain = study_wave("clerk_left", "place_3", "warping", MAKING).waving
    units, rng = units_named(UNITS), np.random.default_rng(3)
    omega = rng.normal(0.0, 0.2, (13, len(units)))
    shown = WarpTrack(units, MAKING.before_s, 1 / 30, omega, plain.fade_s)
    wave = replace(plain, warp=shown)
    record = wave_record(StudyWave(wave, "", Reached(1.0, 1.0, 1.0)), 0.25)
    keys = []
    for key in (2, 5, 6):
        shown = shown.with_key(key, rng.normal(0.0, 0.2, len(units)))
        keys.append(key_record(shown, key))
    again = track_shown(plain, *json.loads(json.dumps([record, keys])))
    assert np.array_equal(shown.omega_rad, again.warp.omega_rad)
    assert all(np.array_equal(shown.at(t), again.warp.at(t)) for t in np.linspace(0, 1, 40))
