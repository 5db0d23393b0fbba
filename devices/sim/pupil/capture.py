"""Pupil Capture as seen from the network: the other end of the Pupil Core driver's wire.

Not modelled: eye images and the pupil detector, eye-camera matching (every datum pairs two
pupils of one instant, or one pupil), the scene camera's optics (`norm_pos` is a pinhole's),
slow slippage of the headset, other plug-ins. The bytes are those of
`visavis.devices.sim.pupil.wire`.
"""

from collections import deque
from collections.abc import Sequence
from itertools import takewhile
from typing import Any, NamedTuple

import msgpack
import numpy as np
import numpy.typing as npt

from visavis.devices.body_contract import has_plans_of
from visavis.devices.contracts import Body, PlanningBody, RecallingBody
from visavis.devices.faults import FaultSchedule, WireFault
from visavis.devices.sim.gaze.calibration import CalibrationJudge
from visavis.devices.sim.gaze.tracker_error import (
    N_SLOW,
    N_WHITE,
    StretchNoise,
    SystematicError,
    TrackerErrorModel,
    draw_systematic,
    measured_directions,
)
from visavis.devices.sim.pupil.wire import (
    BINOCULAR_TOPIC,
    COLUMN,
    GAZE_VALUES,
    MONOCULAR_TOPICS,
    DatumPattern,
    GazeTemplate,
    pack_notification,
    write_datums,
)
from visavis.devices.sim.wire_noise import LEG_FLOOR_NS, NetworkLegs
from visavis.devices.transports import Frames, Message
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector

Floats = npt.NDArray[np.float64]
Times = npt.NDArray[np.int64]

MILLI_HZ = 1000
VERDICT_AFTER_NS = 500 * NS_PER_MS
DEFAULT_VERSION = "3.5.1"
DEFAULT_PORTS = (50021, 50022)
MAX_ANNOTATIONS = 1_000

_EPOCH_STREAM = 0xE0
_GARBAGE_STREAM = 0x6A
_LATENCY, _LOSS, _DUPLICATE, _REORDER, _GARBAGE = range(N_WHITE + N_SLOW, N_WHITE + N_SLOW + 5)


class _Measurements(NamedTuple):
    """What is measured of n samples: columns of `GAZE_VALUES`, datums as bytes, travel times."""

    values: Floats
    datums: npt.NDArray[np.uint8]
    delay_ns: Times

    def first(self, n: int) -> "_Measurements":
        """Return the first n, which share their memory with these."""
        return _Measurements(self.values[:n], self.datums[:n], self.delay_ns[:n])


