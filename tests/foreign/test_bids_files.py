"""BIDS as others write it: inherited sidecars, units, marks, screens, motion without latency."""

import gzip
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.foreign.test_gaze_files import looking
from visavis.analysis.foreign_check import check_foreign
from visavis.analysis.gaze.bids import read_bids
from visavis.analysis.gaze.import_report import prepare, quality_table
from visavis.analysis.session_verdict import Level
from visavis.lab.errors import DataError
from visavis.lab.geometry import yaw_pitch_deg_of
from visavis.lab.screen import FlatScreen
from visavis.recording.bids_sidecar import screen_in_set, sidecar_of

FILES = Path(__file__).parent / "files" / "bids"
SETS = ("stamps_in_ms", "inherited_sidecar", "gaze_on_screen")
EYE = "sub-01/beh/sub-01_task-look_recording-eye1_physio"


@pytest.mark.parametrize("name", SETS)
def test_the_times_of_every_set_are_right(name: str) -> None:
    (verdict,) = check_foreign(FILES / name)
    assert (Level.GREEN, 960, pytest.approx(120, abs=0.01)) == (
        verdict.level,
        verdict.samples,
        verdict.rate_hz,
    )


@pytest.mark.parametrize(
    ("name", "azimuth_deg", "elevation_deg"),
    [
        ("stamps_in_ms", [-4.949, -5.038], [-0.006, 0.069]),
        ("inherited_sidecar", [-4.949, -5.038], [-0.006, 0.069]),
        (
            "gaze_on_screen",  # 744.040, 540.233 and 740.173, 537.153 px of 0.53 x 0.30 m at 0.65 m
            np.degrees(np.arctan((np.array([744.04, 740.173]) - 960) * 0.53 / 1920 / 0.65)),
            [-0.0057, 0.0694],
        ),
    ],
)
def test_the_gaze_of_every_set_is_read(
    name: str, azimuth_deg: list[float], elevation_deg: list[float]
) -> None:
    recording = read_bids(FILES / name / f"{EYE}.tsv.gz")
    assert recording.left is not None
    yaw, pitch = yaw_pitch_deg_of(recording.left.direction)
    assert pytest.approx(120, abs=0.01) == prepare(recording).rate_hz
    assert np.allclose(azimuth_deg, -yaw[:2], atol=1e-3)
    assert np.allclose(elevation_deg, pitch[:2], atol=2e-3)


def test_pupils_in_arbitrary_units_are_no_millimetres() -> None:
    recording = read_bids(FILES / "stamps_in_ms" / f"{EYE}.tsv.gz")
    assert recording.left is not None
    assert np.isnan(recording.left.pupil_mm).all()
    assert any("arbitrary, not in mm" in remark for remark in recording.remarks)


CONTENT: dict[str, Any] = {
    "Columns": ["timestamp", "x_coordinate", "y_coordinate"],
    "SamplingFrequency": 120,
    "PhysioType": "eyetrack",
    "RecordedEye": "right",
    "SampleCoordinateSystem": "eye-in-head",
    "timestamp": {"Units": "s"},
    "x_coordinate": {"Units": "deg"},
    "y_coordinate": {"Units": "deg"},
}
PLACES = ("", "sub-01/", "sub-01/beh/")


def data_set(root: Path, sidecars: dict[str, Any], *, scale: float = 1.0, mark: str = "") -> Path:
    beh = root / "sub-01" / "beh"
    beh.mkdir(parents=True)
    (root / "dataset_description.json").write_text('{"Name": "x", "BIDSVersion": "1.11.0"}')
    for name, content in sidecars.items():
        (root / name).write_text(json.dumps(content), encoding="utf-8-sig" if mark else "utf-8")
    degrees = looking(240)
    rows = [f"{k / 120 * scale!r}\t{x!r}\t{y!r}" for k, (x, y) in enumerate(degrees.tolist())]
    path = root / f"{EYE}.tsv.gz"
    path.write_bytes(gzip.compress((mark + "\n".join(rows) + "\n").encode()))
    return path


