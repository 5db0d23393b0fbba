"""What is planned for one participant of the waving study."""

from collections import Counter

import pytest

from experiments.waving.design import (
    DIRECTIONS,
    TECHNIQUES,
    WavingParameters,
    plan_session,
)
from lab.errors import DesignError
from stimuli.scenes.office import CLERKS, CUSTOMERS, PARTICIPANT_PLACES, neighbour


def trials(seed=3, index=0):
    return [t for t in plan_session(index, seed).trials if not t.is_practice]


def test_54_trials_follow_two_training_trials():
    plan = plan_session(0, 3)
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
    "wrong", [{"wave_s": 0}, {"increment": -1}, {"answer_by": "shout"}, {"blocks": 4}]
)
def test_impossible_parameters_are_refused_by_name(wrong):
    with pytest.raises(DesignError, match=next(iter(wrong))):
        WavingParameters(**wrong)


@pytest.mark.parametrize("clerks", [1, 2, 3])
def test_a_pilot_with_fewer_clerks_has_fewer_trials_and_the_same_training(clerks):
    plan = plan_session(0, 3, params=WavingParameters(clerks=clerks))
    assert 2 + 18 * clerks == len(plan.trials)
