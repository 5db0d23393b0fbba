"""From tables to conclusions: the decision path, exclusions, paths, the published values."""

import numpy as np
import pandas as pd
import pytest

from experiments.crowd import published
from experiments.crowd.analysis import analyse_tables
from experiments.crowd.analysis_parameters import AnalysisParameters
from experiments.crowd.collision_table import collision_facts
from experiments.crowd.conclusions import conclude
from experiments.crowd.design import AFTER, BEFORE, CONDITIONS, HAPTIC
from experiments.crowd.terms import COLLISIONS, PRIMARY, SPEED, TO_GAP
from lab.errors import DataError, UsageError
from recording.integrity import DAMAGED, LOST
from tests.experiments.crowd.synthetic_walks import tables, walks

QUICK = AnalysisParameters(n_permutations=49, n_splits=10)


@pytest.fixture(scope="module")
def study():
    return analyse_tables(tables(walks(14)), QUICK, is_simulated=True)


def test_the_published_pattern_is_found_where_it_was_put_in(study):
    collisions = study.main.comparison(COLLISIONS)
    assert collisions.differs((BEFORE, HAPTIC))
    assert not collisions.differs((HAPTIC, AFTER)) or collisions.means[1] > collisions.means[2]
    for measure in PRIMARY:
        assert study.main.comparison(measure).agrees((BEFORE, HAPTIC))


def test_published_differences_and_absences_are_counted_apart(study):
    differences, of = study.agreement(published_as_different=True)
    assert 7 == of
    assert differences >= 5
    assert 17 == study.agreement(published_as_different=False)[1]
    nothing = analyse_tables(tables(walks(14, effect=False)), QUICK, is_simulated=True)
    assert nothing.agreement(published_as_different=True)[0] <= 1


def test_without_an_effect_most_measures_show_none():
    study = analyse_tables(tables(walks(14, effect=False)), QUICK, is_simulated=True)
    found = [study.main.comparison(m).differs((BEFORE, HAPTIC)) for m in PRIMARY]
    assert sum(found) <= 1


def test_an_opposite_difference_does_not_agree_with_the_published_one():
    walked = walks(14)
    for walk in walked:
        walk.row["speed_m_s"] = 1 - walk.row["speed_m_s"]
    study = analyse_tables(tables(walked), QUICK, is_simulated=True)
    assert study.main.comparison(SPEED).differs((BEFORE, HAPTIC))
    assert study.main.comparison(SPEED).agrees((BEFORE, HAPTIC)) is False


def test_values_are_means_over_walks_of_a_block(study):
    walked = walks(14)
    own = [
        w.row["shoulders_to_gap_deg"]
        for w in walked
        if w.row["participant"] == "S00" and w.row["condition"] == HAPTIC
    ]
    table = study.main.comparison(TO_GAP).table
    assert np.mean(own) == pytest.approx(table[0, CONDITIONS.index(HAPTIC)])


def test_walks_not_tracked_or_not_finished_are_left_out_with_the_reason():
    walked = walks(6)
    walked[0].row["lost_01"] = 0.5
    walked[7].row["came_back"] = False
    study = analyse_tables(tables(walked), QUICK, is_simulated=True)
    reasons = [why for _, _, why in study.excluded]
    assert len(walked) - 2 == len(study.kept)
    assert "50% of the walk not tracked" in reasons[0]
    assert "did not come back" in reasons[1]


@pytest.mark.parametrize(
    ("status", "why"),
    [
        (DAMAGED, "the recording is damaged"),
        (LOST, "the recording is damaged"),
        ("interrupted", "not finished"),
    ],
)
def test_walks_that_cannot_be_read_or_were_not_finished_stand_among_what_is_left_out(status, why):
    given = tables(walks(6))
    columns = ("participant", "session", "group", "condition", "configuration", "is_practice",
               "measure_rule", "measure_surface", "is_simulated")  # fmt: skip
    row = {c: given["trials"].loc[0, c] for c in columns}
    gone = {**row, "trial_id": "T99", "attempt": 1, "status": status, "reason": "cut off"}
    given["trials"] = pd.concat([given["trials"], pd.DataFrame([gone])], ignore_index=True)
    study = analyse_tables(given, QUICK, is_simulated=True)
    assert (("S00", "T99", why),) == study.excluded
    assert ("T99", False) == tuple(study.trials.iloc[-1][["trial_id", "is_analysed"]])
    assert 1 == sum(left.count for left in study.selection.left)
    assert len(given["trials"]) - 1 == len(study.kept)


