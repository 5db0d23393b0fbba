"""What a driver's options have in common, as they stand in `lab_config.yaml`.

Options are the keys next to `driver` and `simulated`. They are checked before anything runs, and
their names carry their units.
"""

from typing import Any, ClassVar

from pydantic import BaseModel, ConfigDict, Field, field_validator

from visavis.devices.faults import FaultSchedule
from visavis.lab.errors import ConfigError


class Options(BaseModel):
    """A driver's options: nothing unknown, nothing converted."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    of_wire: ClassVar[frozenset[str]] = frozenset()
    """Options that are for the wire and not for the driver on it."""

    def for_driver(self) -> dict[str, Any]:
        """Return the driver's arguments besides role, wire and clock."""
        of_session = {"faults", "drift_ppm", "gaze_delay_ms"}
        return self.model_dump(exclude={*of_session, *self.of_wire})

    def for_simulator(self) -> dict[str, Any]:
        """Return a simulator's arguments besides body, clock, seed and faults."""
        return {}


class GazeTiming(Options):
    """What every eye tracker takes: how late its own stamps are.

    `gaze_delay_ms` lies between a movement of the eye and the time the tracker stamps it with; by
    the vendor's document or a measurement. None: not known, and nothing is subtracted.
    """

    gaze_delay_ms: float | None = Field(default=None, ge=0, le=200)


class SimulatedOptions(Options):
    """Options of a driver whose simulator takes faults."""

    faults: list[dict[str, Any]] = Field(default_factory=list)
    """What goes wrong on the simulated wire; docs/devices.md lists the kinds."""

    @field_validator("faults")
    @classmethod
    def _are_known(cls, faults: list[dict[str, Any]]) -> list[dict[str, Any]]:
        try:
            FaultSchedule.from_config(faults)
        except ConfigError as error:  # so that the error names the file and the line
            raise ValueError(str(error)) from error
        return faults


class StreamOptions(SimulatedOptions):
    """What every tracker takes that streams by itself; `drift_ppm` is of its simulated clock."""

    rate_hz: float = Field(default=120.0, ge=1, le=2000)
    lost_after_s: float = Field(default=2.0, gt=0, le=60)
    drift_ppm: float = Field(
        default=0.0, ge=-1000, le=1000, json_schema_extra={"any_magnitude": True}
    )

    def for_simulator(self) -> dict[str, Any]:
        """Return the rate and the drift of the simulated clock."""
        return {"rate_hz": self.rate_hz, "drift_ppm": self.drift_ppm}