@settings(max_examples=25, deadline=None)
@given(
    where=st.lists(st.sampled_from([0, 1, 2]), min_size=len(CONTENT), max_size=len(CONTENT)),
    unit=st.sampled_from(["s", "ms", "us", "milliseconds", "seconds"]),
    marked=st.booleans(),
)
def test_sidecars_are_inherited_wherever_they_lie(
    where: list[int], unit: str, marked: bool, tmp_path_factory: pytest.TempPathFactory
) -> None:
    root = tmp_path_factory.mktemp("set")
    stems = ("task-look_physio", "sub-01_physio", "sub-01_task-look_recording-eye1_physio")
    sidecars: dict[str, dict[str, Any]] = {}
    for place, (key, value) in zip(where, CONTENT.items(), strict=True):
        value = {"Units": unit} if key == "timestamp" else value
        sidecars.setdefault(f"{PLACES[place]}{stems[place]}.json", {})[key] = value
    # Of another task, and farther away than one that says otherwise: neither counts.
    sidecars["task-other_physio.json"] = {"SamplingFrequency": 5}
    scale = {"s": 1, "seconds": 1, "ms": 1e3, "milliseconds": 1e3, "us": 1e6}[unit]
    path = data_set(root, sidecars, scale=scale, mark="\ufeff" if marked else "")
    assert 120 == sidecar_of(path)["SamplingFrequency"]
    recording = read_bids(path)
    assert recording.right is not None
    yaw, _ = yaw_pitch_deg_of(recording.right.direction)
    assert np.allclose(-looking(240)[:, 0], yaw)
    assert pytest.approx(120, rel=1e-3) == prepare(recording).rate_hz
    (verdict,) = check_foreign(root)
    assert (Level.GREEN, pytest.approx(120, rel=1e-3)) == (verdict.level, verdict.rate_hz)


def test_the_nearest_sidecar_has_the_last_word(tmp_path: Path) -> None:
    near = {**CONTENT, "RecordedEye": "left"}
    path = data_set(tmp_path, {"task-look_physio.json": CONTENT, f"{EYE}.json": near})
    assert "left" == sidecar_of(path)["RecordedEye"]


def test_gaze_on_a_screen_that_nobody_describes_is_refused(tmp_path: Path) -> None:
    pixels = {"SampleCoordinateSystem": "gaze-on-screen", "x_coordinate": {"Units": "pixel"}}
    path = data_set(tmp_path, {f"{EYE}.json": {**CONTENT, **pixels}})
    with pytest.raises(DataError, match=r"the set does not describe it.*--screen"):
        read_bids(path)


def test_a_screen_in_centimetres_is_refused(tmp_path: Path) -> None:
    screen = {"ScreenDistance": 65, "ScreenSize": [53, 30], "ScreenResolution": [1920, 1080]}
    side = {"task-look_events.json": {"StimulusPresentation": screen}, f"{EYE}.json": CONTENT}
    path = data_set(tmp_path, side)
    with pytest.raises(DataError, match="were these cm or mm"):
        screen_in_set(path)


def test_motion_without_latency_is_judged_by_its_rate_and_that_is_told(tmp_path: Path) -> None:
    (tmp_path / "dataset_description.json").write_text("{}")
    stem = tmp_path / "sub-1_task-walk_tracksys-imu"
    Path(f"{stem}_motion.tsv").write_text("1\t2\n" * 100)
    Path(f"{stem}_motion.json").write_text('{"SamplingFrequency": 50}')
    Path(f"{stem}_channels.tsv").write_text("name\ttype\nx\tPOS\ny\tPOS\n")
    (verdict,) = check_foreign(tmp_path)
    assert (100, Level.AMBER) == (verdict.samples, verdict.level)
    assert "no latency" in verdict.findings[0][0]


# ---- what eye2bids and mne-bids write ------------------------------------------------------------

SCREEN_PX = np.array([1920, 1080])
POINTS_PX = np.round(SCREEN_PX / 2 + 60 * looking(480), 1)


