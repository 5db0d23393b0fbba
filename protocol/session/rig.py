"""The devices of a session together: open, stream, watch, close."""

import contextlib
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from visavis.devices.contracts import (
    Armband,
    BodyTracker,
    ClockPair,
    Device,
    DeviceInfo,
    EyeTracker,
    Fault,
    Headset,
    Health,
    OnScreen,
    ResponseInput,
    SoundOutput,
    TriggerOutput,
    VibrationPattern,
)
from visavis.devices.pump import Pump
from visavis.lab.clock import NEVER_NS, NS_PER_S, Clock
from visavis.lab.errors import DeviceError
from visavis.lab.geometry import Pose
from visavis.lab.schema import SampleBatch, StreamSchema
from visavis.protocol.plan.experiment import Demands
from visavis.protocol.plan.steps import Play, PlaySound, Vibrate

OPEN_DEADLINE_S = 10.0


def unmet(
    demands: Demands,
    segments: Sequence[str],
    bands: Mapping[str, Armband],
    without: Collection[str] = (),
) -> Iterator[Fault]:
    """Yield a blocking fault for everything the open devices cannot do.

    Devices that the operator goes on `without` are not checked.
    """
    missing = [name for name in demands.segments if name not in segments]
    if missing and "body_tracker" not in without:
        yield Fault(
            "body_tracker",
            "blocking",
            f"the study needs {', '.join(missing)}, which this tracker does not deliver",
            "put a sensor there and name it under devices.body_tracker in lab_config.yaml",
        )
    for role, pattern in demands.vibrations.items():
        band = bands.get(role)
        if band is None:
            continue
        if demands.motors and max(demands.motors) >= band.motor_count:
            yield Fault(
                role,
                "blocking",
                f"the study drives {max(demands.motors) + 1} motors, this band has "
                f"{band.motor_count}",
                "give the role a band with more motors",
            )
        yield from _beyond(role, pattern, band.rate_range_hz)


def _beyond(role: str, pattern: VibrationPattern, range_hz: tuple[float, float]) -> Iterator[Fault]:
    """Compare a pattern with what a band can do; NaN where the band cannot tell."""
    low_hz, high_hz = range_hz
    if pattern.low_hz < low_hz or pattern.high_hz > high_hz:
        yield Fault(
            role,
            "blocking",
            f"the study's vibration swings from {pattern.low_hz:g} to {pattern.high_hz:g} Hz, this "
            f"band does {low_hz:g} to {high_hz:g} Hz",
            "set the study's pattern rates within that, in a new study folder",
        )


@dataclass(frozen=True)
class Rig:
    """The devices by role; `headset` paces the session (a headset, or a screen in its place, which
    has a role of its own), `eye_tracker` delivers gaze where wanted.

    `on_step` is called once per frame to tell a guard, which keeps the bands alive, that the
    session's loop runs; without it the rig keeps them alive itself. `without` are roles the
    operator goes on without; a trial's commands to them are ignored.
    """

    headset: Headset
    eye_tracker: EyeTracker | None
    others: Mapping[str, Device]
    on_step: Callable[[], None] | None = None
    without: frozenset[str] = frozenset()

    def by_role(self) -> dict[str, Device]:
        """Return every device in the fixed order in which it is stepped."""
        tracker = {} if self.eye_tracker is None else {"eye_tracker": self.eye_tracker}
        return {self.display_role: self.headset, **tracker, **self.others}

    @property
    def display_role(self) -> str:
        """Role of the device that paces the session."""
        return "screen" if isinstance(self.headset, OnScreen) else "headset"


