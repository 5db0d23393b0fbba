"""Images through an OpenXR session with graphics: read back from the simulated runtime's chains."""

import contextlib
import sys
from dataclasses import replace

import msgpack
import numpy as np
import pytest

from tests.devices.bodies import FixatingBody
from tests.devices.openvr_rigs import passer
from tests.devices.test_openxr import column, simulated
from visavis.devices.conformance import check_headset, check_lifecycle
from visavis.devices.contracts import DeviceState
from visavis.devices.current_gl import GlCopies
from visavis.devices.drivers.openxr.gaze import OpenXrGaze
from visavis.devices.drivers.openxr.headset import OpenXrHeadset
from visavis.devices.sim.openxr.runtime import HIDDEN_CORNER_01, RENDER_SIZE_PX
from visavis.lab.clock import NS_PER_S, SimClock
from visavis.lab.errors import DeviceDisconnected, DeviceError
from visavis.lab.geometry import quat_from_yaw_pitch_deg

SIZE = (6, 8)


@pytest.fixture
def context():
    moderngl = pytest.importorskip("moderngl")
    try:
        made = moderngl.create_context(standalone=True, require=330, backend="egl")
    except Exception as problem:
        pytest.skip(f"apt-get install libegl1 libgl1-mesa-dri ({problem})")
    with made:
        yield made
    made.release()


@contextlib.contextmanager
def showing(*faults):
    with simulated(*faults) as (runtime, clock):
        headset = OpenXrHeadset("headset", runtime.library().transport(), clock)
        headset.show_images()
        headset.open(1.0)
        batches = []
        headset.start(batches.append)
        try:
            yield headset, runtime, clock, batches
        finally:
            headset.close()


def noise(context, rng, size=SIZE):
    images = [rng.integers(0, 256, (size[1], size[0], 4), dtype=np.uint8) for _ in range(2)]
    return images, [context.texture(size, 4, image[::-1].tobytes()) for image in images]


def one_frame(headset):
    frame = headset.wait_frame()
    with contextlib.suppress(DeviceDisconnected):
        headset.poll(0.0)
    return frame


def test_what_the_runtime_reads_back_is_what_was_handed_over(context):
    rng, seen = np.random.default_rng(1), []
    with showing() as (headset, runtime, _, batches):
        runtime.images.on_frame = seen.append
        handed = []
        for _ in range(7):
            images, textures = noise(context, rng)
            handed.append(images)
            headset.submit(one_frame(headset), textures)
        one_frame(headset)
    assert len(seen) == 7
    for images, shown in zip(handed, seen, strict=True):
        for image, eye in zip(images, shown.eyes, strict=True):
            assert (image == eye.image).all()
    assert (column(batches, "t_submitted_ns", "frame_timing") >= 0).all()


def test_images_come_with_the_place_and_the_view_they_were_drawn_from(context):
    rng, seen = np.random.default_rng(2), []
    with showing() as (headset, runtime, _, _):
        runtime.images.on_frame = seen.append
        frame = one_frame(headset)
        headset.submit(frame, noise(context, rng)[1])
        left, right = headset.eye_views()
    turn = quat_from_yaw_pitch_deg(frame.predicted_display_ns * 1e-9)
    for eye, view in zip(seen[0].eyes, (left, right), strict=True):
        assert eye.orientation_wxyz == pytest.approx(turn, abs=1e-6)
        assert np.tan(eye.angles_rad) == pytest.approx(
            [view.tangent_left, view.tangent_right, view.tangent_bottom, view.tangent_top], rel=1e-5
        )
    middle = np.mean([eye.position_m for eye in seen[0].eyes], axis=0)
    assert middle == pytest.approx([0.0, 1.2, 0.0], abs=1e-6)
    apart = np.subtract(seen[0].eyes[1].position_m, seen[0].eyes[0].position_m)
    assert np.linalg.norm(apart) == pytest.approx(0.063, abs=1e-6)


def test_nothing_new_shows_the_images_before_and_images_may_change_size(context):
    rng, seen = np.random.default_rng(3), []
    with showing() as (headset, runtime, _, _):
        runtime.images.on_frame = seen.append
        headset.submit(one_frame(headset), ())
        assert not seen
        images, textures = noise(context, rng)
        headset.submit(one_frame(headset), textures)
        headset.submit(one_frame(headset), ())
        larger, textures = noise(context, rng, (10, 12))
        headset.submit(one_frame(headset), textures)
    assert [(s.eyes[0].image == images[0]).all() for s in seen[:2]] == [True, True]
    assert (seen[2].eyes[1].image == larger[1]).all()


