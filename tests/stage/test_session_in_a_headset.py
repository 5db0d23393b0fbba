"""A stare session drawn into a simulated headset runtime, which reads every texture back."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import visavis.devices.drivers.openvr.wiring
import visavis.devices.drivers.openxr.wiring
import visavis.running.sessions.drawn_stages
from tests.faults.sessions import events, lab
from tests.stage.sessions import perform_shortest
from visavis.devices.sim.native_build import find_compiler
from visavis.devices.sim.openvr.runtime import SimulatedVrRuntime
from visavis.devices.sim.openxr.runtime import SimulatedXrRuntime
from visavis.lab.clock import NS_PER_S, SimClock
from visavis.lab.config import DeviceConfig, LabConfig
from visavis.lab.frame import FrameInfo
from visavis.lab.geometry import Pose
from visavis.stage.drawn_stage import DrawnStage
from visavis.stage.errors import StageError
from visavis.stage.renderer import LIGHTEST, Renderer
from visavis.stimuli.scene import SceneFrame

RATE_HZ = 20
EVERY = 20
UNPLUGGED_S, GPU_LOST_S, REFUSED_S = (8.0, 11.0), (25.0, 28.0), (42.0, 47.5)
"""While calibrating; while calibrating again; within a trial."""
UNSUPPORTED_FORMAT = 105


class _NowAndThen(DrawnStage):
    """Draws one frame in many, to be quick; the driver fails for a while."""

    made: "_NowAndThen | None" = None

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.watching = options["viewers"]
        self.fails = False
        self.images_given = 0
        _NowAndThen.made = self

    def draw(self, view: SceneFrame, frame: FrameInfo, head: Pose) -> Sequence[Any]:
        """Draw, or only tell the viewers."""
        if frame.index % EVERY:
            for viewer in self.watching:
                viewer.see(view, frame.predicted_display_ns)
            return ()
        since_s = frame.t_ns / NS_PER_S
        if self._renderer is not None and self.fails and _within(since_s, GPU_LOST_S):
            self._renderer.draw = _gpu_lost
        images = super().draw(view, frame, head)
        self.images_given += len(images)
        return images


def _gpu_lost(*_: object, **__: object) -> None:
    raise StageError("the graphics driver reported GL_CONTEXT_LOST", remedy="update the driver")


def _within(since_s: float, span_s: tuple[float, float]) -> bool:
    return span_s[0] <= since_s < span_s[1]


def _config(data_root: Path, driver: str, faults: Sequence[dict[str, Any]] = ()) -> LabConfig:
    config = lab(data_root)
    options = {"display_rate_hz": float(RATE_HZ), "faults": list(faults)}
    headset = DeviceConfig(role="headset", driver=driver, simulated=True, options=options)
    return config.model_copy(
        update={
            "devices": {**config.devices, "headset": headset},
            "display": config.display.model_copy(update={"show": "offscreen"}),
        }
    )


@pytest.fixture
def thin_stage(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw small pictures now and then, where anything can draw."""
    if find_compiler() is None:
        pytest.skip("the simulated runtimes need a C compiler: apt-get install gcc")
    try:
        Renderer(quality=LIGHTEST).close()
    except StageError as problem:
        pytest.skip(str(problem))
    monkeypatch.setattr(visavis.running.sessions.drawn_stages, "DrawnStage", _NowAndThen)
    monkeypatch.setattr(visavis.running.sessions.drawn_stages, "OFFSCREEN_PX", (48, 54))


def _shown() -> tuple[_NowAndThen, list[npt.NDArray[np.uint8]]]:
    made = _NowAndThen.made
    assert made is not None
    return made, made.images()


