"""Flat stimuli in a trial: onsets, durations, keys, and times of simulated people."""

import numpy as np
import pytest

from tests.sessions import request_in
from visavis.lab.config_files import SCREEN_EXAMPLE
from visavis.lab.errors import DesignError
from visavis.protocol.plan.session_plan import Trial
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.sessions.perform import perform_new
from visavis.stimuli.gaze_window import WindowPlace
from visavis.stimuli.picture import Panel
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes.flat import FlatScene
from visavis.study.asking import Answer
from visavis.study.dry_run import still_view
from visavis.study.race import Race
from visavis.study.responses import FreeText, Keys
from visavis.study.trial import TrialScript

STUDY = """
from visavis import Factor, Grating, Keys, Race, Scene, Shape, Study, Text

study = Study("flats", "S", factors=[Factor("ink", ["red", "green"])], calibrate=False)

@study.trial
def trial(t):
    yield t.show(Text("+"), frames=12)
    patch = [Shape("rectangle", 4, colour="grey"), Grating()]
    yield t.show(patch, seconds=0.205, background="grey")
    yield t.dark(0.1)
    keys = Keys("r", "g", right=t.ink[0])
    answer = yield t.show(Text("x", colour=t.ink), seconds=0.2, until=keys, limit_s=2)
    t.row["said"] = answer.option
    yield t.show(Text("+"), until=lambda view: True, seconds=1.0)

@study.answer
def answer(seen, response, rng):
    assert seen.stimuli[0].text == "x"
    return Race({seen.stimuli[0].colour[0]: 2.0}, noise=0.1, other_s=0.3)
"""


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flats")
    (folder / "flats.py").write_text(STUDY)
    return find_study(str(folder / "flats.py"))


@pytest.fixture(scope="module")
def trials(study, tmp_path_factory):
    folder = tmp_path_factory.mktemp("flats")
    request = request_in(folder, study, SCREEN_EXAMPLE)
    return Recording(perform_new(request)).trials()


def lasted_ms(trials, name):
    return ((trials[f"{name}_off_ns"] - trials[f"{name}_on_ns"]) / 1e6).to_numpy()


def test_so_many_frames_are_shown_as_were_asked_for(trials):
    assert set(trials["stimulus_frames"]) == {12}
    assert lasted_ms(trials, "stimulus") == pytest.approx(200.0, abs=0.1)


def test_seconds_are_the_nearest_number_of_frames_and_end_when_the_next_is_lit(trials):
    assert set(trials["stimulus2_frames"]) == {12}
    assert lasted_ms(trials, "stimulus2") == pytest.approx(200.0, abs=0.1)
    assert (trials["stimulus2_on_ns"] == trials["stimulus_off_ns"]).all()


def test_a_press_is_timed_from_the_first_lit_frame_though_the_stimulus_is_gone(trials):
    assert (trials["answer_ms"] > 400).all()
    assert lasted_ms(trials, "stimulus3") == pytest.approx(200.0, abs=0.1)
    assert set(trials["answer_by"]) == {"keys"}


def test_the_answer_comes_back_to_the_trial_and_is_right_or_wrong(trials):
    assert (trials["said"] == trials["answer"]).all()
    assert (trials["answer"] == trials["ink"].str[0]).all()
    assert trials["answer_is_right"].all()


def test_without_a_press_there_is_no_time_of_one(study):
    trial = Trial("T01", 1, 1, False, {"ink": "red"}, 1)
    script = TrialScript(trial, study.experiment({}).settings)
    keys, view = Keys("r", "g", right="r"), still_view(0)
    answer = script.take(keys, Answer(None, "nothing in time", 0, 2_000_000_000, view))
    columns = ("answer", "answer_by", "answer_ms", "answer_is_right")
    assert [None, "nothing in time", None, None] == [script.row[name] for name in columns]
    assert answer.is_right is None


def test_a_condition_ends_what_is_shown_in_its_frame(trials):
    assert set(trials["stimulus4_frames"]) == {1}


