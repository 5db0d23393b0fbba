"""LSL outlets: over the loopback in a process of its own, because LSL's scope is per process."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from visavis.devices.contracts import FRAME_TIMING, body_schema
from visavis.devices.drivers.lsl.outlet import LslOutlets, LslScope
from visavis.lab.clock import SimClock
from visavis.lab.schema import SampleBatch, empty_values
from visavis.lab.xdf_channels import channels_of, flat_values

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def received():
    pytest.importorskip("pylsl", reason="pip install pylsl")
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    environment.pop("LSLAPICFG", None)
    child = subprocess.run(
        [sys.executable, "-m", "tests.devices.lsl_outlet_child", str(os.getpid())],
        capture_output=True,
        text=True,
        timeout=60,
        env=environment,
        cwd=ROOT,
    )
    assert child.returncode == 0, child.stderr
    return json.loads(child.stdout.splitlines()[-1])


def test_samples_arrive_with_their_own_time(received):
    # The clock difference is measured to within a few microseconds; stamps are doubles.
    assert np.abs(received["late_ms"]).max() < 1.0
    assert abs(received["event_late_ms"]) < 1.0


def test_values_arrive_and_missing_stays_missing(received):
    row = dict(zip([c["label"] for c in channels(received)], received["rows"][0], strict=True))
    assert row["direction_head_X"] == pytest.approx(0.6)
    assert row["left_pupil_mm"] is None


def channels(received):
    from xml.etree import ElementTree

    listed = ElementTree.fromstring(received["xml"]).findall("./desc/channels/channel")  # noqa: S314 - our own outlet's
    return [{field.tag: field.text for field in c} for c in listed]


def test_metadata_bear_the_xdf_names_and_the_mark_of_simulation(received):
    assert received["type"] == "Gaze"
    assert channels(received)[0] == {
        "label": "direction_head_X",
        "eye": "both",
        "type": "DirectionX",
        "unit": "normalized",
        "coordinate_system": "head-space",
    }
    assert "<is_simulated>true</is_simulated>" in received["xml"]


def test_the_session_keeps_other_labs_out(received):
    assert received["session"].startswith("visavis-test-")


def test_events_arrive_as_json(received):
    assert json.loads(received["event"]) == {"event": "trial_start", "trial_id": "T01"}


def test_a_body_goes_out_by_our_outlet_and_comes_in_by_our_driver(received):
    assert received["body"] == [[-0.5, 1.25, -0.25]]
    assert received["body_valid"] == [True]


LOOK = """
import sys, pylsl
found = pylsl.resolve_byprop("source_id", sys.argv[1], timeout=float(sys.argv[2]))
print([stream.name() for stream in found])
"""
"""A program of its own, as LabRecorder is: it has LSL's settings and nothing of ours."""


@pytest.mark.parametrize(
    ("ours", "theirs", "expected"),
    [
        ("", "", ["visavis events"]),
        ("visavis-floor-2", "", []),
        ("visavis-floor-2", "visavis-floor-2", ["visavis events"]),
    ],
)
def test_another_program_sees_what_we_send_if_its_session_is_ours(tmp_path, ours, theirs, expected):
    pytest.importorskip("pylsl", reason="pip install pylsl")
    near = "[multicast]\nResolveScope = machine\n[lab]\nKnownPeers = {127.0.0.1}\n"
    settings = {"ours": near, "theirs": near + f"SessionID = {theirs}\n" if theirs else near}
    environments = {}
    for name, text in settings.items():
        path = tmp_path / f"{name}.cfg"
        path.write_text(text)
        environments[name] = {**os.environ, "PYTHONPATH": str(ROOT), "LSLAPICFG": str(path)}
    source = f"study {os.getpid()}"
    with subprocess.Popen(
        [sys.executable, "-m", "tests.devices.lsl_announcing_child", source, ours],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=environments["ours"],
        cwd=tmp_path,
    ) as announcer:
        assert announcer.stdout.readline() == "announced\n"
        look_s = "20" if expected else "2"
        seen = subprocess.run(
            [sys.executable, "-c", LOOK, f"{source}-events", look_s],
            capture_output=True,
            text=True,
            timeout=60,
            env=environments["theirs"],
            cwd=tmp_path,
        )
        announcer.stdin.close()
    assert (seen.returncode, seen.stdout.strip()) == (0, str(expected)), seen.stderr


@pytest.mark.parametrize(("given", "kept"), [("stare-2026", "stare-2026"), ("a;b\n[x]", "abx")])
def test_a_session_name_cannot_break_the_configuration(given, kept):
    assert f"SessionID = {kept}\n" in LslScope(given).configuration()


class FakeLsl:
    """Keep what is pushed; its clock runs 7 s ahead of the session's."""

    cf_double64, cf_string = 2, 3

    def __init__(self, clock):
        self.clock, self.pushed = clock, []

    def set_config_content(self, text):
        self.text = text

    def local_clock(self):
        return self.clock.now_ns() / 1e9 + 7.0

    def StreamInfo(self, name, *args):  # noqa: N802 - the library's name
        return FakeInfo(name)

    def StreamOutlet(self, info, chunk):  # noqa: N802 - the library's name
        return FakeOutlet(info.name, self.pushed)


class FakeInfo:
    def __init__(self, name):
        self.name = name

    def desc(self):
        return self

    def append_child(self, name):
        return self

    def append_child_value(self, name, value):
        return self


class FakeOutlet:
    def __init__(self, name, pushed):
        self.name, self.pushed = name, pushed

    def push_sample(self, row, stamp_s):
        self.pushed.append((self.name, row, stamp_s))


def outlets_on(lsl, clock, **options):
    streams = {"headset": (FRAME_TIMING,)}
    return LslOutlets(
        streams, LslScope("s"), clock, source="x", is_simulated=True, lsl=lsl, **options
    )


def timing_batch(device_ns, host_ns):
    values = empty_values(FRAME_TIMING, 1)
    numbers, device, host = np.arange(1), np.array([device_ns]), np.array([host_ns])
    return SampleBatch(FRAME_TIMING, numbers, device, host, values)


def test_without_an_offset_the_arrival_is_the_stamp():
    clock = SimClock()
    lsl = FakeLsl(clock)
    outlets_on(lsl, clock).take("headset", timing_batch(10**15, 2_000_000_000))
    assert lsl.pushed[0][2] == pytest.approx(9.0)


def test_a_sample_never_bears_a_time_after_its_arrival():
    clock = SimClock()
    lsl = FakeLsl(clock)
    outlets = outlets_on(lsl, clock, offset_of=lambda role: 0)
    outlets.take("headset", timing_batch(3_000_000_000, 2_000_000_000))
    assert lsl.pushed[0][2] == pytest.approx(9.0)


def test_a_stream_nobody_announced_is_left_out():
    clock = SimClock()
    lsl = FakeLsl(clock)
    outlets_on(lsl, clock).take("other", timing_batch(0, 0))
    assert lsl.pushed == []


def test_after_closing_events_go_nowhere():
    clock = SimClock()
    lsl = FakeLsl(clock)
    outlets = outlets_on(lsl, clock)
    outlets.close()
    outlets.event("late", 0)
    assert lsl.pushed == []


def test_every_number_of_a_body_has_a_channel():
    schema = body_schema(("hips", "head"), 60.0)
    values = empty_values(schema, 2)
    zeros = np.zeros(2, np.int64)
    batch = SampleBatch(schema, np.arange(2), zeros, zeros, values)
    assert flat_values(batch).shape == (2, len(channels_of(schema)))
    assert len({c.label for c in channels_of(schema)}) == len(channels_of(schema))
