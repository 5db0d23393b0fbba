"""Walks simulated in memory: they repeat, answer vibration alone, and measure as recordings do."""

from dataclasses import replace

import numpy as np
import pytest

from visavis.analysis.gait import crossing_angles_deg, step_length_m, walk_measures
from visavis.experiments.crowd.collision_measures import collision_rows, walk_volumes
from visavis.experiments.crowd.design import AFTER, BEFORE, HAPTIC, CrowdParameters
from visavis.experiments.crowd.measures import cells_of
from visavis.experiments.crowd.participant.participant import CrowdParticipant
from visavis.experiments.crowd.quick_measures import quick_measures
from visavis.experiments.crowd.quick_study import block_walks, quick_walk
from visavis.experiments.crowd.study import plan_session
from visavis.experiments.crowd.walks import STEP_NS, Walk
from visavis.lab.body_joints import BODY_JOINTS
from visavis.results.opened_study import find_study
from visavis.stimuli.scenes.station_crowd import BOARD_M, START_M

ONE = {"configuration": [1]}


def rows(effect=True, seed=3, parameters=ONE, group_index=0):
    experiment = find_study("crowd").experiment(parameters)
    plan = experiment.plan(group_index, seed)
    blocks = block_walks(CrowdParticipant(group_index, seed, effect), plan, CrowdParameters())
    return {
        trial.factors["condition"]: {"group": plan.group, **row}
        for block in blocks
        for trial, row, _ in block
    }


@pytest.fixture(scope="module")
def felt():
    return rows()


def test_a_session_repeats_bit_for_bit(felt):
    assert rows() == felt


def test_every_walk_comes_back_and_meets_people(felt):
    for row in felt.values():
        assert row["came_back"]
        assert row["collisions"] > 20
        assert 0.3 < row["max_volume_dm3"] < 1.6
        # Cubes that touch both bodies hold more than the bodies have in common.
        assert 1.3 < row["max_volume_published_dm3"] / row["max_volume_dm3"] < 2.5
        assert 0.3 < row["speed_m_s"] < 0.6


def test_caution_is_learned_from_vibration_and_outlasts_it(felt):
    assert felt[BEFORE]["caution"] == 0.0 == felt[BEFORE]["touching_s"]
    assert felt[HAPTIC]["touching_s"] > 5
    assert felt[HAPTIC]["caution"] > 0.1
    assert 0.8 * felt[HAPTIC]["caution"] < felt[AFTER]["caution"] < felt[HAPTIC]["caution"]


def test_without_connection_to_the_skin_nothing_is_learned(felt):
    numb = rows(effect=False)
    assert numb[BEFORE] == felt[BEFORE]
    assert numb[HAPTIC]["touching_s"] > 5
    assert [row["caution"] for row in numb.values()] == [0.0, 0.0, 0.0]


def test_a_control_group_is_never_touched_by_vibration():
    parameters = {**ONE, "group": ["haptics", "control"]}
    groups = {plan_session(i, 3, **parameters).group: i for i in range(4)}
    control = rows(parameters=parameters, group_index=groups["control"])
    assert [row["group"] for row in control.values()] == ["control"] * 3
    assert [row["touching_s"] for row in control.values()] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("within_m", [CrowdParameters().home_within_m, 1.5])
def test_a_walk_ends_as_near_the_mark_as_was_set(within_m):
    trial = plan_session(1, 5).blocks[1].trials[0]
    walk = quick_walk(
        CrowdParticipant(1, 5), trial, 0, replace(CrowdParameters(), home_within_m=within_m)
    )
    head = walk.position_m[:, BODY_JOINTS.index("head")][:, [0, 2]]
    to_mark_m = np.hypot(*(head - START_M).T)
    assert walk.came_back
    assert to_mark_m[-1] <= within_m < to_mark_m[-2]


def test_quick_measures_are_those_of_the_full_measurement():
    participant = CrowdParticipant(1, 5)
    trial = plan_session(1, 5).blocks[1].trials[0]
    quick = quick_walk(participant, trial, 0)
    step_m = step_length_m(participant.person.sex)
    row, cells = quick_measures(quick, step_m)
    end_ns = round(quick.t_s[-1] * 1e9)
    grid = np.arange(0, end_ns, STEP_NS, dtype=np.int64)
    at, turn = participant.segments(BODY_JOINTS, grid)
    walk = Walk(
        trial.trial_id,
        {"trial_id": trial.trial_id, "t_start_ns": 0, **trial.factors},
        quick.crowd,
        grid,
        at,
        turn,
        participant.person.stature_m,
    )
    met = collision_rows(walk, walk_volumes(walk, surface="capsules"))
    largest = [c["max_volume_dm3"] for c in met if c["counted"]]
    assert len(largest) == pytest.approx(row["collisions"], rel=0.12)
    assert np.mean(largest) == pytest.approx(row["max_volume_dm3"], rel=0.08)
    triangulation, path = cells_of(walk)
    left, right = (walk.joint(f"{side}_upper_arm")[:, [0, 2]] for side in ("left", "right"))
    to_gap, _ = crossing_angles_deg(triangulation, path, left, right)
    assert to_gap.mean() == pytest.approx(row["shoulders_to_gap_deg"], abs=2.0)
    gait = walk_measures(walk.t_ns, walk.place_m, (BOARD_M[0], BOARD_M[2]), step_m)
    assert gait.speed_m_s == pytest.approx(row["speed_m_s"], rel=0.03)
    visited = {c for c in path.cells if c is not None}
    assert len(cells) > 20
    assert len(cells & visited) == pytest.approx(len(cells), abs=1)
    assert len(visited) == pytest.approx(len(cells), rel=0.06)
