"""The options of headset runtimes and body trackers, as written in `lab_config.yaml`."""

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ConfigDict, Field


class _Options(BaseModel):
    """What every driver takes; `faults` count on a simulated wire only."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    faults: list[dict[str, Any]] = Field(default_factory=list)


class OpenVrHeadsetOptions(_Options):
    """Options of `openvr_headset`; the rate counts on the simulated runtime only."""

    display_rate_hz: float = Field(default=90.0, ge=1, le=1000)


class OpenXrHeadsetOptions(OpenVrHeadsetOptions):
    """Options of `openxr_headset`."""


class OpenVrControllersOptions(_Options):
    """Options of `openvr_controllers`: the study's control -> "left trigger", "any grip",
    "right trigger axis"; `rays` records where the controllers point.
    """

    controls: dict[str, str] = Field(default_factory=dict)
    rays: bool = True


class OpenXrControllersOptions(_Options):
    """Options of `openxr_controllers`: the study's control -> "left select", "any menu"."""

    controls: dict[str, str] = Field(default_factory=dict)


class OpenXrGazeOptions(_Options):
    """Options of `openxr_gaze`."""

    rate_hz: float = Field(default=120.0, ge=1, le=2000)
    lost_after_s: float = Field(default=2.0, gt=0, le=60)


class _StreamOptions(_Options):
    """What every body tracker takes; `drift_ppm` counts on a simulated wire only."""

    rate_hz: float = Field(default=120.0, ge=1, le=2000)
    lost_after_s: float = Field(default=2.0, gt=0, le=60)
    drift_ppm: float = Field(
        default=0.0, ge=-1000, le=1000, json_schema_extra={"any_magnitude": True}
    )


class OpenVrTrackersOptions(_StreamOptions):
    """Options of `openvr_trackers`: serial number -> segment."""

    worn: dict[str, str] = Field(default_factory=dict)


class XsensOptions(_StreamOptions):
    """Options of `xsens`: the port MVN sends to, and which of its characters."""

    port: int = Field(default=9763, ge=1, le=65535)
    rate_hz: float = Field(default=240.0, ge=1, le=2000)
    character: int = Field(default=0, ge=0, le=255)


class NatNetOptions(_StreamOptions):
    """Options of `natnet`: Motive's computer; without a group the stream is unicast."""

    address: str = Field(default="127.0.0.1", min_length=1)
    port: int = Field(default=1510, ge=1, le=65535)
    multicast_group: str = "239.255.42.99"
    data_port: int = Field(default=1511, ge=1, le=65535)
    bodies: dict[str, str] = Field(default_factory=dict)
    skeleton: str = ""
    yaw_deg: float = Field(
        default=180.0, ge=-360, le=360, json_schema_extra={"any_magnitude": True}
    )


class LslBodyOptions(_StreamOptions):
    """Options of `lsl_body`: which stream, and the stream's object -> segment."""

    name: str = ""
    source_id: str = ""
    objects: dict[str, str] = Field(default_factory=dict)
    rate_hz: float = Field(default=60.0, ge=1, le=2000)


BODY_OPTION_MODELS: Mapping[str, type[BaseModel]] = {
    "lsl_body": LslBodyOptions,
    "natnet": NatNetOptions,
    "openvr_controllers": OpenVrControllersOptions,
    "openxr_controllers": OpenXrControllersOptions,
    "openvr_headset": OpenVrHeadsetOptions,
    "openvr_trackers": OpenVrTrackersOptions,
    "openxr_gaze": OpenXrGazeOptions,
    "openxr_headset": OpenXrHeadsetOptions,
    "xsens": XsensOptions,
}
"""Options by driver name."""
