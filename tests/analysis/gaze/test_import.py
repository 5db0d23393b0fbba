import json
from collections.abc import Collection

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from tests.analysis.gaze.streams import looks, shaken, stamps
from visavis.analysis.gaze.bids import read_bids, write_bids
from visavis.analysis.gaze.foreign import (
    GazeRecording,
    axes_matrix,
    eye_samples,
    quaternions_of_euler,
)
from visavis.analysis.gaze.import_report import (
    movements_of,
    prepare,
    quality_table,
    read_gaze,
    report,
)
from visavis.analysis.gaze.mapped_csv import mapping_of, read_mapping
from visavis.analysis.gaze.movements.kinds import Movement
from visavis.lab.errors import ConfigError, DataError, UsageError
from visavis.lab.geometry import (
    angle_deg,
    direction_from_yaw_pitch_deg,
    quat_conjugate,
    quat_from_yaw_pitch_deg,
    rotate,
    yaw_pitch_deg_of,
)

VIVE_COLUMNS = (
    "time(100ns);time_stamp(ms);time(UnityVideoPlayer);frame;eye_valid_L;eye_valid_R;openness_L;"
    "openness_R;pupil_diameter_L(mm);pupil_diameter_R(mm);pos_sensor_L.x;pos_sensor_L.y;"
    "pos_sensor_R.x;pos_sensor_R.y;gaze_origin_L.x(mm);gaze_origin_L.y(mm);gaze_origin_L.z(mm);"
    "gaze_origin_R.x(mm);gaze_origin_R.y(mm);gaze_origin_R.z(mm);gaze_direct_L.x;gaze_direct_L.y;"
    "gaze_direct_L.z;gaze_direct_R.x;gaze_direct_R.y;gaze_direct_R.z;gaze_sensitive;frown_L;"
    "frown_R;squeeze_L;squeeze_R;wide_L;wide_R;distance_valid_C;distance_C(mm);track_imp_cnt;"
    "helmet_pos_x;helmet_pos_y;helmet_pos_z;helmet_rot_x;helmet_rot_y;helmet_rot_z"
).split(";")


