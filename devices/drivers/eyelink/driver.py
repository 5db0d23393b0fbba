"""Drive an SR Research EyeLink through the vendor's pylink.

Codec: `visavis.devices.drivers.eyelink.codec`. Transport:
`visavis.devices.drivers.eyelink.library`. A screen-based tracker: rays are in the head frame of
`streaming.gaze_rays.Screen`, from eyes at the viewing place. Tested with pylink's own dummy and a
stand-in for pylink; never yet with a real tracker.
"""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from visavis.devices.contracts import (
    CalibrationOutcome,
    ClockPair,
    DeviceState,
    Fault,
    SessionName,
)
from visavis.devices.drivers.eyelink import codec
from visavis.devices.drivers.eyelink.library import TIME, VERDICT
from visavis.devices.drivers.eyelink.spec import EYELINK, PupilScale
from visavis.devices.drivers.streaming.gaze_device import GazeDevice
from visavis.devices.drivers.streaming.gaze_rays import Sample
from visavis.devices.drivers.streaming.screen import Screen
from visavis.devices.plausible import PUPIL_MM
from visavis.devices.transports import Exchange, Frames, Message, MessageTransport
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import DeviceTimeout
from visavis.lab.geometry import Vector, unit

ASK_WITHIN_NS = NS_PER_S // 5
NO_RESULT = 1000
"""Result of the library as long as nothing was calibrated since it connected."""
VERDICTS = {1: "poor calibration", 27: "calibration was ended with Esc", -1: "calibration failed"}
MIN_PUPILS = 200
PERHAPS_OTHER_UNIT = "was artificial_pupil_units measured otherwise?"
RECORD_WITHIN_NS = 10 * NS_PER_S
SETUP_WITHIN_NS = 180 * NS_PER_S
"""How long the host may take to calibrate within a session."""
LOOK_EVERY_NS = NS_PER_S // 50


