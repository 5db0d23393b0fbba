"""The options each driver takes in `lab_config.yaml`, checked before anything runs.

Options are what stands beside `driver` and `simulated`; their names carry their units.
"""

from collections.abc import Mapping
from importlib.metadata import entry_points
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from devices.band_options import BAND_OPTION_MODELS
from devices.body_options import BODY_OPTION_MODELS
from devices.gaze_options import GAZE_OPTION_MODELS
from devices.registry import BUILT_IN, driver_names

ENTRY_POINT_GROUP = "visavis.driver_options"
"""Installed packages describe their drivers' options under this entry-point group."""


class _Options(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class _SimulatedOptions(_Options):
    faults: list[dict[str, Any]] = Field(default_factory=list)
    """What goes wrong on the simulated wire; docs/devices.md lists the kinds."""


class SimulatedHeadsetOptions(_SimulatedOptions):
    """Options of `simulated_headset`."""

    display_rate_hz: float = Field(default=90.0, ge=1, le=1000)


class SimulatedBodyOptions(_SimulatedOptions):
    """Options of `simulated_body`."""

    rate_hz: float = Field(default=100.0, ge=1, le=1000)


class SimulatedResponsesOptions(_Options):
    """Options of `simulated_responses`: none."""


class PupilCoreOptions(_SimulatedOptions):
    """Options of `pupil_core`; `faults` and `drift_ppm` count on a simulated wire only."""

    address: str = Field(default="127.0.0.1", min_length=1)
    port: int = Field(default=50020, ge=1, le=65535)
    rate_hz: float = Field(default=120.0, ge=1, le=2000)
    confidence_threshold_01: float = Field(default=0.6, ge=0, le=1)
    exchange_interval_s: float = Field(default=0.5, gt=0, le=60)
    opening_exchanges: int = Field(default=20, ge=1, le=1000)
    lost_after_s: float = Field(default=2.0, gt=0, le=60)
    eye_distance_mm: float = Field(default=64.0, ge=40, le=90)
    reference_distance_m: float = Field(default=1.0, gt=0, le=20)
    drift_ppm: float = Field(
        default=0.0, ge=-1000, le=1000, json_schema_extra={"any_magnitude": True}
    )


class SimulatedArmbandOptions(_SimulatedOptions):
    """Options of `simulated_armband`; the link's delays, the band's clock and motors."""

    seed: int = Field(default=0, ge=0)
    latency_ms: float = Field(default=1.0, ge=0, le=1000)
    jitter_ms: float = Field(default=0.5, ge=0, le=1000)
    rise_ms: float = Field(default=30.0, ge=0, le=1000)
    max_rate_hz: float = Field(default=150.0, ge=1, le=1000)
    drift_ppm: float = Field(
        default=0.0, ge=-1000, le=1000, json_schema_extra={"any_magnitude": True}
    )


class SerialArmbandOptions(_SimulatedOptions):
    """Options of `serial_armband`: a port by name, or by what is plugged in."""

    port: str = ""
    vid: int | None = Field(default=None, ge=0, le=0xFFFF)
    pid: int | None = Field(default=None, ge=0, le=0xFFFF)
    serial_number: str = ""
    baud: int = Field(default=38_400, ge=1200, le=3_000_000)
    max_rate_hz: float = Field(default=150.0, ge=1, le=1000)


OPTION_MODELS: Mapping[str, type[BaseModel]] = {
    "pupil_core": PupilCoreOptions,
    "serial_armband": SerialArmbandOptions,
    "simulated_armband": SimulatedArmbandOptions,
    **BAND_OPTION_MODELS,
    **BODY_OPTION_MODELS,
    **GAZE_OPTION_MODELS,
    "simulated_body": SimulatedBodyOptions,
    "simulated_headset": SimulatedHeadsetOptions,
    "simulated_responses": SimulatedResponsesOptions,
}
"""Options by driver name, for every driver that ships with Visavis."""


class NoOptions(_Options):
    """Options of a driver whose package describes none."""


def option_models() -> Mapping[str, type[BaseModel]]:
    """Return the options of every driver known here, those of installed packages included."""
    described = {point.name: point for point in entry_points(group=ENTRY_POINT_GROUP)}
    others = {
        name: described[name].load() if name in described else NoOptions
        for name in driver_names()
        if name not in BUILT_IN
    }
    return {**others, **OPTION_MODELS}
