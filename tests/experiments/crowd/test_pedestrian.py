"""Density and speed by PedPy, and files that PedPy reads back."""

import sqlite3
from dataclasses import replace

import numpy as np
import pytest

from tests.experiments.crowd.synthetic_body import carried
from visavis.experiments.crowd import pedestrian
from visavis.experiments.crowd.pedestrian import (
    load_pedpy,
    pedestrian_measures,
    trajectory_table,
    write_pedpy_files,
)
from visavis.lab.errors import UsageError

needs_pedpy = pytest.mark.skipif(
    not pedestrian.has_pedpy(), reason="install PedPy: pip install 'visavis[pedestrian]'"
)


@needs_pedpy
def test_density_and_speed_of_a_straight_walk_are_those_walked():
    walk = carried(6.0, begin=(-2.5, 2.6), end=(-0.1, 0.2))
    found = pedestrian_measures(walk)
    assert 7 == len(found.t_s)
    assert (found.density_per_m2 > 0.8).all()
    assert (found.density_per_m2 < 6).all()
    metres = float(np.hypot(2.4, 2.4))
    assert metres / 6 == pytest.approx(np.nanmean(found.speed_m_s), rel=1e-6)


@needs_pedpy
def test_lost_moments_have_no_density():
    walk = carried(6.0)
    walk.position_m[150:250] = np.nan
    density = pedestrian_measures(walk).density_per_m2
    assert [False, False, True, False] == np.isnan(density[:4]).tolist()


@needs_pedpy
def test_people_at_one_place_count_as_one_and_standing_on_somebody_has_no_density():
    walk = carried(4.0)
    alone = pedestrian_measures(walk).density_per_m2
    people = walk.crowd.position_m.copy()
    near = np.argsort(np.linalg.norm(people - walk.place_m[200], axis=1))
    people[near[-1]] = people[near[0]]
    doubled = replace(walk, crowd=replace(walk.crowd, position_m=people))
    assert alone[2] == pytest.approx(pedestrian_measures(doubled).density_per_m2[2], rel=1e-5)
    people[near[0]] = people[near[-1]] = walk.place_m[200]
    standing = replace(walk, crowd=replace(walk.crowd, position_m=people))
    assert np.isnan(pedestrian_measures(standing).density_per_m2[2])
    assert np.isfinite(pedestrian_measures(standing).density_per_m2[0])


def test_without_pedpy_the_message_says_what_to_install(monkeypatch):
    def gone(name):
        raise ImportError(name)

    monkeypatch.setattr(pedestrian.importlib, "import_module", gone)
    with pytest.raises(UsageError, match=r"visavis\[pedestrian\]"):
        load_pedpy()


def test_text_and_sqlite_hold_everybody_in_metres(tmp_path):
    walk = carried(1.0)
    written = {p.suffix: p for p in write_pedpy_files(walk, tmp_path, "walk")}
    lines = written[".txt"].read_text(encoding="utf-8").splitlines()
    assert "# framerate: 25 fps" == lines[0]
    rows = np.array([line.split() for line in lines[2:]], float)
    assert 26 * (1 + len(walk.crowd)) == len(rows)
    own = rows[rows[:, 0] == 0]
    assert (-2.5, -2.6) == pytest.approx(tuple(own[0, 2:4]), abs=0.05)
    with sqlite3.connect(written[".sqlite"]) as connection:
        assert len(rows) == connection.execute("SELECT count(*) FROM trajectory_data").fetchone()[0]
        meta = dict(connection.execute("SELECT key, value FROM metadata"))
    connection.close()
    assert ("2", "25") == (meta["version"], meta["fps"])


def test_people_face_where_they_stand_facing():
    walk = carried(0.2)
    table = trajectory_table(walk)
    facing = table[table["id"] == 1][["ori_x", "ori_y"]].iloc[0].to_numpy()
    yaw = walk.crowd.yaw_rad[0]
    assert (-np.sin(yaw), np.cos(yaw)) == pytest.approx(tuple(facing))
    own = table[table["id"] == 0][["ori_x", "ori_y"]].to_numpy()
    assert np.linalg.norm(own, axis=1) == pytest.approx(1)


@needs_pedpy
def test_pedpy_reads_every_file_back(tmp_path):
    pedpy = load_pedpy()
    walk = carried(1.0)
    for path in write_pedpy_files(walk, tmp_path, "walk"):
        if path.suffix == ".txt":
            read = pedpy.load_trajectory(trajectory_file=path)
        elif path.suffix == ".sqlite":
            read = pedpy.load_trajectory_from_jupedsim_sqlite(trajectory_file=path)
            area = pedpy.load_walkable_area_from_jupedsim_sqlite(trajectory_file=path)
            assert area.area == pytest.approx(100.0)
        else:
            read = pedpy.load_trajectory_from_ped_data_archive_hdf5(trajectory_file=path)
        assert 25 == read.frame_rate
        assert 1 + len(walk.crowd) == read.data["id"].nunique()
        first = read.data[(read.data["id"] == 0) & (read.data["frame"] == 0)]
        assert (-2.5, -2.6) == pytest.approx(
            (float(first["x"].iloc[0]), float(first["y"].iloc[0])), abs=0.05
        )
