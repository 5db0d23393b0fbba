"""Put a synchronisation test together from display, speaker, band and sensor, real or not."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import numpy.typing as npt

from visavis.analysis.frame_times import (
    PoseAge,
    RuntimePace,
    account_of,
    heads_of,
    pose_age,
    runtime_pace,
)
from visavis.analysis.gaze_delay import (
    MIN_LATENCY_MS,
    GazeDelayBound,
    gaze_delay_bound,
    saccade_latencies_ms,
)
from visavis.analysis.sync_test import Delays, Modality, delays
from visavis.devices.building import build_device
from visavis.devices.byte_links import MemoryLink
from visavis.devices.contracts import Armband, ClockPair, Device, EyeTracker, Headset, Sink
from visavis.devices.drivers.links.serial_port import SerialLink
from visavis.devices.sim.sync_room import PlantedDelay, SimulatedRoom, SyncBoardSimulator
from visavis.devices.sync.audio import SoundCardSensor, SoundCardSpeaker, sound_library
from visavis.devices.sync.board import BAUD, SyncBoard
from visavis.devices.sync.role import RoleSensor
from visavis.devices.sync.sensing import Sensor, Trace
from visavis.lab.clock import NS_PER_MS, Clock, SimClock
from visavis.lab.clock_fit import fit_clock, fit_one_way
from visavis.lab.config import DeviceConfig, LabConfig
from visavis.lab.errors import DeviceError, UsageError
from visavis.lab.schema import SampleBatch
from visavis.lab.yaml_lines import names_or_none
from visavis.protocol.session.sync_test import (
    Patch,
    SeenHeadset,
    SeenMonitor,
    Speaker,
    StimulusTimes,
    perform,
)
from visavis.running.sessions.device_setup import screen_display
from visavis.running.sessions.drawn_stages import open_on_monitor
from visavis.stage.card.context import offscreen_context, release_offscreen

if TYPE_CHECKING:
    from visavis.stage.window import Window

OPENING_S = 10.0
DEFAULT_CHANNELS = {"picture": "light", "sound": "sound", "vibration": "motion"}
AUDIO_CHANNELS = {"picture": "input_1", "sound": "input_2", "vibration": "input_2"}
Float = npt.NDArray[np.float64]


class RoomSpeaker:
    """A loudspeaker in the simulated room."""

    def __init__(self, room: SimulatedRoom, clock: Clock) -> None:
        self._room = room
        self._clock = clock

    def click(self) -> None:
        """Click now."""
        self._room.click(self._clock.now_ns())


def open_device(stack: ExitStack, device: Any, sink: Sink = lambda batch: None) -> Any:
    """Open and start a device until the stack is left."""
    stack.callback(device.close)
    device.open(OPENING_S)
    device.start(sink)
    return device


def real_sensor(lab: LabConfig, name: str, clock: Clock, stack: ExitStack) -> Sensor:
    """Return the sensor that "PORT", "audio", "audio:NAME" or "role:ROLE" names.

    Raises UsageError for a role that the lab does not have, or whose device is simulated.
    """
    kind, _, rest = name.partition(":")
    if kind == "audio":
        return SoundCardSensor(sound_library(), clock, rest or None)
    if kind == "role":
        return RoleSensor(_real_device(lab, rest, clock, stack))
    return SyncBoard(SerialLink(clock, port=name, baud=BAUD), clock)


def _real_device(lab: LabConfig, role: str, clock: Clock, stack: ExitStack) -> Device:
    if role not in lab.devices:
        raise UsageError(f"no role {role!r} in {lab.path}; it has {names_or_none(lab.devices)}")
    if lab.devices[role].simulated:
        raise UsageError(
            f"the lab's {role} is simulated, so nothing could be measured by it; use --simulated, "
            "or configure a real one"
        )
    return build_device(lab.devices[role], clock, None, 0, stack)


def real_speaker(name: str, stack: ExitStack) -> Speaker:
    """Return the sound output of this name; "default" is the computer's own."""
    speaker = SoundCardSpeaker(sound_library(), None if name == "default" else name)
    stack.callback(speaker.close)
    return speaker


def analyse(
    commands: StimulusTimes,
    traces: Mapping[str, Trace],
    channels: Mapping[str, str],
    display_role: str,
    band_role: str,
) -> list[Delays]:
    """Return the delays of all stimuli; raises UsageError for an unknown channel."""
    results = []
    stimuli: tuple[tuple[Modality, list[int], str], ...] = (
        ("picture", commands.picture_ns, display_role),
        ("sound", commands.sound_ns, "speaker"),
        ("vibration", commands.vibration_ns, band_role),
    )
    for modality, asked_ns, source in stimuli:
        channel = channels[modality]
        if not asked_ns or channel == "none":
            continue
        if channel not in traces:
            raise UsageError(
                f"the sensor has no channel {channel!r} for {modality}; it has "
                f"{names_or_none(traces)}"
            )
        trace = traces[channel]
        results.append(
            delays(
                modality,
                source,
                trace.t_ns,
                trace.level,
                asked_ns,
                flash_ns=commands.flash_ns,
                frame_ns=commands.frame_ns,
            )
        )
    return results


