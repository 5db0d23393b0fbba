"""Neon: its driver on the phone's network interface, and its simulator."""

from typing import Any

from visavis.devices.drivers.neon.codec import SceneCamera
from visavis.devices.drivers.neon.driver import Neon
from visavis.devices.drivers.neon.network import NeonNetwork
from visavis.devices.drivers.neon.spec import NEON
from visavis.devices.sim.neon import NeonSimulator
from visavis.devices.transports import MessageTransport
from visavis.devices.wiring import Wiring, driven_by, streamed_by, wired_by
from visavis.lab.clock import Clock


def _neon(
    role: str,
    network: MessageTransport,
    clock: Clock,
    *,
    focal_length_px: float,
    center_x_px: float,
    center_y_px: float,
    camera_pitch_deg: float,
    **options: Any,
) -> Neon:
    camera = SceneCamera(
        focal_length_px, focal_length_px, center_x_px, center_y_px, pitch_deg=camera_pitch_deg
    )
    return Neon(role, network, clock, camera=camera, **options)


WIRINGS = (
    Wiring(
        NEON,
        make=driven_by(_neon),
        real=wired_by(NeonNetwork, "address", "port", remedy=NEON.remedy),
        simulated=streamed_by(NeonSimulator),
    ),
)
