"""What a driver's options have in common, as they stand in `lab_config.yaml`.

Options are what stands beside `driver` and `simulated`; they are checked before anything runs and
their names carry their units.
"""

from typing import Any

from pydantic import BaseModel, ConfigDict, Field


class Options(BaseModel):
    """A driver's options: nothing unknown, nothing converted."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    def without(self, *names: str) -> dict[str, Any]:
        """Return the options by name, except these and those of the simulated wire."""
        return self.model_dump(exclude={"faults", "drift_ppm", *names})


class SimulatedOptions(Options):
    """Options of a driver whose simulator takes faults."""

    faults: list[dict[str, Any]] = Field(default_factory=list)
    """What goes wrong on the simulated wire; docs/devices.md lists the kinds."""


class StreamOptions(SimulatedOptions):
    """What every tracker takes that streams by itself; `drift_ppm` is of its simulated clock."""

    rate_hz: float = Field(default=120.0, ge=1, le=2000)
    lost_after_s: float = Field(default=2.0, gt=0, le=60)
    drift_ppm: float = Field(
        default=0.0, ge=-1000, le=1000, json_schema_extra={"any_magnitude": True}
    )
