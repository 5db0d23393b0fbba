"""XDF files of recordings, read by pyxdf."""

import json

import numpy as np
import pytest

from tests.recording.sessions import PROBE, probe_manifest, record_session
from visavis.lab.clock import NS_PER_S, SimClock
from visavis.lab.errors import RecordingError
from visavis.lab.schema import Field, SampleBatch, StreamSchema, empty_values
from visavis.lab.xdf_channels import channels_of
from visavis.recording.export import export_session
from visavis.recording.folder import create_session
from visavis.recording.reader import Recording
from visavis.recording.writer import Recorder

pyxdf = pytest.importorskip("pyxdf", reason="pip install pyxdf")

OFFSET_NS = 2_500_000_000
DRIFT_PPM = 20.0
GAZE = StreamSchema(
    "gaze",
    (
        Field("direction_head", "f4", "1", "head", (3,)),
        Field("left_pupil_mm", "f4", "mm"),
        Field("confidence_01", "f4", "1"),
        Field("valid", "?", ""),
    ),
    100.0,
)


def loaded(path, **options):
    streams, header = pyxdf.load_xdf(str(path), **options)
    return {s["info"]["name"][0]: s for s in streams}, header


def record_gaze(root, seconds=60):
    """Record gaze whose device clock is 2.5 s behind at first and runs 20 ppm fast."""
    clock = SimClock()
    with create_session(root, probe_manifest()) as folder:
        part = folder.begin_part(clock)
        recorder = Recorder(part, clock, threaded=False, max_batch_ns=NS_PER_S, is_simulated=True)
        recorder.declare(GAZE)
        host_ns = np.arange(seconds * 100, dtype=np.int64) * 10_000_000 + NS_PER_S
        device_ns = device_of(host_ns)
        values = empty_values(GAZE, host_ns.size)
        values["direction_head"] = [0.6, 0.0, -0.8]
        values["left_pupil_mm"] = np.nan
        values["confidence_01"] = np.linspace(0, 1, host_ns.size)
        values["valid"] = True
        for first in range(0, host_ns.size, 100):
            part = slice(first, first + 100)
            seq = np.arange(first, first + 100)
            recorder.append(
                SampleBatch(GAZE, seq, device_ns[part], host_ns[part] + 8_000_000, values[part])
            )
            clock.sleep_until_ns(int(host_ns[part][-1]))
        exchanges = [
            [int(t), int(device_of(np.array([t + 100_000]))[0]), int(t + 200_000)]
            for t in range(NS_PER_S, seconds * NS_PER_S, NS_PER_S // 2)
        ]
        recorder.event(
            "clock_exchanges",
            clock.now_ns(),
            role="eye_tracker",
            send_device_receive_ns=exchanges,
        )
        folder.end_part(clock, recorder.close("complete"))
        return folder.path, host_ns


def device_of(host_ns):
    return host_ns - OFFSET_NS + np.rint(host_ns * DRIFT_PPM * 1e-6).astype(np.int64)


def test_device_times_come_back_on_the_session_clock(tmp_path):
    session, host_ns = record_gaze(tmp_path)
    (path,) = export_session(session, "xdf", tmp_path / "out")
    streams, _ = loaded(path, dejitter_timestamps=False)
    error_ms = (streams["gaze"]["time_stamps"] - host_ns / NS_PER_S) * 1e3
    assert np.abs(error_ms).max() < 0.02


def test_raw_device_times_are_kept(tmp_path):
    session, host_ns = record_gaze(tmp_path, seconds=5)
    (path,) = export_session(session, "xdf", tmp_path / "out")
    streams, _ = loaded(path, synchronize_clocks=False, dejitter_timestamps=False)
    np.testing.assert_allclose(
        streams["gaze"]["time_stamps"], device_of(host_ns) / NS_PER_S, atol=1e-9
    )


def test_gaze_channels_bear_the_metadata_names(tmp_path):
    session, _ = record_gaze(tmp_path, seconds=2)
    (path,) = export_session(session, "xdf", tmp_path / "out")
    streams, header = loaded(path)
    info = streams["gaze"]["info"]
    assert header["info"]["version"] == ["1.0"]
    assert (info["type"], info["channel_format"]) == (["Gaze"], ["double64"])
    desc = info["desc"][0]
    assert desc["is_simulated"] == ["true"]
    channels = [{k: v[0] for k, v in c.items()} for c in desc["channels"][0]["channel"]]
    assert channels[0] == {
        "label": "direction_head_X",
        "eye": "both",
        "type": "DirectionX",
        "unit": "normalized",
        "coordinate_system": "head-space",
    }
    assert channels[3] == {
        "label": "left_pupil_mm",
        "eye": "left",
        "type": "PupilDiameter",
        "unit": "millimeters",
    }
    assert [c["type"] for c in channels[4:]] == ["Confidence", "Valid"]


def test_values_are_exact_and_missing_stays_missing(tmp_path):
    session = record_session(tmp_path)
    (path,) = export_session(session, "xdf", tmp_path / "out")
    streams, _ = loaded(path, dejitter_timestamps=False)
    table = Recording(session).stream("probe")
    data = streams["probe"]["time_series"]
    assert data.shape == (len(table), len(channels_of(PROBE)))
    columns = [c for c in table.columns if c not in ("seq", "t_device_ns", "t_host_ns")]
    columns.remove("recording_part")
    np.testing.assert_array_equal(data, table[columns].to_numpy(np.float64))
    assert np.isnan(data).any()
    assert streams["probe"]["footer"]["info"]["sample_count"] == [str(len(table))]


def test_events_and_trials_are_strings_on_the_session_clock(tmp_path):
    session = record_session(tmp_path)
    (path,) = export_session(session, "xdf", tmp_path / "out")
    streams, _ = loaded(path)
    events = Recording(session).events()
    told = [json.loads(row[0]) for row in streams["events"]["time_series"]]
    assert [e["event"] for e in told] == events["name"].tolist()
    assert told[0]["note"] == "é"
    np.testing.assert_allclose(
        streams["events"]["time_stamps"], events["t_ns"].to_numpy() / NS_PER_S
    )
    trials = [json.loads(row[0]) for row in streams["trials"]["time_series"]]
    assert [t["trial_id"] for t in trials] == ["T00", "T01", "T02"]
    assert trials[0]["first_ms"] is None


def test_a_stream_on_a_foreign_clock_without_exchanges_bears_its_arrivals(tmp_path):
    clock = SimClock()
    with create_session(tmp_path, probe_manifest()) as folder:
        recorder = Recorder(
            folder.begin_part(clock),
            clock,
            threaded=False,
            max_batch_ns=NS_PER_S,
            is_simulated=True,
        )
        recorder.declare(GAZE)
        host_ns = np.arange(50, dtype=np.int64) * 10_000_000
        recorder.append(
            SampleBatch(GAZE, np.arange(50), host_ns + 10**15, host_ns, empty_values(GAZE, 50))
        )
        folder.end_part(clock, recorder.close("complete"))
    (path,) = export_session(folder.path, "xdf", tmp_path / "out")
    streams, _ = loaded(path, dejitter_timestamps=False)
    np.testing.assert_allclose(streams["gaze"]["time_stamps"], host_ns / NS_PER_S)
    assert streams["gaze"]["info"]["desc"][0]["time_stamps"] == ["arrival"]


def test_nothing_is_overwritten(tmp_path):
    session = record_session(tmp_path)
    export_session(session, "xdf", tmp_path / "out")
    with pytest.raises(RecordingError, match="exists already"):
        export_session(session, "xdf", tmp_path / "out")


def test_a_stream_without_samples_is_announced_and_empty(tmp_path):
    clock = SimClock()
    with create_session(tmp_path, probe_manifest()) as folder:
        recorder = Recorder(
            folder.begin_part(clock),
            clock,
            threaded=False,
            max_batch_ns=NS_PER_S,
            is_simulated=True,
        )
        recorder.declare(GAZE)
        folder.end_part(clock, recorder.close("complete"))
    (path,) = export_session(folder.path, "xdf", tmp_path / "out")
    streams, _ = loaded(path)
    assert streams["gaze"]["footer"]["info"]["sample_count"] == ["0"]
    assert len(streams["gaze"]["time_stamps"]) == 0
