"""OpenXR gaze and headset on the genuine loader over the simulated runtime, and on captures."""

import contextlib
import ctypes
import subprocess

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.fuzz.codecs import gaze_is_sound
from tests.devices.bodies import FixatingBody
from tests.devices.openvr_rigs import passer
from visavis.devices.conformance import (
    check_batches,
    check_eye_tracker,
    check_headset,
    check_lifecycle,
)
from visavis.devices.contracts import DeviceState
from visavis.devices.drivers.openxr import eyes
from visavis.devices.drivers.openxr.gaze import OpenXrGaze
from visavis.devices.drivers.openxr.headset import OpenXrHeadset
from visavis.devices.drivers.openxr.runtime_time import PERFORMANCE_COUNTER
from visavis.devices.faults import FaultSchedule
from visavis.devices.sim.native_build import find_compiler
from visavis.devices.sim.openxr import runtime as runtime_module
from visavis.devices.sim.openxr.runtime import EPOCH_NS, SimulatedXrRuntime
from visavis.devices.transports import MemoryTransport, Message
from visavis.devices.wirelog import ReplayTransport, TeeTransport
from visavis.lab.clock import NS_PER_S, SimClock
from visavis.lab.errors import DeviceDisconnected, DeviceError, DeviceNotFound
from visavis.lab.geometry import angle_deg, quat_from_yaw_pitch_deg


@contextlib.contextmanager
def simulated(*faults, body=None, per_eye="none", **options):
    pytest.importorskip("xr", reason="pip install pyopenxr")
    if find_compiler() is None:
        pytest.skip("the simulated OpenXR runtime needs a C compiler: apt-get install gcc")
    clock = SimClock()
    body = body if body is not None else FixatingBody(10.0, 5.0)
    schedule = FaultSchedule.from_config(faults)
    with SimulatedXrRuntime(body, clock, faults=schedule, **options) as runtime:
        runtime.eyes.tell_by(per_eye)
        yield runtime, clock


@contextlib.contextmanager
def running(make, *faults, **options):
    with simulated(*faults, **options) as (runtime, clock):
        device = make("device", runtime.library().transport(), clock)
        device.open(1.0)
        batches = []
        device.start(batches.append)
        try:
            yield device, runtime, clock, batches
        finally:
            device.close()


def poll(device, clock, seconds, step_s=1 / 90):
    for _ in range(round(seconds / step_s)):
        clock.sleep_until_ns(clock.now_ns() + round(step_s * NS_PER_S))
        with contextlib.suppress(DeviceDisconnected):
            device.poll(0.0)


def frames(headset, n):
    found = []
    for _ in range(n):
        found.append(headset.wait_frame())
        headset.submit(found[-1], ())
        with contextlib.suppress(DeviceDisconnected):
            headset.poll(0.0)
    return found


def column(batches, name, stream="gaze"):
    return np.concatenate([b.values[name] for b in batches if b.schema.name == stream])


def test_gaze_keeps_the_contract_on_runtime_and_capture(tmp_path):
    path = tmp_path / "gaze.wire"
    with simulated() as (runtime, clock):

        def make():
            return OpenXrGaze("eyes", runtime.library().transport(), clock)

        for check in (check_lifecycle, check_batches, check_eye_tracker):
            check(make, passer(clock))
        teed = OpenXrGaze("eyes", TeeTransport(runtime.library().transport(), path, clock), clock)
        check_batches(lambda: teed, passer(clock), seconds=1.5)
    clock = SimClock()

    def replay():
        return OpenXrGaze("eyes", ReplayTransport(path, clock), clock)

    for check in (check_lifecycle, check_batches, check_eye_tracker):
        check(replay, passer(clock))


def test_headset_keeps_the_contract_on_runtime_and_capture(tmp_path):
    path = tmp_path / "headset.wire"
    with simulated() as (runtime, clock):

        def make():
            return OpenXrHeadset("headset", runtime.library().transport(), clock)

        check_lifecycle(make, passer(clock))
        check_headset(make)
        wire = TeeTransport(runtime.library().transport(), path, clock)
        check_headset(lambda: OpenXrHeadset("headset", wire, clock), n_frames=40)
    clock = SimClock()
    check_headset(lambda: OpenXrHeadset("headset", ReplayTransport(path, clock), clock))


