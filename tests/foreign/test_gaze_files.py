"""Gaze as other programs write it: read right, or refused with the likely reason."""

from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from tests.analysis.gaze.streams import stamps
from visavis.analysis.gaze.foreign import GazeRecording, eye_samples, quaternions_of_euler
from visavis.analysis.gaze.foreign_times import recordings_of
from visavis.analysis.gaze.import_report import (
    prepare,
    quality_table,
    read_gaze,
    read_recordings,
)
from visavis.analysis.gaze.mapped_csv import GazeMapping, mapping_of, read_mapping
from visavis.analysis.gaze.movements.detect import detect_movements
from visavis.cli.main import app
from visavis.lab.errors import DataError, UsageError
from visavis.lab.geometry import direction_from_yaw_pitch_deg, rotate, yaw_pitch_deg_of
from visavis.lab.screen import FlatScreen

FILES = Path(__file__).parent / "files" / "gaze"
COMMA = FILES / "m_comma.yaml"


def read(name: str, *, valid: object = "ok", mapping: Path = COMMA) -> GazeRecording:
    columns = read_mapping(mapping)
    assert columns.combined is not None
    eye = {**columns.combined.model_dump(by_alias=True), "valid": valid}
    content = {**columns.model_dump(by_alias=True), "combined": eye}
    return read_gaze(FILES / name, "csv", mapping_of(content))


def quality(recording: GazeRecording) -> dict[str, Any]:
    return dict(quality_table(prepare(recording)).set_index("eye").loc["combined"])


# ---- the files ---------------------------------------------------------------------------------


def test_a_hosts_stamps_of_4_and_8_ms_lose_nothing_and_are_of_202_hz() -> None:
    recording = read("host_stamps_4_and_8_ms.csv")
    row = quality(recording)
    assert (0.0, 0) == (row["lost_01"], row["gaps"])
    assert pytest.approx(202.1, abs=0.1) == row["nominal_rate_hz"]
    gaze = prepare(recording)
    assert "202 Hz" in detect_movements(gaze.t_ns, gaze.direction["head"]).why
    assert any("202.1 Hz by regression" in remark for remark in gaze.remarks)


def test_two_recordings_in_one_file_are_two() -> None:
    recording = read("two_recordings_in_one_file.csv")
    with pytest.raises(DataError, match=r"time begins anew at row 960.*a new recording"):
        prepare(recording)
    first, second = recordings_of(recording)
    assert (960, "two_recordings_in_one_file_2") == (len(first), second.name)
    assert all(pytest.approx(120, abs=0.1) == quality(r)["rate_hz"] for r in (first, second))
    assert "2 recordings in one file" in second.remarks[0]


@pytest.mark.parametrize(("name", "value"), [("vive_31", 31), ("varjo_2", 2), ("pico_52", 52)])
def test_a_valid_that_is_a_code_is_said_in_the_mapping(name: str, value: int) -> None:
    with pytest.raises(DataError, match=f"valid: {{column: ok, is:.*it holds 0, {value}"):
        read(f"valid_{name}.csv")
    recording = read(f"valid_{name}.csv", valid={"column": "ok", "is": [value]})
    assert recording.combined is not None
    assert 0 < (~recording.combined.valid).sum() < 100


def test_a_valid_that_is_a_word_is_understood() -> None:
    recording = read("valid_tobii_words.csv")
    assert recording.combined is not None
    assert [False, True] == recording.combined.valid[:2].tolist()


def test_other_encodings_are_read() -> None:
    assert len(read("utf16.csv", mapping=FILES / "m_tab.yaml")) == 960
    recording = read("latin1_remark.csv")
    assert ("read as Windows-1252, it is not UTF-8",) == recording.remarks


def test_a_last_line_that_is_cut_is_left_out_and_told() -> None:
    recording = read("last_line_cut.csv")
    assert 959 == len(recording)
    assert "line 961, the last, is cut off" in recording.remarks[0]