def test_a_person_without_enough_walks_in_a_block_is_left_out_whole():
    walked = walks(6)
    for walk in walked[:2]:
        walk.row["came_back"] = False
    study = analyse_tables(tables(walked), QUICK, is_simulated=True)
    assert "S00" not in study.main.people
    (why,) = (why for who, walk, why in study.excluded if walk is None and who == "S00")
    assert "0% of the walks planned for a block can be used" in why


def test_a_block_broken_off_is_measured_by_its_plan_and_not_by_what_was_finished():
    walked = walks(6, configurations=4)
    dropped = {("S00", HAPTIC, 2), ("S00", HAPTIC, 3), ("S00", HAPTIC, 4)}
    left = [
        w
        for w in walked
        if (w.row["participant"], w.row["condition"], w.row["configuration"]) not in dropped
    ]
    study = analyse_tables(tables(left), QUICK, is_simulated=True)
    assert [("S00", "25% of the walks planned for a block can be used (limit 50%)")] == [
        (who, why) for who, _, why in study.excluded
    ]
    assert "S00" not in study.main.people


def test_planned_walks_count_where_the_session_recorded_them():
    walked = walks(6)
    for walk in walked:
        walk.row["block_walks"] = 8
    study = analyse_tables(tables(walked), QUICK, is_simulated=True)
    assert () == study.main.people
    assert 6 == sum(why.startswith("25% of the walks planned") for _, _, why in study.excluded)


def test_people_without_a_block_or_any_walk_are_named_and_left_out_of_paths_too():
    walked = [w for w in walks(6) if (w.row["participant"], w.row["condition"]) != ("S01", HAPTIC)]
    given = tables(walked)
    given["people"] = pd.concat([given["people"], pd.DataFrame([{"participant": "S77"}])])
    study = analyse_tables(given, QUICK, is_simulated=True)
    assert {"S01", "S77"} == {who for who, walk, _ in study.excluded if walk is None}
    assert 5 == len(study.main.people) == study.main.paths.n_people
    assert 7 == len(study.planned)


def test_a_walk_that_lost_exactly_the_allowed_share_stays():
    limit_01 = 0.10
    walked = walks(4)
    walked[0].row["lost_01"] = limit_01
    walked[1].row["lost_01"] = np.nextafter(limit_01, 1.0)
    study = analyse_tables(tables(walked), QUICK, is_simulated=True)
    assert [walked[1].row["trial_id"]] == [walk for _, walk, _ in study.excluded]
    loose = analyse_tables(tables(walked), QUICK, is_simulated=True, limits={"max_lost_01": 0.2})
    assert () == loose.excluded


@pytest.mark.parametrize(("lost", "out"), [(1, []), (2, ["S00"])])
def test_a_person_with_exactly_the_allowed_share_of_a_blocks_walks_stays(lost, out):
    walked = walks(4, configurations=2)
    for walk in walked[:lost]:
        walk.row["came_back"] = False
    study = analyse_tables(tables(walked), QUICK, is_simulated=True, limits={"min_walks_01": 0.5})
    assert out == [who for who, walk, _ in study.excluded if walk is None]


def test_facts_about_collisions_are_of_the_group_that_felt_vibrations():
    walked = [*walks(4, group="haptics"), *walks(4, 5, effect=False, group="control")]
    for walk in walked:
        if walk.row["group"] == "control":
            walk.collisions.extend([walk.collisions[0]] * 2)
    given = tables(walked)
    study = analyse_tables(given, QUICK, is_simulated=True)
    facts = collision_facts(study.main, given["collisions"])
    assert {1.0} == {facts[c]["counted"] for c in CONDITIONS}
    assert 3.0 == collision_facts(study.control, given["collisions"])[HAPTIC]["counted"]
    assert {"haptics", "control"} == set(study.means["group"])


def test_volumes_of_two_rules_are_refused():
    walked = walks(4)
    walked[3].row["measure_rule"] = "published"
    with pytest.raises(DataError, match="cannot be compared"):
        analyse_tables(tables(walked), QUICK, is_simulated=True)


def test_simulated_walks_given_as_real_are_refused():
    with pytest.raises(DataError, match="holds simulated sessions"):
        analyse_tables(tables(walks(4)), QUICK, is_simulated=False)


