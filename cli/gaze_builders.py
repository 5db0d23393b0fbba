"""Build the eye trackers beyond Pupil Core from a lab's configuration, real or simulated."""

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from typing import Any

from cli.wires import BARE, Wires
from devices.contracts import Body, Device
from devices.drivers.eyelink import driver as eyelink
from devices.drivers.eyelink import library as eyelink_library
from devices.drivers.fove import driver as fove
from devices.drivers.fove import library as fove_library
from devices.drivers.gazepoint import driver as gazepoint
from devices.drivers.hid_gaze import driver as hid_gaze
from devices.drivers.hid_gaze import reports as hid_gaze_usb
from devices.drivers.links import stream_socket as gazepoint_tcp
from devices.drivers.lsl import gaze as lsl_gaze
from devices.drivers.lsl import inlet as lsl_gaze_inlet
from devices.drivers.lsl.outlet import LslScope
from devices.drivers.neon import driver as neon
from devices.drivers.neon import network as neon_network
from devices.drivers.streaming.gaze_rays import Screen
from devices.gaze_options import GAZE_OPTION_MODELS
from devices.sim.eyelink import EyeLinkSimulator
from devices.sim.faults import FaultSchedule
from devices.sim.fove import FoveSimulator
from devices.sim.gazepoint import GazepointSimulator
from devices.sim.hid_gaze import HidGazeSimulator
from devices.sim.lsl.gaze import LslGazeSimulator
from devices.sim.neon import NeonSimulator
from devices.transports import MemoryTransport, MessageTransport
from lab.clock import Clock
from lab.config import DeviceConfig
from lab.errors import ConfigError

SCREEN_OPTIONS = {
    "screen_width_mm": "width_mm",
    "screen_height_mm": "height_mm",
    "screen_distance_mm": "distance_mm",
    "screen_center_right_mm": "center_right_mm",
    "screen_center_up_mm": "center_up_mm",
}
WIRE_OPTIONS = frozenset(
    {"address", "port", "library_path", "serial", "stream_name", "stream_type", "source_id",
     "session_id"}
)  # fmt: skip

Options = dict[str, Any]

DRIVERS: Mapping[str, Callable[..., Device]] = {
    "fove": fove.Fove,
    "gazepoint": gazepoint.Gazepoint,
    "neon": neon.Neon,
    "hid_gaze": hid_gaze.HidGaze,
    "lsl_gaze": lsl_gaze.LslGaze,
    "tobii_lsl": lsl_gaze.TobiiLsl,
    "eyelink": eyelink.EyeLink,
}
SIMULATORS: Mapping[str, Callable[..., Any]] = {
    "fove": FoveSimulator,
    "gazepoint": GazepointSimulator,
    "neon": NeonSimulator,
    "hid_gaze": HidGazeSimulator,
    "lsl_gaze": LslGazeSimulator,
    "tobii_lsl": LslGazeSimulator,
    "eyelink": EyeLinkSimulator,
}


def build_gaze(
    role: str,
    device: DeviceConfig,
    clock: Clock,
    body: Body | None,
    seed: int,
    _: ExitStack,
    wires: Wires = BARE,
) -> Device:
    """Build a tracker named in `DRIVERS`; a simulated one lives in this process."""
    name = device.driver
    options = GAZE_OPTION_MODELS[name].model_validate(dict(device.options)).model_dump()
    faults = options.pop("faults")
    drift_ppm = options.pop("drift_ppm")
    wire = {key: options.pop(key) for key in WIRE_OPTIONS & options.keys()}
    screen = Screen(
        **{own: options.pop(key) for key, own in SCREEN_OPTIONS.items() if key in options}
    )
    is_screen_based = any(key in GAZE_OPTION_MODELS[name].model_fields for key in SCREEN_OPTIONS)
    if is_screen_based:
        options["screen"] = screen
    if "screen_width_px" in options:
        options["screen_px"] = (options.pop("screen_width_px"), options.pop("screen_height_px"))
    transport: MessageTransport
    if not device.simulated:
        transport = real_wire(name, wire, clock)
    elif body is None:
        raise ConfigError(f"{role}: a simulated device needs a simulated participant")
    else:
        try:
            schedule = FaultSchedule.from_config(faults)
        except ConfigError as error:
            raise ConfigError(f"devices.{role}.faults in lab_config.yaml: {error}") from error
        simulated: Options = {"rate_hz": options["rate_hz"], "drift_ppm": drift_ppm}
        if is_screen_based:
            simulated["screen"] = screen
        if "screen_px" in options:
            simulated["screen_px"] = options["screen_px"]
        if name == "gazepoint":
            simulated["camera_m"] = camera_place(screen, options)
        if name == "tobii_lsl":
            simulated["layout"] = "titta"
        simulator = SIMULATORS[name](body, clock=clock, seed=seed, faults=schedule, **simulated)
        transport = MemoryTransport(simulator, clock)
    return DRIVERS[name](role, wires.messages(role, lambda: transport), clock, **options)


def real_wire(name: str, wire: Options, clock: Clock) -> MessageTransport:
    """Return the transport of a real tracker; nothing is opened yet."""
    if name == "fove":
        return fove_library.FoveLibrary(wire["library_path"], clock)
    if name == "gazepoint":
        return gazepoint_tcp.StreamSocket(
            wire["address"], wire["port"], clock, remedy=gazepoint.REMEDY
        )
    if name == "neon":
        return neon_network.NeonNetwork(wire["address"], wire["port"], clock, remedy=neon.REMEDY)
    if name == "hid_gaze":
        return hid_gaze_usb.HidReports(wire["serial"], clock)
    if name == "eyelink":
        return eyelink_library.EyeLinkLibrary(wire["address"], clock)
    session = wire["session_id"]
    return lsl_gaze_inlet.LslInlet(
        clock,
        name=wire["stream_name"],
        content_type=wire["stream_type"],
        source_id=wire["source_id"],
        configuration=LslScope(session).configuration() if session else "",
    )


def camera_place(screen: Screen, options: Options) -> tuple[float, float, float]:
    """Return the camera's place in the head frame, metres."""
    return (
        (screen.center_right_mm + options["camera_right_mm"]) * 1e-3,
        (screen.center_up_mm + options["camera_up_mm"]) * 1e-3,
        (options["camera_toward_mm"] - screen.distance_mm) * 1e-3,
    )


GAZE_BUILDERS = dict.fromkeys(DRIVERS, build_gaze)
"""Builder by driver name, for `cli.rigs`."""