def test_two_keys_without_a_name_are_the_answer():
    assert Keys("f", "j") == Keys("answer", ("f", "j"))
    assert Keys("f", "j", right="j").right == "j"
    assert Keys("seen", ("a", "b"), "a", 2.0) == Keys(
        "seen", options=("a", "b"), right="a", limit_s=2.0
    )
    assert Keys("seen").options == ("trigger",)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("t.show(Text('a'))", "say how long"),
        ("t.show(Text('a'), 1, frames=3)", "not both"),
        ("t.show(Text('a'), frames=0)", "whole number from 1"),
        ("t.show(Text('a'), until=Keys('f'))", "say which keys"),
        ("t.show('a', 1)", "a list of the latter; not 'a'"),
        ("t.show([], 1)", "a list of the latter; not"),
        ("t.show(Text('a'), 1, limit_s=2)", "limit_s is how long keys"),
        ("t.show(Image('a.png', width_deg=3), 1)", "there is no picture .*a.png"),
        (
            "t.show(Scene('rom'), 1)",
            "there is no scene 'rom'; known: audience, person, two_people$",
        ),
        ("t.show(Text(None), 1)", "Text: text is None; it takes a text"),
        (
            "t.show(Scene('room.glb'), 1)",
            r"a room is no scene by its name: show Room\('room.glb'\)",
        ),
    ],
)
def test_a_mistake_in_showing_is_told_with_its_line(tmp_path, line, says):
    (tmp_path / "slip.py").write_text(
        "from visavis import Factor, Image, Keys, Scene, Study, Text\n"
        "study = Study('slip', 'S', factors=[Factor('a', ['x', 'y'])], calibrate=False)\n"
        f"@study.trial\ndef trial(t):\n    yield {line}\n"
    )
    with pytest.raises(DesignError, match=says) as problem:
        find_study(str(tmp_path / "slip.py")).experiment({})
    assert "slip.py, line 5" in str(problem.value)


def test_a_text_that_is_asked_is_free_text_as_in_earlier_study_files(tmp_path):
    (tmp_path / "old.py").write_text(
        "from visavis import Factor, Scene, Study, Text\n"
        "study = Study('old', 'S', factors=[Factor('a', ['x', 'y'])], calibrate=False)\n"
        "@study.trial\ndef trial(t):\n    yield t.ask(Text('who'))\n"
    )
    experiment = find_study(str(tmp_path / "old.py")).experiment({})
    assert experiment.responses == {"who": FreeText("who")}


@pytest.mark.parametrize("is_still", [False, True])
def test_a_question_over_what_is_seen_leaves_it_as_it_stands(study, is_still):
    nobody = np.zeros((0, 3)), np.zeros(0)
    place = WindowPlace.of(1, np.zeros(3), (0.0, 0.0, -1.0))
    lit = SceneFrame(FlatScene("flat", ()), 0, *nobody, turned_deg=(30.0, 0.0), window_at=place)

    class Shown:
        scene, roles = lit.scene, {}

        def frame(self, view, elapsed_ns):
            return None if is_still else lit

    script = TrialScript(Trial("T1", 1, 0, False, {"ink": "red"}, 1), study.experiment({}).settings)
    script._staged_scene, script._lit_frame = Shown(), lit
    panel = Panel("?", ("a", "b"), still_view().head, (1.0, 0.5))
    view = script._board_shown(True)(still_view(), panel).view
    assert (lit.scene, (30.0, 0.0), place) == (view.scene, view.turned_deg, view.window_at)


def test_arrivals_of_a_race_are_those_of_a_wald_distribution():
    rng = np.random.default_rng(3)
    times = np.array([Race({"a": 2.0}, noise=0.5, other_s=0.2).run(rng)[1] for _ in range(4000)])
    mean, variance = 0.5, 0.5**3 * 0.5**2  # 1/v, and (1/v)³ s²
    assert times.mean() - 0.2 == pytest.approx(mean, rel=0.02)
    assert times.var() == pytest.approx(variance, rel=0.1)


def test_more_evidence_is_chosen_more_often_and_sooner():
    rng = np.random.default_rng(3)
    runs = [Race({"a": 2.0, "b": 1.5, "c": 0.0}).run(rng) for _ in range(2000)]
    chosen = np.array([option for option, _ in runs])
    assert set(chosen) == {"a", "b"}
    assert (chosen == "a").mean() > 0.6


@pytest.mark.parametrize("how", [{"drift": {"a": 0.0}}, {"drift": {"a": 1.0}, "noise": 0.0}])
def test_a_race_that_never_ends_is_refused(how):
    with pytest.raises(DesignError, match="Race"):
        Race(**how)