def test_a_frame_that_nobody_shows_is_ended_before_the_next(context):
    with showing() as (headset, runtime, _, _):
        for _ in range(5):
            one_frame(headset)
        headset.submit(one_frame(headset), ())
        calls = [c for c in runtime.calls if c in ("xrBeginFrame", "xrEndFrame")]
    assert calls == ["xrBeginFrame", "xrEndFrame"] * (len(calls) // 2)


def test_a_session_with_graphics_gets_the_focus_by_keeping_up_frames(context):
    with showing() as (headset, runtime, _, _):
        assert runtime.calls.index("xrEndFrame") < runtime.calls.index("xrLocateViews")
        assert "display" in headset.info.capabilities
        assert headset.render_size_px == RENDER_SIZE_PX
        assert headset.state is DeviceState.STREAMING


def test_the_drawing_context_is_left_as_it_was(context):
    rng = np.random.default_rng(4)
    target = context.framebuffer([context.texture((4, 4), 4)])
    with showing() as (headset, _, _, _):
        target.use()
        context.enable_direct(0x8DB9)
        headset.submit(one_frame(headset), noise(context, rng)[1])
        target.clear(1.0, 0.0, 0.0, 1.0)
        assert target.read(components=4)[:4] == b"\xff\x00\x00\xff"
        assert context.error == "GL_NO_ERROR"
        context.disable_direct(0x8DB9)


@pytest.mark.parametrize("broken", ["missing", "refused"])
def test_a_refused_image_is_an_error_and_a_fault_until_one_is_taken(context, broken):
    rng = np.random.default_rng(5)
    with showing() as (headset, runtime, _, _):
        _, textures = noise(context, rng)
        wrong = textures
        if broken == "missing":
            gone = context.texture(SIZE, 4)
            wrong = [textures[0], gone]
            gone.release()
        else:
            runtime.images.forced_error = -23
        with pytest.raises(DeviceError, match="refused the images") as refusal:
            headset.submit(one_frame(headset), wrong)
        assert refusal.value.remedy
        assert "images were refused" in headset.check()[0].message
        runtime.images.forced_error = 0
        headset.submit(one_frame(headset), textures)
        assert not headset.check()


def test_two_images_of_different_size_are_refused(context):
    rng = np.random.default_rng(6)
    with showing() as (headset, _, _, _):
        (small, _), (large, _) = noise(context, rng)[1], noise(context, rng, (9, 9))[1]
        with pytest.raises(DeviceError, match="one size"):
            headset.submit(one_frame(headset), (small, large))


def test_a_copy_that_fails_says_so_and_leaves_the_context_as_it_was(context) -> None:
    from OpenGL import GL

    held = context.texture((4, 4), 4, bytes(range(64)))
    copies = GlCopies()
    copies.copy(held.glo, held.glo, (4, 4))
    GL.glEnable(GL.GL_SCISSOR_TEST)
    drawn = GL.glGetIntegerv(GL.GL_DRAW_FRAMEBUFFER_BINDING)
    assert "GL error" in copies.copy(held.glo, 999, (4, 4))
    assert GL.glIsEnabled(GL.GL_SCISSOR_TEST)
    assert drawn == GL.glGetIntegerv(GL.GL_DRAW_FRAMEBUFFER_BINDING)
    assert 0 == GL.glGetError()
    with pytest.raises(DeviceError, match="no texture 999"):
        copies.read(999)
    assert 63 == int(copies.read(held.glo).max())
    copies.close()


def test_without_pyopengl_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "OpenGL", None)
    with pytest.raises(DeviceError, match="without PyOpenGL") as refused:
        GlCopies()
    assert "pip install PyOpenGL" in refused.value.remedy


def test_without_a_current_context_it_says_what_to_open_first():
    with simulated() as (runtime, clock):
        headset = OpenXrHeadset("headset", runtime.library().transport(), clock)
        headset.show_images()
        with pytest.raises(DeviceError, match="no OpenGL context"):
            headset.open(1.0)
        assert headset.state is DeviceState.CLOSED


def test_a_session_lost_between_waiting_and_showing_comes_back_with_its_images(context):
    fault = {"kind": "disconnect", "start_s": 0.2, "duration_s": 0.5}
    rng, seen = np.random.default_rng(7), []
    with showing(fault) as (headset, runtime, clock, batches):
        runtime.images.on_frame = seen.append
        states = []
        while clock.now_ns() < 2 * NS_PER_S:
            frame = one_frame(headset)
            images, textures = noise(context, rng)
            with contextlib.suppress(DeviceError):
                headset.submit(frame, textures)
            states.append(headset.state)
        assert DeviceState.FAULT in states
        assert states[-1] is DeviceState.STREAMING
        assert (seen[-1].eyes[0].image == images[0]).all()
        rows = [b.seq for b in batches if b.schema.name == "frame_timing"]
        assert (np.diff(np.concatenate(rows)) == 1).all()


