"""Take samples of a body's eyes as any eye tracker would: error, clock, faults, travel times.

The part all gaze simulators share; a simulator adds the bytes of its wire. Not modelled here:
eye images, slow slippage of the headset, a different latency per eye.
"""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple, Required, TypedDict

import numpy as np
import numpy.typing as npt

from visavis.devices.contracts import Body, RecallingBody
from visavis.devices.faults import FaultSchedule
from visavis.devices.sim.gaze.tracker_error import (
    N_SLOW,
    N_WHITE,
    StretchNoise,
    SystematicError,
    TrackerErrorModel,
    draw_systematic,
    measured_directions,
)
from visavis.devices.sim.gaze.trackers import sizes_of_error
from visavis.devices.sim.wire_noise import NetworkLegs
from visavis.devices.transports import Frames, Message
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock

MILLI_HZ = 1000
OPEN_EYE_01 = 0.5
EYE_X_M = 0.032

_EPOCH_STREAM = 0xE0
_GARBAGE_STREAM = 0x6A
_LATENCY, _LOSS, _DUPLICATE, _REORDER, _GARBAGE = range(N_WHITE + N_SLOW, N_WHITE + N_SLOW + 5)

Floats = npt.NDArray[np.float64]


class Shot(NamedTuple):
    """One sample as the tracker took it; `number` is its own counter, from 0.

    Directions are unit vectors in the head frame (NaN never: an unseen eye has `*_seen` False).
    `garbage` replaces the bytes of its message.
    """

    number: int
    t_ns: int
    t_device_ns: int
    arrival_ns: int
    left: tuple[float, float, float]
    right: tuple[float, float, float]
    left_seen: bool
    right_seen: bool
    openness_01: float
    pupil_mm: float
    garbage: bytes | None