def vive_text(n: int = 240, *, lost: Collection[int] = (), head_yaw_deg_s: float = 0.0) -> str:
    """A made-up file: gaze held still in world while the head turns right."""
    t_s = np.arange(n) / 120
    head = np.array([quat_from_yaw_pitch_deg(-head_yaw_deg_s * t) for t in t_s])
    ahead = shaken(np.tile([0.0, 0.0, -1.0], (n, 1)), 1e-6, np.random.default_rng(0))
    gaze = rotate(quat_conjugate(head), ahead)
    lines = [";".join(VIVE_COLUMNS)]
    for i in range(n):
        cells = dict.fromkeys(VIVE_COLUMNS, "0")
        cells["time(100ns)"] = str(638342802882596202 + round(i * 1e7 / 120))
        cells["time_stamp(ms)"] = str((2**31 - 400 + i * 25 // 3 + 2**31) % 2**32 - 2**31)
        for side in "LR":
            gone = i in lost
            cells[f"eye_valid_{side}"] = "8" if gone else "31"
            cells[f"openness_{side}"] = "0" if gone else "1"
            cells[f"pupil_diameter_{side}(mm)"] = "-1" if gone else "3.5"
            vector = (0, 0, 0) if gone else (-gaze[i, 0], gaze[i, 1], -gaze[i, 2])
            for axis, value in zip("xyz", vector, strict=True):
                cells[f"gaze_direct_{side}.{axis}"] = repr(float(value))
        cells["helmet_pos_z"] = "2.5"
        cells["helmet_rot_y"] = repr(float(head_yaw_deg_s * t_s[i] % 360))
        lines.append(";".join(cells.values()))
    return "\n".join(lines) + "\n"


def vive_file(tmp_path, **options):
    path = tmp_path / "made up é.csv"
    path.write_text(vive_text(**options), encoding="utf-8")
    return path


def test_vive_lost_rows_become_missing(tmp_path):
    r = read_gaze(vive_file(tmp_path, lost=range(50, 60)), "vive")
    assert list(range(50, 60)) == np.flatnonzero(np.isnan(r.left.direction[:, 0])).tolist()
    assert np.isnan(r.left.pupil_mm[50:60]).all()
    assert not r.right.valid[50:60].any()
    assert 230 == prepare(r).usable["combined"].sum()


def test_vive_times_are_exact_and_the_device_counter_unwraps(tmp_path):
    r = read_gaze(vive_file(tmp_path), "vive")
    assert [0, 8333300, 16666700] == r.t_ns[:3].tolist()
    assert (np.diff(r.t_device_ns) >= 8_000_000).all()
    assert 1_991_000_000 == r.t_device_ns[-1]


def test_vive_gaze_held_in_world_while_the_head_turns_is_one_fixation(tmp_path):
    r = read_gaze(vive_file(tmp_path, head_yaw_deg_s=30.0), "vive")
    g = prepare(r)
    assert angle_deg(g.direction["world"], np.array([0.0, 0.0, -1.0])).max() < 1e-4
    yaw, _ = yaw_pitch_deg_of(g.direction["head"][120])
    assert pytest.approx(30.0, abs=1e-4) == yaw
    yaw, _ = yaw_pitch_deg_of(rotate(r.head_orientation_wxyz[120], np.array([0.0, 0.0, -1.0])))
    assert pytest.approx(-30.0, abs=1e-4) == yaw
    assert [0.0, 0.0, -2.5] == r.head_position_m[0].tolist()


def test_unity_pitch_and_roll_keep_their_sense(tmp_path):
    path = vive_file(tmp_path, n=3)
    text = pd.read_csv(path, sep=";", dtype=str)
    text["helmet_rot_x"] = ["20", "0", "30"]  # Unity: nose down
    text["helmet_rot_z"] = ["0", "10", "0"]  # Unity: left ear down
    text["helmet_rot_y"] = ["0", "0", "90"]  # to the right
    text.to_csv(path, sep=";", index=False)
    q = read_gaze(path, "vive").head_orientation_wxyz
    yaw, pitch = yaw_pitch_deg_of(rotate(q, np.tile([0.0, 0.0, -1.0], (3, 1))))
    assert np.allclose([0.0, 0.0, -90.0], yaw)
    assert np.allclose([-20.0, 0.0, -30.0], pitch)
    left_ear = rotate(q[1], np.array([-1.0, 0.0, 0.0]))
    assert pytest.approx(-np.sin(np.radians(10))) == left_ear[1]


def cut(text, line):
    lines = text.splitlines()
    lines[line - 1] = lines[line - 1].rsplit(";", 3)[0]
    return "\n".join(lines)


def test_a_vive_file_whose_last_line_is_cut_is_read_without_it(tmp_path):
    path = vive_file(tmp_path, n=5)
    path.write_text(cut(path.read_text(), line=6))
    recording = read_gaze(path, "vive")
    assert 4 == len(recording)
    assert recording.remarks[0].startswith("line 6, the last, is cut off: 39 cells of 42")


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda text: text.replace("3.5", "three", 1), "line 2, column 'pupil_diameter_L"),
        (lambda text: "63x".join(text.rsplit("638", 3)[:2]), "line 4.*not a time stamp"),
        (lambda text: text.splitlines()[0] + "\n\n", "a header but no samples"),
        (lambda text: text.replace("openness_L", "open_L"), "no column 'openness_L'"),
        (lambda text: cut(text, line=3), "line 3 has 39 cells, the header has 42"),
        (lambda text: "", "empty"),
    ],
)
def test_faulty_vive_file_is_refused_by_line(tmp_path, change, complaint):
    path = vive_file(tmp_path, n=5)
    path.write_text(change(path.read_text()))
    with pytest.raises(DataError, match=complaint) as raised:
        read_gaze(path, "vive")
    assert str(path) in str(raised.value)