def test_gaze_is_delivered_beside_images(context):
    with simulated() as (runtime, clock):
        library = runtime.library()
        headset = OpenXrHeadset("headset", library.transport(), clock)
        headset.show_images()
        eyes = OpenXrGaze("eyes", library.transport(), clock)
        batches = []
        for device in (headset, eyes):
            device.open(1.0)
            device.start(batches.append)
        headset.submit(one_frame(headset), noise(context, np.random.default_rng(8))[1])
        eyes.poll(0.0)
        assert column(batches, "valid").all()
        eyes.close()
        headset.close()


def test_driver_with_images_keeps_the_contract(context):
    with simulated() as (runtime, clock):

        def make():
            headset = OpenXrHeadset("headset", runtime.library().transport(), clock)
            headset.show_images()
            return headset

        check_lifecycle(make, passer(clock))
        check_headset(make)
    assert isinstance(clock, SimClock)


class _SpeedingUp(FixatingBody):
    """A head that goes aside faster and faster, which nothing foresees."""

    def head(self, t_ns):
        place, turn = super().head(t_ns)
        return place + np.array([4 * (1e-9 * t_ns) ** 2, 0.0, 0.0]), turn


def test_images_are_shown_from_where_the_head_was_foreseen_last(context):
    rng, seen, body = np.random.default_rng(9), [], _SpeedingUp()
    with simulated(body=body) as (runtime, clock):
        headset = OpenXrHeadset("headset", runtime.library().transport(), clock)
        headset.show_images()
        headset.open(1.0)
        headset.start(lambda _: None)
        runtime.images.on_frame = seen.append
        told, truths_m = [], []
        for ask in (lambda: None, headset.late_head):
            frame = one_frame(headset)
            clock.sleep_until_ns(frame.t_ns + 8_000_000)
            told.append(ask())
            truths_m.append(body.head(frame.predicted_display_ns)[0][0])
            headset.submit(frame, noise(context, rng)[1])
        headset.close()
    early_m, late_m = (np.mean([e.position_m[0] for e in frame.eyes]) for frame in seen)
    assert abs(late_m - truths_m[1]) < 0.8 * abs(early_m - truths_m[0])
    assert told[1].position_m[0] == pytest.approx(late_m, abs=1e-6)


def test_nothing_is_foreseen_again_without_images_tracking_or_a_frame_that_has_begun(context):
    with simulated() as (runtime, clock):
        headset = OpenXrHeadset("headset", runtime.library().transport(), clock)
        headset.open(1.0)
        headset.start(lambda _: None)
        one_frame(headset)
        assert headset.late_head() is None
        headset.close()
    with showing({"kind": "silence", "start_s": 1.0, "duration_s": 9.0}) as (headset, _, clock, _):
        frame = one_frame(headset)
        assert headset.late_head() is not None
        headset.submit(frame, ())
        assert headset.late_head() is None
        clock.sleep_until_ns(2 * NS_PER_S)
        one_frame(headset)
        assert headset.late_head() is None


def test_what_the_lenses_hide_is_known_with_the_views(context):
    with showing() as (headset, runtime, _, _):
        views = headset.eye_views()
    assert "xrGetVisibilityMaskKHR" in runtime.calls
    for view in views:
        corners = np.array(view.hidden).reshape(-1, 3, 2)
        low = [view.tangent_left, view.tangent_bottom]
        size = np.array([view.tangent_right, view.tangent_top]) - low
        sides = np.diff(((corners - low) / size)[:, [0, 1, 2, 0]], axis=1)
        areas = np.abs(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0]) / 2
        assert areas == pytest.approx([HIDDEN_CORNER_01**2 / 2] * 4)
    left, right = (tuple(sorted(view.hidden)) for view in views)
    assert left == right
    assert views[0].hidden != views[1].hidden


@pytest.mark.parametrize("shows", [True, False])
def test_nothing_is_hidden_where_the_runtime_tells_nothing_or_nothing_is_shown(context, shows):
    with simulated(hides_corners=not shows) as (runtime, clock):
        headset = OpenXrHeadset("headset", runtime.library().transport(), clock)
        if shows:
            headset.show_images()
        headset.open(1.0)
        views = headset.eye_views()
        headset.close()
    assert [(), ()] == [view.hidden for view in views]
    assert "xrGetVisibilityMaskKHR" not in runtime.calls


class _Answering:
    """A wire whose runtime answers one question otherwise."""

    def __init__(self, wire, question, answer):
        self._wire, self._question, self._answer = wire, question, answer

    def __getattr__(self, name):
        return getattr(self._wire, name)

    def request(self, frames, timeout_s):
        exchange = self._wire.request(frames, timeout_s)
        if frames[0] == self._question:
            return replace(exchange, frames=(b"", self._answer))
        return exchange