@pytest.mark.parametrize(("yaw", "pitch"), [(0, 0), (25, -10), (-30, 20), (0, 40)])
def test_gaze_is_the_bodys_within_the_head(yaw, pitch):
    body = FixatingBody(yaw, pitch, distance_m=100.0)
    with running(OpenXrGaze, body=body) as (device, _, clock, batches):
        poll(device, clock, 0.2)
        found = column(batches, "direction_head").astype(np.float64)
        assert angle_deg(found, np.broadcast_to(body.direction, found.shape)).max() < 0.05
        assert column(batches, "valid").all()
        assert np.isnan(column(batches, "left_pupil_mm")).all()


def test_the_manifest_says_that_gaze_may_be_smoothed():
    with running(OpenXrGaze) as (device, _, _, _):
        assert "may_be_smoothed" in device.info.capabilities
        assert device.info.is_simulated


def test_the_samples_own_time_is_kept_and_a_sample_comes_once():
    with running(OpenXrGaze, gaze_rate_hz=60.0) as (device, _, clock, batches):
        poll(device, clock, 1.0, step_s=1 / 240)
        stamps = np.concatenate([b.t_device_ns for b in batches]) - EPOCH_NS
        assert (stamps % round(NS_PER_S / 60) == 0).all()
        assert (np.diff(stamps) > 0).all()
        pairs = device.clock_pairs()
        assert pairs[-1].device_ns - pairs[-1].host_send_ns == EPOCH_NS


def test_windows_runtimes_tell_the_time_by_the_performance_counter():
    body = FixatingBody(10.0, 5.0)
    with running(OpenXrGaze, body=body, time_extension=PERFORMANCE_COUNTER) as (
        device,
        runtime,
        clock,
        batches,
    ):
        poll(device, clock, 0.2)
        assert "xrConvertWin32PerformanceCounterToTimeKHR" in runtime.calls
        assert "xrConvertTimespecTimeToTimeKHR" not in runtime.calls
        pairs = device.clock_pairs()
        off_ns = [pair.device_ns - pair.host_send_ns - EPOCH_NS for pair in pairs]
        assert -100 < min(off_ns) <= max(off_ns) <= 0
        assert column(batches, "valid").all()


def test_without_a_sample_time_the_time_of_asking_stands():
    with running(OpenXrGaze, tells_sample_time=False) as (device, _, clock, batches):
        poll(device, clock, 0.1)
        stamps = np.concatenate([b.t_device_ns for b in batches]) - EPOCH_NS
        arrivals = np.concatenate([b.t_host_ns for b in batches])
        assert stamps.tolist() == arrivals.tolist()


def test_bindings_come_before_attaching_and_the_space_comes_after():
    with running(OpenXrGaze) as (_, runtime, _, _):
        order = [
            "xrSuggestInteractionProfileBindings",
            "xrAttachSessionActionSets",
            "xrCreateActionSpace",
        ]
        assert list(dict.fromkeys(c for c in runtime.calls if c in order)) == order
        assert max(i for i, c in enumerate(runtime.calls) if c == order[0]) < runtime.calls.index(
            order[1]
        )


def test_lost_eyes_are_nan_never_a_direction():
    fault = {"kind": "eyes_lost", "start_s": 0.1}
    with running(OpenXrGaze, fault) as (device, _, clock, batches):
        poll(device, clock, 2.0)
        assert not column(batches, "valid")[-5:].any()
        assert np.isnan(column(batches, "direction_head")[-5:]).all()
        assert "neither eye is seen" in " ".join(f.message for f in device.check())