def test_missing_file_unknown_format_and_missing_mapping_are_named(tmp_path):
    with pytest.raises(UsageError, match="no such file"):
        read_gaze(tmp_path / "none.csv", "vive")
    with pytest.raises(UsageError, match="choose one of vive"):
        read_gaze(tmp_path / "none.csv", "xls")
    with pytest.raises(UsageError, match="needs a mapping"):
        read_gaze(tmp_path / "none.csv", "csv")


PUPIL = """gaze_timestamp,world_index,confidence,norm_pos_x,norm_pos_y,base_data,gaze_point_3d_x,\
gaze_point_3d_y,gaze_point_3d_z,eye_center0_3d_x,eye_center0_3d_y,eye_center0_3d_z,gaze_normal0_x,\
gaze_normal0_y,gaze_normal0_z,eye_center1_3d_x,eye_center1_3d_y,eye_center1_3d_z,gaze_normal1_x,\
gaze_normal1_y,gaze_normal1_z
294417.123456789,0,0.9,0.5,0.5,a,100,-100,100,20,0,0,0,0,1,-40,0,0,0.1,0,0.995
294417.131790,0,0.1,0.5,0.5,b,0,0,500,,,,,,,-40,0,0,0,0,1
294417.127000,0,0.8,0.5,0.5,c,0,0,500,20,0,0,0,0,1,,,,,,
"""


def test_pupil_export_is_turned_into_our_axes(tmp_path):
    path = tmp_path / "gaze_positions.csv"
    path.write_text(PUPIL)
    r = read_gaze(path, "pupil")
    yaw, pitch = yaw_pitch_deg_of(r.combined.direction)
    assert np.allclose([-45.0, 0.0, 0.0], yaw)
    assert pytest.approx(np.degrees(np.arctan(1 / np.sqrt(2)))) == pitch[0]
    assert 294417123456789 == r.t_ns[0]
    assert np.isnan(r.right.direction[1]).all()
    assert np.isnan(r.left.direction[2]).all()
    table = quality_table(prepare(r)).set_index("eye")
    assert (1, 2) == (table.loc["combined", "backward_stamps"], table.loc["combined", "usable"])


def test_pupil_export_without_3d_gaze_is_refused(tmp_path):
    path = tmp_path / "gaze_positions.csv"
    path.write_text(PUPIL.replace("100,-100,100", ",,").replace("0,0,500", ",,"))
    with pytest.raises(DataError, match="3-D gaze mapper"):
        read_gaze(path, "pupil")


MAPPING = """
time: {column: Zeit, unit: ms}
space: head
delimiter: ";"
rate_hz: 90
axes: {right: +x, up: +y, forward: +z}
combined: {direction: [gx, gy, gz], valid: ok, pupil: {column: d, unit: m}, confidence: c}
head: {position: [px, py, pz], unit: cm, orientation_wxyz: [qw, qx, qy, qz],
       axes: {right: +x, up: +y, forward: +z}}
"""


def test_mapped_csv_with_decimal_commas(tmp_path):
    (tmp_path / "map.yaml").write_text(MAPPING)
    (tmp_path / "a.csv").write_text(
        "Zeit;gx;gy;gz;ok;d;c;px;py;pz;qw;qx;qy;qz\n"
        "0,5;0,6;0;0,8;1;0,003;0,9;100;150;200;1;0;0;0\n"
        "11,611111;n/a;;nan;false;0;;100;150;200;1;0;0;0\n"
    )
    r = read_gaze(tmp_path / "a.csv", "csv", read_mapping(tmp_path / "map.yaml"))
    assert [500_000, 11_611_111] == r.t_ns.tolist()
    assert [0.6, 0.0, -0.8] == r.combined.direction[0].tolist()
    assert np.isnan(r.combined.direction[1]).all()
    assert [True, False] == r.combined.valid.tolist()
    assert pytest.approx(3.0) == r.combined.pupil_mm[0]
    assert np.isnan(r.combined.pupil_mm[1])
    assert [1.0, 1.5, -2.0] == r.head_position_m[0].tolist()
    assert 90.0 == r.rate_hz


