"""Simulate the room of a synchronisation test: late light, late sound, and the board that notices.

The room is the body that simulated bands are worn on, the eyepiece a photodiode looks into and the
air before a loudspeaker. The board samples it by its own clock and speaks on the real board's wire.
`true_onsets_ns` holds the true onset of each event, for a comparison with the test's result.

Not modelled: how a panel's light rises and fades within a frame, echoes, what a strap swallows.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from visavis.devices.byte_links import Chunk
from visavis.devices.contracts import EYES_DTYPE, OneStretch
from visavis.devices.drivers.armband.codec import FrameReader
from visavis.devices.sync.board_codec import (
    ASK,
    BLOCK,
    BoardTime,
    Samples,
    encode_samples,
    encode_time,
)
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.geometry import Vector, direction_from_yaw_pitch_deg

PERIOD_US = 250
NS_PER_US = 1000
BITS_PER_BYTE = 10
REST, FLASH, CLICK, BUZZ = 20.0, 180.0, 90.0, 80.0
NOISE_SD = 1.0
CLICK_NS = 4 * NS_PER_MS
PITCH_HZ = 900.0
SOONEST_SACCADE_MS, SACCADE_SPREAD_MS = 100.0, 40.0
LOOK_DEG = 7.0
LOOK_LEFT, LOOK_RIGHT = (
    direction_from_yaw_pitch_deg(yaw_deg, 0.0) for yaw_deg in (LOOK_DEG, -LOOK_DEG)
)


@dataclass(frozen=True)
class PlantedDelay:
    """How late a thing is in the simulated room: at least `latency_ms`, and evenly up to
    `jitter_ms` more; `drift_ms_per_min` is added as the test goes on.
    """

    latency_ms: float = 0.0
    jitter_ms: float = 0.0
    drift_ms_per_min: float = 0.0

    def late_ns(self, since_start_ns: int, rng: np.random.Generator) -> int:
        """Draw one delay."""
        drift_ms = self.drift_ms_per_min * since_start_ns / (60 * NS_PER_S)
        return round((self.latency_ms + rng.uniform(0, self.jitter_ms) + drift_ms) * NS_PER_MS)


@dataclass
class SimulatedRoom(OneStretch):
    """The room at the participant's place; times are the session's."""

    clock: Clock
    rng: np.random.Generator
    picture: PlantedDelay = field(default_factory=lambda: PlantedDelay(9.0, 1.0))
    sound: PlantedDelay = field(default_factory=lambda: PlantedDelay(22.0, 3.0))

    def __post_init__(self) -> None:
        self.start_ns = self.clock.now_ns()
        self.true_onsets_ns: dict[str, list[int]] = {"picture": [], "sound": [], "vibration": []}
        self._light: list[tuple[int, bool]] = []
        self._clicks: list[int] = []
        self._buzz: list[tuple[int, float]] = [(self.start_ns, 0.0)]
        self._is_lit = False
        self.gaze_delay_ns: int | None = None
        """How late an eye tracker's stamps are on these eyes; None: they look straight ahead."""
        self._saccades: list[tuple[int, bool]] = []

    def show(self, is_lit: bool, t_display_ns: int) -> None:
        """Take the corner of a frame whose light should leave at this time."""
        if is_lit == self._is_lit:
            return
        self._is_lit = is_lit
        at_ns = t_display_ns + self.picture.late_ns(t_display_ns - self.start_ns, self.rng)
        self._light.append((at_ns, is_lit))
        if self.gaze_delay_ns is not None:
            latency_ms = SOONEST_SACCADE_MS + float(self.rng.exponential(SACCADE_SPREAD_MS))
            self._saccades.append((at_ns + round(latency_ms * NS_PER_MS), is_lit))
        if is_lit:
            self.true_onsets_ns["picture"].append(at_ns)

    def click(self, t_ns: int) -> None:
        """Take a click that was handed to the sound card."""
        at_ns = t_ns + self.sound.late_ns(t_ns - self.start_ns, self.rng)
        self._clicks.append(at_ns)
        self.true_onsets_ns["sound"].append(at_ns)

    def levels(self, t_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.uint8]:
        """Return light, sound and motion (n, 3) as the board's inputs read them."""
        levels = self.rng.normal(REST, NOISE_SD, (t_ns.size, 3))
        switch_ns = np.array([at for at, _ in self._light], np.int64)
        if switch_ns.size:
            last = np.searchsorted(switch_ns, t_ns, side="right") - 1
            light_states = np.array([on for _, on in self._light])
            levels[:, 0] += FLASH * np.where(last >= 0, light_states[last], False)
        for at_ns in self._clicks[-2:]:
            since_s = (t_ns - at_ns) / NS_PER_S
            sounding = (t_ns >= at_ns) & (t_ns < at_ns + CLICK_NS)
            levels[:, 1] += CLICK * sounding * np.abs(np.cos(2 * np.pi * PITCH_HZ * since_s))
        at = np.array([t for t, _ in self._buzz], np.int64)
        strength = np.array([s for _, s in self._buzz])
        last = np.maximum(np.searchsorted(at, t_ns, side="right") - 1, 0)
        levels[:, 2] += BUZZ * strength[last]  # the board measures magnitude, without phase
        return np.clip(np.rint(levels), 0, 255).astype(np.uint8)

    # ---- the body that is worn and tracked ----------------------------------------------------

    def feel(self, role: str, amplitudes_01: Sequence[float], t_ns: int) -> None:
        """Receive the levels of a band's motors."""
        strength = max(amplitudes_01)
        if strength > 0 and self._buzz[-1][1] == 0:
            self.true_onsets_ns["vibration"].append(t_ns)
        self._buzz.append((t_ns, strength))

    def eyes(self, t_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.void]:
        """Return eyes that look to the left, and to the right while the corner is lit.

        They go there a saccade's latency after the light, which is how a person looks at the spots
        of the test; a tracker sees them `gaze_delay_ns` late.
        """
        values = np.zeros(t_ns.size, EYES_DTYPE)
        where: Vector = np.array([0.0, 0.0, -1.0])
        if self.gaze_delay_ns is not None:
            saccades = sorted(self._saccades)
            at_ns = np.array([t for t, _ in saccades], np.int64)
            rights = np.array([False, *(is_right for _, is_right in saccades)])
            is_right = rights[np.searchsorted(at_ns, t_ns - self.gaze_delay_ns, side="right")]
            where = np.where(is_right[:, None], LOOK_RIGHT, LOOK_LEFT)
        for side in ("left", "right"):
            values[f"{side}_direction_head"] = where
        values["openness_01"] = 1.0
        return values

    def head(self, t_ns: int) -> tuple[Vector, Vector]:
        """Return a head that lies still, as a headset on the table does."""
        return np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0, 0.0])

    def segments(
        self, names: Sequence[str], t_ns: npt.NDArray[np.int64]
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Return limbs that lie still."""
        turn = np.zeros((t_ns.size, len(names), 4))
        turn[..., 0] = 1.0
        return np.zeros((t_ns.size, len(names), 3)), turn


class SyncBoardSimulator:
    """The board's `BytePeer`: samples the room, stamps with its own clock, loses blocks.

    `drift_ppm` is how fast its clock runs; bytes take their time at `baud`, then `latency_ms` and
    up to `jitter_ms` more; one block in `1 / loss_01` never arrives.
    """

    def __init__(
        self,
        room: SimulatedRoom,
        clock: Clock,
        rng: np.random.Generator,
        *,
        drift_ppm: float = 40.0,
        baud: int = 250_000,
        latency_ms: float = 0.3,
        jitter_ms: float = 0.8,
        loss_01: float = 0.0,
    ) -> None:
        self._room = room
        self._clock = clock
        self._rng = rng
        self._rate = 1 + drift_ppm * 1e-6
        self._byte_ns = BITS_PER_BYTE * NS_PER_S / baud
        self._latency_ns, self._jitter_ns = latency_ms * NS_PER_MS, jitter_ms * NS_PER_MS
        self._loss_01 = loss_01
        self._origin_ns = clock.now_ns() - 7 * NS_PER_S
        self._reader = FrameReader()
        self._block = -1
        self._free_ns = self._arrival_ns = 0
        self._outbound: deque[Chunk] = deque()

    def connect(self, t_ns: int) -> None:
        """Begin to sample."""
        self._outbound.clear()
        self._block = self._block_at(t_ns)

    def accept(self, data: bytes, t_ns: int) -> None:
        """Answer requests for the clock."""
        there_ns = t_ns + round(len(data) * self._byte_ns + self._delay_ns())
        for frame in self._reader.feed(data):
            if frame.kind == ASK:
                answer = BoardTime(frame.seq, self._device_us(there_ns) % 2**32)
                self._send(encode_time(answer), there_ns)

    def outgoing(self, until_ns: int) -> Sequence[Chunk]:
        """Sample up to this time and return the chunks that have arrived."""
        while self._block_at(until_ns) > self._block:
            first_us = self._block * BLOCK * PERIOD_US
            stamps_us = first_us + np.arange(BLOCK, dtype=np.int64) * PERIOD_US
            t_ns = self._origin_ns + np.rint(stamps_us * NS_PER_US / self._rate).astype(np.int64)
            samples = Samples(
                self._block % 256, first_us % 2**32, PERIOD_US, self._room.levels(t_ns)
            )
            self._block += 1
            if self._rng.random() >= self._loss_01:
                self._send(encode_samples(samples), int(t_ns[-1]))
        chunks: list[Chunk] = []
        while self._outbound and self._outbound[0].t_host_ns <= until_ns:
            chunks.append(self._outbound.popleft())
        return chunks

    def _block_at(self, t_ns: int) -> int:
        return self._device_us(t_ns) // (BLOCK * PERIOD_US)

    def _device_us(self, t_ns: int) -> int:
        return int((t_ns - self._origin_ns) * self._rate / NS_PER_US)

    def _delay_ns(self) -> float:
        return self._latency_ns + float(self._rng.uniform(0, self._jitter_ns))

    def _send(self, data: bytes, t_ns: int) -> None:
        self._free_ns = max(t_ns, self._free_ns) + round(len(data) * self._byte_ns)
        self._arrival_ns = max(self._arrival_ns, self._free_ns + round(self._delay_ns()))
        self._outbound.append(Chunk(self._arrival_ns, data))