@pytest.mark.timeout(900)  # draws some hundred pictures, on whatever processor there is
@pytest.mark.usefixtures("thin_stage")
def test_openvr_reads_back_what_was_drawn_and_faults_pause_without_loss(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("openvr", reason="pip install openvr")
    read_back: list[bool] = []
    runtimes: list[SimulatedVrRuntime] = []

    class Runtime(SimulatedVrRuntime):
        """Refuses textures for a while; compares every one that it takes."""

        def __init__(self, body: Any, clock: SimClock, **options: Any) -> None:
            super().__init__(body, clock, **options)
            self.on_image = self._compare
            runtimes.append(self)

        def _compare(self, eye: int, image: npt.NDArray[np.uint8]) -> None:
            drawn = _shown()[1][eye]
            read_back.append(bool((image[..., :3] == drawn).all()))

        def _submit(self, *arguments: Any) -> int:
            refused = _within(self._clock.now_ns() / NS_PER_S, REFUSED_S)
            self.refuse_submit(UNSUPPORTED_FORMAT if refused else 0)
            made = _NowAndThen.made
            assert made is not None
            made.fails = True
            return super()._submit(*arguments)

    monkeypatch.setattr(visavis.devices.drivers.openvr.wiring, "SimulatedVrRuntime", Runtime)
    start_s, end_s = UNPLUGGED_S
    unplugged = {"kind": "disconnect", "start_s": start_s, "duration_s": end_s - start_s}
    recording = perform_shortest(_config(tmp_path, "openvr_headset", [unplugged]), (1, 2))

    assert recording.status == "complete"
    done = recording.trials()
    assert {"P1", "T01", "T02"} == set(done.loc[done["status"] == "complete", "trial_id"])
    cut_short = done.loc[done["status"] == "interrupted", "reason"].tolist()
    assert any("refused" in reason for reason in cut_short)
    assert len(read_back) > 40
    assert all(read_back)
    made, (runtime,) = _shown()[0], runtimes
    assert runtime.failure is None
    assert len(runtime.submissions) == len(read_back) < made.images_given

    told = {e["message"]: e for e in events(recording, "fault")}
    refusal = next(m for m in told if "refused" in m)
    assert "TextureUsesUnsupportedFormat" in refusal
    assert "RGBA8" in told[refusal]["remedy"]
    assert "the headset is not tracked" in told
    assert "the graphics driver reported GL_CONTEXT_LOST" in told
    assert len(events(recording, "device_lost")) == len(events(recording, "device_back")) > 0

    timing = recording.stream_arrays("frame_timing")
    drawn = recording.stream_arrays("drawn")
    taken = set(timing["frame"][timing["t_submitted_ns"] >= 0].tolist())
    assert len(taken) == len(read_back) // 2
    assert taken <= set(drawn["frame"][drawn["drawn"]].tolist())
    assert timing["timing_known"].all()
    assert not drawn["drawn"].all()


@pytest.mark.timeout(900)  # draws some hundred pictures, on whatever processor there is
@pytest.mark.usefixtures("thin_stage")
def test_openxr_reads_back_what_was_drawn_from_where_the_head_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("xr", reason="pip install pyopenxr")
    read_back: list[bool] = []
    runtimes: list[SimulatedXrRuntime] = []
    places: dict[int, tuple[float, ...]] = {}

    class Runtime(SimulatedXrRuntime):
        """Compares every frame that shows something new."""

        def __init__(self, body: Any, clock: SimClock, **options: Any) -> None:
            super().__init__(body, clock, **options)
            self.images.on_frame = self._compare
            self.last: object = None
            runtimes.append(self)

        def _compare(self, shown: Any) -> None:
            if shown.eyes[0].image is self.last:
                return  # nothing new: the images before
            self.last = shown.eyes[0].image
            pairs = zip(shown.eyes, _shown()[1], strict=True)
            read_back.append(all((eye.image[..., :3] == drawn).all() for eye, drawn in pairs))
            middle = np.mean([eye.position_m for eye in shown.eyes], axis=0)
            places.setdefault(len(places), tuple(middle))

    monkeypatch.setattr(visavis.devices.drivers.openxr.wiring, "SimulatedXrRuntime", Runtime)
    recording = perform_shortest(_config(tmp_path, "openxr_headset"))

    assert recording.status == "complete"
    assert runtimes[0].failure is None
    assert len(read_back) > 20
    assert all(read_back)
    assert runtimes[0].images.frames_shown > EVERY * (len(read_back) - 1)
    head = recording.stream_arrays("head")["position_m"]
    apart_m = [float(np.abs(head - place).max(axis=1).min()) for place in places.values()]
    assert max(apart_m) < 1e-6
