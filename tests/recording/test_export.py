import gzip
import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from tests.recording.sessions import new_recorder, probe_batch, probe_manifest, record_session
from visavis.lab.clock import NS_PER_S, SimClock
from visavis.lab.errors import RecordingError, UsageError
from visavis.lab.schema import Field, SampleBatch, StreamSchema, empty_values
from visavis.recording.bids import NO_TIME, export_bids, rate_hz
from visavis.recording.bids_about import DatasetAbout
from visavis.recording.export import export_session, export_tables
from visavis.recording.folder import create_session
from visavis.recording.reader import Recording
from visavis.recording.writer import Recorder

VECTOR = (3,)
GAZE_LIKE = StreamSchema(
    "gaze",
    (
        Field("direction_head", "f4", "1", "head", VECTOR),
        Field("valid", "?", ""),
        Field("left_direction_head", "f4", "1", "head", VECTOR),
        Field("left_valid", "?", ""),
        Field("left_pupil_mm", "f4", "mm"),
        Field("right_direction_head", "f4", "1", "head", VECTOR),
        Field("right_valid", "?", ""),
        Field("right_pupil_mm", "f4", "mm"),
    ),
    120.0,
)
HEAD_LIKE = StreamSchema(
    "head",
    (
        Field("position_m", "f4", "m", "world", VECTOR),
        Field("orientation_wxyz", "f4", "1", "world", (4,)),
        Field("valid", "?", ""),
    ),
    90.0,
)


BODY_LIKE = StreamSchema(
    "body",
    (
        Field("position_m", "f4", "m", "world", (2, 3), "segments: pelvis left_hand"),
        Field("orientation_wxyz", "f4", "1", "world", (2, 4)),
        Field("valid", "?", "", shape=(2,)),
    ),
    60.0,
)
HANDS = replace(BODY_LIKE, name="hands")
MOTION_TYPES = (
    "ACCEL", "ANGACCEL", "GYRO", "JNTANG", "LATENCY", "MAGN", "MISC", "ORNT", "POS", "VEL",
)  # fmt: skip
"""Types of channels of motion in BIDS 1.11.1."""
BELT = StreamSchema("belt", (Field("breath_01", "f4", "1"),), 32.0)
KNOB = StreamSchema("knob", (Field("turn_deg", "f4", "deg"),), 0.0)


