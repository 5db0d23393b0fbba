"""Build any driver as a lab's configuration would: simulated, captured, or played back."""

import contextlib

from tests.devices.body_rigs import WalkingBody
from visavis.devices import conformance
from visavis.devices.building import build_device
from visavis.devices.captures import device_of, note_of
from visavis.devices.registry import built_in
from visavis.devices.wirelog import read_wire_log
from visavis.devices.wires import BARE, CapturedWires, ReplayedWires
from visavis.lab.clock import NS_PER_S, SimClock
from visavis.lab.config import DeviceConfig

ROLES = {
    "eye tracker": "eye_tracker",
    "headset": "headset",
    "responses": "responses",
    "body tracker": "body_tracker",
    "armband": "armband_left_forearm",
    "sound output": "sound",
    "triggers": "triggers",
    "other": "eeg",
}
CODES = {"codes": {"trial_start": 1, "trial_end": 2}}
NEEDED = {
    **dict.fromkeys(
        (
            "serial_triggers",
            "xid_triggers",
            "parallel_triggers",
            "labjack_triggers",
            "lsl_triggers",
        ),
        CODES,
    ),
    "openvr_trackers": {"worn": {"LHR-0A": "left_hand"}},
    "ble_sensor": {"profile": "polar_ecg"},
    "lsl_body": {"objects": {"Wand": "right_hand"}},
    "natnet": {"multicast_group": ""},
    "qualisys": {"bodies": {"Wand": "right_hand"}},
    "vicon": {"bodies": {"Wand": "right_hand"}},
    "ble_armband": {"name": "Visavis"},
    "spp_armband": {"address": "00:11:22:33:44:55"},
}
LATER_NS = 3600 * NS_PER_S
MS = 1_000_000


def pressing(driver, now_ns):
    """Somebody who presses twice a second, where the device is there to be pressed."""
    capabilities = built_in()[driver].product.capabilities
    if not {"keys", "voice"} & capabilities:
        return WalkingBody()
    control = "voice" if "voice" in capabilities else "trigger"
    downs = [now_ns + 50 * MS + n * 500 * MS for n in range(40)]
    return WalkingBody(
        presses=[(t + up * 80 * MS, control, 1.0 - up) for t in downs for up in (0, 1)]
    )


def own_options(driver):
    return {**NEEDED.get(driver, {}), **built_in()[driver].dialect.options}


def config_of(driver, **options):
    spec = built_in()[driver]
    options = spec.options.model_validate(own_options(driver) | options).model_dump()
    role = ROLES[spec.kind]
    return DeviceConfig(role=role, driver=driver, simulated=True, options=options)


class Bench:
    """Factories for fresh devices that share one clock, one body and one runtime."""

    def __init__(self, config, clock, stack, wires=BARE):
        self.clock = clock
        self.make_on = lambda wires: build_device(
            config, clock, pressing(config.driver, clock.now_ns()), 1, stack, wires
        )
        self.wires = wires

    def make(self):
        return self.make_on(self.wires)

    def let_pass(self, seconds):
        self.clock.sleep_until_ns(self.clock.now_ns() + round(seconds * NS_PER_S))


def checks_of(driver):
    """Every check of the conformance suite for this kind of device, by name."""
    found = {"lifecycle": conformance.check_lifecycle, "batches": conformance.check_batches}
    if built_in()[driver].kind == "headset":
        # a headset delivers with its frames, which the other checks do not wait for
        return {
            "lifecycle": conformance.check_lifecycle,
            "headset": lambda make, let_pass: conformance.check_headset(make),
        }
    own = {
        "eye tracker": conformance.check_eye_tracker,
        "body tracker": conformance.check_body_tracker,
        "responses": conformance.check_response_input,
        "armband": conformance.check_armband,
        "sound output": conformance.check_sound_output,
        "triggers": conformance.check_trigger_output,
    }
    kind = built_in()[driver].kind
    return {**found, kind: own[kind]} if kind in own else found


def check_on_simulator(driver, check, **options):
    with contextlib.ExitStack() as stack:
        bench = Bench(config_of(driver, **options), SimClock(), stack)
        check(bench.make, bench.let_pass)


def capture(driver, check, path):
    """Write what crosses the wire while a check runs."""
    config = config_of(driver)
    with contextlib.ExitStack() as stack:
        clock = SimClock()
        wires = CapturedWires(config.role, path, clock, note_of(config))
        bench = Bench(config, clock, stack, wires)
        check(bench.make, bench.let_pass)
        wires.end()
    return wires.is_captured


def check_on_replay(path, check):
    """Run a check over a capture, with nothing but what the file says of itself."""
    with contextlib.ExitStack() as stack:
        clock = SimClock(LATER_NS)
        config = device_of(path, read_wire_log(path))
        bench = Bench(config, clock, stack, ReplayedWires(path, clock))
        check(bench.make, bench.let_pass)
