"""The plan of the stare study."""

from collections import Counter

import pytest

from experiments.stare.design import CONDITIONS, StareParameters, plan_session
from experiments.stare.scene import CHARACTERS, characters_of, scene_of
from experiments.stare.study import StareStudy
from lab.errors import DesignError
from stimuli.scenes.audience import ACTIVE_PLACES, PLACES, depth_of, zone_of

PLAN = plan_session(7, 1)
TRIALS = [t for t in PLAN.trials if not t.is_practice]


def test_every_condition_meets_every_place_twice_in_72_trials() -> None:
    counts = Counter((t.factors["condition"], t.factors["place"]) for t in TRIALS)

    assert {(c, p): 2 for c in CONDITIONS for p in ACTIVE_PLACES} == counts
    assert 72 == len(TRIALS)


@pytest.mark.parametrize("participant", range(12))
def test_each_block_of_24_holds_six_of_each_condition_and_balanced_places(
    participant: int,
) -> None:
    plan = plan_session(participant, 5)
    for block in plan.blocks[1:]:
        trials = [t.factors for t in block.trials]

        assert dict.fromkeys(CONDITIONS, 6) == Counter(t["condition"] for t in trials)
        assert {8} == set(Counter(t["zone"] for t in trials).values())
        assert {8} == set(Counter(t["depth"] for t in trials).values())
        assert {2, 3} == set(Counter(t["place"] for t in trials).values())


def test_training_comes_first_and_nothing_in_it_changes() -> None:
    first = PLAN.blocks[0]

    assert ["P1"] == [t.trial_id for t in first.trials]
    assert first.trials[0].is_practice
    assert "speaker" in first.instruction
    assert scene_of(first.trials[0]).name == "training"
    assert [1, 24, 24, 24] == [len(b.trials) for b in PLAN.blocks]


def test_every_block_has_its_own_instruction_and_calibration() -> None:
    assert 4 == len({b.instruction for b in PLAN.blocks})
    assert all(b.calibrate for b in PLAN.blocks)
    assert ("demographics", "social_anxiety", "free_comment") == PLAN.questionnaires


def test_place_agrees_with_its_zone_and_depth() -> None:
    for trial in PLAN.trials:
        place = str(trial.factors["place"])

        assert zone_of(place) == trial.factors["zone"]
        assert depth_of(place) == trial.factors["depth"]


def test_same_seed_and_index_repeat_the_plan_and_others_differ() -> None:
    assert plan_session(7, 1) == PLAN
    assert plan_session(8, 1) != PLAN
    assert plan_session(7, 2) != PLAN


def test_instructions_do_not_speak_of_gaze_conditions() -> None:
    """Participants must not be told to search for eyes."""
    for block in PLAN.blocks:
        for word in ("gaze", "stare", "staring", "looks at you"):
            assert word not in block.instruction.lower()


def test_characters_are_shuffled_over_the_places_at_every_trial() -> None:
    shuffles = [characters_of(t) for t in TRIALS]

    assert all(sorted(CHARACTERS) == sorted(s) for s in shuffles)
    assert 72 == len(set(shuffles))
    assert characters_of(TRIALS[3]) == shuffles[3]
    # Every place sees most models in 72 draws: the shuffle reaches all eleven places.
    assert all(8 < len({s[i] for s in shuffles}) for i in range(len(PLACES)))


def test_six_women_and_five_men() -> None:
    assert {"female": 6, "male": 5} == Counter(c.split("_")[0] for c in CHARACTERS)


def test_one_repetition_makes_a_study_of_36_trials_still_balanced() -> None:
    plan = plan_session(0, 1, params=StareParameters(repetitions=1, trial_s=2.0))

    assert 36 == len(plan.trials) - 1
    assert {3} == {
        n
        for b in plan.blocks[1:]
        for n in Counter(t.factors["condition"] for t in b.trials).values()
    }
    assert 2.0 == plan.parameters["trial_s"]


def test_study_gives_the_session_what_it_asks_for() -> None:
    study = StareStudy()

    assert ("stare", 11, 16.0, 3.0) == (
        study.name,
        study.agent_count,
        study.trial_s,
        study.intertrial_s,
    )
    assert study.plan(7, 1) == PLAN
    assert 0 == study.blank(None).brightness_01
    assert () == study.blank(None).agents


def test_a_group_is_refused() -> None:
    with pytest.raises(DesignError, match="no group 'b'"):
        StareStudy().plan(0, 1, "b")


@pytest.mark.parametrize(
    "wrong",
    [
        {"trial_s": 0.0},
        {"practice_s": -1.0},
        {"repetitions": 0},
        {"switch_at_01": 1.0},
        {"pad_deg": -0.1},
    ],
)
def test_impossible_parameters_are_refused_by_name(wrong: dict[str, float]) -> None:
    with pytest.raises(DesignError, match=next(iter(wrong))):
        StareParameters(**wrong)