class EyeLink(GazeDevice):
    """Follow the `EyeTracker` contract over pylink; its host computer leads calibrations.

    `pupil_scale` comes from an artificial pupil measured in the lab; without it pupils stay
    unknown, because the tracker's unit depends on camera and distance.
    """

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        *,
        rate_hz: float = 1000.0,
        lost_after_s: float = 2.0,
        exchange_interval_s: float = 1.0,
        screen: Screen | None = None,
        screen_px: tuple[int, int] = (1920, 1080),
        pupil_scale: PupilScale = codec.UNKNOWN_PUPIL,
        eye_distance_mm: float = 64.0,
        drift_correction: bool = False,
    ) -> None:
        self._corrects_drift = drift_correction
        self._setup_until_ns: int | None = None
        self._target: Vector | None = None
        self._has_shown = False
        self._look_ns = 0
        self._screen = screen or Screen()
        self._screen_px = screen_px
        self._pupil_scale = pupil_scale
        self._pupil_count = self._wrong_pupil_count = 0
        self._last_pupil_mm = 0.0
        self._half_m = eye_distance_mm * 5e-4
        extra = {"pupil"} if pupil_scale.artificial_units else set()
        capabilities = EYELINK.product.capabilities | extra
        super().__init__(
            role,
            transport,
            clock,
            replace(EYELINK, product=replace(EYELINK.product, capabilities=capabilities)),
            rate_hz=rate_hz,
            lost_after_s=lost_after_s,
            exchange_interval_s=exchange_interval_s,
        )

    def annotate(self, text: str, t_host_ns: int) -> None:
        """Send a message into the tracker's file; it begins with its delay in ms."""
        self._life.require("annotate", DeviceState.OPEN, DeviceState.STREAMING)

        def send() -> None:
            late_ns = self._clock.now_ns() - t_host_ns
            self._transport.send(0, (codec.delayed_message(text, late_ns).encode(),))

        self._mark(send)

    def begin_recording(self, name: SessionName, folder: Path) -> None:
        """Let the host record to a file of the session's name; it is fetched as `<role>.edf`."""
        self._life.require("begin_recording", DeviceState.OPEN)
        path = folder / f"{self.info.role}.edf"
        frames = (b"record", codec.edf_name(name).encode(), str(path).encode())
        self._ask(frames, self._clock.now_ns() + RECORD_WITHIN_NS)

    def lead_calibration(self) -> None:
        """Stop recording and let the host calibrate; it says where its targets belong."""
        self._life.require("lead_calibration", DeviceState.STREAMING)
        self._calibration = None

        def begin() -> None:
            self._ask((b"setup",), self._clock.now_ns() + RECORD_WITHIN_NS)
            self._setup_until_ns = self._clock.now_ns() + SETUP_WITHIN_NS
            self._target, self._has_shown = None, False

        self._wire.do(begin)

    def wanted_target(self) -> Vector | None:
        """Return the direction of the host's target; None while it shows none."""
        return self._target

    def calibration_verdict(self) -> CalibrationOutcome | None:
        """Return the host's verdict; None until it came and the tracker records again."""
        return None if self.is_paused else self._calibration

    @property
    def is_paused(self) -> bool:
        """Tell whether the host calibrates: it sends no samples then."""
        return self._setup_until_ns is not None

    def correct_drift(self, direction_head: Vector) -> CalibrationOutcome:
        """Let the host shift gaze onto this direction, where `drift_correction` allows it."""
        self._life.require("correct_drift", DeviceState.STREAMING)
        if not self._corrects_drift:
            return CalibrationOutcome(False, "not corrected: drift_correction is off")
        x, y, z = (float(v) for v in direction_head)
        place = codec.target_px((x, y, z), self._screen, self._screen_px)
        codes: list[int] = []

        def correct() -> None:
            frames = (b"drift", f"{place[0]} {place[1]}".encode())
            answer = self._ask(frames, self._clock.now_ns() + ASK_WITHIN_NS).frames[1]
            codes.append(VERDICT.unpack_from(answer)[0])

        self._wire.do(correct)
        (code,) = codes
        return CalibrationOutcome(code == 0, codec.DRIFT_RESULTS.get(code, f"code {code}"))

    def poll(self, timeout_s: float) -> int:
        """Deliver samples; while the host calibrates, ask what it shows. See the contract."""
        if self._life.state is not DeviceState.STREAMING or self._setup_until_ns is None:
            return super().poll(timeout_s)
        self._heard_ns = self._clock.now_ns()  # silence is meant
        row_count = super().poll(timeout_s)
        if self._clock.now_ns() >= self._look_ns:
            self._look_ns = self._clock.now_ns() + LOOK_EVERY_NS
            self._look_at_setup(self._setup_until_ns)
        return row_count

    def _look_at_setup(self, until_ns: int) -> None:
        now_ns = self._clock.now_ns()
        try:
            answer = self._ask((b"target",), now_ns + ASK_WITHIN_NS).frames[1]
        except DeviceTimeout:
            return
        is_shown, x, y, code = codec.TARGET.unpack(answer)
        if is_shown:
            self._has_shown = True
            shares = x / self._screen_px[0], y / self._screen_px[1]
            self._target = unit(np.array(self._screen.point_m(*shares)))
        else:
            self._target = None
        is_over = self._has_shown and code != NO_RESULT  # an earlier result stands until then
        if not is_over and now_ns < until_ns:
            return
        self._setup_until_ns, self._target = None, None
        self._ask((b"leave",), now_ns + RECORD_WITHIN_NS)
        if is_over:
            self._take_verdict(self._ask((b"verdict",), now_ns + RECORD_WITHIN_NS).frames[1])
        if self._calibration is None:
            text = f"the host did not finish within {SETUP_WITHIN_NS / NS_PER_S:.0f} s"
            self._calibration = CalibrationOutcome(False, text)

    def _connect(self, deadline_ns: int) -> None:
        self._setup_until_ns = None
        version = self._ask((b"version",), deadline_ns).frames[1].decode("utf-8", "replace")
        self.info = replace(self.info, model=version or "EyeLink")
        verdict = self._ask((b"verdict",), deadline_ns).frames[1]
        self._take_verdict(verdict)
        self._take_time(self._ask((b"time",), deadline_ns))

    def _ask_time(self, now_ns: int) -> None:
        try:
            self._take_time(self._ask((b"time",), now_ns + ASK_WITHIN_NS))
        except DeviceTimeout:
            return  # reported by `check` if it lasts

    def _decode(self, message: Message) -> Iterable[Sample]:
        sample = codec.decode_sample(
            message.frames[0], self._screen, self._screen_px, self._half_m, self._pupil_scale
        )
        if sample is None:
            self._malformed += 1
        else:
            self._compare_pupils(codec.pupil_sizes(message.frames[0]))
            yield sample

    def _compare_pupils(self, sizes: tuple[float, ...]) -> None:
        """Count pupils that no eye has."""
        scale = self._pupil_scale
        if not scale.artificial_units:
            return
        for size in sizes:
            pupil_mm = scale.diameter_mm(size)
            self._pupil_count += 1
            if not PUPIL_MM.admit(pupil_mm):
                self._wrong_pupil_count += 1
                self._last_pupil_mm = pupil_mm

    def _own_faults(self) -> Iterable[Fault]:
        if self._pupil_count < MIN_PUPILS or 2 * self._wrong_pupil_count < self._pupil_count:
            return
        unit = "area" if self._pupil_scale.is_area else "diameter"
        yield self._warning(
            f"{PUPIL_MM.sentence('the pupil', self._last_pupil_mm)}: {PERHAPS_OTHER_UNIT}",
            f"measure the artificial pupil where the eye is, with pupil_size: {unit}",
        )

    def _take_time(self, exchange: Exchange) -> None:
        frames: Frames = exchange.frames
        if len(frames) != 2 or len(frames[1]) != TIME.size:
            self._malformed += 1
            return
        (device_ns,) = TIME.unpack(frames[1])
        self._add_pair(ClockPair(exchange.t_send_ns, device_ns, exchange.t_receive_ns))

    def _take_verdict(self, raw: bytes) -> None:
        if len(raw) < VERDICT.size:
            self._malformed += 1
            return
        (code,) = VERDICT.unpack_from(raw)
        text = raw[VERDICT.size :].decode("utf-8", "replace").strip()
        if code == NO_RESULT:
            self._calibration = None
            fault = self._uncalibrated(
                "the host has not calibrated since it was connected",
                "calibrate with `visavis devices setup`; an earlier calibration may still hold, "
                "which the validation measures",
            )
        else:
            self._calibration = CalibrationOutcome(code == 0, text or VERDICTS.get(code, str(code)))
            fault = self._uncalibrated(
                f"not calibrated: {self._calibration.message}",
                "calibrate with `visavis devices setup`",
            )
        self._note("calibrated", None if code == 0 else fault)