def test_seconds_called_milliseconds_are_refused() -> None:
    with pytest.raises(DataError, match=r"no eye tracker has 120 005 Hz; is the unit s\?"):
        prepare(read("seconds_called_ms.csv"))


def test_stamps_that_a_spreadsheet_ruined_are_refused() -> None:
    with pytest.raises(DataError, match=r"nearly all stamps are equal.*spreadsheet"):
        prepare(read("stamps_destroyed_by_excel.csv"))


def test_dots_are_missing() -> None:
    recording = read("dots_for_missing.csv")
    assert recording.combined is not None
    assert 14 == np.isnan(recording.combined.direction[:, 0]).sum()


def imported(out: Path, *files: Path, more: Sequence[str] = ()) -> Any:
    arguments = ["--format", "csv", "--mapping", str(COMMA), "-o", str(out), *more]
    return CliRunner().invoke(app, ["import", "gaze", *map(str, files), *arguments])


def test_files_of_one_name_are_named_from_their_folders(tmp_path: Path) -> None:
    files = [FILES / f"recording_{i}" / "gaze.csv" for i in (1, 2)]
    result = imported(tmp_path, *files)
    assert 0 == result.exit_code, result.output
    expected = {"recording_1_gaze_quality.csv", "recording_2_gaze_quality.csv"}
    assert expected == {path.name for path in tmp_path.glob("*_quality.csv")}


def test_nothing_is_written_when_one_of_several_files_is_refused(tmp_path: Path) -> None:
    sound, faulty = FILES / "recording_1" / "gaze.csv", FILES / "seconds_called_ms.csv"
    result = imported(tmp_path / "out", sound, faulty)
    assert isinstance(result.exception, DataError)
    assert "1 of 2 files" in str(result.exception)
    assert not (tmp_path / "out").exists()


def test_nothing_is_written_when_one_of_several_reports_is_there(tmp_path: Path) -> None:
    files = [FILES / f"recording_{i}" / "gaze.csv" for i in (1, 2)]
    (tmp_path / "recording_2_gaze_quality.csv").write_text("x")
    result = imported(tmp_path, *files)
    assert isinstance(result.exception, UsageError)
    assert ["recording_2_gaze_quality.csv"] == [path.name for path in tmp_path.iterdir()]
    with pytest.raises(UsageError, match="given twice"):
        read_recordings([files[0], files[0]], "csv", read_mapping(COMMA))


# ---- further members of the kinds --------------------------------------------------------------


