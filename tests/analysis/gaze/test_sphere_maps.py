"""Maps of gaze on the sphere: of one width everywhere, without a seam, by solid angle."""

import numpy as np
import pytest
from scipy.stats import mannwhitneyu

from visavis.analysis.gaze.maps import MIN_PEOPLE, _clusters, clusters_of_difference
from visavis.analysis.gaze.sphere_maps import (
    SPHERE_SMOOTHING_DEG,
    SphereGrid,
    auc,
    cc,
    kld,
    nss,
    sphere_map,
)
from visavis.lab.geometry import direction_from_yaw_pitch_deg

GRID = SphereGrid()


def map_of(right_deg: float, up_deg: float, seconds: float = 2.0) -> np.ndarray:
    """Return the map of gaze that stayed at one place."""
    return sphere_map(GRID, *(np.array([v]) for v in (right_deg, up_deg, seconds)))


def degrees_from(right_deg: float, up_deg: float) -> np.ndarray:
    """Return how far each cell is from a place, by the great circle."""
    right, up = np.meshgrid(*GRID.centres())
    cells, place = (
        direction_from_yaw_pitch_deg(-np.asarray(r), np.asarray(u))
        for r, u in ((right, up), (right_deg, up_deg))
    )
    return np.degrees(np.arccos(np.clip(cells @ place, -1, 1)))


def test_the_cells_are_the_sphere() -> None:
    assert 4 * np.pi * np.degrees(1) ** 2 == pytest.approx(GRID.area_deg2().sum())


@pytest.mark.parametrize("up_deg", [0.5, -45.5, 80.5, 88.5, -89.5, 90.0])
def test_a_peak_is_as_wide_and_as_high_and_holds_as_much_time_near_a_pole(up_deg: float) -> None:
    density = map_of(30.5, up_deg)
    far_deg = degrees_from(30.5, min(up_deg, 89.5))
    sd = SPHERE_SMOOTHING_DEG
    expected = 2.0 / (2 * np.pi * sd**2) * np.exp(-0.5 * (far_deg / sd) ** 2)
    near = far_deg < 3 * sd
    assert 2.0 == pytest.approx((density * GRID.area_deg2()).sum())
    np.testing.assert_allclose(density[near], expected[near], atol=0.02 * expected.max())
    assert 0 == density[far_deg > 4 * sd + 1].max()