@pytest.mark.parametrize(
    "orientation",
    [
        {"orientation_wxyz": ["w", "x", "y", "z"]},
        {"orientation_xyzw": ["x", "y", "z", "w"]},
        {"euler": {"columns": ["a", "b", "c"], "order": "yxz", "unit": "deg"}},
        {"euler": {"columns": ["a_rad", "b_rad", "c_rad"], "order": "yxz", "unit": "rad"}},
    ],
)
def test_a_mapped_head_is_the_same_however_its_turn_is_written(tmp_path, orientation):
    angles_deg = np.array([20.0, 35.0, -50.0])
    w, x, y, z = quaternions_of_euler(angles_deg[None], "yxz")[0]
    a, b, c = angles_deg
    numbers = [0, 0.0, 0.0, -1.0, 1, 2, 3, w, x, y, z, a, b, c, *np.radians(angles_deg)]
    path = tmp_path / "a.csv"
    names = "t,gx,gy,gz,px,py,pz,w,x,y,z,a,b,c,a_rad,b_rad,c_rad"
    path.write_text(f"{names}\n" + ",".join(repr(float(n)) for n in numbers) + "\n")
    read = read_gaze(
        path,
        "csv",
        mapping_of(
            {
                "time": {"column": "t", "unit": "s"},
                "space": "head",
                "axes": {"right": "+x", "up": "+y", "forward": "-z"},
                "combined": {"direction": ["gx", "gy", "gz"]},
                "head": {"position": ["px", "py", "pz"], "unit": "m", **orientation},
            }
        ),
    )
    expected = rotate(np.array([w, x, y, z]), np.eye(3))
    assert pytest.approx(expected, abs=1e-9) == rotate(read.head_orientation_wxyz[0], np.eye(3))


@pytest.mark.parametrize(("unit", "factor"), [("deg", 1.0), ("rad", np.pi / 180)])
def test_mapped_angles_keep_their_sense(tmp_path, unit, factor):
    path = tmp_path / "a.csv"
    path.write_text(f"t,az,el\n0,{10 * factor},{5 * factor}\n")
    angles = {"azimuth": "az", "elevation": "el", "unit": unit, "elevation_positive": "down"}
    mapping = mapping_of(
        {"time": {"column": "t", "unit": "s"}, "space": "world", "left": {"angles": angles}}
    )
    yaw, pitch = yaw_pitch_deg_of(read_gaze(path, "csv", mapping).left.direction[0])
    assert (pytest.approx(-10.0), pytest.approx(-5.0)) == (yaw, pitch)


def test_wrong_mapping_lists_every_problem_at_once():
    with pytest.raises(ConfigError) as raised:
        mapping_of({"time": {"column": "t", "unit": "min"}, "space": "sky", "tims": 1})
    for part in ("time.unit", "space", "tims"):
        assert part in str(raised.value)


def test_axis_named_twice_is_refused():
    with pytest.raises(UsageError, match="one axis twice"):
        axes_matrix("+x", "-x", "+z")


values = hnp.arrays(
    np.float64, 7, elements=st.one_of(st.just(np.nan), st.floats(-1e6, 1e6, allow_subnormal=True))
)


