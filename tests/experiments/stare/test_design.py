"""The plan of the stare study."""

import hashlib
from collections import Counter
from typing import Any

import pytest

from visavis.experiments.stare.design import CONDITIONS, StareParameters
from visavis.experiments.stare.scene import CHARACTERS, characters_of, scene_of
from visavis.experiments.stare.study import experiment_of, plan_session, study
from visavis.lab.errors import ConfigError, DesignError
from visavis.stimuli.scenes.audience import ACTIVE_PLACES, PLACES, depth_of, zone_of
from visavis.study.experiment import StudyExperiment

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
    study = experiment_of()

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
        experiment_of().plan(0, 1, "b")


@pytest.mark.parametrize(
    "wrong",
    [
        {"trial_s": 0.0},
        {"practice_s": -1.0},
        {"practice_s": 20.0, "practice_limit_s": 19.0},
        {"practice_limit_s": float("inf")},
        {"agents": 8},
        {"agents": 12},
        {"switch_at_01": 1.0},
        {"pad_deg": -0.1},
    ],
)
def test_impossible_parameters_are_refused_by_name(wrong: dict[str, float]) -> None:
    with pytest.raises((ConfigError, DesignError), match=next(iter(wrong))):
        experiment_of(StareParameters(**wrong))


def test_repetitions_below_one_are_refused() -> None:
    with pytest.raises(DesignError, match="repetitions"):
        experiment_of(StareParameters(repetitions=0))


@pytest.mark.parametrize(
    ("overrides", "sizes"),
    [
        ({"blocks": 4}, [1, 18, 18, 18, 18]),
        ({"blocks": 1}, [1, 72]),
        ({"conditions": ["A", "D"]}, [1, 12, 12, 12]),
        ({"conditions": ["D", "AD"], "zones": ["left"]}, [1, 4, 4, 4]),
    ],
)
def test_blocks_conditions_and_places_are_set_by_name(
    overrides: dict[str, Any], sizes: list[int]
) -> None:
    plan = StudyExperiment(study, overrides).plan(0, 1)
    levels = {str(t.factors["condition"]) for t in plan.trials if not t.is_practice}

    assert sizes == [len(b.trials) for b in plan.blocks]
    assert set(overrides.get("conditions", CONDITIONS)) == levels


def test_a_smaller_audience_keeps_the_active_places_and_hides_nobody_behind_the_absent() -> None:
    experiment = StudyExperiment(study, {"agents": 9})
    scene = scene_of(TRIALS[0], 9)

    assert 9 == experiment.agent_count
    assert ACTIVE_PLACES == tuple(a.place for a in scene.agents)
    assert 2 == len(scene_of(TRIALS[0]).occluders) - len(scene.occluders)


def test_a_condition_that_is_none_is_refused_with_those_there_are() -> None:
    with pytest.raises(DesignError, match="no condition 'AA'; choose among A, D, AD, DA"):
        StudyExperiment(study, {"conditions": ["A", "AA"]})


def test_instructions_say_the_numbers_that_are_in_force() -> None:
    changed = {"trial_s": 8.0, "blocks": 4, "intertrial_s": 2.0}
    training, first, second, third, last = (
        b.instruction for b in StudyExperiment(study, changed).plan(0, 1).blocks
    )

    assert "dark for two seconds" in training
    assert first.startswith("Now the first of four parts begins: 18 scenes of 8 seconds.")
    assert second.startswith("This is the second of four parts, with 18 scenes")
    assert third.startswith("This is the third of four parts")
    assert last.startswith("This is the last part")


@pytest.mark.parametrize("language", ["en", "de", "fr"])
@pytest.mark.parametrize("blocks", [1, 2, 4])
def test_every_language_has_every_instruction(language: str, blocks: int) -> None:
    plan = StudyExperiment(study, {"language": language, "blocks": blocks}).plan(0, 1)

    assert blocks + 1 == len({b.instruction for b in plan.blocks})
    assert not any("{" in b.instruction for b in plan.blocks)


def test_the_instructions_of_the_source_read_as_they_did() -> None:
    read = "\n".join(b.instruction for b in PLAN.blocks)

    assert "dark for three seconds: bring head" in PLAN.blocks[0].instruction
    assert "Now the first of three parts begins: 24 scenes of 16 seconds. Face" in read
    assert "This is the second of three parts, with 24 scenes as before. Observe" in read
    assert "950b75" == hashlib.sha256(read.encode()).hexdigest()[:6]