class GazeSource:
    """Measure a body's eyes on a grid: sample k at `k * 10**9 // rate_hz` ns of session time.

    The device's clock has an epoch of its own (from the seed, unless `epoch_ns` is given) and
    runs `drift_ppm` fast. Noise is drawn from (seed, `body.stretch()`), the systematic error
    from (seed, `body.fit()`, the fit calibrated at).
    """

    def __init__(
        self,
        body: Body,
        *,
        seed: int,
        clock: Clock,
        rate_hz: float,
        faults: FaultSchedule | None = None,
        error: TrackerErrorModel | None = None,
        drift_ppm: float = 0.0,
        epoch_ns: int | None = None,
    ) -> None:
        self.body = body
        self.faults = faults if faults is not None else FaultSchedule()
        self.rate_hz = rate_hz
        self.calibrated_fit: int | None = None
        self._seed = seed
        self._rate_milli_hz = round(rate_hz * MILLI_HZ)
        self._period_ns = NS_PER_S * MILLI_HZ // self._rate_milli_hz
        self._error = error if error is not None else TrackerErrorModel()
        self._drift = drift_ppm * 1e-6
        self.origin_ns = clock.now_ns()
        random_epoch_ns = int(np.random.default_rng([seed, _EPOCH_STREAM]).integers(10**12, 10**14))
        self._epoch_ns = random_epoch_ns if epoch_ns is None else epoch_ns
        self.garbage_rng = np.random.default_rng([seed, _GARBAGE_STREAM])
        self._next = -(-self.origin_ns * self._rate_milli_hz // (NS_PER_S * MILLI_HZ))
        self._first = self._next
        self._arrived_ns = -(2**62)
        self._stretch: int | None = None
        self._noise: StretchNoise | None = None
        self._fit_pair: tuple[int, int | None] | None = None
        self._systematic: SystematicError | None = None

    def is_away(self, t_ns: int) -> bool:
        """Tell whether the device is away at this time."""
        since_ns = t_ns - self.origin_ns
        return any(
            self.faults.active(kind, since_ns) is not None for kind in ("late_start", "disconnect")
        )

    def is_unresponsive(self, t_ns: int) -> bool:
        """Tell whether requests stay unanswered at this time."""
        return self.is_away(t_ns) or self.faults.active("mute", t_ns - self.origin_ns) is not None

    def claimed_version(self, t_ns: int, version: str) -> str:
        """Return the version to claim: the fault's, else its own."""
        fault = self.faults.active("version", t_ns - self.origin_ns)
        return version if fault is None else fault.text

    def device_ns(self, t_ns: int) -> int:
        """Return what the device's clock shows at a session time."""
        since_ns = t_ns - self.origin_ns
        own_ns = self._epoch_ns + since_ns + round(self._drift * since_ns)
        return own_ns + self.faults.clock_error_ns(since_ns)

    def take(self, t_ns: int) -> list[Shot]:
        """Return the samples due up to this session time, with faults, without lost ones."""
        scale, rate = NS_PER_S * MILLI_HZ, self._rate_milli_hz
        last = ((t_ns + 1) * rate - 1) // scale
        first, self._next = self._next, max(self._next, last + 1)
        if last < first:
            return []
        times = [k * scale // rate for k in range(first, last + 1)]
        t = np.array(times, np.int64)
        eyes = self.body.eyes(t)
        directions, noise = self._measure(eyes)
        shots: list[Shot] = []
        for i, at_ns in enumerate(times):
            jitter_ms = (2.0 * noise[i, _LATENCY] - 1.0) * self._error.latency_jitter_ms
            travel_ns = round((self._error.latency_ms + jitter_ms) * NS_PER_MS)
            self._arrived_ns = max(self._arrived_ns, at_ns + travel_ns)  # samples arrive in order
            shot = Shot(
                first + i - self._first,
                at_ns,
                self.device_ns(at_ns),
                self._arrived_ns,
                tuple(directions[i, 0].tolist()),
                tuple(directions[i, 1].tolist()),
                bool(eyes["openness_01"][i] >= OPEN_EYE_01),
                bool(eyes["openness_01"][i] >= OPEN_EYE_01),
                float(eyes["openness_01"][i]),
                float(eyes["pupil_mm"][i]),
                None,
            )
            if self.faults.faults:
                shots += self._with_faults(shot, noise[i])
            else:
                shots.append(shot)
        return shots

    def _measure(self, eyes: npt.NDArray[np.void]) -> tuple[Floats, Floats]:
        stretch = self.body.stretch()
        if stretch != self._stretch or self._noise is None:
            self._stretch = stretch
            self._noise = StretchNoise(self._error, self._seed, stretch, self.rate_hz)
        fit_pair = (self.body.fit(), self.calibrated_fit)
        if fit_pair != self._fit_pair or self._systematic is None:
            self._fit_pair = fit_pair
            self._systematic = draw_systematic(
                self._error, self._seed, fit=fit_pair[0], calibrated_fit=fit_pair[1]
            )
        noise = self._noise.take(eyes.size)
        directions = np.empty((eyes.size, 2, 3))
        measured_directions(
            np.ascontiguousarray(eyes["left_direction_head"]),
            np.ascontiguousarray(eyes["right_direction_head"]),
            noise,
            self._systematic.offset_rad,
            self._systematic.gain,
            directions,
        )
        return directions, noise

    def _with_faults(self, shot: Shot, draws: Floats) -> Sequence[Shot]:
        since_ns = shot.t_ns - self.origin_ns
        active = {f.kind: f for f in self.faults.faults if f.start_ns <= since_ns < f.end_ns}
        if active.keys() & {"late_start", "silence", "disconnect"}:
            return ()

        def happens(kind: str, column: int) -> bool:
            return kind in active and draws[column] < active[kind].amount

        if happens("loss", _LOSS):
            return ()
        if "backward" in active:
            back_ns = round(active["backward"].amount * NS_PER_S)
            shot = shot._replace(t_device_ns=shot.t_device_ns - back_ns)
        if "eyes_lost" in active:
            eyes = active["eyes_lost"].eyes
            shot = shot._replace(
                left_seen=shot.left_seen and eyes == "right",
                right_seen=shot.right_seen and eyes == "left",
            )
        if happens("garbage", _GARBAGE):
            size = int(self.garbage_rng.integers(1, 200))
            shot = shot._replace(garbage=self.garbage_rng.bytes(size))
        arrival_ns = shot.arrival_ns
        if "burst" in active:
            arrival_ns = max(arrival_ns, self.origin_ns + active["burst"].end_ns)
        if happens("reorder", _REORDER):
            arrival_ns += 2 * self._period_ns
        shot = shot._replace(arrival_ns=arrival_ns)
        return (shot, shot) if happens("duplicate", _DUPLICATE) else (shot,)


class Measuring(TypedDict, total=False):
    """Keyword arguments of every `GazePeer`: how a simulated tracker measures."""

    seed: Required[int]
    clock: Required[Clock]
    rate_hz: float | None
    faults: FaultSchedule | None
    error: TrackerErrorModel | None
    drift_ppm: float
    epoch_ns: int | None


class GazePeer(ABC):
    """The other end of a message wire, fed by a `GazeSource`; a subclass defines the bytes.

    `to_message` turns a shot into frames (None: nothing is sent); `answer` answers a request.
    """

    usual_rate_hz = 120.0
    usual_epoch_ns: int | None = None
    """The epoch of the device's clock in ns; None: drawn from the seed."""
    driver = ""
    """The driver whose tracker it is, by which `trackers` knows how well it measures."""
    is_calibrated_before = False
    """Whether it was calibrated before the session, in its own program."""

    def __init__(
        self,
        body: Body,
        *,
        seed: int,
        clock: Clock,
        rate_hz: float | None = None,
        faults: FaultSchedule | None = None,
        error: TrackerErrorModel | None = None,
        drift_ppm: float = 0.0,
        epoch_ns: int | None = None,
    ) -> None:
        self.source = GazeSource(
            body,
            seed=seed,
            clock=clock,
            rate_hz=self.usual_rate_hz if rate_hz is None else rate_hz,
            faults=faults,
            error=TrackerErrorModel(**sizes_of_error(self.driver)) if error is None else error,
            drift_ppm=drift_ppm,
            epoch_ns=self.usual_epoch_ns if epoch_ns is None else epoch_ns,
        )
        if self.is_calibrated_before:
            self.source.calibrated_fit = body.fit()
        self._recalls_ns = body.recalls_ns if isinstance(body, RecallingBody) else 0
        self._advanced_ns = self.source.origin_ns - 1
        self._legs = NetworkLegs(seed)
        self._outbox: deque[Message] = deque()
        self._needs_sorting = False

    @abstractmethod
    def to_message(self, shot: Shot) -> Frames | None:
        """Return a sample's frames as the device sends them."""

    def answer(self, frames: Frames, t_ns: int) -> Frames | None:
        """Answer a request that reaches the device; None when it stays silent."""
        return None

    @property
    def is_busy(self) -> bool:
        """Tell whether samples must be taken as they are due, as while it calibrates."""
        return False

    def may_wait(self, t_ns: int) -> bool:
        """Tell whether messages may be read later than they arrive, which faults forbid.

        If the eyes can be asked for the past, many samples are then taken at once: as soon as half
        of that time has passed, so that it seldom has to be asked for that alone.
        """
        if self.source.faults.faults or self.is_busy:
            return False
        if t_ns - self._advanced_ns > self._recalls_ns // 2:
            self.advance(t_ns)
        return True

    def waits_until_ns(self) -> int:
        """Return a session time before which `may_wait` has nothing to do and returns True."""
        if self.source.faults.faults or self.is_busy:
            return 0
        return self._advanced_ns + self._recalls_ns + 1

    def arriving(self, until_ns: int) -> Sequence[Message] | None:
        """Return None: which messages are coming is not known."""
        return None

    def advance(self, t_ns: int) -> None:
        """Take every sample due up to this session time."""
        self._advanced_ns = max(self._advanced_ns, t_ns)
        for shot in self.source.take(t_ns):
            frames = self.to_message(shot)
            if frames is not None:
                self.push(shot.arrival_ns, frames)

    def push(self, arrival_ns: int, frames: Frames) -> None:
        """Send frames that arrive at the host at this time."""
        if self._outbox and arrival_ns < self._outbox[-1].t_host_ns:
            self._needs_sorting = True
        self._outbox.append(Message(arrival_ns, frames))

    def outgoing(self, until_ns: int) -> Sequence[Message]:
        """Return the messages that have arrived at the host by this time, in order of arrival."""
        if self._needs_sorting:
            self._outbox = deque(sorted(self._outbox, key=lambda m: m.t_host_ns))
            self._needs_sorting = False
        messages = []
        while self._outbox and self._outbox[0].t_host_ns <= until_ns:
            messages.append(self._outbox.popleft())
        return messages

    def leg_ns(self) -> int:
        """Draw how long the next request or reply travels."""
        return self._legs.draw_ns()

    def handle_request(self, frames: Frames, t_ns: int) -> Frames | None:
        """Answer unless a fault keeps the device silent."""
        return None if self.source.is_unresponsive(t_ns) else self.answer(frames, t_ns)

    def accept(self, frames: Frames, t_ns: int) -> None:
        """Take a message that wants no answer."""
        self.handle_request(frames, t_ns)