class PupilCoreSimulator:
    """Publish gaze data of a body's eyes and answer Pupil Remote's requests.

    Sample k is taken at `k * 10**9 // rate_hz` ns of the session clock. The device's clock has
    an epoch of its own (from the seed) and runs `drift_ppm` fast. Noise is drawn from (seed,
    `body.stretch()`) and the systematic error from (seed, `body.fit()`, the fit calibrated at).
    Session time of the fault schedule begins when the simulator is made. `ports` are what
    SUB_PORT and PUB_PORT answer. `recordings` are the annotations in each recording by its name:
    the latest of those sent while it ran, once the plug-in that takes them was started.
    """

    def __init__(
        self,
        body: Body,
        *,
        seed: int,
        clock: Clock | None = None,
        rate_hz: float = 120,
        faults: FaultSchedule | None = None,
        error: TrackerErrorModel | None = None,
        drift_ppm: float = 0.0,
        eye_distance_mm: float = 64.0,
        version: str = DEFAULT_VERSION,
    ) -> None:
        self.ports = DEFAULT_PORTS
        self.annotations: deque[dict[str, Any]] = deque(maxlen=MAX_ANNOTATIONS)
        self.recordings: dict[str, deque[dict[str, Any]]] = {}
        self._recording: str | None = None
        self._captures_annotations = False
        self._body = body
        self._recalls_ns = body.recalls_ns if isinstance(body, RecallingBody) else 0
        self._plans = body if isinstance(body, PlanningBody) and has_plans_of(type(body)) else None
        self._seed = seed
        self._rate_hz = rate_hz
        self._rate_milli_hz = round(rate_hz * MILLI_HZ)
        self._faults = faults if faults is not None else FaultSchedule()
        self._error = error if error is not None else TrackerErrorModel()
        self._drift = drift_ppm * 1e-6
        self._version = version
        self._origin_ns = clock.now_ns() if clock is not None else 0
        epoch_rng = np.random.default_rng([seed, _EPOCH_STREAM])
        self._epoch_ns = int(epoch_rng.integers(10**12, 10**14))
        self._legs = NetworkLegs(seed)
        self._garbage = np.random.default_rng([seed, _GARBAGE_STREAM])
        half_mm = eye_distance_mm / 2
        centers = {0: (half_mm, 0.0, 0.0), 1: (-half_mm, 0.0, 0.0)}
        self._both = GazeTemplate(BINOCULAR_TOPIC, centers)
        self._single = tuple(
            GazeTemplate(MONOCULAR_TOPICS[eye], {eye: centers[eye]}) for eye in (0, 1)
        )
        self._half_mm = half_mm
        self._next_sample = -(-self._origin_ns * self._rate_milli_hz // (NS_PER_S * MILLI_HZ))
        self._advanced_ns = self._origin_ns - 1
        self._outbox: deque[Message] = deque()
        self._extra: list[Message] = []
        self._stretch: int | None = None
        self._noise: StretchNoise | None = None
        self._fit_pair: tuple[int, int | None] | None = None
        self._systematic: SystematicError | None = None
        self._calibrated_fit: int | None = None
        self._judge: CalibrationJudge | None = None
        self._turn: Vector | None = None
        self._room = self._make_room(16)
        self._queued_eyes: list[Floats] = []
        self._queued_ns: list[int] = []
        self._queue_key: tuple[int, int] | None = None

    def may_wait(self, t_ns: int) -> bool:
        """Tell whether messages may be read later than they arrive, which faults forbid.

        If the eyes can be asked for the past, many samples are then made at once: as soon as half
        of that time has passed, so that it seldom has to be asked for that alone.
        """
        if self._faults.faults:
            return False
        if t_ns - self._advanced_ns > self._recalls_ns // 2:
            self.advance(t_ns)
        return True

    def waits_until_ns(self) -> int:
        """Return a session time before which `may_wait` has nothing to do and returns True."""
        return 0 if self._faults.faults else self._advanced_ns + self._recalls_ns + 1

    def arriving(self, until_ns: int) -> Sequence[Message] | None:
        """Return the messages that will have arrived by a coming time, as long as the body's plans
        hold; None while a calibration goes on, and where the body has no plans.
        """
        plans = self._plans
        if plans is None or self._faults.faults or self._judge is not None:
            return None
        self._publish_queue()
        stretch_and_fit = (self._body.stretch(), self._body.fit())
        if self._noise is None or stretch_and_fit != self._queue_key:
            return None
        scale, rate = NS_PER_S * MILLI_HZ, self._rate_milli_hz
        last = ((until_ns + 1) * rate - 1) // scale
        t_list = [k * scale // rate for k in range(self._next_sample, last + 1)]
        coming: Sequence[Message] = ()
        if t_list:
            eyes = self._turned(plans.eyes_ahead(np.array(t_list, np.int64)))
            coming = self._messages(_as_rows(eyes), t_list, self._noise.following(len(t_list)))
        messages = [*self._outbox, *coming]
        return list(takewhile(lambda message: message.t_host_ns <= until_ns, messages))

    def advance(self, t_ns: int) -> None:
        """Take every sample due up to this session time."""
        scale = NS_PER_S * MILLI_HZ
        last = ((t_ns + 1) * self._rate_milli_hz - 1) // scale
        first = self._next_sample
        if self._faults.faults:
            self._publish_notifications(self._advanced_ns, t_ns)
        self._advanced_ns = max(self._advanced_ns, t_ns)
        if last < first:
            return
        self._next_sample = last + 1
        rate = self._rate_milli_hz
        t_list = [k * scale // rate for k in range(first, last + 1)]
        self._sample(np.array(t_list, np.int64), t_list)

    def outgoing(self, until_ns: int) -> Sequence[Message]:
        """Return the messages that have arrived at the host by this time."""
        if self._queued_eyes:
            self._publish_queue()
        outbox = self._outbox
        messages = []
        while outbox and outbox[0].t_host_ns <= until_ns:
            messages.append(outbox.popleft())
        if self._extra:
            due = [m for m in self._extra if m.t_host_ns <= until_ns]
            if due:
                self._extra = [m for m in self._extra if m.t_host_ns > until_ns]
                messages = sorted([*messages, *due], key=lambda m: m.t_host_ns)
        return messages

    def leg_ns(self) -> int:
        """Draw how long the next request or reply travels."""
        return self._legs.draw_ns()

    def handle_request(self, frames: Frames, t_ns: int) -> Frames | None:
        """Answer as Pupil Remote does; None while a fault keeps it silent."""
        since_ns = t_ns - self._origin_ns
        for kind in ("late_start", "disconnect", "mute"):
            if self._faults.active(kind, since_ns) is not None:
                return None
        command = frames[0]
        if command.startswith(b"notify.") and len(frames) > 1:
            self._publish_queue()  # with the calibration in force when they were measured
            self._take_notification(frames[1], t_ns)
            return (b"Notification received.",)
        return (self._reply(command, t_ns).encode(),)

    def accept(self, frames: Frames, t_ns: int) -> None:
        """Take an annotation published to PUB_PORT; other topics are ignored."""
        if len(frames) == 2 and frames[0].startswith(b"annotation"):
            payload = _unpack(frames[1])
            if payload is not None:
                self.annotations.append(payload)
                if self._recording is not None and self._captures_annotations:
                    self.recordings[self._recording].append(payload)

    def device_ns(self, t_ns: int) -> int:
        """Return what the device's clock shows at a session time."""
        since_ns = t_ns - self._origin_ns
        clock_ns = self._epoch_ns + since_ns
        if self._drift:
            clock_ns += round(self._drift * since_ns)
        for fault in self._faults.of_kind("drift"):
            clock_ns += round(max(0, since_ns - fault.start_ns) * fault.amount * 1e-6)
        for fault in self._faults.of_kind("clock_jump"):
            if since_ns >= fault.start_ns:
                clock_ns += round(fault.amount * NS_PER_S)
        return clock_ns

    def _reply(self, command: bytes, t_ns: int) -> str:
        if command == b"t":
            return repr(self.device_ns(t_ns) / NS_PER_S)
        if command == b"SUB_PORT":
            return str(self.ports[0])
        if command == b"PUB_PORT":
            return str(self.ports[1])
        if command == b"v":
            fault = self._faults.active("version", t_ns - self._origin_ns)
            return fault.text if fault is not None else self._version
        if command[:1] == b"R":
            self._recording = command[2:].decode("utf-8", "replace")
            self.recordings[self._recording] = deque(maxlen=MAX_ANNOTATIONS)
        elif command[:1] == b"r":
            self._recording = None
        if command[:1] in (b"R", b"r", b"C", b"c"):
            return "OK"
        return "Unknown command."

    def _make_room(self, n: int) -> _Measurements:
        return _Measurements(
            np.empty((n, len(GAZE_VALUES))),
            np.empty((n, self._both.pattern.bytes.size), np.uint8),
            np.empty(n, np.int64),
        )

    def _sample(self, t: Times, t_list: list[int]) -> None:
        """Sample the body's eyes now; their messages are made when they are read."""
        eyes = self._body.eyes(t)
        queue_key = (self._body.stretch(), self._body.fit())
        if queue_key != self._queue_key:
            self._publish_queue()
            self._queue_key = queue_key
        if self._judge is not None:
            stamps_s = [self.device_ns(t_ns) / NS_PER_S for t_ns in t_list]
            left, right = eyes["left_direction_head"], eyes["right_direction_head"]
            self._judge.observe(stamps_s, left, right, eyes["openness_01"])
        self._queued_eyes.append(_as_rows(self._turned(eyes)))
        self._queued_ns += t_list
        if self._faults.faults:
            self._publish_queue()

    def _turned(self, eyes: npt.NDArray[np.void]) -> npt.NDArray[np.void]:
        """Return eyes as the last calibration turns them."""
        if self._turn is None:
            return eyes
        eyes = eyes.copy()
        for side in ("left_direction_head", "right_direction_head"):
            eyes[side] = eyes[side] @ self._turn.T
        return eyes

    def _publish_queue(self) -> None:
        """Measure the eyes sampled since the last call and send the results."""
        batches, t_list = self._queued_eyes, self._queued_ns
        if not batches or self._queue_key is None:
            return
        self._queued_eyes, self._queued_ns = [], []
        eyes = batches[0] if len(batches) == 1 else np.concatenate(batches)
        stretch, fit = self._queue_key
        if stretch != self._stretch or self._noise is None:
            self._stretch = stretch
            self._noise = StretchNoise(self._error, self._seed, stretch, self._rate_hz)
        fit_pair = (fit, self._calibrated_fit)
        if fit_pair != self._fit_pair or self._systematic is None:
            self._fit_pair = fit_pair
            self._systematic = draw_systematic(
                self._error, self._seed, fit=fit_pair[0], calibrated_fit=fit_pair[1]
            )
        noise = self._noise.take(len(t_list))
        if self._faults.faults:
            measurements = self._measured(eyes, t_list, noise)
            delays: list[int] = measurements.delay_ns.tolist()
            self._publish_faulty(t_list, delays, measurements.values, noise)
            return
        self._outbox.extend(self._messages(eyes, t_list, noise))

    def _messages(self, eyes: Floats, t_list: list[int], noise: Floats) -> list[Message]:
        """Return the messages of measured eyes, with the times of their arrival."""
        measurements = self._measured(eyes, t_list, noise)
        delays: list[int] = measurements.delay_ns.tolist()
        frames = self._both.messages(measurements.datums)
        return [
            Message(t_ns + delay, of_one)
            for t_ns, delay, of_one in zip(t_list, delays, frames, strict=True)
        ]

    def _measured(self, eyes: Floats, t_list: list[int], noise: Floats) -> _Measurements:
        """Measure eyes (n, 8) at times with noise; the result is overwritten by the next."""
        n = len(t_list)
        if self._drift or self._faults.faults:
            t_device, ahead_ns = np.array([self.device_ns(t_ns) for t_ns in t_list], np.int64), 0
        else:
            t_device, ahead_ns = np.array(t_list, np.int64), self._epoch_ns - self._origin_ns
        assert self._systematic is not None  # noqa: S101 - drawn before the first is published
        if n > self._room.delay_ns.size:  # reused by every call, which copies its messages
            self._room = self._make_room(2 * n)
        measurements = self._room.first(n)
        _measure(
            eyes,
            noise,
            self._systematic.offset_rad,
            self._systematic.gain,
            self._half_mm,
            t_device,
            ahead_ns,
            self._error.latency_ms,
            self._error.latency_jitter_ms,
            self._both.pattern,
            measurements,
        )
        return measurements

    def _publish_faulty(
        self, t_list: list[int], delays: list[int], values: Floats, noise: Floats
    ) -> None:
        period_ns = NS_PER_S * MILLI_HZ // self._rate_milli_hz
        for i, t_ns in enumerate(t_list):
            since_ns = t_ns - self._origin_ns
            active = {
                fault.kind: fault
                for fault in self._faults.faults
                if fault.start_ns <= since_ns < fault.end_ns
            }
            if active.keys() & {"late_start", "silence", "disconnect"}:
                continue
            if _happens(active, "loss", noise[i, _LOSS]):
                continue
            row = values[i : i + 1]
            if "backward" in active:
                row[0, 0] -= active["backward"].amount
            template = self._both
            if "eyes_lost" in active:
                eyes = active["eyes_lost"].eyes
                if eyes == "both":
                    row[0, COLUMN["confidence"]] = 0.0
                    row[0, COLUMN["confidence0"] : COLUMN["confidence1"] + 1] = 0.0
                else:
                    template = self._single[0 if eyes == "left" else 1]
            frames: Frames = template.pack(row)[0]
            if _happens(active, "garbage", noise[i, _GARBAGE]):
                frames = (frames[0], self._garbage.bytes(int(self._garbage.integers(1, 400))))
            arrival_ns = t_ns + delays[i]
            if "burst" in active:
                arrival_ns = max(arrival_ns, self._origin_ns + active["burst"].end_ns)
            if _happens(active, "reorder", noise[i, _REORDER]):
                arrival_ns += 2 * period_ns
            self._extra.append(Message(arrival_ns, frames))
            if _happens(active, "duplicate", noise[i, _DUPLICATE]):
                self._extra.append(Message(arrival_ns, frames))

    def _publish_notifications(self, after_ns: int, until_ns: int) -> None:
        for fault in self._faults.of_kind("notify"):
            at_ns = self._origin_ns + fault.start_ns
            if after_ns < at_ns <= until_ns:
                self._notify(fault.text, at_ns)

    def _notify(self, subject: str, t_ns: int, **fields: Any) -> None:
        frames = pack_notification(subject, timestamp=self.device_ns(t_ns) / NS_PER_S, **fields)
        self._extra.append(Message(t_ns + LEG_FLOOR_NS, frames))

    def _take_notification(self, payload: bytes, t_ns: int) -> None:
        notification = _unpack(payload)
        if notification is None:
            return
        subject = notification.get("subject")
        if subject == "start_plugin" and notification.get("name") == "Annotation_Capture":
            self._captures_annotations = True
        if subject == "calibration.should_start":
            if "translation_eye0" in notification and "translation_eye1" in notification:
                self._judge = CalibrationJudge()
                self._notify("calibration.started", t_ns)
        elif subject == "calibration.add_ref_data" and self._judge is not None:
            self._judge.add_references(notification.get("ref_data", ()))
        elif subject == "calibration.should_stop" and self._judge is not None:
            verdict = self._judge.verdict()
            self._judge = None
            self._notify("calibration.stopped", t_ns)
            if verdict.reason is None:
                self._calibrated_fit = self._body.fit()
                self._turn = verdict.turn
                self._notify("calibration.successful", t_ns + VERDICT_AFTER_NS)
            else:
                self._notify("calibration.failed", t_ns + VERDICT_AFTER_NS, reason=verdict.reason)


def _as_rows(eyes: npt.NDArray[np.void]) -> Floats:
    """Return eyes, records of `EYES_DTYPE`, as rows (n, 8)."""
    return np.ndarray((len(eyes), 8), np.float64, np.ascontiguousarray(eyes))


def _happens(active: dict[str, WireFault], kind: str, draw: float) -> bool:
    return kind in active and draw < active[kind].amount


def _unpack(payload: bytes) -> dict[str, Any] | None:
    try:
        content = msgpack.unpackb(payload, strict_map_key=False)
    except (ValueError, msgpack.UnpackException):
        return None
    return content if isinstance(content, dict) else None


@compiled
def _measure(
    eyes: Floats,
    noise: Floats,
    offset_rad: Floats,
    gain: Floats,
    half_mm: float,
    t_ns: Times,
    ahead_ns: int,
    latency_ms: float,
    latency_jitter_ms: float,
    pattern: DatumPattern,
    measurements: _Measurements,
) -> None:
    """Measure `eyes` (n, 8), rows of `EYES_DTYPE`, into `measurements`.

    The device's clock shows `ahead_ns` more than `t_ns`.
    It is one call, because a frame brings only one or two samples.
    """
    values, delay_ns = measurements.values, measurements.delay_ns
    n = eyes.shape[0]
    directions = np.empty((n, 2, 3))
    measured_directions(eyes[:, 0:3], eyes[:, 3:6], noise, offset_rad, gain, directions)
    fill_values(directions, eyes[:, 6], eyes[:, 7], half_mm, values)
    for i in range(n):
        # Whole nanoseconds are added before the division: seconds as floats would lose the last.
        values[i, 0] = (t_ns[i] + ahead_ns) / 1e9
        jitter_ms = (2.0 * noise[i, _LATENCY] - 1.0) * latency_jitter_ms
        delay_ns[i] = np.int64((jitter_ms + latency_ms) * 1e6)
    write_datums(values, pattern, measurements.datums)


@compiled
def fill_values(
    directions: Floats, openness_01: Floats, pupil_mm: Floats, half_mm: float, values: Floats
) -> None:
    """Write the columns of `GAZE_VALUES`, except the time, from the measured eyes.

    `directions` (n, 2, 3) is in the head frame, left eye first; an eye closed by half or more loses
    confidence. The gaze point is the closest approach of both lines, at most 10 m away.
    """
    for i in range(directions.shape[0]):
        lx, ly, lz = directions[i, 0, 0], -directions[i, 0, 1], -directions[i, 0, 2]
        rx, ry, rz = directions[i, 1, 0], -directions[i, 1, 1], -directions[i, 1, 2]
        confidence = min(1.0, max(0.0, openness_01[i] * 1.2 - 0.1)) * 0.99
        closing = lx - rx
        depth_mm = 10_000.0
        if closing > 2.0 * half_mm / depth_mm:
            depth_mm = 2.0 * half_mm / closing
        mx, my, mz = (lx + rx) / 2, (ly + ry) / 2, (lz + rz) / 2
        values[i, 1] = confidence
        values[i, 2] = 0.5 + 0.5 * mx / max(mz, 0.1)
        values[i, 3] = 0.5 - 0.5 * my / max(mz, 0.1)
        values[i, 4] = mx * depth_mm
        values[i, 5] = my * depth_mm
        values[i, 6] = mz * depth_mm
        values[i, 7], values[i, 8], values[i, 9] = rx, ry, rz
        values[i, 10], values[i, 11], values[i, 12] = lx, ly, lz
        for eye in range(2):
            values[i, 13 + eye] = confidence
            values[i, 15 + eye] = pupil_mm[i]
            values[i, 17 + eye] = pupil_mm[i] * 12.0
