"""The OpenXR drivers keep the specification, and the simulated runtime refuses what breaks it."""

import contextlib
import ctypes
import os
import platform
from pathlib import Path

import numpy as np
import pytest

from tests.devices.test_openxr import frames, simulated
from visavis.devices.drivers.openxr.controllers import OpenXrControllers
from visavis.devices.drivers.openxr.gaze import OpenXrGaze
from visavis.devices.drivers.openxr.headset import OpenXrHeadset

LAYER = "XR_APILAYER_LUNARG_core_validation"
FOLDERS = {("Linux", "x86_64"): "linux_x86_64", ("Linux", "aarch64"): "linux_aarch64"}
HARMLESS = "VALID_DEBUG"


@contextlib.contextmanager
def validated(folder, monkeypatch):
    """Let Khronos' own validation layer watch every call; yield what it complained of, at last."""
    xr = pytest.importorskip("xr", reason="pip install pyopenxr")
    where = FOLDERS.get((platform.system(), platform.machine()), "none")
    layers = Path(xr.__file__).parent / "api_layer" / where
    if not layers.is_dir():
        pytest.skip("pyopenxr brings no validation layer for this system")
    file = folder / "validation.txt"
    monkeypatch.setenv("XR_API_LAYER_PATH", str(layers))
    monkeypatch.setenv("XR_ENABLE_API_LAYERS", LAYER)
    monkeypatch.setenv("XR_CORE_VALIDATION_EXPORT_TYPE", "text")
    monkeypatch.setenv("XR_CORE_VALIDATION_FILE_NAME", str(file))
    complaints: list[str] = []
    yield complaints
    assert file.exists(), "the layer did not run"
    lines = file.read_text().splitlines()
    complaints += [line for line in lines if line.startswith("[") and HARMLESS not in line]


def started(runtime, clock, *, shows=False):
    library = runtime.library()
    devices = (
        OpenXrHeadset("headset", library.transport(), clock),
        OpenXrGaze("eyes", library.transport(), clock),
        OpenXrControllers("responses", library.transport(), clock, controls={"yes": "any select"}),
    )
    if shows:
        devices[0].show_images()
    for device in devices:
        device.open(2.0)
        device.start(lambda _: None)
    return devices


@pytest.mark.parametrize("per_eye", ["none", "meta"])
def test_khronos_validation_finds_nothing_in_a_headless_session(per_eye, tmp_path, monkeypatch):
    with validated(tmp_path, monkeypatch) as complaints:
        with simulated(per_eye=per_eye) as (runtime, clock):
            headset, eyes, controllers = started(runtime, clock)
            frames(headset, 5)
            eyes.poll(0.0)
            controllers.poll(0.0)
            for device in (controllers, eyes, headset):
                device.close()
    assert [] == complaints


def test_khronos_validation_finds_nothing_in_a_session_with_pictures(tmp_path, monkeypatch):
    moderngl = pytest.importorskip("moderngl")
    try:
        context = moderngl.create_context(standalone=True, require=330, backend="egl")
    except Exception as problem:
        pytest.skip(f"apt-get install libegl1 libgl1-mesa-dri ({problem})")
    with validated(tmp_path, monkeypatch) as complaints, context:
        with simulated() as (runtime, clock):
            headset, eyes, controllers = started(runtime, clock, shows=True)
            pair = [context.texture((6, 8), 4, bytes(6 * 8 * 4)) for _ in range(2)]
            for _ in range(3):
                headset.submit(headset.wait_frame(), pair)
                headset.late_head()
                headset.poll(0.0)
            for device in (eyes, controllers, headset):
                device.close()
    context.release()
    assert [] == complaints


def test_the_validation_layer_does_find_what_is_wrong(tmp_path, monkeypatch):
    xr = pytest.importorskip("xr")
    with validated(tmp_path, monkeypatch) as complaints:
        with simulated() as (runtime, clock):
            headset, *_ = devices = started(runtime, clock)
            library = headset._transport._library
            location = xr.SpaceLocation()
            ctypes.c_int32.from_buffer(location).value = 5  # another structure's type
            spaces = library._spaces
            result = xr.raw_functions.xrLocateSpace(
                spaces["view"], spaces["stage"], xr.Time(10**15), ctypes.byref(location)
            )
            assert xr.Result(result).value < 0
            for device in devices:
                device.close()
    assert complaints


def test_a_headless_session_asks_for_no_frames():
    with simulated() as (runtime, clock):
        headset, *others = started(runtime, clock)
        starts = [frame.t_ns for frame in frames(headset, 5)]
        for device in (*others, headset):
            device.close()
    assert not {"xrWaitFrame", "xrBeginFrame", "xrEndFrame"} & set(runtime.calls)
    assert np.diff(starts) == pytest.approx(1e9 / 90, abs=2)


def test_a_headless_frame_that_comes_late_is_counted_as_such():
    with simulated() as (runtime, clock):
        headset, *others = started(runtime, clock)
        frames(headset, 2)
        clock.sleep_until_ns(clock.now_ns() + 40_000_000)
        (late,) = frames(headset, 1)
        for device in (*others, headset):
            device.close()
    assert 3 == late.dropped


BREACHES = {
    "a frame of a headless session": ("begin_frame", "CallOrderInvalidError"),
    "a session begun twice": ("begin_session", "SessionRunningError"),
    "a session ended that need not stop": ("end_session", "SessionNotStoppingError"),
    "a time that is none": ("locate", "TimeInvalidError"),
    "a path that is not well formed": ("path", "PathFormatInvalidError"),
    "an action set attached twice": ("attach", "ActionsetsAlreadyAttachedError"),
    "an action read as another type": ("type", "ActionTypeMismatchError"),
    "an action named as another": ("action", "ActionsetsAlreadyAttachedError"),
}


@pytest.mark.parametrize("breach", BREACHES)
def test_the_simulated_runtime_refuses(breach):
    xr = pytest.importorskip("xr")
    what, error = BREACHES[breach]
    with simulated() as (runtime, clock):
        devices = started(runtime, clock)
        library = devices[0]._transport._library
        actions = library._actions
        breaches = {
            "begin_frame": lambda: xr.begin_frame(library._session),
            "begin_session": lambda: xr.begin_session(
                library._session,
                xr.SessionBeginInfo(xr.ViewConfigurationType.PRIMARY_STEREO),
            ),
            "end_session": lambda: xr.end_session(library._session),
            "locate": lambda: library._locate("view", "stage", 0),
            "path": lambda: xr.string_to_path(library._instance, "/user/hand/Left"),
            "attach": lambda: xr.attach_session_action_sets(
                library._session, xr.SessionActionSetsAttachInfo(action_sets=[actions._set])
            ),
            "type": lambda: xr.get_action_state_float(
                library._session, actions._get_info("select", 0)
            ),
            "action": lambda: actions._action("select", xr.ActionType.BOOLEAN_INPUT),
        }
        with pytest.raises(getattr(xr.exception, error)):
            breaches[what]()
        for device in devices:
            device.close()
    assert os.environ.get("XR_ENABLE_API_LAYERS") is None


def test_headless_frames_lie_on_the_grid_of_the_clock_on_which_sessions_align():
    with simulated() as (runtime, clock):
        clock.sleep_until_ns(12_345_678)
        headset, *others = started(runtime, clock)
        starts = [frame.t_ns for frame in frames(headset, 60)]
        for device in (*others, headset):
            device.close()
    assert any(t_ns % 100_000_000 == 0 for t_ns in starts)
    assert all(t_ns in (k * 10**9 // 90 for k in range(90)) for t_ns in starts)