def gaze_session(
    root: Path,
    *,
    is_simulated: bool = True,
    own: Sequence[StreamSchema] = (),
    screen: Mapping[str, Any] | None = None,
    late_s: Mapping[str, float] = MappingProxyType({}),
) -> Recording:
    clock = SimClock()
    manifest = replace(
        probe_manifest(is_simulated=is_simulated),
        devices=[{"role": "gaze", "vendor": "Maker", "model": "Eye", "serial": "7"}],
    )
    if screen is not None:
        manifest = replace(manifest, configuration={"screen": screen})
    with create_session(root, manifest) as folder:
        recorder = Recorder(
            folder.begin_part(clock),
            clock,
            threaded=False,
            max_batch_ns=NS_PER_S,
            is_simulated=is_simulated,
        )
        for schema in (GAZE_LIKE, HEAD_LIKE, *own):
            recorder.declare(schema)
            n = int(schema.nominal_rate_hz) or 2
            values = empty_values(schema, n)
            for field in schema.fields:
                if field.dtype == "?" and field.shape:  # every segment is lost once
                    values[field.name] = np.arange(n)[:, None] != np.arange(1, 1 + field.shape[0])
                elif field.dtype == "?":
                    values[field.name] = np.arange(n) != 1
                elif len(field.shape) == 2:
                    values[field.name] = np.arange(np.prod(field.shape)).reshape(field.shape) / 8
                elif field.name.endswith("direction_head"):
                    yaw = np.pi / 4 + 0.004 * np.arange(n)
                    values[field.name] = np.stack([np.sin(yaw), 0 * yaw, -np.cos(yaw)], axis=1)
                elif field.name == "orientation_wxyz":
                    values[field.name] = [1.0, 0.0, 0.0, 0.0]
                else:
                    values[field.name] = 3.5 if field.shape == () else [1.0, 2.0, 3.0]
            first_ns = 5 * NS_PER_S + round(late_s.get(schema.name, 0.0) * NS_PER_S)
            t_ns = first_ns + np.arange(n) * NS_PER_S // n
            recorder.append(SampleBatch(schema, np.arange(n), t_ns, t_ns, values))
        recorder.event("trial_start", 5 * NS_PER_S + NS_PER_S // 4, trial_id="T01")
        recorder.trial(
            {
                "trial_id": "T01",
                "condition": "AD",
                "first_ms": None,
                "t_start_ns": 5 * NS_PER_S + NS_PER_S // 4,
                "t_end_ns": 5 * NS_PER_S + NS_PER_S // 2,
            }
        )
        folder.end_part(clock, recorder.close("complete"))
        return Recording(folder.path)


def test_parquet_keeps_values_units_and_the_mark_of_simulation(tmp_path: Path) -> None:
    recording = Recording(record_session(tmp_path))
    export_tables(recording, tmp_path / "out")
    table = pq.read_table(tmp_path / "out" / "probe.parquet")
    expected = probe_batch(0, 450)
    assert expected.seq.tolist() == table["seq"].to_pylist()
    assert (expected.values["position_m"][:, 2] == table["position_z_m"].to_numpy()).all()
    metadata = table.schema.field("position_z_m").metadata
    assert (b"m", b"world") == (metadata[b"unit"], metadata[b"frame"])
    assert b"true" == table.schema.metadata[b"is_simulated"]
    trials = pd.read_csv(tmp_path / "out" / "trials.csv")
    assert ["T00", "T01", "T02"] == trials["trial_id"].tolist()
    assert trials["is_simulated"].all()
    assert trials["first_ms"].isna().all()


def test_export_overwrites_nothing(tmp_path: Path) -> None:
    path = record_session(tmp_path)
    for name in ("parquet", "bids", "xdf"):
        export_session(path, name, tmp_path / name)
        with pytest.raises(RecordingError, match="export into a"):
            export_session(path, name, tmp_path / name)
    with pytest.raises(UsageError, match="choose parquet, bids or xdf"):
        export_session(path, "xls", tmp_path / "xls")


def test_bids_gaze_is_in_degrees_right_and_up_and_lost_is_missing(tmp_path: Path) -> None:
    export_bids([gaze_session(tmp_path / "d")], tmp_path / "b", task="stare", dataset_name="Stare")
    beh = tmp_path / "b" / "sub-P01" / "ses-001" / "beh"
    stem = "sub-P01_ses-001_task-stare_run-1"
    for eye, recorded in (("eye1", "left"), ("eye2", "right"), ("eye3", "cyclopean")):
        notes = json.loads((beh / f"{stem}_recording-{eye}_physio.json").read_text("utf-8"))
        table = pd.read_csv(
            beh / f"{stem}_recording-{eye}_physio.tsv.gz",
            sep="\t",
            names=notes["Columns"],
            na_values="n/a",
        )
        assert ["timestamp", "x_coordinate", "y_coordinate"] == notes["Columns"][:3]
        assert ("eyetrack", recorded, "eye-in-head") == (
            notes["PhysioType"],
            notes["RecordedEye"],
            notes["SampleCoordinateSystem"],
        )
        assert 120.0 == pytest.approx(notes["SamplingFrequency"], abs=0.01)
        assert notes["IsSimulated"] is True
        assert "Maker" == notes["Manufacturer"]
        assert 120 == len(table)
        assert 45.0 == pytest.approx(table["x_coordinate"][0], abs=1e-4)
        assert 0.0 == pytest.approx(table["y_coordinate"][0], abs=1e-4)
        assert [False, True, False] == table["x_coordinate"].isna().tolist()[:3]
        assert 5 * NS_PER_S == table["t_host_ns"][0]


def test_bids_events_give_trials_onset_and_duration_in_seconds(tmp_path: Path) -> None:
    export_bids([gaze_session(tmp_path / "d")], tmp_path / "b", task="stare", dataset_name="Stare")
    beh = tmp_path / "b" / "sub-P01" / "ses-001" / "beh"
    path = beh / "sub-P01_ses-001_task-stare_run-1_events.tsv"
    table = pd.read_csv(path, sep="\t", na_values="n/a")
    trial = table[table["trial_type"] == "trial"].iloc[0]
    assert (0.25, 0.25, "AD") == (trial["onset"], trial["duration"], trial["condition"])
    assert ["onset", "duration", "trial_type"] == list(table.columns[:3])
    notes = json.loads(path.with_suffix(".json").read_text("utf-8"))
    assert set(table.columns) <= set(notes)


def test_bids_motion_columns_are_those_of_its_channels(tmp_path: Path) -> None:
    export_bids([gaze_session(tmp_path / "d")], tmp_path / "b", task="stare", dataset_name="Stare")
    motion = tmp_path / "b" / "sub-P01" / "ses-001" / "motion"
    stem = "sub-P01_ses-001_task-stare_tracksys-HMD_run-1"
    channels = pd.read_csv(motion / f"{stem}_channels.tsv", sep="\t")
    table = pd.read_csv(
        motion / f"{stem}_motion.tsv", sep="\t", names=channels["name"].tolist(), na_values="n/a"
    )
    assert [1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0, 0.0] == table.iloc[0].tolist()
    assert table.iloc[1, :7].isna().all()
    assert not table.iloc[1].isna()["latency"]
    notes = json.loads((motion / f"{stem}_motion.json").read_text("utf-8"))
    assert len(channels) == notes["MotionChannelCount"]


@pytest.mark.parametrize(
    ("expected", "system"),
    [
        ({"MotionChannelCount": 8, "POSChannelCount": 3, "ORNTChannelCount": 4}, "HMD"),
        ({"MotionChannelCount": 15, "POSChannelCount": 6, "ORNTChannelCount": 8}, "body"),
    ],
)
def test_bids_counts_of_motion_channels_are_those_of_the_table_of_channels(
    expected: dict[str, int], system: str, tmp_path: Path
) -> None:
    # The rule of the official validator for EEG: XChannelCount == count(channels.type, X). Its
    # own example of motion, one point with position and quaternion, has 7, 3 and 4 channels;
    # here the latency of samples is one more.
    recording = gaze_session(tmp_path / "d", own=(BODY_LIKE,))
    export_bids([recording], tmp_path / "b", task="stare", dataset_name="Stare", about=ABOUT)
    stem = f"sub-P01_ses-001_task-stare_tracksys-{system}_run-1"
    motion = tmp_path / "b" / "sub-P01" / "ses-001" / "motion"
    notes = json.loads((motion / f"{stem}_motion.json").read_text("utf-8"))
    channels = pd.read_csv(motion / f"{stem}_channels.tsv", sep="\t", keep_default_na=False)
    table = pd.read_csv(motion / f"{stem}_motion.tsv", sep="\t", header=None)
    assert expected == {key: notes[key] for key in expected}
    counts = {k.removesuffix("ChannelCount"): n for k, n in notes.items() if k.endswith("lCount")}
    assert len(table.columns) == counts.pop("Motion") == len(channels)
    assert {*MOTION_TYPES} == set(counts)
    assert {kind: (channels["type"] == kind).sum() for kind in MOTION_TYPES} == counts
    points = set(channels["tracked_point"]) - {"n/a"}
    assert len(points) == notes["TrackedPointsCount"]
    assert [] == issues_of(tmp_path / "b")


@pytest.mark.parametrize("tracked", ["body", "hands"])
def test_bids_channels_of_a_body_name_each_segments_own_column(
    tmp_path: Path, tracked: str
) -> None:
    recording = gaze_session(tmp_path / "d", own=(BODY_LIKE, HANDS))
    export_bids([recording], tmp_path / "b", task="stare", dataset_name="Stare", about=ABOUT)
    stem = f"sub-P01_ses-001_task-stare_tracksys-{tracked}_run-1"
    motion = tmp_path / "b" / "sub-P01" / "ses-001" / "motion"
    channels = pd.read_csv(motion / f"{stem}_channels.tsv", sep="\t", keep_default_na=False)
    table = pd.read_csv(
        motion / f"{stem}_motion.tsv", sep="\t", names=channels["name"].tolist(), na_values="n/a"
    )
    recorded = recording.stream_arrays(tracked)
    for k, segment in enumerate(("pelvis", "left_hand")):
        own = channels[channels["tracked_point"] == segment]
        assert [*"xyz", "quat_x", "quat_y", "quat_z", "quat_w"] == own["component"].tolist()
        assert ["POS"] * 3 + ["ORNT"] * 4 == own["type"].tolist()
        turn = recorded["orientation_wxyz"][:, k, [1, 2, 3, 0]]
        expected = np.concatenate([recorded["position_m"][:, k], turn], axis=1)
        expected[~recorded["valid"][:, k]] = np.nan
        np.testing.assert_allclose(table[own["name"]].to_numpy(), expected)


def test_bids_says_from_when_and_how_long_every_recording_lasted(tmp_path: Path) -> None:
    recording = gaze_session(tmp_path / "d", own=(BELT,), late_s={"belt": 0.25, "gaze": 0.5})
    export_bids([recording], tmp_path / "b", task="stare", dataset_name="Stare", about=ABOUT)
    folder = tmp_path / "b" / "sub-P01" / "ses-001"
    stem = "sub-P01_ses-001_task-stare"
    # The head is the first to be recorded, 90 poses a second for a second: 89 steps.
    for name, start_s in (("belt", 0.25), ("eye1", 0.5), ("eye3", 0.5)):
        path = folder / "beh" / f"{stem}_run-1_recording-{name}_physio.json"
        notes = json.loads(path.read_text("utf-8"))
        packed = pd.read_csv(path.with_suffix(".tsv.gz"), sep="\t", names=notes["Columns"])
        assert start_s == notes["StartTime"] == packed["timestamp"][0]
    path = folder / "motion" / f"{stem}_tracksys-HMD_run-1_motion.json"
    assert 89 / 90 == pytest.approx(json.loads(path.read_text("utf-8"))["RecordingDuration"])


def test_bids_refuses_a_mixture_of_simulated_and_real(tmp_path: Path) -> None:
    both = [gaze_session(tmp_path / "d", is_simulated=s) for s in (True, False)]
    with pytest.raises(RecordingError, match="analyse them separately"):
        export_bids(both, tmp_path / "b", task="stare", dataset_name="Stare")


def test_bids_export_repeats_byte_for_byte(tmp_path: Path) -> None:
    recording = gaze_session(tmp_path / "d")
    for name in ("a", "b"):
        export_bids([recording], tmp_path / name, task="stare", dataset_name="Stare")
    files = [p.relative_to(tmp_path / "a") for p in (tmp_path / "a").rglob("*") if p.is_file()]
    assert len(files) > 10
    for file in files:
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()
    packed = next(p for p in files if p.suffix == ".gz")
    assert gzip.decompress((tmp_path / "a" / packed).read_bytes())


def test_bids_says_who_made_it_where_and_under_which_licence(tmp_path: Path) -> None:
    recording = gaze_session(tmp_path / "d")
    export_bids([recording], tmp_path / "b", task="stare", dataset_name="Stare", about=ABOUT)
    said = json.loads((tmp_path / "b" / "dataset_description.json").read_text("utf-8"))
    assert ("CC-BY-4.0", ["Ada One", "Bo Two"]) == (said["License"], said["Authors"])
    readme = (tmp_path / "b" / "README.md").read_text("utf-8")
    assert "People looked at faces." in readme
    assert "Everybody sat." in readme
    stem = "sub-P01/ses-001/motion/sub-P01_ses-001_task-stare_tracksys-HMD_run-1_motion.json"
    notes = json.loads((tmp_path / "b" / stem).read_text("utf-8"))
    assert ("Institute", "People looked at faces.") == (
        notes["InstitutionName"],
        notes["TaskDescription"],
    )


SCREEN = {
    "width_m": 0.531, "height_m": 0.299, "width_px": 1920, "height_px": 1080,
    "distance_m": 0.65, "rate_hz": 60.0, "head": "fixed",
}  # fmt: skip


@pytest.mark.parametrize(("head", "held"), [("fixed", "chin-rest"), ("tracked", "none")])
def test_bids_describes_the_screen_and_how_the_head_was_held(
    head: str, held: str, tmp_path: Path
) -> None:
    recording = gaze_session(tmp_path / "d", screen={**SCREEN, "head": head})
    export_bids([recording], tmp_path / "b", task="stare", dataset_name="Stare", about=ABOUT)
    folder = tmp_path / "b" / "sub-P01" / "ses-001"
    notes = json.loads(
        (folder / "beh" / "sub-P01_ses-001_task-stare_run-1_events.json").read_text()
    )
    shown = notes["StimulusPresentation"]
    assert (0.65, [0.531, 0.299]) == (shown["ScreenDistance"], shown["ScreenSize"])
    assert ([1920, 1080], ["top", "left"]) == (shown["ScreenResolution"], shown["ScreenOrigin"])
    assert (held, 60.0) == (shown["HeadStabilization"], shown["ScreenRefreshRate"])
    motion = sorted(p.name for p in folder.glob("motion/*_motion.tsv"))
    tracked = ["sub-P01_ses-001_task-stare_tracksys-eyetracker_run-1_motion.tsv"]
    assert (tracked if head == "tracked" else []) == motion
    assert [] == issues_of(tmp_path / "b")


def test_bids_holds_a_labs_own_streams_with_their_units(tmp_path: Path) -> None:
    recording = gaze_session(tmp_path / "d", own=(BELT, KNOB))
    export_bids([recording], tmp_path / "b", task="stare", dataset_name="Stare", about=ABOUT)
    beh = tmp_path / "b" / "sub-P01" / "ses-001" / "beh"
    stem = "sub-P01_ses-001_task-stare_run-1"
    notes = json.loads((beh / f"{stem}_recording-belt_physio.json").read_text("utf-8"))
    table = pd.read_csv(
        beh / f"{stem}_recording-belt_physio.tsv.gz", sep="\t", names=notes["Columns"]
    )
    assert 32 == len(table)
    assert {3.5} == set(table["breath_01"])
    assert "1" == notes["breath_01"]["Units"]
    assert 32.0 == notes["SamplingFrequency"]
    events = pd.read_csv(beh / f"{stem}_events.tsv", sep="\t")
    assert 2 == (events["trial_type"] == "knob").sum()
    assert [3.5, 3.5] == events["knob_turn_deg"].dropna().tolist()


def test_bids_keeps_who_stood_where_once_among_the_stimuli(tmp_path: Path) -> None:
    agents = [{"identifier": "a1", "head_centre_m": [0.0, 1.2, -2.0]}]
    crowd = {"position_m": [[1.0, 2.0]]}
    clock = SimClock()
    with create_session(tmp_path / "d", probe_manifest()) as folder:
        recorder = new_recorder(folder, clock)
        recorder.append(probe_batch(0, 10))
        for number, shown in enumerate((agents, [], agents)):
            recorder.event("scene", number, scene=number, scene_name="hall", agents=shown)
        recorder.event("crowd", 9, people=json.dumps(crowd))
        folder.end_part(clock, recorder.close("complete"))
        recording = Recording(folder.path)
    export_bids([recording], tmp_path / "b", task="probe", dataset_name="Probe", about=ABOUT)
    stem = "sub-P01/ses-001/beh/sub-P01_ses-001_task-probe_run-1_events"
    events = pd.read_csv(tmp_path / "b" / f"{stem}.tsv", sep="\t", na_values="n/a")
    assert not {"agents", "people"} & set(events.columns)
    named = events["stim_file"].tolist()
    assert [True, False, True, True] == [isinstance(name, str) for name in named]
    assert named[0] == named[2] != named[3]
    files = {p.name: json.loads(p.read_text("utf-8")) for p in (tmp_path / "b/stimuli").iterdir()}
    assert {named[0], named[3]} == set(files)
    assert {"scene_name": "hall", "agents": agents} == files[named[0]]
    assert {"people": crowd} == files[named[3]]
    assert [] == issues_of(tmp_path / "b")


ABOUT = DatasetAbout(
    description="People looked at faces.",
    methods=("Everybody sat.",),
    authors=("Ada One", "Bo Two"),
    licence="CC-BY-4.0",
    how_to_acknowledge="Cite the paper.",
    funding=("A fund",),
    ethics_approvals=("Board 7",),
    references=("https://example.org",),
    institution="Institute",
    institution_address="Street 1",
    department="Department",
)
VALIDATOR = Path(sys.executable).with_name("bids-validator-deno")
BEYOND_US = {"HEDVersion", "SourceDatasets", "CogAtlasID", "CogPOID"}
"""Recommended keys that no recording can answer: tags and terms of ontologies a lab may add, and
where the session folders lie."""


def issues_of(data_set: Path) -> list[str]:
    """Return what the official validator says, but for what no recording can answer."""
    done = subprocess.run([str(VALIDATOR), "--json", str(data_set)], capture_output=True, text=True)
    return [
        f"{i['severity']} {i['code']} {i.get('subCode', '')} {i.get('location', '')}"
        for i in json.loads(done.stdout)["issues"]["issues"]
        if i["severity"] == "error" or i.get("subCode") not in BEYOND_US
    ]


def test_official_validator_finds_nothing_that_could_be_mended(tmp_path: Path) -> None:
    recording = gaze_session(tmp_path / "d", own=(BELT, KNOB))
    export_bids([recording], tmp_path / "b", task="stare", dataset_name="Stare", about=ABOUT)
    assert [] == issues_of(tmp_path / "b")


@pytest.mark.parametrize(
    ("device_ms", "host_ms", "expected_hz"),
    [
        ([0, 8, 16, 24, 32, 40], [5, 5, 5, 30, 30, 45], 125.0),  # arrived in bunches
        ([0, 8, 17, 25, 33, 42, 50], [0] * 7, 120.0),  # coarse stamps
        ([0, 10, 20, 520, 530, 540], [0, 10, 20, 520, 530, 540], 100.0),  # a gap
        ([0, 10, 5, 20, 30], [0, 10, 20, 30, 40], 100.0),  # one stamp that went back
        ([NO_TIME] * 4, [0, 20, 40, 60], 50.0),  # no clock of its own
        ([7], [7], 0.0),
    ],
)
def test_a_streams_rate_is_that_of_its_samples_not_of_their_arrival(
    device_ms: list[int], host_ms: list[int], expected_hz: float
) -> None:
    device = [t if t == NO_TIME else t * 1_000_000 for t in device_ms]
    arrays = {
        "t_device_ns": np.array(device, np.int64),
        "t_host_ns": np.array(host_ms, np.int64) * 1_000_000,
    }
    assert rate_hz(arrays) == pytest.approx(expected_hz, rel=0.01)