@pytest.mark.parametrize("answer", [[[[0, 0]], []], [[[0, np.nan]] * 3, []], [[], [], []], [1, 2]])
def test_an_account_of_what_lenses_hide_that_makes_no_triangles_is_refused(context, answer):
    with simulated() as (runtime, clock):
        wire = _Answering(runtime.library().transport(), b"hidden", msgpack.packb(answer))
        headset = OpenXrHeadset("headset", wire, clock)
        headset.show_images()
        with pytest.raises(DeviceError, match="lenses hide"):
            headset.open(1.0)
        headset.close()


def test_a_capture_of_before_lenses_were_asked_about_hides_nothing(context):
    with simulated() as (runtime, clock):
        answer = msgpack.packb(["Visavis of old", False])
        wire = _Answering(runtime.library().transport(), b"runtime", answer)
        headset = OpenXrHeadset("headset", wire, clock)
        headset.show_images()
        headset.open(1.0)
        assert [(), ()] == [view.hidden for view in headset.eye_views()]
        headset.close()


def test_images_whose_context_is_gone_are_left_to_the_process(context):
    xr = pytest.importorskip("xr")
    with simulated() as (runtime, clock):
        library = runtime.library()
        headset = OpenXrHeadset("headset", library.transport(), clock)
        headset.show_images()
        headset.open(1.0)
        headset.start(lambda _: None)
        headset.submit(one_frame(headset), noise(context, np.random.default_rng(4))[1])
        instance = library._instance
        other = pytest.importorskip("moderngl").create_context(
            standalone=True, require=330, backend="egl"
        )
        headset.close()  # a genuine runtime would take the process with it
        assert headset.state is DeviceState.CLOSED
        assert not {"xrDestroySwapchain", "xrDestroyInstance"} & set(runtime.calls)
        other.release()
        context.__enter__()
        xr.destroy_instance(instance)
        assert runtime.failure is None


def test_the_simulated_runtime_fails_where_a_genuine_one_would_crash(context):
    xr = pytest.importorskip("xr")
    with simulated() as (runtime, clock):
        library = runtime.library()
        headset = OpenXrHeadset("headset", library.transport(), clock)
        headset.show_images()
        headset.open(1.0)
        headset.start(lambda _: None)
        headset.submit(one_frame(headset), noise(context, np.random.default_rng(4))[1])
        other = pytest.importorskip("moderngl").create_context(
            standalone=True, require=330, backend="egl"
        )
        with pytest.raises(xr.exception.RuntimeFailureError):
            xr.destroy_swapchain(library._images._chains[0][0])
        other.release()
        context.__enter__()
        headset.close()
        assert "context of its images was gone" in str(runtime.failure)
        runtime.failure = None


def test_eyes_that_are_moved_apart_are_drawn_for_and_told(context):
    rng, seen = np.random.default_rng(6), []
    with showing() as (headset, runtime, _, _):
        runtime.images.on_frame = seen.append

        def apart_m():
            headset.submit(one_frame(headset), noise(context, rng)[1])
            left, right = headset.eye_views()
            drawn = np.subtract(seen[-1].eyes[1].position_m, seen[-1].eyes[0].position_m)
            assert np.linalg.norm(drawn) == pytest.approx(right.offset_m[0] - left.offset_m[0])
            return right.offset_m[0] - left.offset_m[0]

        assert apart_m() == pytest.approx(0.063)
        assert () == headset.check()
        hidden = headset.eye_views()[0].hidden
        runtime.ipd_m = 0.070
        assert apart_m() == pytest.approx(0.070)
        assert hidden == headset.eye_views()[0].hidden != ()
        (fault,) = headset.check()
        assert ("warning", True) == (fault.severity, "from 63.0 to 70.0 mm" in fault.message)
        runtime.ipd_m = 0.063
        assert apart_m() == pytest.approx(0.063)
        assert () == headset.check()


def test_views_that_differ_by_rounding_are_the_same_and_small_turns_of_the_knob_add_up(context):
    with showing() as (headset, runtime, _, _):
        one_frame(headset)
        first = headset.eye_views()
        for micrometres in (1, -1, 2):
            runtime.ipd_m = 0.063 + micrometres * 1e-6
            one_frame(headset)
            assert first is headset.eye_views()
        for step in range(1, 21):
            runtime.ipd_m = 0.063 + step * 5e-6
            one_frame(headset)
        left, right = headset.eye_views()
        assert right.offset_m[0] - left.offset_m[0] == pytest.approx(0.0631, abs=2.5e-5)