@pytest.mark.parametrize(
    ("fault", "options", "words"),
    [
        ({"kind": "late_start"}, {}, "finds no headset"),
        ({"kind": "version", "text": "old"}, {}, "older than OpenXR 1.0"),
        ({"kind": "loss"}, {"supports_gaze": False}, "offers no eye gaze"),
    ],
)
def test_a_runtime_that_cannot_is_not_found_with_what_to_do(fault, options, words):
    with simulated(fault, **options) as (runtime, clock):
        device = OpenXrGaze("eyes", runtime.library().transport(), clock)
        with pytest.raises(DeviceNotFound, match=words) as refusal:
            device.open(1.0)
        assert refusal.value.remedy
        assert device.state is DeviceState.CLOSED


def test_head_poses_are_the_bodys_at_the_predicted_time():
    with running(OpenXrHeadset) as (headset, _, _, batches):
        found = frames(headset, 10)
        expected = [quat_from_yaw_pitch_deg(f.predicted_display_ns * 1e-9) for f in found]
        np.testing.assert_allclose(
            column(batches, "orientation_wxyz", "head"), np.array(expected), atol=1e-6
        )
        assert all(f.predicted_display_ns > f.t_ns for f in found)


def test_a_headless_session_refuses_images_and_says_what_to_set():
    with running(OpenXrHeadset) as (headset, _, _, _):
        frame = frames(headset, 1)[0]
        with pytest.raises(DeviceError, match=r"display\.show"):
            headset.submit(frame, (1, 2))


def test_a_session_without_the_focus_is_a_fault_until_it_has_it_back():
    fault = {"kind": "standby", "start_s": 0.2, "duration_s": 0.3}
    with running(OpenXrHeadset, fault) as (headset, _, _, _):
        frames(headset, 5)
        assert not headset.check()
        frames(headset, 20)
        assert "has not got the focus" in " ".join(f.message for f in headset.check())
        frames(headset, 30)
        assert not headset.check()


def test_a_lost_session_is_told_and_frames_go_on_until_it_is_back():
    fault = {"kind": "disconnect", "start_s": 0.2, "duration_s": 0.5}
    with running(OpenXrHeadset, fault) as (headset, _, _, batches):
        frames(headset, 30)
        assert headset.state is DeviceState.FAULT
        assert "lost the OpenXR session" in headset.check()[0].message
        frames(headset, 150)
        assert headset.state is DeviceState.STREAMING
        assert column(batches, "valid", "head")[-1]
        seqs = np.concatenate([b.seq for b in batches if b.schema.name == "head"])
        assert (np.diff(seqs) == 1).all()


def test_a_runtime_that_ends_the_session_is_followed_out():
    with running(OpenXrHeadset) as (headset, runtime, _, _):
        frames(headset, 3)
        runtime.end()
        assert not headset.check()
        frames(headset, 2)
        assert "xrEndSession" in runtime.calls
        assert runtime.calls.count("xrCreateSession") == 2


def test_gaze_and_headset_share_one_session():
    with simulated() as (runtime, clock):
        library = runtime.library()
        headset = OpenXrHeadset("headset", library.transport(), clock)
        eyes = OpenXrGaze("eyes", library.transport(), clock)
        batches = []
        for device in (headset, eyes):
            device.open(1.0)
            device.start(batches.append)
        frames(headset, 5)
        eyes.poll(0.0)
        assert {b.schema.name for b in batches} == {"head", "head_measured", "frame_timing", "gaze"}
        assert runtime.calls.count("xrCreateSession") == 1
        eyes.close()
        headset.close()


# ---- either eye -----------------------------------------------------------------------------


@pytest.mark.parametrize("per_eye", ["htc", "meta"])
def test_each_eye_keeps_the_contract_on_runtime_and_capture(tmp_path, per_eye):
    path = tmp_path / "eyes.wire"
    with simulated(per_eye=per_eye) as (runtime, clock):

        def make():
            return OpenXrGaze("eyes", runtime.library().transport(), clock)

        for check in (check_lifecycle, check_batches, check_eye_tracker):
            check(make, passer(clock))
        teed = OpenXrGaze("eyes", TeeTransport(runtime.library().transport(), path, clock), clock)
        check_batches(lambda: teed, passer(clock), seconds=1.5)
    clock = SimClock()

    def replay():
        return OpenXrGaze("eyes", ReplayTransport(path, clock), clock)

    for check in (check_lifecycle, check_batches, check_eye_tracker):
        check(replay, passer(clock))


