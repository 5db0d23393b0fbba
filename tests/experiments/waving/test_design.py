"""What is planned for one participant of the waving study."""

from collections import Counter

import pytest

from visavis.experiments.waving import clips
from visavis.experiments.waving.clips import DEFAULT_MAKING, DIRECTIONS, TECHNIQUES
from visavis.experiments.waving.study import study, who_question
from visavis.lab.errors import DesignError
from visavis.results.opened_study import OpenedStudy
from visavis.stimuli.scenes.office import (
    CLERKS,
    CUSTOMERS,
    PARTICIPANT_PLACES,
    STANDING_EYE_M,
    neighbour,
)
from visavis.study.trial import TrialScript

WAVING = OpenedStudy(study)


def trials(seed=3, index=0):
    return [t for t in WAVING.experiment({}).plan(index, seed).trials if not t.is_practice]


def test_54_trials_follow_two_training_trials():
    plan = WAVING.experiment({}).plan(0, 3)
    assert [2, 18, 18, 18] == [len(b.trials) for b in plan.blocks]
    assert all(t.is_practice for t in plan.blocks[0].trials)


def test_every_cell_has_nine_trials_one_per_clerk_and_own_place():
    cells = Counter((t.factors["technique"], t.factors["direction"]) for t in trials())
    assert {(a, b): 9 for a in TECHNIQUES for b in DIRECTIONS} == cells
    situations = Counter(
        (t.factors["clerk"], t.factors["participant_place"])
        for t in trials()
        if (t.factors["technique"], t.factors["direction"]) == ("warping", "left")
    )
    assert {(c.name, p): 1 for c in CLERKS for p in PARTICIPANT_PLACES} == situations


def test_addressee_follows_from_own_place_and_direction():
    for trial in trials():
        f = trial.factors
        assert neighbour(f["participant_place"], f["direction"]).name == f["target_place"]


def test_same_seed_same_order_other_participant_another():
    assert trials(3, 1) == trials(3, 1)
    assert [t.factors for t in trials(3, 1)] != [t.factors for t in trials(3, 2)]


def test_places_stand_from_left_to_right():
    assert sorted(c.x_m for c in CUSTOMERS) == [c.x_m for c in CUSTOMERS]


@pytest.mark.parametrize(
    "wrong",
    [
        {"wave_s": 0},
        {"increment": -1},
        {"warp_from": "aside"},
        {"eye_height_m": 16},
        {"technique": ["aside"]},
    ],
)
def test_impossible_parameters_are_refused_by_name(wrong):
    with pytest.raises(DesignError, match=next(iter(wrong))):
        WAVING.experiment(wrong)


@pytest.mark.parametrize("clerks", [1, 2, 3])
def test_a_pilot_with_fewer_clerks_has_fewer_trials_and_the_same_training(clerks):
    levels = [c.name for c in CLERKS][:clerks]
    plan = WAVING.experiment({"clerk": levels}).plan(0, 3)
    assert 2 + 18 * clerks == len(plan.trials)
    middle = "clerk_middle" if clerks > 1 else "clerk_left"
    practised = [t.factors["clerk"] for t in plan.trials if t.is_practice]
    assert [middle, "clerk_left"] == practised


def test_repetitions_can_be_set():
    plan = WAVING.experiment({"repetitions": 2, "clerk": ["clerk_left"]}).plan(0, 3)
    assert 2 + 2 * 18 == len(plan.trials)


def test_a_wave_at_the_participant_is_made_for_the_planned_eye_height_others_for_the_usual():
    heights = []
    factors = {"clerk": "clerk_left", "technique": "warping", "participant_place": "place_3"}
    for target in ("place_3", "place_2"):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(clips, "study_wave", lambda *args: heights.append(args[-1]))
            clips.wave_of({**factors, "target_place": target}, DEFAULT_MAKING, 1.5)
    assert [1.5, STANDING_EYE_M] == heights


def test_choices_mean_places_from_left_to_right_and_one_is_oneself():
    experiment = WAVING.experiment({})
    question = who_question("place_2")
    _, labels = TrialScript(trials()[0], experiment.settings).words_of(question)
    assert ("left", "me", "right", "right 2", "right 3") == labels
    assert ("place_1", "place_2", "place_3", "place_4", "place_5") == question.options


@pytest.mark.parametrize("language", ["en", "de", "fr"])
def test_the_choices_of_every_language_can_be_told_apart(language):
    experiment = WAVING.experiment({"language": language})
    script = TrialScript(trials()[0], experiment.settings)
    for place in PARTICIPANT_PLACES:
        assert 5 == len(set(script.words_of(who_question(place))[1]))
    assert ["who", "realism"] == [r.name for r in experiment.words.values()]