def pose_age_of(commands: StimulusTimes, results: Sequence[Delays]) -> PoseAge:
    """Return the age of pictures' heads by the display's stamps and the delay of its light."""
    described_ns, handed_ns = heads_of(commands.display_batches)
    light_of = dict(zip(commands.begun_ns, commands.light_ns, strict=True))
    rows = [i for i, at_ns in enumerate(handed_ns.tolist()) if at_ns in light_of]
    light_ns = np.array([light_of[int(handed_ns[i])] for i in rows], np.int64)
    return pose_age(described_ns[rows], handed_ns[rows], light_ns, _picture_delay_ms(results))


def pace_of(commands: StimulusTimes) -> RuntimePace:
    """Return whether the display showed every frame once."""
    begun_ns = np.array(commands.begun_ns, np.int64)
    return runtime_pace(begun_ns, commands.frame_ns, account_of(commands.display_batches))


def gaze_bound_of(
    commands: StimulusTimes,
    results: Sequence[Delays],
    role: str,
    *,
    min_latency_ms: float = MIN_LATENCY_MS,
) -> GazeDelayBound:
    """Return the bound on a tracker's delay from the saccades to the test's spots."""
    batches = [batch for batch in commands.gaze_batches if batch.schema.name == "gaze"]
    late_ns = 0.0 if np.isnan(d := _picture_delay_ms(results)) else d * NS_PER_MS
    light_ns = [round(at_ns + late_ns) for at_ns in commands.gaze_ns]
    if not batches:
        return gaze_delay_bound(role, np.full(len(light_ns), np.nan), min_latency_ms=min_latency_ms)
    device_ns = np.concatenate([batch.t_device_ns for batch in batches])
    host_ns = np.concatenate([batch.t_host_ns for batch in batches])
    values = np.concatenate([batch.values for batch in batches])
    pairs = commands.gaze_pairs
    fit = fit_clock(pairs) if pairs else fit_one_way(device_ns, host_ns)
    since_ns = device_ns - fit.reference_device_ns
    t_ns = device_ns + fit.offset_ns + np.rint(since_ns * fit.drift_ppm * 1e-6).astype(np.int64)
    order = np.argsort(t_ns, kind="stable")
    gaze = values["direction_head"].astype(np.float64)
    latencies = saccade_latencies_ms(t_ns[order], gaze[order], values["valid"][order], light_ns)
    return gaze_delay_bound(role, latencies, min_latency_ms=min_latency_ms)


def _picture_delay_ms(results: Sequence[Delays]) -> float:
    return next((r.median_ms for r in results if r.modality == "picture" and r.is_sound), np.nan)


def _keep_gaze(commands: StimulusTimes, tracker: EyeTracker | None) -> None:
    if tracker is not None:
        commands.gaze_pairs = list[ClockPair](tracker.clock_pairs())


def perform_real(
    lab: LabConfig,
    clock: Clock,
    *,
    sensor_name: str,
    speaker_name: str,
    band_role: str,
    channels: Mapping[str, str],
    repeats: int,
    progress: Callable[[int], None],
    eyes_role: str = "",
) -> tuple[list[Delays], StimulusTimes, Sensor]:
    """Test the display of this lab, and its speaker and band where they are named.

    Before a screen the participant's window is opened as in a session.

    Raises:
        UsageError: a device to be tested is simulated, or the lab does not have it.
        StageError: there is nothing that draws, or not the monitor that is described.
        DeviceError: a device fails, or somebody closed the window.
    """
    screen = lab.display.on_screen
    if screen is None and "headset" not in lab.devices:
        raise UsageError(
            f"{lab.path} has no display to test: add the role headset under devices, or describe "
            "the screen under display (docs/screens.md)"
        )
    if screen is None and lab.devices["headset"].simulated:
        raise UsageError("the lab's display is simulated; use --simulated, or configure a real one")
    with ExitStack() as stack:
        sensor = real_sensor(lab, sensor_name, clock, stack)
        band = _real_device(lab, band_role, clock, stack) if band_role else None
        if band is not None and not isinstance(band, Armband):
            raise UsageError(f"{band_role} is not an armband; leave --band out, or name one's role")
        # A window has its own OpenGL context; a headset is given pictures drawn off the screen.
        display = screen_display(lab, clock)
        if screen is not None and display is not None:
            window = open_on_monitor(screen, display, clock, "Visavis: synchronisation test")
            stack.callback(window.close)
            headset: Headset = display
            context, progress = window.context, _while_open(window, progress)
        else:
            headset = cast("Headset", build_device(lab.devices["headset"], clock, None, 0, stack))
            getattr(headset, "show_images", lambda: None)()
            context = offscreen_context()
            stack.callback(release_offscreen, context)
        display_batches: list[SampleBatch] = []
        gaze_batches: list[SampleBatch] = []
        open_device(stack, headset, display_batches.append)
        if band is not None:
            open_device(stack, band)
        tracker: EyeTracker | None = None
        if eyes_role:
            tracker = cast("EyeTracker", _real_device(lab, eyes_role, clock, stack))
            if not hasattr(tracker, "begin_calibration"):
                raise UsageError(f"{eyes_role} is no eye tracker; leave --eyes out, or name one's")
            open_device(stack, tracker, gaze_batches.append)
        speaker = real_speaker(speaker_name, stack) if speaker_name else None
        # The sensor opens last, when everything that it measures runs.
        patch = Patch(headset, context)
        stack.callback(patch.release)
        stack.callback(sensor.close)
        sensor.open()
        commands = perform(
            sensor,
            clock,
            np.random.default_rng(),
            patch=patch,
            speaker=speaker,
            band=band,
            eye_tracker=tracker,
            repeats=repeats,
            progress=progress,
        )
        commands.display_batches, commands.gaze_batches = display_batches, gaze_batches
        _keep_gaze(commands, tracker)
        results = analyse(commands, sensor.traces(), channels, patch.role, band_role)
        return results, commands, sensor


