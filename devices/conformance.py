"""Check that a device keeps its contract: plain functions for any driver, ours or not.

Each takes a factory that makes a fresh closed device and raises AssertionError naming the broken
promise. `let_pass(seconds)` lets session time go by: it moves a virtual clock, or waits.
"""

import itertools
from collections.abc import Callable
from functools import partial

import numpy as np

from visavis.devices.contracts import (
    GAZE,
    HAPTICS,
    HEAD,
    RESPONSES,
    SOUND_EVENTS,
    Armband,
    BodyTracker,
    Device,
    DeviceState,
    EyeTracker,
    Headset,
    ResponseInput,
    SoundOutput,
    TriggerOutput,
    body_schema,
)
from visavis.lab.clock import NS_PER_MS
from visavis.lab.errors import DeviceError
from visavis.lab.geometry import Pose
from visavis.lab.schema import SampleBatch, StreamSchema
from visavis.stimuli.sound import Waveform

LetPass = Callable[[float], None]

OPEN_DEADLINE_S = 5.0
STEP_S = 0.01
SLOW_PERIODS = 3
UNIT_LENGTH_TOLERANCE = 1e-4


def check_lifecycle(make: Callable[[], Device], let_pass: LetPass) -> None:
    """Check the states, that errors name method and state, and that close is idempotent."""
    device = make()
    _promise(device.state is DeviceState.CLOSED, "a new device is closed")
    _refuses(device, "start", lambda: device.start(lambda batch: None))
    _refuses(device, "poll", lambda: device.poll(0.0))
    _refuses(device, "stop", device.stop)
    device.open(OPEN_DEADLINE_S)
    _promise(device.state is DeviceState.OPEN, "open() leads to open")
    _refuses(device, "open", lambda: device.open(OPEN_DEADLINE_S))
    info = device.info
    _promise(bool(info.role and info.driver and info.model), "info is complete once open")
    schemas = device.describe()
    _promise(len(schemas) > 0, "describe() names at least one stream")
    _promise(device.describe() == schemas, "describe() keeps its order")
    for _ in range(2):
        device.start(lambda batch: None)
        _promise(device.state is DeviceState.STREAMING, "start() leads to streaming")
        _refuses(device, "start", lambda: device.start(lambda batch: None))
        let_pass(STEP_S)
        device.poll(0.0)
        device.stop()
        _promise(device.state is DeviceState.OPEN, "stop() leads back to open")
    device.close()
    device.close()
    _promise(device.state is DeviceState.CLOSED, "close() leads to closed, also twice")
    device.open(OPEN_DEADLINE_S)
    device.start(lambda batch: None)
    device.close()
    _promise(device.state is DeviceState.CLOSED, "close() works while streaming")


def check_batches(make: Callable[[], Device], let_pass: LetPass, *, seconds: float = 1.0) -> None:
    """Check shapes, dtypes, order and counts of what a device delivers."""
    device = make()
    batches = collect(device, let_pass, seconds=seconds)
    schemas = device.describe()
    total = sum(len(batch) for batch in batches)
    _promise(device.health().received == total, "health().received counts what was delivered")
    for schema in schemas:
        own = [batch for batch in batches if batch.schema == schema]
        if schema.nominal_rate_hz > 0:
            _promise(len(own) > 0, f"stream {schema.name!r} delivers")
        _check_stream(schema, own)
    _promise(
        all(batch.schema in schemas for batch in batches), "every batch bears a described schema"
    )
    device.close()


def check_eye_tracker(make: Callable[[], EyeTracker], let_pass: LetPass) -> None:
    """Check the gaze fields: unit vectors or NaN, validity separate from value, clock pairs."""
    device = make()
    batches = collect(device, let_pass)
    _promise(device.describe()[0].fields == GAZE.fields, "the first stream has GAZE's fields")
    gaze = device.describe()[0]
    values = np.concatenate([b.values for b in batches if b.schema == gaze])
    for name in ("direction_head", "left_direction_head", "right_direction_head"):
        lengths = np.linalg.norm(values[name].astype(np.float64), axis=1)
        is_known = np.isfinite(lengths)
        near_one = np.abs(lengths[is_known] - 1) < UNIT_LENGTH_TOLERANCE
        _promise(bool(near_one.all()), f"{name} is a unit vector or NaN, never zero")
    _promise(
        bool(np.isfinite(values["direction_head"][values["valid"]]).all()),
        "a valid sample has a direction",
    )
    _promise(bool((values["eyes_used"] <= 3).all()), "eyes_used has two bits")
    for eye in ("left", "right"):
        pupil_mm = values[f"{eye}_pupil_mm"]
        _promise(bool((~(pupil_mm <= 0)).all()), "an unknown pupil is NaN, never zero")
    for pair in device.clock_pairs():
        _promise(pair.host_receive_ns >= pair.host_send_ns, "an answer follows its request")
    device.close()