@pytest.mark.parametrize("per_eye", ["htc", "meta"])
@pytest.mark.parametrize(("yaw", "pitch"), [(0, 0), (25, -10), (-30, 20)])
def test_each_eye_converges_on_what_the_body_looks_at(per_eye, yaw, pitch):
    body = FixatingBody(yaw, pitch, distance_m=0.5)
    with running(OpenXrGaze, body=body, per_eye=per_eye) as (device, _, clock, batches):
        poll(device, clock, 0.2)
        true = body.eyes(np.zeros(1, np.int64))[0]
        for eye in ("left", "right"):
            found = column(batches, f"{eye}_direction_head").astype(np.float64)
            assert (
                angle_deg(found, np.broadcast_to(true[f"{eye}_direction_head"], found.shape)).max()
                < 0.05
            )
            assert column(batches, f"{eye}_valid").all()
        assert (column(batches, "eyes_used") == 3).all()
        assert np.allclose(column(batches, "origin_m"), 0.0, atol=1e-6)  # between both eyes
        vergence = angle_deg(
            *(
                column(batches, f"{eye}_direction_head").astype(np.float64)
                for eye in ("left", "right")
            )
        )
        assert vergence.min() > 5.0
        assert {"per_eye", "may_be_smoothed"} <= device.info.capabilities
        assert {"htc": "XR_HTC", "meta": "XR_FB"}[per_eye] in device.info.model


def test_pupils_and_openness_come_with_htcs_extension_alone():
    with running(OpenXrGaze, per_eye="htc") as (device, _, clock, batches):
        poll(device, clock, 0.2)
        assert [s.name for s in device.describe()] == ["gaze", "openness"]
        assert np.allclose(column(batches, "left_pupil_mm"), 3.5)
        opened = column(batches, "right_openness_01", "openness")
        assert len(opened) == len(column(batches, "valid"))
        assert np.allclose(opened, 1.0)
        assert {"pupil", "openness"} <= device.info.capabilities
    with running(OpenXrGaze, per_eye="meta") as (device, _, clock, batches):
        poll(device, clock, 0.2)
        assert [s.name for s in device.describe()] == ["gaze"]
        assert np.isnan(column(batches, "left_pupil_mm")).all()
        assert np.allclose(column(batches, "confidence_01"), 0.875)
        assert "pupil" not in device.info.capabilities


def test_the_time_of_an_eyes_sample_is_kept_and_a_sample_comes_once():
    with running(OpenXrGaze, per_eye="htc", gaze_rate_hz=60.0) as (device, _, clock, batches):
        poll(device, clock, 1.0, step_s=1 / 240)
        stamps = np.concatenate([b.t_device_ns for b in batches if b.schema.name == "gaze"])
        assert ((stamps - EPOCH_NS) % round(NS_PER_S / 60) == 0).all()
        assert (np.diff(stamps) > 0).all()


@pytest.mark.parametrize("per_eye", ["htc", "meta"])
def test_lost_eyes_are_nan_in_each(per_eye):
    lost = {"kind": "eyes_lost", "start_s": 0.2, "duration_s": 10}
    with running(OpenXrGaze, lost, per_eye=per_eye) as (device, _, clock, batches):
        clock.sleep_until_ns(clock.now_ns() + NS_PER_S)
        batches.clear()
        poll(device, clock, 0.2)
        assert np.isnan(column(batches, "left_direction_head")).all()
        assert np.isnan(column(batches, "direction_head")).all()
        assert not column(batches, "valid").any()


def test_the_combined_ray_can_be_asked_for_all_the_same():
    def combined(role, transport, clock):
        return OpenXrGaze(role, transport, clock, eyes="combined")

    with running(combined, per_eye="htc") as (device, _, clock, batches):
        poll(device, clock, 0.2)
        assert np.isnan(column(batches, "left_direction_head")).all()
        assert column(batches, "valid").all()
        assert "per_eye" not in device.info.capabilities


