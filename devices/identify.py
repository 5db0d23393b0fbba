"""Buzz one armband so that the operator sees where it is worn."""

from contextlib import ExitStack

from visavis.devices.building import build_device
from visavis.devices.contracts import Armband
from visavis.devices.haptic_safety import HapticGuard
from visavis.devices.pump import Pump
from visavis.devices.sim.body.idle import IdleBody
from visavis.lab.clock import NS_PER_MS, Clock
from visavis.lab.config import DeviceConfig
from visavis.lab.errors import DeviceError

OPEN_DEADLINE_S = 10.0
PULSES = 3
PULSE_MS = 250
PAUSE_MS = 250
AMPLITUDE_01 = 0.8
STEP_NS = 10 * NS_PER_MS


def buzz(config: DeviceConfig, clock: Clock) -> str:
    """Vibrate all motors of a band three times; return a sentence with the confirmed pulses.

    Raises:
        DeviceError: the band is missing, or the device is not a band.
    """
    rows: list[bool] = []
    with ExitStack() as stack:
        device = build_device(config, clock, IdleBody(), 1, stack)
        if not isinstance(device, Armband):
            raise DeviceError(
                f"driver {config.driver!r} is not an armband's",
                role=config.role,
                remedy="give the role an armband's driver",
            )
        device.open(OPEN_DEADLINE_S)
        stack.callback(device.close)
        pump = Pump(
            device,
            lambda batch: rows.extend(
                bool(r["acknowledged"])
                for r in (batch.values if batch.schema.name == "haptics" else ())
                if r["kind"] == 0 and r["amplitudes_01"][0] > 0
            ),
            clock,
        )
        pump.start()
        stack.callback(pump.stop)
        with HapticGuard(
            {config.role: device}, clock, handle_signals=not clock.is_virtual
        ) as guard:
            for _ in range(PULSES):
                device.set_amplitudes([AMPLITUDE_01] * device.motor_count, PULSE_MS)
                until_ns = clock.now_ns() + (PULSE_MS + PAUSE_MS) * NS_PER_MS
                while clock.now_ns() < until_ns:
                    clock.sleep_until_ns(clock.now_ns() + STEP_NS)
                    guard.tick()
                    pump.step()
        battery = device.health().battery_01
        who = f"{config.role}: {PULSES} pulses sent to {device.info.model}"
        serial = f" {device.info.serial}" if device.info.serial else ""
        confirmed_count = sum(rows)
        confirmation = (
            f"{confirmed_count} confirmed by the band"
            if confirmed_count
            else "this band confirms nothing"
        )
        charge = f"; battery {battery:.0%}" if battery is not None else ""
        nobody = "; simulated: nothing vibrates" if device.info.is_simulated else ""
        return f"{who}{serial}, {confirmation}{charge}{nobody}"
