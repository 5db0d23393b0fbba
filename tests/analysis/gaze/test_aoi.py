import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from visavis.analysis.gaze.aoi import (
    LOST,
    NONE,
    SENSITIVITY_PADS_DEG,
    aoi_by_pad,
    aoi_of_samples,
    pad_for_accuracy_deg,
)
from visavis.lab.errors import UsageError


def decide(angles, radii, limits, hit, pad_deg=1.0, dtype=np.float64):
    return aoi_of_samples(
        np.array([angles], dtype),
        np.array([radii], dtype),
        np.array([limits], dtype),
        np.array([hit], np.int16),
        pad_deg=pad_deg,
    )[0]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize(
    ("expected", "angle", "limit", "hit"),
    [
        (0, 2.0, 9.0, 0),  # within the head
        (0, 3.9, 9.0, -1),  # within the pad
        (0, 4.0, 9.0, -1),  # on the padded rim
        (NONE, 4.1, 9.0, -1),  # beyond it
        (0, 3.5, 0.5, -1),  # the pad limit's rim
        (NONE, 3.6, 0.5, -1),  # beyond the limit although within the pad
        (NONE, 3.1, 0.0, -1),  # heads overlap: no pad at all
        (LOST, 2.0, 9.0, -2),
        (LOST, np.nan, 9.0, -1),
    ],
)
def test_pad_reaches_to_the_smaller_of_pad_and_limit(expected, angle, limit, hit, dtype):
    assert expected == decide([angle], [3.0], [limit], hit, dtype=dtype)


def test_of_two_agents_in_line_the_nearer_one_is_hit():
    assert decide([1.0, 1.0], [3.0, 2.0], [0.0, 0.0], 0) == 0
    assert decide([1.0, 1.0], [3.0, 2.0], [0.0, 0.0], 1) == 1


def test_head_behind_an_occluder_does_not_count():
    assert decide([1.0], [3.0], [9.0], -1) == NONE


def test_smaller_angle_over_radius_wins_and_then_the_lower_index():
    assert decide([3.5, 3.5], [3.0, 3.2], [1.0, 1.0], -1) == 1
    assert decide([3.5, 3.5], [3.2, 3.0], [1.0, 1.0], -1) == 0
    assert decide([3.5, 3.5], [3.0, 3.0], [1.0, 1.0], -1) == 0


def test_head_hit_wins_over_the_padded_neighbour():
    assert decide([2.9, 3.1], [3.0, 3.0], [1.0, 1.0], 0) == 0


def test_rim_is_not_a_hole_when_the_ray_test_rounds_the_other_way():
    just_inside = 3.0 * (1 - 1e-7)
    assert decide([just_inside], [3.0], [9.0], -1) == 0


def test_no_samples_and_no_agents_are_defined():
    empty = np.zeros((0, 11))
    assert aoi_of_samples(empty, empty, empty, np.zeros(0, np.int16)).tolist() == []
    none = np.zeros((2, 0))
    assert aoi_of_samples(none, none, none, np.array([-1, -2], np.int16)).tolist() == [NONE, LOST]


def test_online_and_recorded_decisions_agree():
    rng = np.random.default_rng(4)
    radius = rng.uniform(1, 5, (20_000, 3))
    limit = rng.uniform(0, 2, radius.shape)
    angle = radius + np.minimum(1.0, limit) + rng.normal(0, 3e-7, radius.shape)
    hit = np.full(len(angle), -1, np.int16)
    online = aoi_of_samples(angle, radius, limit, hit)
    f4 = np.float32
    again = aoi_of_samples(angle.astype(f4), radius.astype(f4), limit.astype(f4), hit)
    assert np.array_equal(online, again)
    assert 0 < (online == NONE).sum() < len(online)


def test_wider_pads_only_add_samples():
    rng = np.random.default_rng(5)
    angle = rng.uniform(0, 12, (500, 1))
    radius = np.full(angle.shape, 3.0)
    hit = np.where(angle[:, 0] < 3, 0, -1).astype(np.int16)
    counts = [int((a == 0).sum()) for a in aoi_by_pad(angle, radius, radius + 9, hit).values()]
    assert list(aoi_by_pad(angle, radius, radius, hit)) == list(SENSITIVITY_PADS_DEG)
    assert counts == sorted(counts)
    assert counts[0] == int((angle <= 3).sum())
    assert counts[-1] == int((angle <= 5).sum())


@given(
    hnp.arrays(np.float64, (6, 4), elements=st.floats(0, 20)),
    hnp.arrays(np.float64, (6, 4), elements=st.floats(0.1, 8)),
    hnp.arrays(np.float64, (6, 4), elements=st.floats(0, 3)),
    hnp.arrays(np.int16, 6, elements=st.integers(-2, 3)),
    st.floats(0, 3),
)
def test_decision_follows_the_rule_written_out(angle, radius, limit, hit, pad):
    angle, radius, limit = (x.astype(np.float32).astype(float) for x in (angle, radius, limit))
    expected = []
    for i in range(6):
        ranked = sorted(
            (angle[i, j] / radius[i, j], j)
            for j in range(4)
            if angle[i, j] <= radius[i, j] + min(pad, limit[i, j])
            and (hit[i] == j or angle[i, j] >= radius[i, j] * (1 - 1e-5))
        )
        expected.append(LOST if hit[i] == -2 else ranked[0][1] if ranked else NONE)
    assert expected == aoi_of_samples(angle, radius, limit, hit, pad_deg=pad).tolist()


def test_pad_follows_the_participants_validation_within_bounds():
    given_ = [None, float("nan"), 0.2, 0.8, 4.0]
    assert [1.0, 1.0, 0.5, 0.8, 1.5] == [pad_for_accuracy_deg(a) for a in given_]


@pytest.mark.parametrize("pad", [-0.1, np.inf, np.nan])
def test_impossible_pad_is_refused(pad):
    with pytest.raises(UsageError, match="pad_deg"):
        decide([1.0], [3.0], [1.0], 0, pad_deg=pad)


def test_shapes_that_disagree_are_refused():
    with pytest.raises(UsageError, match="disagree"):
        aoi_of_samples(np.zeros((2, 3)), np.zeros((2, 2)), np.zeros((2, 3)), np.zeros(2, np.int16))