def test_a_runtime_whose_tracker_has_not_started_is_left_alone_for_a_second():
    with running(OpenXrGaze, per_eye="htc") as (device, runtime, clock, batches):
        poll(device, clock, 0.1)
        runtime.eyes.refusals = 1
        runtime.calls.clear()
        poll(device, clock, 0.5)
        assert runtime.calls.count("xrGetEyeGazeDataHTC") == 1
        poll(device, clock, 0.7)
        assert runtime.calls.count("xrGetEyeGazeDataHTC") > 10
        assert column(batches, "valid")[-1]


def test_eyes_that_the_headset_does_not_track_are_not_asked_for():
    with simulated(per_eye="meta") as (runtime, clock):
        runtime.eyes.supported = False
        device = OpenXrGaze("eyes", runtime.library().transport(), clock)
        device.open(1.0)
        assert "per_eye" not in device.info.capabilities
        device.close()


def test_orientation_is_kept_where_only_the_place_is_inferred(monkeypatch):
    """Flags 0b0111, as Monado and headsets that lost their cameras' view tell them."""
    with running(OpenXrHeadset) as (headset, _, _, batches):
        monkeypatch.setattr(runtime_module, "ALL_VALID_AND_TRACKED", 0b0111)
        frames(headset, 5)
        (fault,) = headset.check()
        head = np.concatenate([b.values for b in batches if b.schema.name == "head"])[-1]

    assert not head["valid"]
    assert np.isnan(head["position_m"]).all()
    assert np.linalg.norm(head["orientation_wxyz"]) == pytest.approx(1.0)
    assert fault.severity == "warning"
    assert fault.message == "only the headset's orientation is tracked, its place is inferred"


VENDORS_LAYOUT = """
#include <stdint.h>
#include <stddef.h>
#include <stdio.h>
typedef uint32_t XrBool32; typedef int64_t XrTime; typedef int32_t XrStructureType;
typedef struct XrSpace_T *XrSpace;
typedef struct { float x, y, z, w; } XrQuaternionf;
typedef struct { float x, y, z; } XrVector3f;
typedef struct { float x, y; } XrVector2f;
typedef struct { XrQuaternionf orientation; XrVector3f position; } XrPosef;
typedef struct { XrStructureType type; void *next; XrBool32 supportsEyeTracking; } Properties;
typedef struct { XrStructureType type; const void *next; XrSpace baseSpace; XrTime time; } Info;
typedef struct { XrBool32 isValid; XrPosef gazePose; } OneGaze;
typedef struct { XrStructureType type; void *next; XrTime time; OneGaze gaze[2]; } Gaze;
typedef struct { XrBool32 isDiameterValid, isPositionValid; float pupilDiameter;
                 XrVector2f pupilPosition; } OnePupil;
typedef struct { XrStructureType type; void *next; XrTime time; OnePupil pupilData[2]; } Pupils;
typedef struct { XrBool32 isValid; float eyeOpenness, eyeWide, eyeSqueeze; } OneShape;
typedef struct { XrStructureType type; void *next; XrTime time; OneShape data[2]; } Shapes;
int main(void) {
    printf("%zu %zu %zu ", offsetof(Properties, supportsEyeTracking), sizeof(Properties),
           offsetof(Info, time));
    printf("%zu %zu %zu %zu ", offsetof(Gaze, time), offsetof(Gaze, gaze[1].isValid),
           offsetof(Gaze, gaze[1].gazePose.position), sizeof(Gaze));
    printf("%zu %zu %zu ", offsetof(Pupils, pupilData[1].pupilDiameter),
           offsetof(Pupils, pupilData[0].pupilPosition), sizeof(Pupils));
    printf("%zu %zu", offsetof(Shapes, data[1].eyeOpenness), sizeof(Shapes));
}
"""
"""Members in the order and with the types that HTC's plugins for two engines declare."""


