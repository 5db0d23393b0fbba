"""The floor of a pair's time reads every triangle and finds the crossings of every column."""

import numpy as np
import pytest

from benchmarks.collision_volume import (
    SPACINGS_M,
    columns_of,
    cross_columns,
    read_faces,
    trade_off,
)
from visavis.analysis.collisions import capsule, common_volume


def posts(apart_m: float):
    """Return two upright capsules, the second higher and aside."""
    return (
        capsule(np.zeros(3), np.array([0.0, 0.6, 0.0]), 0.1),
        capsule(np.array([apart_m, 0.05, 0.01]), np.array([apart_m, 0.65, 0.01]), 0.1),
    )


def test_the_floor_reads_every_corner_and_every_triangle():
    for mesh in posts(0.1):
        box, n_faces, lowest_m = read_faces(mesh.vertices_m, mesh.faces)
        assert len(mesh.faces) == n_faces
        assert lowest_m == pytest.approx(mesh.vertices_m[mesh.faces, 1].min(axis=1).sum())
        np.testing.assert_array_equal(
            box, [mesh.vertices_m.min(axis=0), mesh.vertices_m.max(axis=0)]
        )


def test_the_floor_crosses_each_column_and_four_times_as_many_at_half_the_spacing():
    pair = posts(0.1)
    n_stretches = common_volume(*pair).n_cells
    n_crossings = cross_columns(columns_of(pair))
    assert n_stretches <= n_crossings <= 4 * n_stretches
    assert pytest.approx(4 * n_crossings, rel=0.1) == cross_columns(columns_of(pair, 0.005))


def test_closer_columns_leave_a_smaller_error():
    pairs = [posts(0.1), posts(0.12)]
    true = np.array([common_volume(*pair).volume_m3 for pair in pairs])
    curve = trade_off(pairs, true)
    assert list(SPACINGS_M) == [cell_m for cell_m, _, _ in curve]
    # Here the truth is what columns 1 cm apart give.
    assert 0.0 == curve[SPACINGS_M.index(0.010)][2] < curve[0][2]