def looking(n: int = 600, seed: int = 0) -> npt.NDArray[np.float64]:
    """Azimuth and elevation (n, 2) in degrees of somebody who looks about."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(-12, 12, (n // 30 + 1, 2))
    return np.repeat(places, 30, axis=0)[:n] + rng.normal(0, 0.05, (n, 2))


def written(path: Path, columns: dict[str, Any], sign: str = ",") -> Path:
    lines = [sign.join(columns)]
    lines += [sign.join(map(str, row)) for row in zip(*columns.values(), strict=True)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def angles(**more: Any) -> GazeMapping:
    eye = {"angles": {"azimuth": "az", "elevation": "el", "unit": more.pop("unit", "deg")}}
    time = {"column": "t", "unit": more.pop("time", "ms")}
    return mapping_of(
        {"time": time, "space": "head", "combined": {**eye, **more.pop("eye", {})}, **more}
    )


SCALES = {"ns": 1, "us": 10**3, "ms": 10**6, "s": 10**9}


@settings(max_examples=30, deadline=None)
@given(
    rate_hz=st.sampled_from([30, 60, 120, 250, 1000]),
    real=st.sampled_from(sorted(SCALES)),
    said=st.sampled_from(sorted(SCALES)),
)
def test_a_unit_of_time_that_makes_no_rate_is_refused_with_the_right_one(
    rate_hz: int, real: str, said: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    t_ns = stamps(200, rate_hz)
    az, el = looking(200).T
    path = tmp_path_factory.mktemp("t") / "a.csv"
    written(path, {"t": (t_ns / SCALES[real]).tolist(), "az": az, "el": el})
    if real == said:
        recording = read_gaze(path, "csv", angles(time=said))
        assert pytest.approx(rate_hz, rel=0.01) == prepare(recording).rate_hz
        return
    shown_hz = rate_hz * SCALES[real] / SCALES[said]
    with (
        nullcontext()
        if 1 <= shown_hz <= 4000
        else pytest.raises(DataError, match=f"is the unit.* {real}\\b")
    ):
        prepare(read_gaze(path, "csv", angles(time=said)))


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 99), said=st.sampled_from(["deg", "rad"]))
def test_angles_in_the_other_unit_are_refused(
    seed: int, said: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    degrees = looking(seed=seed)
    path = tmp_path_factory.mktemp("t") / "a.csv"
    for unit, values in (("deg", degrees), ("rad", np.radians(degrees))):
        az, el = values.T
        written(path, {"t": stamps(600) / 1e6, "az": az, "el": el})
        if unit == said:
            recording = read_gaze(path, "csv", angles(unit=said))
            assert recording.combined is not None
            yaw, _ = yaw_pitch_deg_of(recording.combined.direction)
            assert np.allclose(-degrees[:, 0], yaw)
            continue
        with pytest.raises(DataError, match="rad" if said == "deg" else "deg"):
            read_gaze(path, "csv", angles(unit=said))


def test_gaze_that_stays_in_the_middle_is_read_when_the_mapping_says_so(tmp_path: Path) -> None:
    az, el = (looking() / 10).T
    path = written(tmp_path / "a.csv", {"t": stamps(600) / 1e6, "az": az, "el": el})
    convention = {"azimuth": "az", "elevation": "el", "unit": "deg", "unit_is_certain": True}
    assert 600 == len(read_gaze(path, "csv", angles(eye={"angles": convention})))


@pytest.mark.parametrize("codes", [(0, 4), ("0", "1"), ("Invalid", "0"), (0, 0)])
def test_a_column_that_calls_nothing_valid_is_refused(codes: Any, tmp_path: Path) -> None:
    az, el = looking().T
    ok = np.where(np.arange(600) % 20 == 0, codes[1], codes[0])
    cells = [("" if k % 20 == 0 else a) for k, a in enumerate(az)]
    path = written(tmp_path / "a.csv", {"t": stamps(600) / 1e6, "az": cells, "el": el, "ok": ok})
    with pytest.raises(DataError, match=r"valid: \{column: ok, is: \["):
        read_gaze(path, "csv", angles(eye={"valid": "ok"}))
    says = {"valid": {"column": "ok", "is": [codes[0]]}}
    assert 600 == len(read_gaze(path, "csv", angles(eye=says)))


@settings(max_examples=15, deadline=None)
@given(others=st.integers(1, 6), blinks=st.booleans())
def test_rows_of_other_sensors_are_left_out_and_lost_gaze_is_not(
    others: int, blinks: bool, tmp_path_factory: pytest.TempPathFactory
) -> None:
    n = 400
    t_ns = stamps(n * (others + 1), 120 * (others + 1))
    is_gaze = np.arange(len(t_ns)) % (others + 1) == 0
    gaze = looking(n).astype(object)
    if blinks:
        gaze[100:130] = ""
    az = np.full(len(t_ns), "", object)
    el, ok = az.copy(), az.copy()
    az[is_gaze], el[is_gaze] = gaze.T
    ok[is_gaze] = ["0" if a == "" else "1" for a in gaze[:, 0]]
    path = tmp_path_factory.mktemp("t") / "a.csv"
    written(path, {"t": (t_ns / 1e6).tolist(), "az": az, "el": el, "ok": ok})
    recording = read_gaze(path, "csv", angles(eye={"valid": "ok"}))
    row = quality(recording)
    assert (n, pytest.approx(120, abs=0.1)) == (len(recording), row["nominal_rate_hz"])
    assert pytest.approx(30 / n if blinks else 0.0, abs=2e-3) == row["lost_01"]
    assert "another sensor's" in recording.remarks[0]


def test_samples_that_share_stamps_are_spread_and_none_is_lost() -> None:
    gaze = direction_from_yaw_pitch_deg(*looking(1000).T)
    t_ns = stamps(1000, 2000.0) // 1_000_000 * 1_000_000
    recording = GazeRecording("x", t_ns, "head", combined=eye_samples(gaze))
    prepared = prepare(recording)
    assert (1000, pytest.approx(2000, rel=1e-3)) == (len(prepared.t_ns), prepared.rate_hz)
    assert any("stamps are coarse" in remark for remark in prepared.remarks)


def test_a_rate_that_changes_is_told_and_nothing_is_lost() -> None:
    slow = stamps(600, 60)
    t_ns = np.concatenate([slow, slow[-1] + 16_666_667 + stamps(600, 120)])
    gaze = direction_from_yaw_pitch_deg(*looking(1200).T)
    recording = GazeRecording("x", t_ns, "head", combined=eye_samples(gaze))
    assert pytest.approx(0.0, abs=2e-3) == quality(recording)["lost_01"]
    assert any("60, then 120 Hz" in remark for remark in prepare(recording).remarks)


def test_a_stated_rate_that_is_not_the_stamps_is_told() -> None:
    gaze = direction_from_yaw_pitch_deg(*looking(600).T)
    recording = GazeRecording("x", stamps(600, 60), "head", combined=eye_samples(gaze), rate_hz=120)
    assert any("60 Hz by its stamps, 120 Hz stated" in r for r in prepare(recording).remarks)


@settings(max_examples=30, deadline=None)
@given(
    order=st.sampled_from(["xyz", "xzy", "yxz", "yzx", "zxy", "zyx"]),
    degrees=st.tuples(*[st.floats(-180, 180)] * 3),
)
def test_euler_angles_turn_in_the_order_that_is_said(
    order: str, degrees: tuple[float, ...]
) -> None:
    turned = np.array([[0.3, -0.5, 0.8]])
    for axis in order:
        alone = np.zeros((1, 3))
        alone[0, "xyz".index(axis)] = degrees["xyz".index(axis)]
        turned = rotate(quaternions_of_euler(alone, axis), turned)
    whole = rotate(quaternions_of_euler(np.array([degrees]), order), np.array([[0.3, -0.5, 0.8]]))
    assert np.allclose(turned, whole)


def test_vectors_that_are_no_directions_are_refused_and_not_dropped(tmp_path: Path) -> None:
    az, el = np.radians(looking()).T
    columns = {"t": range(0, 8 * len(az), 8), "x": np.sin(az), "y": np.sin(el)}
    columns["z"] = np.full(len(az), -0.7)
    path = written(tmp_path / "a.csv", columns)
    mapping = mapping_of(
        {
            "time": {"column": "t", "unit": "ms"},
            "space": "head",
            "combined": {"direction": ["x", "y", "z"]},
        }
    )
    with pytest.raises(DataError, match=r"x, y, z are 0\.7\d* long in the middle, and a direction"):
        read_gaze(path, "csv", mapping)


def test_shares_called_pixels_are_refused(tmp_path: Path) -> None:
    az, el = looking().T
    columns = {"t": range(0, 8 * len(az), 8), "x": 0.5 + az / 40, "y": 0.5 + el / 40}
    path = written(tmp_path / "a.csv", columns)
    sizes = {"width_px": 1920, "height_px": 1080, "width_m": 0.53, "height_m": 0.30}
    mapping = mapping_of(
        {
            "time": {"column": "t", "unit": "ms"},
            "space": "head",
            "screen": {**sizes, "distance_m": 0.65},
            "combined": {"pixels": {"x": "x", "y": "y"}},
        }
    )
    with pytest.raises(DataError, match=r"x and y never exceed .* px; are they shares of the"):
        read_gaze(path, "csv", mapping)


def test_pixels_are_directions_by_the_screens_geometry(tmp_path: Path) -> None:
    screen = FlatScreen(0.53, 0.30, 1920, 1080, 0.65)
    path = written(tmp_path / "a.csv", {"t": [0, 8, 16], "x": [960, 1920, 0], "y": [540, 540, 0]})
    sizes = {"width_px": 1920, "height_px": 1080, "width_m": 0.53, "height_m": 0.30}
    mapping = mapping_of(
        {
            "time": {"column": "t", "unit": "ms"},
            "space": "head",
            "screen": {**sizes, "distance_m": 0.65},
            "combined": {"pixels": {"x": "x", "y": "y"}},
        }
    )
    recording = read_gaze(path, "csv", mapping)
    assert recording.combined is not None
    yaw, pitch = yaw_pitch_deg_of(recording.combined.direction)
    edge = np.degrees(np.arctan(0.265 / 0.65))
    assert np.allclose([0, -edge, edge], yaw)
    assert np.allclose([0, 0], pitch[:2])
    assert pitch[2] > 0
    met = screen.meets_m(np.zeros((3, 3)), recording.combined.direction)
    assert np.allclose([[960, 540], [1920, 540], [0, 0]], screen.pixels_of(met))


# ---- gaze and pupils that no eye has -------------------------------------------------------------

SCREEN = {"width_px": 1920, "height_px": 1080, "width_m": 0.53, "height_m": 0.3, "distance_m": 0.65}


def headset_file(folder: Path, rays: npt.NDArray[np.float64], pupil_mm: npt.ArrayLike) -> Path:
    pupils = np.broadcast_to(np.asarray(pupil_mm, float), len(rays))
    rows = [
        f"{8.333333 * k:.6f},{x!r},{y!r},{z!r},{p!r}"
        for k, ((x, y, z), p) in enumerate(zip(rays.tolist(), pupils.tolist(), strict=True))
    ]
    path = folder / "gaze.csv"
    path.write_text("\n".join(["t,x,y,z,pupil", *rows]) + "\n", encoding="utf-8")
    return path


def headset(path: Path) -> GazeRecording:
    eye = {"direction": ["x", "y", "z"], "pupil": {"column": "pupil", "unit": "mm"}}
    content = {"time": {"column": "t", "unit": "ms"}, "space": "head", "combined": eye}
    return read_gaze(path, "csv", mapping_of(content))


def wandering(n: int = 600) -> npt.NDArray[np.float64]:
    t = np.arange(n) / 120
    return direction_from_yaw_pitch_deg(12 * np.sin(t) + 0.1, 7 * np.cos(1.7 * t) + 0.1)


def test_gaze_that_is_mostly_behind_the_head_is_an_axis_the_other_way(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="600 of 600 samples of the combined gaze look behind"):
        prepare(headset(headset_file(tmp_path, wandering() * [1, 1, -1], 3.2)))


@settings(max_examples=10, deadline=None)
@given(n=st.integers(1, 200), first=st.integers(0, 300))
def test_single_gaze_behind_the_head_is_lost_and_told(
    n: int, first: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    rays = wandering()
    rays[first : first + n, 2] *= -1
    gaze = prepare(headset(headset_file(tmp_path_factory.mktemp("g"), rays, 3.2)))
    assert not gaze.usable["combined"][first : first + n].any()
    assert any(f"{n} of 600 samples" in remark for remark in gaze.remarks)


def test_gaze_that_is_exactly_straight_ahead_again_and_again_is_told(tmp_path: Path) -> None:
    rays = wandering()
    assert not any(
        "straight" in r for r in prepare(headset(headset_file(tmp_path, rays, 3))).remarks
    )
    rays[100:130] = [0, 0, -1]
    gaze = prepare(headset(headset_file(tmp_path, rays, 3)))
    assert any("30 of 600 samples" in remark for remark in gaze.remarks)


@pytest.mark.parametrize(
    ("size", "unit"),
    [(3200.0, "is the unit µm"), (0.0032, "is the unit m"), (40.0, "another unit")],
)
def test_pupils_of_another_unit_are_left_out_and_told(
    size: float, unit: str, tmp_path: Path
) -> None:
    gaze = prepare(headset(headset_file(tmp_path, wandering(), size)))
    assert np.isnan(gaze.eyes["combined"].pupil_mm).all()
    assert any("left out" in remark and unit in remark for remark in gaze.remarks)


def test_single_pupils_of_no_human_are_counted(tmp_path: Path) -> None:
    sizes = np.full(600, 3.2)
    sizes[50:60] = 0.2
    gaze = prepare(headset(headset_file(tmp_path, wandering(), sizes)))
    assert any("10 of 600 pupil sizes" in remark for remark in gaze.remarks)
    assert 3.2 == gaze.eyes["combined"].pupil_mm[0]


@pytest.mark.parametrize("mark", [0, -1, -32768, 1e8])
@pytest.mark.parametrize(("rows", "is_lost"), [(40, True), (1, False)])
def test_points_that_mean_lost_gaze_are_lost_though_they_are_called_valid(
    mark: float, rows: int, is_lost: bool, tmp_path: Path
) -> None:
    points = 960 + 200 * np.sin(np.arange(600) / 40)[:, None] * [1, 0.5]
    points[100 : 100 + rows] = mark
    lines = [f"{8.333333 * k:.6f},{x},{y},1" for k, (x, y) in enumerate(points.tolist())]
    path = tmp_path / "g.csv"
    path.write_text("\n".join(["t,x,y,ok", *lines]) + "\n", encoding="utf-8")
    content = {
        "time": {"column": "t", "unit": "ms"},
        "space": "head",
        "screen": SCREEN,
        "combined": {"pixels": {"x": "x", "y": "y"}, "valid": "ok"},
    }
    recording = read_gaze(path, "csv", mapping_of(content))
    assert recording.combined is not None
    assert is_lost == np.isnan(recording.combined.direction[100, 0])
    assert is_lost == any("lost the eye" in remark for remark in recording.remarks)


DAMAGES = {
    "gone": lambda path: path.unlink(),
    "empty": lambda path: path.write_text(""),
    "header alone": lambda path: path.write_text(path.read_text().splitlines()[0] + "\n"),
    "other columns": lambda path: path.write_text(path.read_text().replace("pupil", "size", 1)),
    "a word": lambda path: path.write_text(path.read_text().replace("\n16.666", "\nsoon", 1)),
}


@settings(max_examples=15, deadline=None)
@given(
    n=st.integers(2, 4),
    which=st.integers(0, 3),
    damage=st.sampled_from(sorted(DAMAGES)),
)
def test_one_file_of_several_that_is_refused_leaves_nothing_half_done(
    n: int, which: int, damage: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    root = tmp_path_factory.mktemp("several")
    files = []
    for k in range(n):
        (root / f"p{k}").mkdir()
        files.append(headset_file(root / f"p{k}", wandering(60), 3.2))
    DAMAGES[damage](files[which % n])
    mapping = root / "m.yaml"
    mapping.write_text(
        "time: {column: t, unit: ms}\nspace: head\n"
        "combined: {direction: [x, y, z], pupil: {column: pupil, unit: mm}}\n"
    )
    arguments = ["--format", "csv", "--mapping", str(mapping), "-o", str(root / "out")]
    result = CliRunner().invoke(app, ["import", "gaze", *map(str, files), *arguments])
    assert isinstance(result.exception, DataError | UsageError)
    assert f"p{which % n}" in str(result.exception)
    assert not (root / "out").exists()
