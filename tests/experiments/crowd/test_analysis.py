"""From tables to conclusions: the decision path, exclusions, paths, the published values."""

import numpy as np
import pandas as pd
import pytest

from tests.experiments.crowd.synthetic_walks import tables, walks
from tests.experiments.crowd.tables import OPENED, analysed
from visavis.experiments.crowd import published
from visavis.experiments.crowd.comparisons import PAIRS, PRIMARY, PathThresholds
from visavis.experiments.crowd.design import AFTER, BEFORE, CONDITIONS, HAPTIC
from visavis.experiments.crowd.measures import MeasureParameters
from visavis.experiments.crowd.measuring import narrow_gaps
from visavis.experiments.crowd.sections import collision_facts
from visavis.lab.errors import ConfigError, DataError, UsageError
from visavis.recording.integrity import DAMAGED_STATUS, LOST_STATUS
from visavis.results.report.study_report import _beside_published


@pytest.fixture(scope="module")
def study():
    return analysed(tables(walks(14)))


def contrast(analysis, column, pair=(BEFORE, HAPTIC)):
    return analysis.finding(column).contrast(pair)


def of_control(analysis, column):
    return next(
        f for f in analysis.findings if f.compare.name == f"{column} by condition (control)"
    )


def left_out(analysis):
    """Return who and what does not count and why: participant, walk (None: all), reason."""
    rows, people = analysis.selection.rows, analysis.selection.people
    out = rows[~rows["is_analysed"] & ~rows["left_out_because"].str.startswith("participant")]
    gone = people[~people["is_analysed"]]
    walks_out = zip(out["participant"], out["trial_id"], out["left_out_because"], strict=True)
    whole = ((p, None, w) for p, w in gone[["participant", "left_out_because"]].to_numpy())
    return [*walks_out, *whole]


def test_the_published_pattern_is_found_where_it_was_put_in(study):
    assert contrast(study, "collisions").is_significant
    later = contrast(study, "collisions", (HAPTIC, AFTER))
    assert not later.is_significant or later.difference > 0
    for measure in PRIMARY:
        assert contrast(study, measure.column).agreement.agrees


def test_published_differences_and_absences_are_counted_apart(study):
    def agreeing(analysis, published_as_different):
        agreements = [
            c.agreement for f in analysis.findings for c in f.contrasts if c.published_result
        ]
        return [a.agrees for a in agreements if a.published_significant == published_as_different]

    assert 7 == len(agreeing(study, True))
    assert sum(agreeing(study, True)) >= 5
    assert 17 == len(agreeing(study, False))
    nothing = analysed(tables(walks(14, effect=False)))
    assert sum(agreeing(nothing, True)) <= 1


def test_without_an_effect_most_measures_show_none():
    study = analysed(tables(walks(14, effect=False)))
    assert sum(contrast(study, m.column).is_significant for m in PRIMARY) <= 1


def test_an_opposite_difference_does_not_agree_with_the_published_one():
    walked = walks(14)
    for walk in walked:
        walk.row["speed_m_s"] = 1 - walk.row["speed_m_s"]
    speed = contrast(analysed(tables(walked)), "speed_m_s")
    assert speed.is_significant
    assert speed.agreement.agrees is False


def test_values_are_means_over_walks_of_a_block(study):
    own = [
        w.row["shoulders_to_gap_deg"]
        for w in walks(14)
        if w.row["participant"] == "S00" and w.row["condition"] == HAPTIC
    ]
    means = study.cell_means().set_index(["participant", "condition"])
    assert np.mean(own) == pytest.approx(means.loc[("S00", HAPTIC), "shoulders_to_gap_deg"])


def test_walks_not_tracked_or_not_finished_are_left_out_with_the_reason():
    walked = walks(6)
    walked[0].row["lost_01"] = 0.5
    walked[7].row["came_back"] = False
    study = analysed(tables(walked))
    reasons = [why for _, _, why in left_out(study)]
    assert len(walked) - 2 == len(study.selection.counted)
    assert "50% of the walk not tracked" in reasons[0]
    assert "did not come back" in reasons[1]


@pytest.mark.parametrize(
    ("status", "why"),
    [
        (DAMAGED_STATUS, "the recording is damaged"),
        (LOST_STATUS, "the recording is damaged"),
        ("interrupted", "not finished"),
    ],
)
def test_walks_that_cannot_be_read_or_were_not_finished_stand_among_what_is_left_out(status, why):
    given = tables(walks(6))
    columns = (
        "participant",
        "session",
        "group",
        "condition",
        "configuration",
        "is_practice",
        "measure_rule",
        "measure_surface",
        "is_simulated",
    )
    row = {c: given["trials"].loc[0, c] for c in columns}
    gone = {**row, "trial_id": "T99", "attempt": 1, "status": status, "reason": "cut off"}
    given["trials"] = pd.concat([given["trials"], pd.DataFrame([gone])], ignore_index=True)
    study = analysed(given, planned=2)
    assert [("S00", "T99", why)] == left_out(study)
    assert 1 == sum(left.count for left in study.selection.left)
    assert len(given["trials"]) - 1 == len(study.selection.counted)