def check_headset(make: Callable[[], Headset], *, n_frames: int = 30) -> None:
    """Check pacing: rising frames at the nominal rate, one pose per frame."""
    device = make()
    device.open(OPEN_DEADLINE_S)
    batches: list[SampleBatch] = []
    device.start(batches.append)
    _promise(device.describe()[0].fields == HEAD.fields, "the first stream has HEAD's fields")
    frames = []
    for _ in range(n_frames):
        frame = device.wait_frame()
        device.submit(frame, ())
        device.poll(0.0)
        frames.append(frame)
    for before, after in itertools.pairwise(frames):
        _promise(after.index == before.index + 1 + after.dropped, "index counts dropped frames too")
        _promise(after.t_ns > before.t_ns, "frame times rise")
    _promise(
        all(frame.predicted_display_ns >= frame.t_ns for frame in frames),
        "light follows the frame's start",
    )
    span = frames[-1].index - frames[0].index
    rate_hz = span * 1e9 / (frames[-1].t_ns - frames[0].t_ns)
    _promise(abs(rate_hz / device.display_rate_hz - 1) < 0.05, "frames keep the nominal rate")
    batches = [batch for batch in batches if batch.schema.name == HEAD.name]
    _promise(sum(map(len, batches)) == n_frames, "every frame brings one pose")
    described_ns = np.concatenate([batch.t_device_ns for batch in batches]).tolist()
    light_ns = [frame.predicted_display_ns for frame in frames]
    _promise(described_ns in (light_ns, [f.t_ns for f in frames]), "a pose has the time it is of")
    values = np.concatenate([batch.values for batch in batches])
    lengths = np.linalg.norm(values["orientation_wxyz"][values["valid"]], axis=1)
    _promise(bool((np.abs(lengths - 1) < UNIT_LENGTH_TOLERANCE).all()), "valid poses are unit")
    device.close()


def check_body_tracker(make: Callable[[], BodyTracker], let_pass: LetPass) -> None:
    """Check the body stream: its shape, unit quaternions, NaN where a segment is not valid."""
    device = make()
    batches = collect(device, let_pass)
    schema = device.describe()[0]
    expected = body_schema(device.segments, schema.nominal_rate_hz)
    _promise(schema.fields == expected.fields, "the first stream has the body's fields")
    _promise(len(set(device.segments)) == len(device.segments), "segments have their own names")
    values = np.concatenate([batch.values for batch in batches])
    valid = values["valid"]
    lengths = np.linalg.norm(values["orientation_wxyz"].astype(np.float64), axis=-1)
    near_one = np.abs(lengths[valid] - 1) < UNIT_LENGTH_TOLERANCE
    _promise(bool(near_one.all()), "a valid segment has a unit quaternion")
    for name in ("position_m", "orientation_wxyz"):
        finite = np.isfinite(values[name]).all(axis=-1)
        _promise(bool((finite == valid).all()), f"{name} is NaN where, and only where, not valid")
    device.close()


def check_response_input(make: Callable[[], ResponseInput], let_pass: LetPass) -> None:
    """Check that every response names a control."""
    device = make()
    batches = collect(device, let_pass)
    _promise(device.describe()[0].fields == RESPONSES.fields, "the first stream has its fields")
    _promise(len(device.controls) > 0, "there is a control")
    for batch in (b for b in batches if b.schema.fields == RESPONSES.fields):
        is_in_range = batch.values["control"] < len(device.controls)
        _promise(bool(is_in_range.all()), "every response names a known control")
    device.close()


