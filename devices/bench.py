"""Run devices for a while outside any session, and say how their streams arrive."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from typing import Any, cast

from visavis.devices.building import build_device
from visavis.devices.contracts import Armband, Body, Device, DeviceInfo, Fault, Headset, Health
from visavis.devices.haptic_safety import HapticGuard
from visavis.devices.pump import Pump
from visavis.devices.shared_body import SharedBody
from visavis.devices.sim.body.idle import IdleBody
from visavis.devices.stream_figures import (
    ClockFigures,
    StreamFigures,
    clock_figures,
    stream_figures,
)
from visavis.devices.wires import BARE, Wires
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.config import DeviceConfig
from visavis.lab.errors import DeviceTimeout, LabError
from visavis.lab.schema import SampleBatch

OPEN_DEADLINE_S = 5.0
SIMULATED_OPEN_S = 20.0
"""A simulator on real sockets first compiles its kernels, slowly on a busy computer."""

STEP_NS = NS_PER_S // 100
SEED = 1
SETTLE_S = 0.5
"""The beginning of a capture is not measured, because connections and threads are starting."""

BUSY_REMEDY = "it is simulated here, so this computer is too busy: close other programs"

Tick = Callable[[float], None]
Prepare = Callable[[Device, ExitStack], None]
"""Makes a device ready to be opened; what it needs meanwhile is closed after the device."""


@dataclass(frozen=True)
class Trial:
    """The result of one device in a capture; `error` says why it never streamed."""

    role: str
    driver: str
    simulated: bool
    info: DeviceInfo | None = None
    streams: tuple[StreamFigures, ...] = ()
    clock: ClockFigures | None = None
    health: Health | None = None
    faults: tuple[Fault, ...] = ()
    events: tuple[str, ...] = ()
    error: str = ""
    remedy: str = ""


@dataclass
class _Running:
    device: Device
    pump: Pump
    batches: list[SampleBatch] = field(default_factory=list)
    events: list[str] = field(default_factory=list)


def capture(
    devices: Sequence[DeviceConfig],
    clock: Clock,
    seconds: float,
    *,
    wires: Wires = BARE,
    tick: Tick | None = None,
    is_over: Callable[[], bool] | None = None,
    prepare: Prepare | None = None,
) -> tuple[Trial, ...]:
    """Open every device, stream for a while, close; one that fails does not stop the others.

    A headset among them paces the loop. Every device is made ready by `prepare` before any is
    opened, because some share a runtime. `tick` gets the seconds measured so far; `is_over` ends
    the capture early.
    """
    trials: dict[str, Trial] = {d.role: Trial(d.role, d.driver, d.simulated) for d in devices}
    body: Any = IdleBody() if clock.is_virtual else SharedBody(IdleBody())
    with ExitStack() as stack:
        built = _built(devices, clock, body, stack, wires, trials, prepare)
        running = _start(built, clock, stack, trials)
        bands = {r: one.device for r, one in running.items() if isinstance(one.device, Armband)}
        with HapticGuard(bands, clock, handle_signals=not clock.is_virtual) as guard:
            _stream(running, clock, seconds, guard, tick, is_over)
        for role, one in running.items():
            one.pump.stop()
            trials[role] = _with_figures(trials[role], one)
            one.device.close()
    return tuple(trials.values())


def _built(
    devices: Sequence[DeviceConfig],
    clock: Clock,
    body: Body,
    stack: ExitStack,
    wires: Wires,
    trials: dict[str, Trial],
    prepare: Prepare | None,
) -> list[tuple[DeviceConfig, Device]]:
    built = []
    for config in devices:
        try:
            device = build_device(config, clock, body, SEED, stack, wires)
            if prepare is not None:
                prepare(device, stack)
        except LabError as problem:
            trials[config.role] = _failed(trials[config.role], problem)
        else:
            built.append((config, device))
    return built


def _failed(trial: Trial, problem: LabError) -> Trial:
    remedy = str(getattr(problem, "remedy", ""))
    text = str(problem).removesuffix(f"; {remedy}").removeprefix(f"{trial.role}: ")
    if trial.simulated and isinstance(problem, DeviceTimeout):
        remedy = BUSY_REMEDY
    return replace(trial, error=text, remedy=remedy)


def _start(
    built: Sequence[tuple[DeviceConfig, Device]],
    clock: Clock,
    stack: ExitStack,
    trials: dict[str, Trial],
) -> dict[str, _Running]:
    running: dict[str, _Running] = {}
    for config, device in built:
        try:
            device.open(SIMULATED_OPEN_S if config.simulated else OPEN_DEADLINE_S)
        except LabError as problem:
            trials[config.role] = _failed(trials[config.role], problem)
            continue
        stack.callback(device.close)
        batches: list[SampleBatch] = []
        running[config.role] = _Running(device, Pump(device, batches.append, clock), batches)
    for one in running.values():
        one.pump.start()
        stack.callback(one.pump.stop)
    return running


def _stream(
    running: Mapping[str, _Running],
    clock: Clock,
    seconds: float,
    guard: HapticGuard,
    tick: Tick | None,
    is_over: Callable[[], bool] | None,
) -> None:
    if not running:
        return
    headsets = [r.device for r in running.values() if hasattr(r.device, "wait_frame")]
    headset = cast(Headset, headsets[0]) if headsets else None
    start_ns = clock.now_ns()
    is_settled = False
    while (now_ns := clock.now_ns()) < start_ns + round((SETTLE_S + seconds) * NS_PER_S):
        if headset is not None:
            headset.submit(headset.wait_frame(), ())
        else:
            clock.sleep_until_ns(now_ns + STEP_NS)
        for one in running.values():
            has_begun = bool(one.batches)
            one.pump.step()
            events = one.pump.take_events()
            if has_begun or is_over is None:  # silence before the first batch is not an event
                one.events += [f"{e.kind}: {e.message}" for e in events]
        guard.tick()
        since_s = (clock.now_ns() - start_ns) / NS_PER_S
        if not is_settled and since_s >= SETTLE_S and not clock.is_virtual:
            is_settled = True
            for one in running.values():
                one.batches.clear()
        if tick is not None:
            tick(max(0.0, since_s - SETTLE_S))
        if is_over is not None and is_over():
            return


def _with_figures(trial: Trial, one: _Running) -> Trial:
    device = one.device
    pairs = device.clock_pairs()
    return replace(
        trial,
        info=device.info,
        streams=tuple(stream_figures(schema, one.batches, pairs) for schema in device.describe()),
        clock=clock_figures(one.batches, pairs),
        health=one.pump.health(),
        faults=one.pump.faults(),
        events=tuple(one.events),
    )
