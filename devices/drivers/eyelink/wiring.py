"""EyeLink: its driver on the vendor's library, its camera's set-up, and its simulator."""

from visavis.devices.drivers.eyelink.camera_setup import FullScreen, set_up
from visavis.devices.drivers.eyelink.driver import EyeLink
from visavis.devices.drivers.eyelink.library import EyeLinkLibrary, eyelink_library
from visavis.devices.drivers.eyelink.spec import EYELINK, EyeLinkOptions
from visavis.devices.sim.eyelink import EyeLinkSimulator
from visavis.devices.transports import MessageTransport
from visavis.devices.wiring import Site, Wiring, driven_by, streamed_by
from visavis.lab.errors import ConfigError


def _library(site: Site[EyeLinkOptions]) -> MessageTransport:
    options = site.options
    if options.pupil_mm_per_unit:
        raise ConfigError(
            "pupil_mm_per_unit took the tracker's area of a pupil for its diameter: measure the "
            "artificial pupil again and give artificial_pupil_mm and artificial_pupil_units"
        )
    return EyeLinkLibrary(
        options.address,
        site.clock,
        screen_px=(options.screen_width_px, options.screen_height_px),
        rate_hz=options.rate_hz,
        gives_area=options.pupil_size == "area",
        corrects_drift=options.drift_correction,
    )


def _set_up(site: Site[EyeLinkOptions]) -> str:
    return set_up(site.options.address, FullScreen(), eyelink_library())


WIRINGS = (
    Wiring(
        EYELINK,
        make=driven_by(EyeLink),
        real=_library,
        simulated=streamed_by(EyeLinkSimulator),
        set_up=_set_up,
    ),
)
