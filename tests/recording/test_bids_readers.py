"""What other programs read of a BIDS export is what was recorded.

The data set is read by its own sidecars alone, as somebody does who knows the standard and not
Visavis, and handed to MNE-Python and pymovements.
"""

import gzip
import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from tests.recording.test_export import ABOUT, BELT, gaze_session
from visavis.recording.bids import export_bids
from visavis.recording.reader import Recording

STEM = "sub-P01_ses-001_task-stare"
SESSION = Path("sub-P01") / "ses-001"


@pytest.fixture
def exported(tmp_path: Path) -> tuple[Recording, Path]:
    recording = gaze_session(tmp_path / "d", own=(BELT,))
    export_bids([recording], tmp_path / "b", task="stare", dataset_name="Stare", about=ABOUT)
    return recording, tmp_path / "b" / SESSION


def physio(folder: Path, name: str) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Read a recording by its sidecar."""
    path = folder / "beh" / f"{STEM}_run-1_recording-{name}_physio.json"
    said = json.loads(path.read_text("utf-8"))
    table = pd.read_csv(
        path.with_suffix(".tsv.gz"), sep="\t", names=said["Columns"], na_values="n/a"
    )
    return table, said


def angles_of(recording: Recording, eye: str) -> tuple[Any, Any]:
    """Return gaze in degrees right and up (n, 2), NaN where it is lost, and what is valid."""
    gaze = recording.stream_arrays("gaze")
    x, y, z = gaze[f"{eye}_direction_head"].astype(np.float64).T
    degrees = np.degrees([np.arctan2(x, -z), np.arctan2(y, np.hypot(x, z))]).T
    valid = gaze[f"{eye}_valid"]
    return np.where(valid[:, None], degrees, np.nan), valid


def test_mne_reads_gaze_pupils_streams_and_trials(exported: Any, tmp_path: Path) -> None:
    mne = pytest.importorskip("mne", reason="MNE-Python is not installed: pip install '.[dev]'")
    recording, folder = exported
    table, said = physio(folder, "eye1")
    names = ["x_coordinate", "y_coordinate", "pupil_size"]
    info = mne.create_info(names, said["SamplingFrequency"], ["eyegaze", "eyegaze", "pupil"])
    raw = mne.io.RawArray(table[names].to_numpy().T, info, verbose="error")
    mne.preprocessing.eyetracking.set_channel_types_eyetrack(
        raw,
        {
            "x_coordinate": ("eyegaze", "deg", said["RecordedEye"], "x"),
            "y_coordinate": ("eyegaze", "deg", said["RecordedEye"], "y"),
            "pupil_size": ("pupil", "mm", said["RecordedEye"]),
        },
    )
    events = pd.read_csv(folder / "beh" / f"{STEM}_run-1_events.tsv", sep="\t", na_values="n/a")
    trials = events[events["trial_type"] == "trial"]
    raw.set_annotations(
        mne.Annotations(
            trials["onset"] - said["StartTime"], trials["duration"], trials["condition"]
        )
    )
    raw.save(tmp_path / "gaze_raw.fif", fmt="double", verbose="error")

    back = mne.io.read_raw_fif(tmp_path / "gaze_raw.fif", preload=True, verbose="error")
    expected, _ = angles_of(recording, "left")
    data = back.get_data()  # in radians and metres, as MNE keeps them
    np.testing.assert_allclose(np.degrees(data[:2].T), expected, atol=1e-6)
    np.testing.assert_allclose(
        data[2] * 1e3, recording.stream_arrays("gaze")["left_pupil_mm"], atol=1e-6
    )
    row = recording.trials().iloc[0]
    first_ns = recording.stream_arrays("gaze")["t_host_ns"][0]
    assert [row["condition"]] == list(back.annotations.description)
    assert (row["t_start_ns"] - first_ns) / 1e9 == pytest.approx(back.annotations.onset[0])
    assert (row["t_end_ns"] - row["t_start_ns"]) / 1e9 == pytest.approx(
        back.annotations.duration[0]
    )


def test_mne_reads_motion_and_a_labs_own_stream(exported: Any) -> None:
    mne = pytest.importorskip("mne", reason="MNE-Python is not installed: pip install '.[dev]'")
    recording, folder = exported
    stem = folder / "motion" / f"{STEM}_tracksys-HMD_run-1"
    channels = pd.read_csv(f"{stem}_channels.tsv", sep="\t")
    said = json.loads(Path(f"{stem}_motion.json").read_text("utf-8"))
    table = pd.read_csv(f"{stem}_motion.tsv", sep="\t", names=channels["name"], na_values="n/a")
    raw = mne.io.RawArray(
        table.to_numpy().T,
        mne.create_info(channels["name"].tolist(), said["SamplingFrequency"], "misc"),
        verbose="error",
    )
    head = recording.stream_arrays("head")
    expected = np.where(head["valid"][:, None], head["position_m"], np.nan)
    picks = channels.loc[channels["type"] == "POS", "name"].tolist()
    np.testing.assert_allclose(raw.get_data(picks).T, expected)
    assert head["t_host_ns"].size / said["SamplingFrequency"] == pytest.approx(
        raw.times[-1] + 1 / said["SamplingFrequency"], rel=1e-3
    )

    table, said = physio(folder, "belt")
    belt = mne.io.RawArray(
        table[["breath_01"]].to_numpy().T,
        mne.create_info(["breath_01"], said["SamplingFrequency"], "misc"),
        verbose="error",
    )
    assert BELT.nominal_rate_hz == pytest.approx(belt.info["sfreq"])
    np.testing.assert_allclose(
        belt.get_data()[0], recording.stream_arrays("belt")["breath_01"], rtol=1e-6
    )


@pytest.mark.parametrize("eye", ["left", "right"])
def test_pymovements_reads_gaze_as_recorded(exported: Any, eye: str, tmp_path: Path) -> None:
    pm = pytest.importorskip(
        "pymovements",
        reason="pymovements is not installed (it needs an AGPL library, so it is no test "
        "dependency): pip install '.[peers]'",
    )
    recording, folder = exported
    name = {"left": "eye1", "right": "eye2"}[eye]
    _, said = physio(folder, name)
    packed = folder / "beh" / f"{STEM}_run-1_recording-{name}_physio.tsv.gz"
    plain = tmp_path / "gaze.tsv"
    plain.write_bytes(gzip.decompress(packed.read_bytes()))
    gaze = pm.gaze.from_csv(
        plain,
        pm.Experiment(sampling_rate=said["SamplingFrequency"]),
        time_column="timestamp",
        time_unit="s",
        position_columns=["x_coordinate", "y_coordinate"],
        read_csv_kwargs={
            "separator": "\t",
            "has_header": False,
            "new_columns": said["Columns"],
            "null_values": "n/a",
        },
    )
    expected, valid = angles_of(recording, eye)
    found = np.array([[np.nan if v is None else v for v in p] for p in gaze.samples["position"]])
    np.testing.assert_allclose(found, expected, atol=1e-9)
    assert valid.sum() == np.isfinite(found).all(axis=1).sum()
    times_s = recording.stream_arrays("gaze")["t_host_ns"] / 1e9
    spent_ms = np.diff(np.asarray(gaze.samples["time"], float))
    np.testing.assert_allclose(spent_ms, np.diff(times_s) * 1e3, atol=1e-3)
    gaze.pos2vel(method="preceding")
    speed = np.array([[np.nan if v is None else v for v in p] for p in gaze.samples["velocity"]])
    expected_deg_s = np.diff(expected, axis=0) / np.diff(times_s)[:, None]
    np.testing.assert_allclose(speed[5:], expected_deg_s[4:], rtol=1e-3, atol=1e-9)