def test_structures_lie_as_a_compiler_lays_out_the_vendors(tmp_path):
    compiler = find_compiler()
    if compiler is None:
        pytest.skip("needs a C compiler: apt-get install gcc")
    (tmp_path / "layout.c").write_text(VENDORS_LAYOUT)
    program = tmp_path / "layout"
    subprocess.run([compiler, "-o", str(program), str(tmp_path / "layout.c")], check=True)
    told = subprocess.run([str(program)], capture_output=True, text=True, check=True).stdout
    gaze, pupil, shape = eyes._EyeGaze, eyes._EyePupil, eyes._EyeShape
    after = eyes._Gaze.eyes.offset
    ours = [
        eyes._Supports.supports_eye_tracking.offset,
        ctypes.sizeof(eyes._Supports),
        eyes._GazeInfo.time.offset,
        eyes._Gaze.time.offset,
        after + ctypes.sizeof(gaze) + gaze.is_valid.offset,
        after + ctypes.sizeof(gaze) + gaze.place.offset,
        ctypes.sizeof(eyes._Gaze),
        after + ctypes.sizeof(pupil) + pupil.diameter_mm.offset,
        after + pupil.on_sensor.offset,
        ctypes.sizeof(eyes._Pupils),
        after + ctypes.sizeof(shape) + shape.openness.offset,
        ctypes.sizeof(eyes._Shapes),
    ]
    assert list(map(int, told.split())) == ours


@given(st.binary(max_size=160) | st.binary(min_size=106, max_size=106))
def test_any_bytes_of_eyes_are_read_or_counted(raw):
    device = OpenXrGaze("eyes", MemoryTransport(None, SimClock()), SimClock())
    for asked in (b"eyes", b"gaze"):
        for sample in device._decode(Message(1, (asked, b"", raw))):
            assert gaze_is_sound(sample)


def test_a_runtime_that_died_is_found_again_by_every_device_when_it_is_back():
    with simulated() as (runtime, clock):
        library = runtime.library()
        headset = OpenXrHeadset("headset", library.transport(), clock)
        eyes = OpenXrGaze("eyes", library.transport(), clock)
        batches = []
        for device in (headset, eyes):
            device.open(1.0)
            device.start(batches.append)

        def both(n):
            for _ in range(n):
                frames(headset, 1)
                with contextlib.suppress(DeviceDisconnected):
                    eyes.poll(0.0)

        both(20)
        runtime.crash()
        both(90)
        assert DeviceState.FAULT is headset.state
        message = headset.check()[0].message
        assert "lost the OpenXR session: the OpenXR runtime does not answer" == message
        runtime.restart()
        both(200)
        assert (DeviceState.STREAMING,) * 2 == (headset.state, eyes.state)
        assert () == headset.check() == eyes.check()
        before = {name: len(column(batches, "valid", name)) for name in ("gaze", "head_measured")}
        both(20)
        for name, count in before.items():
            assert column(batches, "valid", name)[count:].all()
            assert len(column(batches, "valid", name)) > count + 10
        eyes.close()
        headset.close()


def test_runtime_that_starts_slowly_again_keeps_no_frame_waiting():
    with running(OpenXrHeadset) as (headset, runtime, clock, batches):
        frames(headset, 20)
        runtime.crash()
        frames(headset, 20)
        runtime.ready_after_ns = 2 * NS_PER_S
        runtime.restart()
        longest_ns = 0
        for _ in range(400):
            before_ns = clock.now_ns()
            with contextlib.suppress(DeviceDisconnected):
                headset.poll(0.0)
            longest_ns = max(longest_ns, clock.now_ns() - before_ns)
            frames(headset, 1)
        assert DeviceState.STREAMING is headset.state
        assert longest_ns < NS_PER_S // 8
        assert column(batches, "valid", "head")[-1]


def test_session_that_never_runs_is_let_go_of():
    with simulated() as (runtime, clock):
        runtime.ready_after_ns = 10 * NS_PER_S
        headset = OpenXrHeadset("headset", runtime.library().transport(), clock)
        with pytest.raises(DeviceNotFound, match="did not get the focus in time"):
            headset.open(1.0)
        assert "xrDestroyInstance" in runtime.calls