@settings(max_examples=25, deadline=None)
@given(
    hnp.arrays(np.int64, 7, elements=st.integers(-(2**63), 2**63 - 1)),
    hnp.arrays(np.float64, (7, 3), elements=st.one_of(st.just(np.nan), st.floats(-1, 1))),
    values,
    hnp.arrays(np.bool_, 7),
    st.sampled_from(["head", "world"]),
)
def test_bids_keeps_every_ns_and_nan(tmp_path_factory, t_ns, direction, extra, valid, space):
    eye = eye_samples(direction, valid=valid, pupil_mm=extra, confidence_01=extra[::-1])
    wrote = GazeRecording(
        "sub-01_task-crowd_run-1",
        t_ns,
        space,
        left=eye,
        combined=eye_samples(-direction),
        t_device_ns=t_ns[::-1],
        head_position_m=direction,
        rate_hz=120.0,
        head_orientation_wxyz=np.column_stack([extra, direction]),
        notes={"a": "b"},
    )
    root = tmp_path_factory.mktemp("bids")
    paths = write_bids(wrote, root, subject="01", task="crowd")
    assert 2 == len(paths)
    read = read_bids(paths[0])
    assert np.array_equal(wrote.t_ns, read.t_ns)
    assert np.array_equal(wrote.t_device_ns, read.t_device_ns)
    assert np.array_equal(wrote.head_position_m, read.head_position_m, equal_nan=True)
    assert np.array_equal(wrote.head_orientation_wxyz, read.head_orientation_wxyz, equal_nan=True)
    assert read.right is None
    for name in ("left", "combined"):
        a, b = wrote.eyes[name], read.eyes[name]
        for column in ("direction", "valid", "pupil_mm", "openness_01", "confidence_01"):
            assert np.array_equal(getattr(a, column), getattr(b, column), equal_nan=True)
    assert (wrote.name, space, 120.0, {"a": "b"}) == (
        read.name,
        read.space,
        read.rate_hz,
        read.notes,
    )


def written(tmp_path, **changes):
    gaze = shaken(looks([(0, 0), (10, 0)], [60, 60]), 0.05, np.random.default_rng(0))
    recording = GazeRecording("x", stamps(len(gaze)), "head", left=eye_samples(gaze))
    (path,) = write_bids(recording, tmp_path, subject="01", task="crowd")
    sidecar = path.with_name(path.name.replace(".tsv.gz", ".json"))
    content = json.loads(sidecar.read_text()) | changes
    sidecar.write_text(json.dumps({k: v for k, v in content.items() if v is not None}))
    return path, gaze


def test_bids_sidecar_holds_what_the_standard_requires(tmp_path):
    path, _ = written(tmp_path)
    assert "sub-01_task-crowd_run-1_recording-eye1_physio.tsv.gz" == path.name
    content = json.loads(path.with_name(path.name.replace(".tsv.gz", ".json")).read_text())
    required = {"SamplingFrequency", "StartTime", "Columns", "PhysioType", "RecordedEye"}
    assert required | {"SampleCoordinateSystem"} <= content.keys()
    assert ["timestamp", "x_coordinate", "y_coordinate"] == content["Columns"][:3]
    assert ("deg", "deg") == (content["x_coordinate"]["Units"], content["y_coordinate"]["Units"])


def test_bids_of_others_is_read_from_its_angles(tmp_path):
    path, gaze = written(tmp_path)
    sidecar = path.with_name(path.name.replace(".tsv.gz", ".json"))
    content = json.loads(sidecar.read_text())
    content["Columns"] = [c.replace("gaze_", "other_") for c in content["Columns"]]
    sidecar.write_text(json.dumps(content))
    assert angle_deg(read_bids(path).left.direction, gaze).max() < 1e-9


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"RecordedEye": None}, "RecordedEye missing"),
        ({"RecordedEye": "third"}, "use left, right or cyclopean"),
        ({"PhysioType": "cardiac"}, "not eye tracking"),
        ({"timestamp": {"Units": "min"}}, "Units 'min' unknown"),
    ],
)
def test_faulty_bids_sidecar_is_refused(tmp_path, changes, complaint):
    path, _ = written(tmp_path, **changes)
    with pytest.raises(DataError, match=complaint):
        read_bids(path)


def test_bids_screen_coordinates_and_cut_files_are_refused(tmp_path):
    path, _ = written(tmp_path, SampleCoordinateSystem="gaze-on-screen")
    sidecar = path.with_name(path.name.replace(".tsv.gz", ".json"))
    sidecar.write_text(sidecar.read_text().replace("gaze_x", "other_x"))
    with pytest.raises(DataError, match="convert it to angles"):
        read_bids(path)
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(DataError, match="not a whole gzip"):
        read_bids(path)