def test_gaze_at_the_seam_is_continuous_and_as_anywhere_else() -> None:
    at_seam, ahead = map_of(-179.5, 10.0), map_of(0.5, 10.0)
    np.testing.assert_allclose(np.roll(ahead, 180, axis=1), at_seam, atol=1e-12)
    edge = at_seam[GRID.rows // 2 - 10, [0, -1]]
    assert edge[1] == pytest.approx(edge[0] * np.exp(-0.5 / SPHERE_SMOOTHING_DEG**2), rel=0.05)
    np.testing.assert_array_equal(map_of(180.0, 10.0), map_of(-180.0, 10.0))


def test_reversed_gaze_moves_the_map() -> None:
    right_deg, up_deg = np.array([20.5, 25.5, 100.5]), np.array([10.5, -60.5, 40.5])
    seconds = np.array([1.0, 2.0, 3.0])
    as_it_was = sphere_map(GRID, right_deg, up_deg, seconds)
    mirror_map = sphere_map(GRID, -right_deg, -up_deg, seconds)
    np.testing.assert_allclose(as_it_was[::-1, ::-1], mirror_map, atol=1e-12)
    assert not np.allclose(as_it_was, mirror_map, atol=0.01)


def test_a_difference_across_the_seam_is_one_cluster_and_ends_where_it_ends() -> None:
    random = np.random.default_rng(1)
    differences = np.array(
        [
            sphere_map(GRID, random.normal(180, 6, 80), random.normal(0, 6, 80), np.full(80, 0.1))
            - sphere_map(GRID, random.normal(0, 6, 80), random.normal(0, 6, 80), np.full(80, 0.1))
            for _ in range(MIN_PEOPLE)
        ]
    )
    clusters = clusters_of_difference(differences, cell_deg2=GRID.area_deg2())
    more, less = sorted((c for c in clusters if c.p < 0.05), key=lambda c: not c.is_more)
    assert more.cells[:, 0].any()
    assert more.cells[:, -1].any()
    assert more.is_more > less.is_more
    assert degrees_from(180.0, 0.0)[more.cells].max() < 30
    assert degrees_from(0.0, 0.0)[less.cells].max() < 30


def test_cells_count_by_their_solid_angle_and_touch_at_a_pole() -> None:
    t = np.zeros(GRID.shape)
    t[0, [3, 90, 200]] = 5.0  # three cells at the pole, none beside another
    t[89, 100] = 5.0
    _, at_equator = sorted(_clusters(t, 2.0, GRID.area_deg2()), key=lambda one: one[1])
    at_pole, _ = sorted(_clusters(t, 2.0, GRID.area_deg2()), key=lambda one: one[1])
    assert [3, 1] == [int(cells.sum()) for cells, _, _ in (at_pole, at_equator)]
    assert 5 * GRID.area_deg2()[89, 0] == pytest.approx(at_equator[1])
    assert 15 * GRID.area_deg2()[0, 0] == pytest.approx(at_pole[1])
    assert 4 == len(_clusters(t, 2.0, None))  # in a plane they do not touch


def pair_at(up_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """Return two maps of gaze that stayed at two places, three degrees above each other."""
    return map_of(20.5, up_deg - 1.5) + 1e-5, map_of(20.5, up_deg + 1.5) + 1e-5


@pytest.mark.parametrize("up_deg", [30.0, -60.0, 80.0])
def test_two_maps_are_as_alike_wherever_on_the_sphere_they_are(up_deg: float) -> None:
    at_horizon, elsewhere = pair_at(0.0), pair_at(up_deg)
    assert 0.5 < cc(GRID, *at_horizon) < 0.7  # exp(-(3 / 2)**2 / 4), and the mean of all is near 0
    assert cc(GRID, *at_horizon) == pytest.approx(cc(GRID, *elsewhere), abs=0.01)
    assert kld(GRID, *at_horizon) == pytest.approx(kld(GRID, *elsewhere), rel=0.03)


def test_a_map_is_like_itself_and_a_wide_one_loses_what_is_known_of_gaussians() -> None:
    density, other = pair_at(10.0)
    assert 1 == pytest.approx(cc(GRID, density, density))
    assert 0 == pytest.approx(kld(GRID, density, density), abs=1e-9)
    assert cc(GRID, density, other) == pytest.approx(cc(GRID, 3 * density, other))
    narrow = map_of(0.5, 0.5)
    even = np.ones(GRID.shape)
    sd_deg, sphere_deg2 = SPHERE_SMOOTHING_DEG, GRID.area_deg2().sum()
    entropy = np.log(2 * np.pi * np.e * sd_deg**2)  # of a Gaussian in two dimensions
    assert np.log(sphere_deg2) - entropy == pytest.approx(kld(GRID, narrow, even), rel=0.01)


def test_fixations_are_so_many_deviations_over_the_mean_of_a_map() -> None:
    density = map_of(40.5, 50.5)
    random = np.random.default_rng(2)
    right_deg = random.uniform(-180, 180, 200_000)
    up_deg = np.degrees(np.arcsin(random.uniform(-1, 1, 200_000)))  # evenly over the sphere
    assert 0 == pytest.approx(nss(GRID, density, right_deg, up_deg), abs=0.03)
    sd = np.sqrt(GRID.area_deg2().sum() / (4 * np.pi * SPHERE_SMOOTHING_DEG**2))  # at its peak
    peak = nss(GRID, density, np.array([40.5]), np.array([50.5]))
    assert 2 * sd == pytest.approx(peak, rel=0.02)
    with pytest.raises(ValueError, match="the same everywhere"):
        cc(GRID, density, np.ones(GRID.shape))


def test_a_map_is_higher_at_fixations_than_elsewhere_as_often_as_ranks_say() -> None:
    density = map_of(40.5, 50.5)
    random = np.random.default_rng(3)
    right_deg, up_deg = random.normal(40.5, 4, 300), random.normal(50.5, 4, 300)
    elsewhere_deg = (
        random.uniform(-180, 180, 100_000),
        np.degrees(np.arcsin(random.uniform(-1, 1, 100_000))),
    )
    at, other = (density[GRID.cells_of(*one)] for one in ((right_deg, up_deg), elsewhere_deg))
    expected = mannwhitneyu(at, other).statistic / (len(at) * len(other))
    assert expected == pytest.approx(auc(GRID, density, right_deg, up_deg), abs=0.001)
    assert expected == pytest.approx(auc(GRID, density**0.5, right_deg, up_deg), abs=0.001)
    assert 1 - expected == pytest.approx(auc(GRID, -density, right_deg, up_deg), abs=0.001)
    assert 0.5 == pytest.approx(auc(GRID, np.ones(GRID.shape), right_deg, up_deg))


def test_maps_that_cannot_be_compared_are_refused_with_why() -> None:
    density, nothing = map_of(40.5, 50.5), np.zeros(GRID.shape)
    for pair in ((density, nothing), (nothing, density)):
        with pytest.raises(ValueError, match="a map has no time in it"):
            kld(GRID, *pair)
    with pytest.raises(ValueError, match=r"a map has 90 × 180 cells, not 180 × 360"):
        kld(GRID, density, np.ones((90, 180)))
    with pytest.raises(ValueError, match=r"a map has 90 × 180 cells, not 180 × 360"):
        cc(GRID, density, np.ones((90, 180)))
    with pytest.raises(ValueError, match=r"a map has 90 × 180 cells, not 180 × 360"):
        auc(GRID, np.ones((90, 180)), np.zeros(1), np.zeros(1))
    for measure in (nss, auc):
        with pytest.raises(ValueError, match="there are no fixations"):
            measure(GRID, density, np.zeros(0), np.zeros(0))