def test_a_person_without_enough_walks_in_a_block_is_left_out_whole():
    walked = walks(6)
    for walk in walked[:2]:
        walk.row["came_back"] = False
    study = analysed(tables(walked))
    assert "S00" not in set(study.selection.counted["participant"])
    (why,) = (why for who, walk, why in left_out(study) if walk is None and who == "S00")
    assert "0% of the walks planned for a block can be used" in why


def test_a_block_broken_off_is_measured_by_its_plan_and_not_by_what_was_finished():
    walked = walks(6, configurations=4)
    dropped = {("S00", HAPTIC, 2), ("S00", HAPTIC, 3), ("S00", HAPTIC, 4)}
    left = [
        w
        for w in walked
        if (w.row["participant"], w.row["condition"], w.row["configuration"]) not in dropped
    ]
    study = analysed(tables(left))
    assert [("S00", "25% of the walks planned for a block can be used (limit 50%)")] == [
        (who, why) for who, _, why in left_out(study)
    ]


def test_people_without_a_block_or_any_walk_are_named_and_left_out_of_paths_too():
    walked = [w for w in walks(6) if (w.row["participant"], w.row["condition"]) != ("S01", HAPTIC)]
    study = analysed(tables(walked), everybody=["S77"])
    assert {"S01", "S77"} == {who for who, walk, _ in left_out(study) if walk is None}
    assert 5 == study.n_participants == study.further[0].paths.n_people
    assert 7 == len(study.selection.people)


def test_a_study_with_fewer_blocks_leaves_nobody_out_and_compares_what_there_is():
    walked = [w for w in walks(8) if w.row["condition"] != AFTER]
    study = analysed(tables(walked), parameters={"condition": [BEFORE, HAPTIC]})
    assert 8 == study.n_participants
    assert [] == left_out(study)
    assert contrast(study, "collisions").is_significant
    assert [(BEFORE, HAPTIC)] == list(study.further[0].paths.block_pairs)
    statuses = [c.status for c in study.conclusions]
    assert "found" == statuses[2]
    assert "undecided" == statuses[3]


def test_a_walk_that_lost_exactly_the_allowed_share_stays():
    limit_01 = 0.10
    walked = walks(4)
    walked[0].row["lost_01"] = limit_01
    walked[1].row["lost_01"] = np.nextafter(limit_01, 1.0)
    study = analysed(tables(walked))
    assert [walked[1].row["trial_id"]] == [walk for _, walk, _ in left_out(study)]
    assert [] == left_out(analysed(tables(walked), max_lost_01=0.2))


@pytest.mark.parametrize(("lost", "out"), [(1, []), (2, ["S00"])])
def test_a_person_with_exactly_the_allowed_share_of_a_blocks_walks_stays(lost, out):
    walked = walks(4, configurations=2)
    for walk in walked[:lost]:
        walk.row["came_back"] = False
    study = analysed(tables(walked), min_walks_01=0.5)
    assert out == [who for who, walk, _ in left_out(study) if walk is None]


def test_facts_about_collisions_are_of_the_group_that_felt_vibrations():
    walked = [*walks(4, group="haptics"), *walks(4, 5, effect=False, group="control")]
    for walk in walked:
        if walk.row["group"] == "control":
            walk.collisions.extend([walk.collisions[0]] * 2)
    given = tables(walked)
    main, control = analysed(given).further
    facts = collision_facts(main, given["collisions"])
    assert {1.0} == {facts[c]["counted"] for c in CONDITIONS}
    assert 3.0 == collision_facts(control, given["collisions"])[HAPTIC]["counted"]


def test_two_people_are_too_few_for_any_test_and_the_report_says_so():
    study = analysed(tables(walks(2)))
    assert all(f.outcome is None and f.why_not for f in study.findings)
    assert all(p.fair is None and p.problem for p in study.further[0].paths.pairs)
    assert {"undecided"} == {c.status for c in study.conclusions}


def test_unrelated_paths_show_no_excess_within_blocks(study):
    for agreements in study.further[0].paths.equivalence:
        assert abs(np.nanmean(agreements.excess)) < 0.03
        assert agreements.test is not None


def test_whole_blocks_look_more_alike_than_halves_without_any_effect(study):
    paths = study.further[0].paths
    halves = paths.within["union"].mean()
    assert all(p.mean > halves for p in paths.pairs if p.variant == "union")
    fair = [p.fair for p in paths.pairs if p.variant == "union"]
    assert all(f.p > 0.02 for f in fair)


def test_a_control_group_is_analysed_apart_and_compared():
    walked = [*walks(8, group="haptics"), *walks(8, 5, effect=False, group="control")]
    study = analysed(tables(walked))
    assert ("haptics", "control") == tuple(group.group for group in study.further)
    assert contrast(study, "collisions").is_significant
    assert not of_control(study, "collisions").contrast((BEFORE, HAPTIC)).is_significant
    between = [f for f in study.findings if f.compare.between]
    assert len(PRIMARY) == len(between)
    assert all("group:condition" in {t.name for t in f.terms} for f in between)