def test_bids_never_overwrites_and_checks_labels(tmp_path):
    written(tmp_path)
    with pytest.raises(UsageError, match="already there"):
        written(tmp_path)
    recording = GazeRecording("x", stamps(1), "head", left=eye_samples(np.zeros((1, 3))))
    with pytest.raises(UsageError, match="letters and digits"):
        write_bids(recording, tmp_path, subject="0_1", task="crowd")


def test_report_writes_tables_and_a_picture(tmp_path):
    gaze = shaken(looks([(0, 0), (10, 0), (-10, 5)], [60, 90, 60]), 0.02, np.random.default_rng(0))
    gaze[80:100] = 0.0
    recording = GazeRecording("demo", stamps(len(gaze)), "world", combined=eye_samples(gaze))
    got = report(recording, tmp_path / "out")
    fixations = got.fixations[got.fixations.detector == "I-VT 30°/s"]
    assert 4 == len(fixations)
    assert np.allclose([0, -10, -10, 10], fixations.azimuth_right_deg, atol=0.1)
    assert ["combined"] == got.quality.eye.tolist()
    assert pytest.approx(20 / 220, abs=1e-4) == got.quality.lost_01[0]
    again = pd.read_csv(tmp_path / "out" / "demo_fixations.csv")
    assert len(got.fixations) == len(again)
    assert {"threshold_deg_s", "frozen_ms"} <= set(got.parameters.parameter)
    assert b"\x89PNG" == (tmp_path / "out" / "demo_gaze.png").read_bytes()[:4]
    assert 7 == len(got.files)
    adaptive = got.detectors[got.detectors.detector == "adaptive"].iloc[0]
    assert ("Engbert–Kliegl", True) == (adaptive.chosen, "120 Hz" in adaptive.why)
    assert ["blink", "fixation", "saccade"] == sorted(set(got.movements.movement))
    with pytest.raises(UsageError, match="already there"):
        report(recording, tmp_path / "out")


def test_movements_in_world_tell_the_speeds_of_head_and_eye_apart():
    n = 360
    t = stamps(n)
    head_deg = 20 * np.sin(2 * np.pi * 0.5 * t / 1e9)
    pose = np.array([quat_from_yaw_pitch_deg(deg) for deg in head_deg])
    still = shaken(np.tile([0.0, 0.0, -1.0], (n, 1)), 0.02, np.random.default_rng(0))
    eye = rotate(quat_conjugate(pose), still)
    recording = GazeRecording(
        "turning",
        t,
        "head",
        combined=eye_samples(eye),
        head_position_m=np.zeros((n, 3)),
        head_orientation_wxyz=pose,
    )
    found = movements_of(prepare(recording))
    assert [Movement.FIXATION] == found["world"].kind.tolist()
    assert pytest.approx(found["world"].head_deg_s[0], rel=0.15) == found["world"].eye_deg_s[0]
    assert found["head"].share_01(Movement.FIXATION) < 0.5


def test_report_of_a_recording_all_lost_is_defined(tmp_path):
    recording = GazeRecording("gone", stamps(50), "head", left=eye_samples(np.zeros((50, 3))))
    got = report(recording, tmp_path)
    assert 0 == got.detectors.fixations.sum()
    assert [1.0, 1.0] == got.quality.lost_01.tolist()


def test_repeats_and_contradictions_are_counted_in_the_report():
    gaze = direction_from_yaw_pitch_deg(np.arange(10.0), np.zeros(10))
    rows = [0, 1, 1, 2, 3, 4, 4, 5, 7, 6, 8, 9]
    t = stamps(10)[rows]
    gaze = gaze[rows]
    gaze[6] = gaze[0]
    recording = GazeRecording("x", t, "head", left=eye_samples(gaze))
    row = quality_table(prepare(recording)).iloc[0]
    assert (2, 1, 1, 10, 12) == (
        row.repeated_stamps,
        row.conflicting_stamps,
        row.backward_stamps,
        row.usable,
        row.file_rows,
    )
    with pytest.raises(DataError, match="x: row 9 is stamped"):
        prepare(recording, backward="error")