class RunningRig:
    """Own the devices while a session runs: one pump each, threads only in real time.

    Always used as a context manager, so that every exit path stops and closes every device.
    """

    def __init__(self, rig: Rig, clock: Clock, sink: Callable[[str, SampleBatch], None]) -> None:
        self._rig = rig
        self.display_role = rig.display_role
        """Role of the device that paces the session."""
        self._clock = clock
        self._devices = rig.by_role()
        self._bands = {r: d for r, d in self._devices.items() if isinstance(d, Armband)}
        self._triggers = [d for d in self._devices.values() if isinstance(d, TriggerOutput)]
        sound = self._devices.get("sound")
        self._sound = sound if isinstance(sound, SoundOutput) else None
        tracker = self._devices.get("body_tracker")
        self._segments = tracker.segments if isinstance(tracker, BodyTracker) else ()
        self._pumps = {
            role: Pump(device, self._sink_of(role, sink), clock)
            for role, device in self._devices.items()
        }
        self._in_order = tuple(self._pumps.values())
        self._gaze_pump = self._pumps.get("eye_tracker")
        self._display_pump = self._pumps[rig.display_role]
        self._others = tuple(
            pump
            for pump in self._in_order
            if pump is not self._gaze_pump and pump is not self._display_pump
        )
        self.is_muted = False
        """While true, bands take silence only; the operator wants no vibration in this trial."""
        self.has_vibrated = False
        """Whether any band was asked to vibrate since this was last set false."""

    @property
    def headset(self) -> Headset:
        """The device that paces the session."""
        return self._rig.headset

    @property
    def eye_tracker(self) -> EyeTracker | None:
        """The device that delivers gaze; None in a study without one."""
        return self._rig.eye_tracker

    @property
    def gaze_rate_hz(self) -> float | None:
        """Nominal rate of gaze; None without an eye tracker."""
        tracker = self._rig.eye_tracker
        return None if tracker is None else tracker.describe()[0].nominal_rate_hz

    @property
    def without(self) -> frozenset[str]:
        """Roles the operator goes on without in this part of the session."""
        return self._rig.without

    def clock_pairs(self) -> dict[str, Sequence[ClockPair]]:
        """Return the time exchanges of all devices but bands, by role.

        A band's own times stand in its stream of commands.
        """
        self.catch_up()
        return {
            role: device.clock_pairs()
            for role, device in self._devices.items()
            if role != self.display_role and role not in self._bands
        }

    def mark(self, text: str, t_ns: int) -> None:
        """Send a mark's trigger, and mark the eye tracker's own recording, where these exist.

        The first word of the mark decides the trigger. Never waits for the tracker.
        """
        self.catch_up()
        for device in self._triggers:
            device.trigger(text.partition(" ")[0], t_ns)
        tracker = self._rig.eye_tracker
        if tracker is not None and "annotation" in tracker.info.capabilities:
            with contextlib.suppress(DeviceError):  # it is away; the session learns that elsewhere
                tracker.annotate(text, t_ns)

    def is_band(self, role: str) -> bool:
        """Tell whether an armband fills a role."""
        return role in self._bands

    @property
    def has_bands(self) -> bool:
        """Tell whether an armband is among the devices."""
        return bool(self._bands)

    def _sink_of(
        self, role: str, sink: Callable[[str, SampleBatch], None]
    ) -> Callable[[SampleBatch], None]:
        if role not in self._bands:
            return lambda batch: sink(role, batch)
        own: dict[str, StreamSchema] = {}

        def rename(batch: SampleBatch) -> None:
            name = batch.schema.name
            if name not in own:
                own[name] = _of_band(role, batch.schema)
            sink(role, replace(batch, schema=own[name]))

        return rename

    def __enter__(self) -> "RunningRig":
        try:
            for role, device in self._devices.items():
                _open(role, device)
        except BaseException:
            self._close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._close()

    def _close(self) -> None:
        for pump in self._in_order:
            pump.stop()
        for device in self._devices.values():
            device.close()

    def schemas(self) -> tuple[StreamSchema, ...]:
        """Return every stream the devices will deliver."""
        return tuple(
            _of_band(role, schema) if role in self._bands else schema
            for role, device in self._devices.items()
            for schema in device.describe()
        )

    @property
    def segments(self) -> tuple[str, ...]:
        """Names of the body tracker's segments; empty without one."""
        return self._segments

    def infos(self) -> tuple[DeviceInfo, ...]:
        """Return who every device is; complete once open."""
        return tuple(d.info for d in self._devices.values())

    def preflight(self, demands: Demands) -> tuple[Fault, ...]:
        """Check every device, and that they can do what a study demands.

        Raises:
            DeviceError: a device reports a blocking fault or cannot do it; the message lists all.
        """
        faults = tuple(f for d in self._devices.values() for f in d.check())
        faults += tuple(unmet(demands, self._segments, self._bands, self._rig.without))
        if self._sound is not None:
            for sound in demands.sounds:
                self._sound.prepare(sound)
        elif demands.sounds and "sound" not in self._rig.without:
            faults += (
                Fault(
                    "sound",
                    "blocking",
                    "the study plays sounds, which this device does not",
                    "give the role sound a device that does, such as sound_card",
                ),
            )
        blocking = [f for f in faults if f.severity == "blocking"]
        if len(blocking) == 1:
            raise DeviceError(blocking[0].message, role=blocking[0].role, remedy=blocking[0].remedy)
        if blocking:
            raise DeviceError(
                " | ".join(f"{f.role}: {f.message}; {f.remedy}" for f in blocking),
            )
        return faults

    def start(self) -> None:
        """Start streaming; in real time with a thread for every device that may have one."""
        for pump in self._in_order:
            pump.start()

    def step(self, *, gaze_may_wait: bool = False, head_may_wait: bool = False) -> bool:
        """Let every device without a thread deliver what its wire has brought.

        With `gaze_may_wait` an eye tracker that can wait is deferred, with `head_may_wait` the
        display. Return whether the eye tracker was deferred.
        """
        for pump in self._in_order:
            if pump is self._gaze_pump:
                pump.step(may_wait=gaze_may_wait)
            elif pump is self._display_pump:
                pump.step(may_wait=head_may_wait)
            else:
                pump.step()
        if self._rig.on_step is not None:
            self._rig.on_step()
        else:
            for band in self._bands.values():
                band.keep_alive()
        return self._gaze_pump is not None and self._gaze_pump.is_put_off

    def idle_until_ns(self) -> int:
        """Return a session time before which `step` may be left out while `is_idle`; 0 if unknown.

        It holds until the next command to a device.
        """
        return min(self.display_waits_until_ns(), self.gaze_waits_until_ns())

    def display_waits_until_ns(self) -> int:
        """Return the part of `idle_until_ns` that is all devices' but the eye tracker's."""
        if self._bands or self._rig.on_step is not None:
            return 0
        return self._display_pump.put_off_until_ns()

    def gaze_waits_until_ns(self) -> int:
        """Return the part of `idle_until_ns` that is the eye tracker's."""
        return NEVER_NS if self._gaze_pump is None else self._gaze_pump.put_off_until_ns()

    def step_gaze(self) -> None:
        """Do for the eye tracker alone what `step` does while gaze may wait."""
        if self._gaze_pump is not None:
            self._gaze_pump.step(may_wait=True)

    @property
    def has_sound(self) -> bool:
        """Tell whether a device plays sounds."""
        return self._sound is not None

    def others_idle_until_ns(self) -> int:
        """Return until when no device but display and eye tracker has anything to do; 0 if unknown.

        It holds until something else is shown.
        """
        until_ns = NEVER_NS
        for pump in self._others:
            until_ns = min(until_ns, pump.idle_until_ns())
        return until_ns

    def is_idle(self, t_ns: int) -> bool:
        """Tell whether no device has anything to do up to this time, which is before
        `idle_until_ns`. If so, display and eye tracker are deferred as by `step`.
        """
        # asked at every frame: what is shown may change what a participant does next
        for pump in self._others:
            if pump.idle_until_ns() <= t_ns:
                return False
        self._display_pump.is_put_off = True
        if self._gaze_pump is not None:
            self._gaze_pump.is_put_off = True
        return True

    def catch_up(self) -> None:
        """Let the eye tracker deliver what was deferred."""
        if self._gaze_pump is not None and self._gaze_pump.is_put_off:
            self._gaze_pump.step()

    def deliver_all(self) -> None:
        """Let every device deliver what was deferred."""
        for pump in self._in_order:
            if pump.is_put_off:
                pump.step()

    def tap_body(self, tap: Callable[[SampleBatch], None] | None) -> None:
        """Hand every batch of the body tracker to `tap` when it arrives; None ends it."""
        pump = self._pumps.get("body_tracker")
        if pump is not None:
            pump.tap = tap

    def step_body(self) -> None:
        """Let only the body tracker deliver what has arrived."""
        self._pumps["body_tracker"].step()

    @property
    def body_period_ns(self) -> int | None:
        """Interval of body samples where only the loop itself polls for them.

        None where the tracker has a thread, where a real headset paces the loop, or where there
        is not a tracker.
        """
        pump = self._pumps.get("body_tracker")
        if pump is None or pump.is_threaded or not self._rig.headset.info.is_simulated:
            return None
        rate_hz = pump.device.describe()[0].nominal_rate_hz
        return round(NS_PER_S / rate_hz) if rate_hz > 0 else None

    def controls(self) -> tuple[str, ...]:
        """Return the names of the response device's controls; empty without one."""
        device = self._devices.get("responses")
        return tuple(device.controls) if isinstance(device, ResponseInput) else ()

    def vibrate(self, step: Vibrate) -> None:
        """Set the motors of a haptic role, unless muted.

        Raises:
            DeviceError: no such device in this session.
        """
        if step.role in self._rig.without:
            return
        band = self._band(step.role)
        self.has_vibrated = True
        if not self.is_muted:
            band.set_amplitudes(step.amplitudes_01, step.ttl_ms)

    def play(self, step: Play) -> None:
        """Start a pattern on a haptic role, unless muted.

        Raises:
            DeviceError: no such device in this session.
        """
        if step.role in self._rig.without:
            return
        band = self._band(step.role)
        self.has_vibrated = True
        if not self.is_muted:
            band.play(step.pattern, step.motors, step.amplitude_01)

    def play_sound(self, step: PlaySound) -> int | None:
        """Play a sound; return its number, None where the operator goes on without sound.

        Raises:
            DeviceError: no device of this session plays sounds.
        """
        if "sound" in self._rig.without:
            return None
        if self._sound is None:
            raise DeviceError(
                "the trial wants to play a sound, but no such device is configured",
                role="sound",
                remedy="name it under devices in lab_config.yaml: sound: {driver: sound_card}",
            )
        place = None if step.at_m is None else np.array(step.at_m)
        return self._sound.play(step.sound, at_m=place, gain_db=step.gain_db, loops=step.loops)

    def hear_from(self, head: Pose) -> None:
        """Set the pose from which the participant hears."""
        if self._sound is not None:
            self._sound.hear_from(head)

    def hush(self) -> None:
        """Stop all sounds."""
        if self._sound is not None:
            self._sound.hush()

    def silence(self, role: str = "") -> None:
        """Stop every motor of a haptic role, or of all bands."""
        for name, band in self._bands.items():
            if role in ("", name):
                band.silence()

    def _band(self, role: str) -> Armband:
        band = self._bands.get(role)
        if band is None:
            raise DeviceError(
                "the trial wants to vibrate it, but no such device is configured",
                role=role,
                remedy="name it under devices in lab_config.yaml",
            )
        return band

    def faults(self) -> tuple[Fault, ...]:
        """Return the faults that hold now; those of deferred gaze are seen when it is delivered."""
        return tuple(f for pump in self._in_order for f in pump.faults())

    def health(self) -> dict[str, Health]:
        """Return what every device has delivered, what was lost and how often it came back."""
        self.deliver_all()
        return {role: pump.health() for role, pump in self._pumps.items()}


def _open(role: str, device: Device) -> None:
    """Open a device; add the role to errors of its wire, which does not know it."""
    try:
        device.open(OPEN_DEADLINE_S)
    except DeviceError as error:
        if error.role:
            raise
        what = str(error).removesuffix(f"; {error.remedy}")
        raise type(error)(what, role=role, remedy=error.remedy) from error


def _of_band(role: str, schema: StreamSchema) -> StreamSchema:
    """Name a stream after its band: several bands of one kind are worn at once."""
    return replace(schema, name=f"{schema.name}_{role}")
