"""Parameters with which no session could be run are refused before anybody puts anything on."""

import pytest

from visavis.experiments.crowd.design import CrowdParameters
from visavis.experiments.crowd.patterns import PATTERNS
from visavis.lab.errors import ConfigError, DesignError, UsageError
from visavis.results.opened_study import find_study
from visavis.running.sessions.study_folder import read_parameters

UNUSABLE = (
    "haptic_update_hz=.nan",
    "haptic_update_hz=four",
    "haptic_update_hz=-4",
    "quiet_after_ms=.nan",
    "quiet_after_ms=.inf",
    "quiet_after_ms=0",
    "quiet_after_ms=5",
    "limit_s=.nan",
    "limit_s=.inf",
    "limit_s=-1",
    "intertrial_s=.nan",
    "home_within_m=.nan",
    "home_within_m=100",
    "configurations=2.5",
    "configurations=true",
    "configuration=9",
    "tracking_side_m=.nan",
    "tracking_side_m=x",
    "tracking_side_m=7",
    "nearest_motor=maybe",
    "group=[sham]",
    "record_gaze=nope",
    "density_per_m2=0.2",
    "density_per_m2=3",
    "pattern=",
    "pattern=[1]",
    "pattern=tickle",
    "pattern_low_hz=-5",
    "pattern_low_hz=.nan",
    "pattern_low_hz=200",
    "pattern_modulation_hz=.inf",
    "pattern_modulation_hz=80",
)


@pytest.mark.parametrize("assignment", UNUSABLE)
def test_unusable_value_is_refused_by_name(assignment: str) -> None:
    name = assignment.partition("=")[0]
    with pytest.raises((ConfigError, DesignError), match=name):
        find_study("crowd").experiment(read_parameters([assignment]))


@pytest.mark.parametrize("pattern", PATTERNS)
def test_every_named_pattern_can_be_chosen(pattern: str) -> None:
    assert PATTERNS[pattern] == CrowdParameters(pattern=pattern).vibration


@pytest.mark.parametrize("text", ["limit_s=[", "limit_s={a", "limit_s", "=3"])
def test_text_that_is_no_assignment_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match="NAME=VALUE"):
        read_parameters([text])


def test_one_name_given_twice_is_refused() -> None:
    with pytest.raises(UsageError, match="limit_s is set twice"):
        read_parameters(["limit_s=90", "limit_s=60"])


def test_crowds_and_a_control_group_are_levels() -> None:
    wanted = {"configurations": [1, 2], "groups": ["haptics", "control"]}
    read = find_study("crowd").experiment(wanted).parameters
    assert ([1, 2], ["haptics", "control"]) == (read["configuration"], read["group"])


def test_a_block_is_called_by_its_condition_in_every_language() -> None:
    for language in ("en", "de", "fr"):
        plan = find_study("crowd").experiment({"language": language}).plan(0, 1)
        assert ["NoHaptic1", "Haptic", "NoHaptic2"] == [b.name for b in plan.blocks[1:]]


def test_a_study_with_one_group_has_none() -> None:
    plan = find_study("crowd").experiment({}).plan(0, 1)
    assert ("", {"condition", "configuration", "vibrates"}) == (
        plan.group,
        set(plan.trials[-1].factors),
    )


def test_a_thinner_crowd_is_planned_shown_and_prepared_for() -> None:
    thin = find_study("crowd").experiment({"density_per_m2": 0.8, "configurations": [1]})
    (read, *_) = thin.read.values()
    people = len(read.lit_frame.scene.crowd)
    assert people == pytest.approx(0.8 * 64, abs=0.04 * 64)
    assert people <= thin.people_count < find_study("crowd").experiment({}).people_count == 97