def check_armband(make: Callable[[], Armband], let_pass: LetPass) -> None:
    """Check that every command gives one row, that misuse is refused, and that silence is free.

    The device is used as an experiment does: settings, keep-alive once per step, silence.
    """
    device = make()
    _promise(isinstance(device, Armband), "the device has every method of an armband")
    _promise(device.silence() is not None, "silence() is allowed while closed")
    device.open(OPEN_DEADLINE_S)
    _promise(device.describe()[0].fields == HAPTICS.fields, "the first stream has HAPTICS' fields")
    device.silence()
    batches: list[SampleBatch] = []
    device.start(batches.append)
    n = device.motor_count
    _promise(n > 0, "there is a motor")
    on, off = [1.0] * n, [0.0] * n

    def go_on(seconds: float) -> None:
        for _ in range(round(seconds / STEP_S)):
            let_pass(STEP_S)
            device.keep_alive()
            device.poll(0.0)

    for amplitudes in ([*on, 0.0], [1.5] * n, [-0.1] * n, [float("nan")] * n):
        _refuses_value(partial(device.set_amplitudes, amplitudes, 100), "amplitudes")
    _refuses_value(partial(device.set_amplitudes, on, 0), "times to live")
    numbers = [device.set_amplitudes(on, 400)]
    go_on(0.3)
    numbers.append(device.set_amplitudes(off, 400))
    go_on(0.1)
    numbers.append(device.silence())
    go_on(0.6)
    commands = [b for b in batches if b.schema.name == HAPTICS.name]
    rows = np.concatenate([b.values for b in commands])
    stamps = np.concatenate([b.t_host_ns for b in commands])
    _promise(bool((stamps >= rows["t_sent_ns"]).all()), "its row bears a time after it was sent")
    for number in numbers:
        own = rows[rows["command"] == number]
        _promise(own.size == 1, "every command gives one row")
        _promise(
            bool(own["t_commanded_ns"][0] <= own["t_sent_ns"][0]), "it is sent after it was asked"
        )
    _promise(len(set(rows["command"].tolist())) == rows.size, "no number comes twice")
    columns = min(n, HAPTICS.dtype["amplitudes_01"].shape[0])
    first = rows[rows["command"] == numbers[0]]["amplitudes_01"][0]
    _promise(bool((first[:columns] == 1).all()), "the row holds what was asked")
    _promise(bool(np.isnan(first[n:]).all()), "motors that are not there are NaN")
    _promise(
        rows[rows["command"] == numbers[2]]["kind"][0] == 2, "silence() gives a row of its kind"
    )
    device.close()
    device.silence()


def check_trigger_output(
    make: Callable[[], TriggerOutput], let_pass: LetPass, *, mark: str = "trial_start"
) -> None:
    """Check that every pulse has a row, in order, with its stamps; `mark` is one with a code."""
    device = make()
    device.open(OPEN_DEADLINE_S)
    batches: list[SampleBatch] = []
    device.start(batches.append)
    let_pass(STEP_S)
    device.poll(0.0)
    _promise(not device.trigger("no_such_mark", 0), "a mark without a code is not sent")
    for number in range(3):
        _promise(device.trigger(mark, number), "trigger() says that a mark has a code")
    for _ in range(50):
        let_pass(STEP_S)
        device.poll(0.0)
    device.stop()
    rows = np.concatenate([batch.values for batch in batches])
    _promise(rows["t_commanded_ns"].tolist() == [0, 1, 2], "every mark gives one row, in order")
    _promise(len(set(rows["code"].tolist())) == 1, "the row holds the code")
    _promise(bool((rows["t_before_ns"] <= rows["t_after_ns"]).all()), "before is before after")
    _promise(bool((rows["t_after_ns"] < rows["t_released_ns"]).all()), "a pulse has a width")
    stamps = np.concatenate([batch.t_host_ns for batch in batches])
    _promise(stamps.tolist() == rows["t_after_ns"].tolist(), "a pulse bears the time of its onset")
    later = rows["t_before_ns"][1:] >= rows["t_released_ns"][:-1]
    _promise(bool(later.all()), "a pulse waits for the one before")
    device.close()