def _while_open(window: "Window", progress: Callable[[int], None]) -> Callable[[int], None]:
    """Return a progress function that ends the test once the window has been closed."""

    def report_while_open(count: int) -> None:
        if window.closed:
            raise DeviceError("the window was closed", role="screen", remedy="run the test again")
        progress(count)

    return report_while_open


def perform_simulated(
    *,
    seed: int,
    repeats: int,
    picture: PlantedDelay,
    sound: PlantedDelay,
    lab: LabConfig | None = None,
    gaze_delay_ms: float | None = None,
    rise_ms: float = 30.0,
    loss_01: float = 0.0,
    progress: Callable[[int], None] = lambda count: None,
) -> tuple[list[Delays], StimulusTimes, Sensor, dict[str, Float]]:
    """Test the simulated room on the virtual clock; return its true delays (ms), too.

    With `gaze_delay_ms` an eye tracker whose stamps are that late watches the room's eyes. The
    display is a simulated headset, or the screen that `lab` describes, on a simulated monitor.
    """
    clock = SimClock()
    room_rng, board_rng, order_rng = np.random.default_rng(seed).spawn(3)
    room = SimulatedRoom(clock, room_rng, picture, sound)
    role = "armband_left_forearm"
    with ExitStack() as stack:
        context = offscreen_context()
        stack.callback(release_offscreen, context)

        display_batches: list[SampleBatch] = []
        gaze_batches: list[SampleBatch] = []

        def device(
            name: str, driver: str, sink: Sink = lambda batch: None, **options: object
        ) -> Any:
            config = DeviceConfig(role=name, driver=driver, simulated=True, options=options)
            return open_device(stack, build_device(config, clock, room, seed, stack), sink)

        display = None if lab is None else screen_display(lab, clock)
        if display is None:
            headset = SeenHeadset(
                device("headset", "simulated_headset", display_batches.append), room.show
            )
        else:
            display.attach(SeenMonitor(clock, display.display_rate_hz, room.show))
            headset = open_device(stack, display, display_batches.append)
        tracker: EyeTracker | None = None
        if gaze_delay_ms is not None:
            room.gaze_delay_ns = round(gaze_delay_ms * NS_PER_MS)
            tracker = device("eye_tracker", "pupil_core", gaze_batches.append)
        band: Armband = device(role, "simulated_armband", rise_ms=rise_ms)
        board = SyncBoardSimulator(room, clock, board_rng, loss_01=loss_01)
        sensor = SyncBoard(MemoryLink(board, clock), clock)
        sensor.open()
        patch = Patch(cast("Headset", headset), context)
        stack.callback(patch.release)
        commands = perform(
            sensor,
            clock,
            order_rng,
            patch=patch,
            speaker=RoomSpeaker(room, clock),
            band=band,
            eye_tracker=tracker,
            repeats=repeats,
            progress=progress,
        )
        commands.display_batches, commands.gaze_batches = display_batches, gaze_batches
        _keep_gaze(commands, tracker)
        results = analyse(commands, sensor.traces(), DEFAULT_CHANNELS, patch.role, role)
    command_times_ns = {
        "picture": commands.picture_ns,
        "sound": commands.sound_ns,
        "vibration": commands.vibration_ns,
    }
    true_ms = {
        name: (np.array(room.true_onsets_ns[name][: len(asked_ns)]) - np.array(asked_ns))
        / NS_PER_MS
        for name, asked_ns in command_times_ns.items()
    }
    return results, commands, sensor, true_ms
