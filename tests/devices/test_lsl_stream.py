"""Any LSL stream is recorded; pylsl's own outlets are the other end, in a process of its own."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.devices.gaze_rigs import GazeRig, let_pass_on
from tests.faults.sessions import events, lab, perform
from visavis.devices import conformance
from visavis.devices.drivers.lsl.gaze_codec import StreamInfo
from visavis.devices.drivers.lsl.stream import LslStream, schema_of
from visavis.devices.registry import driver_spec
from visavis.devices.sim.lsl.stream import LslStreamSimulator
from visavis.lab.clock import NS_PER_S
from visavis.lab.clock_fit import offset_ns
from visavis.lab.config import DeviceConfig

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def received(tmp_path_factory):
    pytest.importorskip("pylsl", reason="pip install pylsl")
    folder = tmp_path_factory.mktemp("lsl")
    settings = folder / "lsl_api.cfg"
    settings.write_text("[multicast]\nResolveScope = machine\n[lab]\nKnownPeers = {127.0.0.1}\n")
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "LSLAPICFG": str(settings)}
    child = subprocess.run(
        [sys.executable, "-m", "tests.devices.lsl_stream_child", str(os.getpid())],
        capture_output=True,
        text=True,
        timeout=60,
        env=environment,
        cwd=folder,
    )
    assert child.returncode == 0, child.stderr
    return json.loads(child.stdout.splitlines()[-1])


def test_numbers_have_the_columns_and_units_their_sender_names(received):
    expected = [["fz", "uV"], ["cz", "uV"], ["pz", "uV"]]
    assert received["eeg"]["fields"] == expected
    first = received["eeg"]["first"]
    assert (first[0], first[2]) == (-first[1], 0.5)


def test_stamps_stay_the_senders_and_offsets_are_kept(received):
    assert received["eeg"]["stamped_as_sent"]
    assert received["eeg"]["pairs"] >= 3


def test_markers_keep_their_text(received):
    assert received["marks"]["first"].startswith("stimulus ")
    assert received["marks"]["first"].endswith(" ä")
    assert received["marks"]["stamped_as_sent"]


def test_simulated_stream_delivers_its_numbers_with_offsets():
    rig = GazeRig(LslStream, LslStreamSimulator, rate_hz=250.0).start().run(1.0)

    t_s = (rig.stamps("t_device_ns") + offset_ns(rig.driver.clock_pairs())) / NS_PER_S
    expected = 2 * np.sin(2 * np.pi * 2 * t_s)
    assert abs(rig.column("cz") - expected).max() < 0.02
    assert rig.driver.health().gaps == 0
    assert rig.messages() == ""


def test_contract_is_kept_on_a_memory_wire():
    from tests.devices.bodies import FixatingBody
    from visavis.devices.transports import MemoryTransport
    from visavis.lab.clock import SimClock

    clock = SimClock()

    def make():
        peer = LslStreamSimulator(FixatingBody(), clock=clock, seed=1)
        return LslStream("eeg", MemoryTransport(peer, clock), clock)

    conformance.check_lifecycle(make, let_pass_on(clock))
    conformance.check_batches(make, let_pass_on(clock))


@pytest.mark.parametrize(
    ("labels", "expected"),
    [
        (["Fz", "Fz"], ["fz", "fz_"]),
        (["", "Ä 1"], ["channel_1", "1"]),
        (["EDA_ms"], ["eda_ms_"]),
    ],
)
def test_any_labels_make_columns_of_their_own(labels, expected):
    channels = tuple({"label": label, "unit": "microsiemens"} for label in labels)
    info = StreamInfo("x", "", 10.0, len(labels), channels)

    assert [f.name for f in schema_of(info, "eda").fields] == expected


def test_a_role_the_lab_named_is_recorded_with_its_clock_beside_a_study(tmp_path):
    config = lab(tmp_path)
    options = driver_spec("lsl_stream").options(rate_hz=100.0, drift_ppm=50.0).model_dump()
    eeg = DeviceConfig(role="eeg", driver="lsl_stream", simulated=True, options=options)
    recording = perform(config.model_copy(update={"devices": {**config.devices, "eeg": eeg}}))

    arrays = recording.stream_arrays("eeg")
    assert recording.stream_schema("eeg").fields[1].unit == "uV"
    assert np.diff(arrays["t_device_ns"]).max() < 10_100_000
    told = [e for e in events(recording, "clock_exchanges") if e["role"] == "eeg"]
    assert sum(len(e["send_device_receive_ns"]) for e in told) >= 5