def eye2bids_set(root: Path) -> Path:
    """As eye2bids 2 converts a binocular file; the right eye keeps EyeLink's blanks and dots."""
    about = {
        "Manufacturer": "SR-Research",
        "PhysioType": "eyetrack",
        "Columns": ["timestamp", "x_coordinate", "y_coordinate", "pupil_size"],
        "timestamp": {"Units": "ms", "Origin": "System startup"},
        "x_coordinate": {"LongName": "Gaze position (x)", "Units": "pixel"},
        "y_coordinate": {"LongName": "Gaze position (y)", "Units": "pixel"},
        "pupil_size": {"Units": "a.u."},
        "SampleCoordinateSystem": "gaze-on-screen",
        "ManufacturersModelName": "EYELINK II CL v5.15 Jan 24 2018",
        "SamplingFrequency": 250,
        "StartTime": 3000000,
        "StopTime": 3001920,
        "CalibrationCount": 0,
    }
    for number, (eye, missing) in enumerate([("Left", "n/a"), ("Right", "   .")], start=1):
        rows = [f"{3_000_000 + 4 * k}\t{x}\t{y}\t900.0" for k, (x, y) in enumerate(POINTS_PX)]
        rows[50:60] = [f"{3_000_000 + 4 * k}\t{missing}\t{missing}\t0.0" for k in range(50, 60)]
        stem = f"rest_recording-eye{number}_physio"
        packed = gzip.compress(("\n".join(rows) + "\n").encode())
        (root / f"{stem}.tsv.gz").write_bytes(packed)
        (root / f"{stem}.json").write_text(json.dumps(about | {"RecordedEye": eye}, indent=4))
        (root / f"rest_recording-eye{number}_physioevents.json").write_text(
            json.dumps({"Columns": ["onset", "duration", "trial_type", "blink", "message"]})
        )
    screen = {"ScreenDistance": 0.65, "ScreenOrigin": ["top", "left"], "ScreenRefreshRate": 60}
    screen |= {"ScreenSize": [0.53, 0.3], "ScreenResolution": SCREEN_PX.tolist()}
    (root / "rest_events.json").write_text(json.dumps({"StimulusPresentation": screen}))
    return root / "rest_recording-eye1_physio.tsv.gz"


def mne_bids_set(root: Path) -> Path:
    """As mne-bids 0.19 writes gaze beside EEG: stamps in seconds, one file an eye, px by name."""
    (root / "dataset_description.json").write_text('{"Name": "a", "BIDSVersion": "1.11.1"}')
    folder = root / "sub-01" / "eeg"
    folder.mkdir(parents=True)
    for number, eye in enumerate(("left", "right"), start=1):
        about = {
            "SamplingFrequency": 250.0,
            "StartTime": 0.0,
            "Columns": ["timestamp", "x_coordinate", "y_coordinate", "pupil_size"],
            "PhysioType": "eyetrack",
            "RecordedEye": eye,
            "SampleCoordinateSystem": "gaze-on-screen",
            "timestamp": {"Units": "s"},
            "x_coordinate": {"Units": "pixel"},
            "y_coordinate": {"Units": "pixel"},
            "pupil_size": {"Description": "Pupil size of the recorded eye", "Units": "arbitrary"},
        }
        rows = [f"{k / 250}\t{x}\t{y}\t900.0" for k, (x, y) in enumerate(POINTS_PX)]
        rows[50:60] = [f"{k / 250}\tn/a\tn/a\tn/a" for k in range(50, 60)]
        stem = f"sub-01_task-rest_recording-eye{number}_physio"
        (folder / f"{stem}.tsv.gz").write_bytes(gzip.compress(("\n".join(rows) + "\n").encode()))
        (folder / f"{stem}.json").write_text(json.dumps(about))
    screen = {"ScreenDistance": 0.65, "ScreenOrigin": ["top", "left"], "ScreenSize": [0.53, 0.3]}
    screen |= {"ScreenResolution": SCREEN_PX.tolist()}
    (folder / "sub-01_task-rest_events.json").write_text(
        json.dumps({"StimulusPresentation": screen})
    )
    return folder / "sub-01_task-rest_recording-eye1_physio.tsv.gz"


@pytest.mark.parametrize("write", [eye2bids_set, mne_bids_set])
def test_what_other_writers_make_of_an_eyelink_recording_is_read(
    write: Callable[[Path], Path], tmp_path: Path
) -> None:
    recording = read_bids(write(tmp_path))
    assert ["left", "right"] == list(recording.eyes)
    expected = FlatScreen(0.53, 0.3, 1920, 1080, 0.65).directions_of(POINTS_PX)
    expected[50:60] = np.nan
    for eye in recording.eyes.values():
        np.testing.assert_allclose(eye.direction, expected, atol=1e-12)
        assert np.isnan(eye.pupil_mm).all()
    gaze = prepare(recording)
    assert (480, pytest.approx(250)) == (len(gaze.t_ns), gaze.rate_hz)