def check_sound_output(make: Callable[[], SoundOutput], let_pass: LetPass) -> None:
    """Check that every sound begins once, lasts as long as it is, and ends on command.

    A click of 100 ms is heard three times: alone, ended early, and again and again until hushed.
    """
    device = make()
    device.open(OPEN_DEADLINE_S)
    batches: list[SampleBatch] = []
    device.start(batches.append)
    click = Waveform("click", np.full((800, 1), 0.1, np.float32), 8000)
    device.prepare(click)
    device.hear_from(Pose(np.array([0.0, 1.2, 0.0]), np.array([1.0, 0.0, 0.0, 0.0])))
    _refuses_value(lambda: device.play(click, gain_db=1000.0), "a gain of 1000 dB is refused")
    numbers = []
    for case in range(3):
        at_m = np.array([1.0, 1.2, 0.0]) if case == 1 else None
        numbers.append(device.play(click, at_m=at_m, gain_db=-20.0, loops=case == 2))
        for step in range(40):
            let_pass(STEP_S)
            device.poll(0.0)
            if (case, step) in ((1, 4), (2, 30)):
                device.hush(numbers[-1])
    _promise(numbers == [0, 1, 2], "sounds are numbered from 0")
    rows = np.concatenate([batch.values for batch in batches])
    start_rows, end_rows, stop_rows = (
        rows[rows["event"] == SOUND_EVENTS.index(name)] for name in ("began", "ended", "stopped")
    )
    _promise(start_rows["sound"].tolist() == numbers, "every sound begins once, in order")
    _promise(
        bool((start_rows["t_sounding_ns"] > start_rows["t_commanded_ns"]).all()),
        "begins when asked",
    )
    _promise(end_rows["sound"].tolist() == numbers[:1], "a sound ends by itself")
    _promise(stop_rows["sound"].tolist() == numbers[1:], "a sound ends when it is told to")
    lasted_ns = int(end_rows["t_sounding_ns"][0] - start_rows["t_sounding_ns"][0])
    _promise(abs(lasted_ns - 100 * NS_PER_MS) < NS_PER_MS, "a sound lasts as long as it is")
    device.stop()
    device.close()


def collect(device: Device, let_pass: LetPass, *, seconds: float = 1.0) -> list[SampleBatch]:
    """Open, start and poll a device for a while; it is stopped but still open afterwards.

    A slow device gets the time of `SLOW_PERIODS` samples.
    """
    batches: list[SampleBatch] = []
    device.open(OPEN_DEADLINE_S)
    rates_hz = [s.nominal_rate_hz for s in device.describe() if s.nominal_rate_hz > 0]
    seconds = max([seconds, *(SLOW_PERIODS / rate_hz for rate_hz in rates_hz)])
    device.start(batches.append)
    for _ in range(round(seconds / STEP_S)):
        let_pass(STEP_S)
        before = sum(map(len, batches))
        count = device.poll(0.0)
        _promise(
            count == sum(map(len, batches)) - before, "poll() returns the samples it delivered"
        )
    device.stop()
    return batches


def _check_stream(schema: StreamSchema, batches: list[SampleBatch]) -> None:
    last_seq = -1
    last_host_ns = -(2**63)
    for batch in batches:
        n = len(batch)
        _promise(n > 0, "no batch is empty")
        _promise(batch.values.dtype == schema.dtype, "values have the schema's dtype")
        for name in ("seq", "t_device_ns", "t_host_ns"):
            column = getattr(batch, name)
            _promise(column.dtype == np.int64 and column.shape == (n,), f"{name} is int64 (n,)")
        _promise(batch.values.shape == (n,), "values have one row per sample")
        _promise(int(batch.seq[0]) > last_seq, "seq rises across batches")
        _promise(bool((np.diff(batch.seq) > 0).all()), "seq rises within a batch")
        _promise(int(batch.t_host_ns[0]) >= last_host_ns, "arrival times do not go back")
        _promise(bool((np.diff(batch.t_host_ns) >= 0).all()), "arrival times do not go back")
        last_seq, last_host_ns = int(batch.seq[-1]), int(batch.t_host_ns[-1])


def _refuses(device: Device, method: str, call: Callable[[], object]) -> None:
    try:
        call()
    except DeviceError as refusal:
        text = str(refusal)
        names_both = method in text and device.state.value in text
        _promise(names_both, f"the refusal of {method}() names method and state")
        return
    raise AssertionError(f"{method}() must be refused while {device.state.value}")


def _refuses_value(call: Callable[[], object], what: str) -> None:
    try:
        call()
    except DeviceError:
        return
    raise AssertionError(f"broken promise: wrong {what} are refused with a DeviceError")


def _promise(is_kept: bool, promise: str) -> None:
    if not is_kept:
        raise AssertionError(f"broken promise: {promise}")