def test_two_people_are_too_few_for_any_test_and_the_report_says_so():
    study = analyse_tables(tables(walks(2)), QUICK, is_simulated=True)
    assert all(c.test is None and c.problem for c in study.main.comparisons)
    assert all(p.fair is None and p.problem for p in study.main.paths.pairs)
    assert {"undecided"} == {c.status for c in conclude(study)}


def test_unrelated_paths_show_no_excess_within_blocks(study):
    for found in study.main.paths.equivalence:
        assert abs(np.nanmean(found.excess)) < 0.03
        assert found.test is not None


def test_whole_blocks_look_more_alike_than_halves_without_any_effect(study):
    halves = study.main.paths.within["union"].mean()
    assert all(p.mean > halves for p in study.main.paths.pairs if p.variant == "union")
    fair = [p.fair for p in study.main.paths.pairs if p.variant == "union"]
    assert all(f.p > 0.02 for f in fair)


def test_a_control_group_is_analysed_apart_and_compared():
    walked = [*walks(8, group="haptics"), *walks(8, 5, effect=False, group="control")]
    study = analyse_tables(tables(walked), QUICK, is_simulated=True)
    assert ("haptics", "control") == (study.main.group, study.control.group)
    assert study.main.comparison(COLLISIONS).differs((BEFORE, HAPTIC))
    assert not study.control.comparison(COLLISIONS).differs((BEFORE, HAPTIC))
    assert len(PRIMARY) == len(study.between_groups)


def test_published_means_and_dice_stand_as_printed():
    assert (71.0, 62.8, 60.7) == tuple(published.MEANS["collisions"][c].mean for c in CONDITIONS)
    assert (0.43, 0.40, 0.42) == tuple(published.MEANS["speed_m_s"][c].mean for c in CONDITIONS)
    for pair, values in published.DICE_BETWEEN.items():
        assert published.DICE_BETWEEN_ALL[pair].mean == pytest.approx(np.mean(values), abs=1.5e-3)


def test_impossible_thresholds_are_refused():
    with pytest.raises(UsageError, match="max_lost_01"):
        analyse_tables(tables(walks(4)), QUICK, is_simulated=True, limits={"max_lost_01": 2})


def with_gaps(apart_m, angles_deg):
    """Return a study's tables whose first walk crosses gaps so wide at such angles."""
    walked = walks(4)
    walked[0].crossings[:] = [
        {**walked[0].crossings[0], "centres_apart_m": apart, "shoulders_to_gap_deg": angle}
        for apart, angle in zip(apart_m, angles_deg, strict=True)
    ]
    return tables(walked)


def test_shoulders_to_narrow_gaps_leave_out_gaps_nobody_squeezes_through():
    given = with_gaps((0.8, 1.5, 1.51, 7.7), (20.0, 30.0, 80.0, 90.0))
    study = analyse_tables(given, QUICK, is_simulated=True)
    first = study.trials.iloc[0]
    assert 25.0 == first["shoulders_to_gap_narrow_deg"]
    assert 2 == first["crossings_narrow"]
    pd.testing.assert_series_equal(
        given["trials"]["shoulders_to_gap_deg"], study.trials["shoulders_to_gap_deg"]
    )
    wide = AnalysisParameters(n_permutations=49, n_splits=10, narrow_gap_m=2.0)
    first = analyse_tables(given, wide, is_simulated=True).trials.iloc[0]
    assert first["shoulders_to_gap_narrow_deg"] == pytest.approx((20 + 30 + 80) / 3)


def test_a_walk_without_a_narrow_gap_has_no_angle_to_one():
    study = analyse_tables(with_gaps((3.0,), (50.0,)), QUICK, is_simulated=True)
    first = study.trials.iloc[0]
    assert np.isnan(first["shoulders_to_gap_narrow_deg"])
    assert 0 == first["crossings_narrow"]


def test_a_narrow_gap_without_an_angle_counts_and_adds_none():
    given = with_gaps((0.8, 0.9), (20.0, np.nan))
    first = analyse_tables(given, QUICK, is_simulated=True).trials.iloc[0]
    assert (20.0, 2) == (first["shoulders_to_gap_narrow_deg"], first["crossings_narrow"])


def test_a_width_of_no_gap_is_refused():
    with pytest.raises(UsageError, match="narrow_gap_m"):
        AnalysisParameters(narrow_gap_m=0.0)