def paused(path: Path, *, fills: bool) -> None:
    """Pause a set for 2 s after its sample 240: as eye2bids says it, or filled as by mne-bids,
    whose pauses end a little after the sample that follows.
    """
    for each in path.parent.glob("*_physio.tsv.gz"):
        rows = [
            line.split("\t") for line in gzip.decompress(each.read_bytes()).decode().split("\n")
        ]
        step = float(rows[1][0]) - float(rows[0][0])
        for row in rows[240:-1]:
            row[0] = repr(float(row[0]) + 500 * step)
        if fills:
            begin = float(rows[239][0])
            n = [[repr(begin + (k + 1) * step), "n/a", "n/a", "n/a"] for k in range(500)]
            rows[240:240] = n
        each.write_bytes(gzip.compress("\n".join("\t".join(row) for row in rows).encode()))
        if not fills:
            events = each.with_name(each.name.replace("_physio.", "_physioevents."))
            lines = ["3000000\tn/a\tn/a\tn/a\tSTART", "3000956\tn/a\tn/a\tn/a\tEND"]
            lines += ["3000000\t40\tfixation\t0\tn/a", "3002960\tn/a\tn/a\tn/a\tSTART"]
            events.write_bytes(gzip.compress("\n".join(lines).encode()))
    if fills:
        table = "onset\tduration\ttrial_type\n0.1\t0.0\tfirst\n0.96\t2.003\tBAD_ACQ_SKIP\n"
        (path.parent / "sub-01_task-rest_events.tsv").write_text(table)


@pytest.mark.parametrize(("write", "fills"), [(eye2bids_set, False), (mne_bids_set, True)])
def test_pause_that_another_writer_tells_of_is_no_loss(
    write: Callable[[Path], Path], fills: bool, tmp_path: Path
) -> None:
    path = write(tmp_path)
    (tmp_path / "dataset_description.json").write_text("{}")
    paused(path, fills=fills)
    recording = read_bids(path)
    gaze = prepare(recording)
    assert (480, 1) == (len(recording), len(recording.resumed_ns))
    assert pytest.approx(250, rel=1e-3) == gaze.rate_hz
    assert pytest.approx(10 / 480, abs=1e-3) == quality_table(gaze)["lost_01"].iloc[-1]
    assert any("paused 1 times; pauses are no loss" in r for r in recording.remarks)
    assert all(Level.RED != verdict.level for verdict in check_foreign(tmp_path))
    # A gap that nobody tells of stays one.
    for events in tmp_path.rglob("*events.tsv*"):
        events.unlink()
    assert () == read_bids(path).resumed_ns
    if not fills:
        assert all(Level.RED == verdict.level for verdict in check_foreign(tmp_path))


def test_resolution_that_names_the_last_pixel_is_one_more_and_that_is_told(tmp_path: Path) -> None:
    path = eye2bids_set(tmp_path)
    right = read_bids(path).eyes["left"].direction
    events = tmp_path / "rest_events.json"
    events.write_text(events.read_text().replace("1920", "1919").replace("1080", "1079"))
    recording = read_bids(path)
    np.testing.assert_array_equal(right, recording.eyes["left"].direction)
    assert any("read as 1920 x 1080" in remark for remark in recording.remarks)


def test_stamps_in_whole_milliseconds_of_2000_samples_a_second_are_coarse_and_not_wrong(
    tmp_path: Path,
) -> None:
    path = eye2bids_set(tmp_path)
    (tmp_path / "dataset_description.json").write_text("{}")
    for each in tmp_path.glob("*_physio.tsv.gz"):
        rows = [f"{3_000_000 + k // 2}\t{x}\t{y}\t900.0" for k, (x, y) in enumerate(POINTS_PX)]
        each.write_bytes(gzip.compress("\n".join(rows).encode()))
        side = each.with_name(each.name.replace(".tsv.gz", ".json"))
        side.write_text(json.dumps(json.loads(side.read_text()) | {"SamplingFrequency": 2000}))
    for verdict in check_foreign(tmp_path):
        assert (Level.AMBER, pytest.approx(2000, rel=0.01)) == (verdict.level, verdict.rate_hz)
        assert "240 samples share the stamp of the one before" in verdict.findings[0][0]
    assert pytest.approx(2000, rel=0.01) == prepare(read_bids(path)).rate_hz
