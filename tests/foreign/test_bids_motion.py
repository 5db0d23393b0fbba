"""BIDS motion as others write it: the layouts of the official examples, with made-up samples.

The examples of bids-standard/bids-examples hold sidecars and channels and no samples. What
`motion_dualtask` (angles by a left-hand rule, latency), `motion_spotrotation` (quaternions, metres
of a virtual room) and `motion_systemvalidation` (markers without latency, accelerations) say of
their channels is said here, too.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from visavis.analysis.foreign_check import check_foreign
from visavis.analysis.foreign_motion import (
    import_motion,
    quality_of_motion,
    read_bids_motion,
)
from visavis.cli.main import app
from visavis.lab.errors import DataError, UsageError

Array = npt.NDArray[np.float64]
N, RATE_HZ = 240, 480.0
T_S = np.arange(N) / RATE_HZ
OURS_M = np.column_stack([0.3 * np.sin(T_S * 3), 1.6 + 0.05 * np.cos(T_S * 5), -0.8 * T_S])
"""Where the point is: x right, y up, z backward; it walks forward."""
YAW_DEG = 20 * np.sin(T_S * 2)
"""How it turns about the upright axis, to the left."""
COLUMNS = ("name", "component", "type", "tracked_point", "units", "reference_frame")


def data_set(
    folder: Path,
    channels: Sequence[Sequence[str]],
    values: Array,
    *,
    frame: Mapping[str, str] | None = None,
    cell: str = "{!r}",
) -> Path:
    (folder / "dataset_description.json").write_text('{"Name": "a", "BIDSVersion": "1.11.0"}')
    own = folder / "sub-01" / "motion"
    own.mkdir(parents=True)
    stem = "sub-01_task-walk_tracksys-omc"
    rows = ["\t".join(cell.format(v) if v == v else "n/a" for v in row) for row in values.tolist()]
    path = own / f"{stem}_motion.tsv"
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    sidecar = {"SamplingFrequency": RATE_HZ, "TaskName": "walk", "TrackingSystemName": "omc"}
    (own / f"{stem}_motion.json").write_text(json.dumps(sidecar), encoding="utf-8")
    table = pd.DataFrame(channels, columns=list(COLUMNS))
    table.to_csv(own / f"{stem}_channels.tsv", sep="\t", index=False)
    if frame is not None:  # for all tracking systems, from above
        levels = {"reference_frame": {"Levels": {"global": dict(frame)}}}
        (folder / "task-walk_channels.json").write_text(json.dumps(levels), encoding="utf-8")
    return path


def places(point: str, unit: str = "m") -> list[tuple[str, ...]]:
    return [(f"{point}_{c}", c, "POS", point, unit, "global") for c in "xyz"]


LATENCY = ("latency", "n/a", "LATENCY", "n/a", "seconds", "n/a")
LETTERS = {"R": 0, "L": 0, "S": 1, "I": 1, "A": 2, "P": 2}
SIGNS = {"R": 1, "L": -1, "S": 1, "I": -1, "A": -1, "P": 1}


def in_axes(ours: Array, axes: str) -> Array:
    """Return points of our frame as a set with these axes writes them."""
    return np.column_stack([SIGNS[a] * ours[:, LETTERS[a]] for a in axes])


@settings(max_examples=40, deadline=None)
@given(
    axes=st.permutations(["RL", "SI", "AP"]).flatmap(
        lambda pairs: st.tuples(*(st.sampled_from(pair) for pair in pairs)).map("".join)
    ),
    unit=st.sampled_from(["m", "cm", "mm"]),
)
def test_places_in_any_axes_and_unit_are_ours(
    axes: str, unit: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    scale = {"m": 1, "cm": 100, "mm": 1000}[unit]
    values = np.column_stack([scale * in_axes(OURS_M, axes), T_S])
    path = data_set(
        tmp_path_factory.mktemp("b"),
        [*places("head", unit), LATENCY],
        values,
        frame={"SpatialAxes": axes},
    )
    motion = read_bids_motion(path)
    assert motion.points[0].position_m is not None
    np.testing.assert_allclose(motion.points[0].position_m, OURS_M, atol=1e-9)
    assert np.rint(T_S * 1e9).astype(int).tolist() == motion.t_ns.tolist()
    (row,) = quality_of_motion(motion).to_dict("records")
    assert (pytest.approx(RATE_HZ), 0.0) == (row["rate_hz"], row["unseen_01"])
    assert 0.8 < row["speed_median_m_s"] < 1.3


def test_angles_by_a_left_hand_rule_are_the_same_turn(tmp_path: Path) -> None:
    """As motion_dualtask: axes forward, right, up; turned about z, then x, then y."""
    turns = [(f"head_eul_{c}", c, "ORNT", "head", "rad", "global") for c in "xyz"]
    # Upright is z; in left-handed axes a turn to the left is negative.
    angles = np.column_stack([np.zeros(N), np.zeros(N), -np.radians(YAW_DEG)])
    conf = ("head_Conf", "n/a", "MISC", "head", "n/a", "global")
    frame = {"SpatialAxes": "ARS", "RotationOrder": "ZXY", "RotationRule": "left-hand"}
    values = np.column_stack([angles, in_axes(OURS_M, "ARS"), np.ones(N), T_S])
    path = data_set(tmp_path, [*turns, *places("head"), conf, LATENCY], values, frame=frame)
    motion = read_bids_motion(path)
    ours = motion.points[0].orientation_wxyz
    assert ours is not None
    expected = Rotation.from_euler("y", YAW_DEG[:, None], degrees=True).as_quat()[:, [3, 0, 1, 2]]
    np.testing.assert_allclose(ours, expected, atol=1e-12)
    assert any("1 channels are neither" in remark for remark in motion.remarks)


@settings(max_examples=30, deadline=None)
@given(
    axes=st.sampled_from(["ARS", "ALS", "RSA", "RSP", "LAS"]),
    rule=st.sampled_from(["left-hand", "right-hand"]),
    order=st.sampled_from(["XYZ", "ZXY", "YZX", "ZYX"]),
    degrees=st.tuples(*[st.floats(-80, 80)] * 3),
)
# Three digits behind the point could be thousands elsewhere; BIDS has decimal points.
@example(axes="RAS", rule="right-hand", order="XYZ", degrees=(1.625, 1.625, 1.625))
def test_angles_of_any_rule_and_order_are_scipys(
    axes: str,
    rule: str,
    order: str,
    degrees: tuple[float, float, float],
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    turns = [(f"h_{c}", c, "ORNT", "h", "deg", "global") for c in "xyz"]
    frame = {"SpatialAxes": axes, "RotationOrder": order, "RotationRule": rule}
    values = np.tile(degrees, (6, 1))
    motion = read_bids_motion(data_set(tmp_path_factory.mktemp("b"), turns, values, frame=frame))
    # scipy turns by matrices that know nothing of hands: R(angle) about an axis is R(-angle) by
    # the other rule, and a frame is taken over by conjugation.
    to_ours = np.linalg.inv(in_axes(np.eye(3), axes))
    by_hand = 1 if rule == "right-hand" else -1
    inner = {c: by_hand * d for c, d in zip("XYZ", degrees, strict=True)}
    turned = Rotation.from_euler(order.lower(), [inner[c] for c in order], degrees=True).as_matrix()
    if np.linalg.det(to_ours) < 0:
        # A right-hand turn is one against the axes of a left-handed frame.
        turned = Rotation.from_euler(
            order.lower(), [-inner[c] for c in order], degrees=True
        ).as_matrix()
    expected = to_ours.T @ turned @ to_ours
    wxyz = motion.points[0].orientation_wxyz
    assert wxyz is not None
    got = Rotation.from_quat(wxyz[0, [1, 2, 3, 0]]).as_matrix()
    np.testing.assert_allclose(got, expected, atol=1e-9)


def test_quaternions_in_metres_of_a_virtual_room(tmp_path: Path) -> None:
    """As motion_spotrotation."""
    names = [(f"h_{c}", f"quat_{c}", "ORNT", "h", "n/a", "global") for c in "wxyz"]
    turned = Rotation.from_euler("y", YAW_DEG[:, None], degrees=True).as_quat()[:, [3, 0, 1, 2]]
    values = np.column_stack([turned, OURS_M, T_S])
    frame = {"SpatialAxes": "RSP"}
    path = data_set(tmp_path, [*names, *places("h", "vm"), LATENCY], values, frame=frame)
    motion = read_bids_motion(path)
    np.testing.assert_allclose(motion.points[0].orientation_wxyz, turned, atol=1e-12)
    assert any("virtual room" in remark for remark in motion.remarks)


def test_markers_without_latency_are_read_by_their_rate_and_that_is_told(tmp_path: Path) -> None:
    """As motion_systemvalidation: many points, no frame, no latency; accelerations are none."""
    points = [f"p{k}" for k in range(5)]
    values = np.column_stack([OURS_M + k for k in range(5)])
    values[40:50, 3:6] = np.nan
    values[60:70, 6:9] = 0.0
    path = data_set(tmp_path, [row for p in points for row in places(p)], values)
    assert "nobody can tell" in str(check_foreign(tmp_path)[0].findings)
    remarks = import_motion([path], tmp_path / "out")["sub-01_task-walk_tracksys-omc"]
    text = " ".join(remarks)
    for words in ("no latency", "which way its axes", "p1 was not seen in 4.2%", "p2 was not seen"):
        assert words in text
    table = pd.read_csv(tmp_path / "out" / "sub-01_task-walk_tracksys-omc_motion.csv")
    assert (5 * N, set(points)) == (len(table), set(table["point"]))
    imu = [(f"a_{c}", c, "ACCEL", "a", "m/s^2", "global") for c in "xyz"]
    (tmp_path / "imu").mkdir()
    with pytest.raises(DataError, match="no position and no orientation"):
        read_bids_motion(data_set(tmp_path / "imu", imu, np.ones((N, 3))))


def test_millimetres_called_metres_and_unknown_words_are_refused(tmp_path: Path) -> None:
    def refused(name: str, words: str, **changes: object) -> None:
        (tmp_path / name).mkdir()
        content = {"channels": [*places("h"), LATENCY], "values": np.column_stack([OURS_M, T_S])}
        path = data_set(tmp_path / name, **(content | changes))  # type: ignore[arg-type]
        with pytest.raises(DataError, match=words):
            read_bids_motion(path)

    refused("mm", "is the unit mm", values=np.column_stack([1000 * OURS_M, T_S]))
    refused("unit", "is in ft", channels=[*places("h", "ft"), LATENCY])
    refused("axes", "SpatialAxes 'XYZ' are none", frame={"SpatialAxes": "XYZ"})
    refused("cells", "cells", channels=[*places("h"), LATENCY, LATENCY])


def test_a_point_faster_than_any_person_is_told(tmp_path: Path) -> None:
    values = np.column_stack([30 * OURS_M, T_S])
    path = data_set(tmp_path, [*places("h"), LATENCY], values, frame={"SpatialAxes": "RSP"})
    (remarks,) = import_motion([path], tmp_path / "out").values()
    assert any("faster than 13 m/s" in remark for remark in remarks)


def test_the_command_reads_all_before_it_writes_any(tmp_path: Path) -> None:
    values = np.column_stack([OURS_M, T_S])
    path = data_set(tmp_path, [*places("h"), LATENCY], values, frame={"SpatialAxes": "RSP"})
    empty = path.with_name("sub-01_task-walk_tracksys-imu_motion.tsv")
    empty.write_text("\n")
    channels = path.with_name(path.name.replace("motion", "channels"))
    empty.with_name(empty.name.replace("motion", "channels")).write_bytes(channels.read_bytes())
    out = tmp_path / "out"
    result = CliRunner().invoke(app, ["import", "motion", str(path), str(empty), "-o", str(out)])
    assert "1 of 2 files" in str(result.exception)
    assert not out.exists()
    result = CliRunner().invoke(app, ["import", "motion", str(path), "-o", str(out)])
    assert result.exception is None, result.output
    assert 2 == len(list(out.iterdir()))
    with pytest.raises(UsageError, match="already there"):
        import_motion([path], out)
    with pytest.raises(UsageError, match="no BIDS motion"):
        read_bids_motion(channels)


ODD = ("x", 5, [1], None, True)


@pytest.mark.parametrize("odd", ODD)
@pytest.mark.parametrize("place", ["reference_frame", "Levels", "global"])
def test_frames_that_are_no_objects_are_refused(tmp_path: Path, place: str, odd: object) -> None:
    path = data_set(tmp_path, [*places("head"), LATENCY], np.column_stack([OURS_M, T_S]))
    whole = {"global": odd} if place == "global" else odd
    frame = whole if place == "reference_frame" else {"Levels": whole}
    (tmp_path / "task-walk_channels.json").write_text(json.dumps({"reference_frame": frame}))
    with pytest.raises(DataError, match=f"{place} .* no object; mend the sidecar"):
        read_bids_motion(path)


@pytest.mark.parametrize("rate_hz", ["5e-324", "1" + "0" * 400, "1e300", "true", "[10]", "-1"])
def test_a_rate_that_no_tracker_has_gives_no_stamps(tmp_path: Path, rate_hz: str) -> None:
    path = data_set(tmp_path, places("head"), OURS_M)
    sidecar = path.with_suffix(".json")
    sidecar.write_text(f'{{"SamplingFrequency": {rate_hz}}}')
    with pytest.raises(DataError, match="neither a latency channel nor a SamplingFrequency"):
        read_bids_motion(path)


def test_tens_of_thousands_of_points_are_gone_through_once(tmp_path: Path) -> None:
    """Each of them went through all channels: minutes, of a file of 1 MB."""
    n = 30_000
    channels = [(f"c{k}", "n/a", "MISC", f"p{k}", "n/a", "n/a") for k in range(n)]
    path = data_set(tmp_path, channels, np.ones((1, n)), cell="{:.0f}")
    with pytest.raises(DataError, match="no position and no orientation"):
        read_bids_motion(path)


@pytest.mark.filterwarnings("error")
def test_numbers_that_overflow_are_refused_or_unseen_without_a_warning(tmp_path: Path) -> None:
    far = OURS_M.copy()
    far[0], far[1] = 1e308, -1e308
    path = data_set(tmp_path, [*places("head"), LATENCY], np.column_stack([far, T_S]))
    with pytest.raises(DataError, match="moves over inf m"):
        read_bids_motion(path)
