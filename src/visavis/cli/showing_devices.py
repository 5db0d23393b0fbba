"""Try devices as a session opens them: a headset that shows pictures is told so before it opens.

Runtimes without XR_MND_headless (Meta's and HTC's on a PC, Varjo's, Windows Mixed Reality) refuse a
session that shows none, to every device of theirs.
"""

from collections.abc import Sequence
from contextlib import ExitStack

from visavis.devices.bench import Prepare
from visavis.devices.contracts import Device
from visavis.devices.registry import driver_spec
from visavis.lab.config import DeviceConfig, LabConfig

SHOWN_IN_HEADSET = ("headset", "offscreen")
"""What `display.show` is where a headset is handed pictures."""
ONE_SESSION = ("openxr",)
"""Runtimes whose devices share one session, which the headset decides about."""
WINDOW_PX = (320, 180)


def with_their_headset(lab: LabConfig, devices: Sequence[DeviceConfig]) -> tuple[DeviceConfig, ...]:
    """Return devices to be tried, before them the headset that shares their runtime's session."""
    headset = lab.devices.get("headset")
    if headset is None or headset in devices or lab.display.show not in SHOWN_IN_HEADSET:
        return tuple(devices)
    runtime = driver_spec(headset.driver).wire.runtime
    is_shared = runtime in ONE_SESSION and any(
        driver_spec(d.driver).wire.runtime == runtime and d.simulated == headset.simulated
        for d in devices
    )
    return (headset, *devices) if is_shared else tuple(devices)


def shown_pictures(lab: LabConfig) -> Prepare | None:
    """Return how a device is made ready for pictures; None where the lab hands it none."""
    show = lab.display.show
    if show not in SHOWN_IN_HEADSET:
        return None

    def prepare(device: Device, stack: ExitStack) -> None:
        show_images = getattr(device, "show_images", None)
        if show_images is None:
            return
        # late: graphics libraries, which most labs' devices are tried without
        if show == "headset":
            from visavis.stage.window import Window

            stack.callback(Window("Visavis: devices", WINDOW_PX).close)
        else:
            from visavis.stage.card.context import offscreen_context, release_offscreen

            stack.callback(release_offscreen, offscreen_context())
        show_images()

    return prepare
