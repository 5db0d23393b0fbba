"""The options of the eye trackers beyond Pupil Core, as written in `lab_config.yaml`."""

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

PositiveMm = Annotated[float, Field(gt=0, le=10_000)]
OffsetMm = Annotated[float, Field(ge=-5000, le=5000)]


class _GazeOptions(BaseModel):
    """What every tracker takes; `faults` and `drift_ppm` count on a simulated wire only."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    rate_hz: float = Field(default=120.0, ge=1, le=2000)
    lost_after_s: float = Field(default=2.0, gt=0, le=60)
    faults: list[dict[str, Any]] = Field(default_factory=list)
    drift_ppm: float = Field(
        default=0.0, ge=-1000, le=1000, json_schema_extra={"any_magnitude": True}
    )


class _ScreenOptions(_GazeOptions):
    """Where the screen stands as seen from the viewing place."""

    screen_width_mm: PositiveMm = 531.0
    screen_height_mm: PositiveMm = 299.0
    screen_distance_mm: PositiveMm = 650.0
    screen_center_right_mm: OffsetMm = 0.0
    screen_center_up_mm: OffsetMm = 0.0


class FoveOptions(_GazeOptions):
    """Options of `fove`."""

    library_path: str = Field(default="FoveClient", min_length=1)
    eye_distance_mm: float = Field(default=64.0, ge=40, le=90)


class GazepointOptions(_ScreenOptions):
    """Options of `gazepoint`; the camera's place is given from the screen's centre."""

    address: str = Field(default="127.0.0.1", min_length=1)
    port: int = Field(default=4242, ge=1, le=65535)
    rate_hz: float = Field(default=60.0, ge=1, le=2000)
    camera_right_mm: OffsetMm = 0.0
    camera_up_mm: OffsetMm = -180.0
    camera_toward_mm: OffsetMm = 0.0
    eye_distance_mm: float = Field(default=64.0, ge=40, le=90)


class NeonOptions(_GazeOptions):
    """Options of `neon`; the scene camera is a pinhole of these pixels until it is calibrated."""

    address: str = Field(default="neon.local", min_length=1)
    port: int = Field(default=8080, ge=1, le=65535)
    rate_hz: float = Field(default=200.0, ge=1, le=2000)
    exchange_interval_s: float = Field(default=1.0, gt=0, le=60)
    opening_exchanges: int = Field(default=20, ge=1, le=1000)
    focal_length_px: float = Field(default=891.0, gt=0, le=10_000)
    center_x_px: float = Field(default=800.0, ge=0, le=10_000)
    center_y_px: float = Field(default=600.0, ge=0, le=10_000)
    camera_pitch_deg: float = Field(
        default=0.0, ge=-60, le=60, json_schema_extra={"any_magnitude": True}
    )


class HidGazeOptions(_ScreenOptions):
    """Options of `hid_gaze`; an empty serial takes the first eye tracker found."""

    serial: str = ""
    time_unit_us: float = Field(default=0.0, ge=0, le=1_000_000)
    """Microseconds per tick of the time stamp; 0 finds the unit from the rate."""
    eye_distance_mm: float = Field(default=64.0, ge=40, le=90)


class LslGazeOptions(_ScreenOptions):
    """Options of `lsl_gaze` and `tobii_lsl`; empty names match any stream of the type."""

    stream_name: str = ""
    stream_type: str = "Gaze"
    source_id: str = ""
    session_id: str = ""
    exchange_interval_s: float = Field(default=5.0, gt=0, le=600)
    eye_distance_mm: float = Field(default=64.0, ge=40, le=90)


class EyeLinkOptions(_ScreenOptions):
    """Options of `eyelink`."""

    address: str = Field(default="100.1.1.1", min_length=1)
    rate_hz: float = Field(default=1000.0, ge=1, le=2000)
    exchange_interval_s: float = Field(default=1.0, gt=0, le=60)
    screen_width_px: int = Field(default=1920, ge=1, le=100_000)
    screen_height_px: int = Field(default=1080, ge=1, le=100_000)
    pupil_mm_per_unit: float = Field(default=0.0, ge=0, le=1)
    """Millimetres of diameter per unit of the tracker's pupil size; 0 leaves pupils unknown."""
    eye_distance_mm: float = Field(default=64.0, ge=40, le=90)


GAZE_OPTION_MODELS: Mapping[str, type[BaseModel]] = {
    "fove": FoveOptions,
    "gazepoint": GazepointOptions,
    "neon": NeonOptions,
    "hid_gaze": HidGazeOptions,
    "lsl_gaze": LslGazeOptions,
    "tobii_lsl": LslGazeOptions,
    "eyelink": EyeLinkOptions,
}
"""Options by driver name."""