def test_without_a_control_group_nothing_is_asked_of_one(study):
    assert [{}] * 18 == [dict(f.compare.only) for f in study.findings]
    assert not any(f.compare.between for f in study.findings)


def test_printed_volumes_stand_beside_those_of_the_sources_own_rule_alone(study):
    assert "max_volume_dm3" not in published.MEANS
    rows = pd.DataFrame([w.row for w in walks(4)])
    rows["max_volume_published_dm3"] = 1.5
    found = analysed(tables(walks(4)) | {"trials": rows})
    measured = found.measure("max_volume_published_dm3")
    assert {BEFORE, HAPTIC} == set(found.study.report.source.cells[measured.column])
    table = _beside_published(found, OPENED.experiment({}).texts)
    volumes = [row for row in table.rows if "olume" in str(row[0])]
    means = [row for row in volumes if "rule" in str(row[0])]
    assert 2 == len(means)
    assert all("1.5" in str(row[1]) for row in means)
    assert not any("+5 %" in str(row) for row in volumes)


def test_published_means_and_dice_stand_as_printed():
    assert (71.0, 62.8, 60.7) == tuple(published.MEANS["collisions"][c].mean for c in CONDITIONS)
    assert (0.43, 0.40, 0.42) == tuple(published.MEANS["speed_m_s"][c].mean for c in CONDITIONS)
    for pair, values in published.DICE_BETWEEN.items():
        assert published.DICE_BETWEEN_ALL[pair].mean == pytest.approx(np.mean(values), abs=1.5e-3)


@pytest.mark.parametrize(
    ("setting", "problem", "said"),
    [
        ({"max_lost_01": 2}, UsageError, "max_lost_01"),
        ({"alpha": 0}, UsageError, "alpha"),
        ({"dice_bound": 1.0}, UsageError, "dice_bound"),
        ({"n_splits": 0}, UsageError, "n_splits"),
        ({"n_splits": "many"}, ConfigError, "n_splits"),
        ({"narrow_gap_m": 0}, UsageError, "narrow_gap_m"),
        ({"rule": "cubes"}, ConfigError, "choose volume"),
        ({"n_split": 3}, DataError, "n_split"),
    ],
)
def test_impossible_settings_are_refused_before_anything_is_measured(setting, problem, said):
    with pytest.raises(problem, match=said):
        OPENED.check_settings(setting)


def test_thresholds_that_were_set_are_in_force():
    study = analysed(tables(walks(6)), alpha=0.001, dice_bound=0.2, n_permutations=19)
    assert {0.001} == {f.compare.alpha for f in study.findings}
    assert PathThresholds(10, 19, 0.2) == study.thresholds
    assert all(e.test.high == 0.2 for e in study.further[0].paths.equivalence)
    assert all(p.fair.n_permutations == 19 for p in study.further[0].paths.pairs)


def test_the_threshold_of_normality_that_was_set_decides_the_test():
    given = tables(walks(14))
    usual = analysed(given).finding("collisions")
    ranks = analysed(given, normality_alpha=0.999).finding("collisions")
    assert ("F" in usual.terms[0].row, "chi2" in ranks.terms[0].row) == (True, True)


def gaps(*apart_and_angle):
    return [{"centres_apart_m": m, "shoulders_to_gap_deg": deg} for m, deg in apart_and_angle]


def test_shoulders_to_narrow_gaps_leave_out_gaps_nobody_squeezes_through():
    crossed = gaps((0.8, 20.0), (1.5, 30.0), (1.51, 80.0), (7.7, 90.0))
    agreements = narrow_gaps({"crossings": 4}, crossed, 1.5)
    assert {"shoulders_to_gap_narrow_deg": 25.0, "crossings_narrow": 2} == agreements
    wide = narrow_gaps({"crossings": 4}, crossed, 2.0)
    assert wide["shoulders_to_gap_narrow_deg"] == pytest.approx((20 + 30 + 80) / 3)


def test_a_walk_without_a_narrow_gap_has_no_angle_to_one():
    agreements = narrow_gaps({"crossings": 1}, gaps((3.0, 50.0)), 1.5)
    assert {"shoulders_to_gap_narrow_deg": None, "crossings_narrow": 0} == agreements


def test_a_walk_without_cells_has_no_count_of_narrow_gaps():
    assert narrow_gaps({"crossings": None}, [], 1.5)["crossings_narrow"] is None


def test_a_narrow_gap_without_an_angle_counts_and_adds_none():
    agreements = narrow_gaps({"crossings": 2}, gaps((0.8, 20.0), (0.9, None)), 1.5)
    assert {"shoulders_to_gap_narrow_deg": 20.0, "crossings_narrow": 2} == agreements


def test_a_width_of_no_gap_is_refused():
    with pytest.raises(UsageError, match="narrow_gap_m"):
        MeasureParameters(narrow_gap_m=0.0)


def test_every_published_pair_has_a_verdict_of_ours(study):
    for column in published.TESTS:
        assert set(PAIRS) == {(c.first, c.second) for c in study.finding(column).contrasts}
