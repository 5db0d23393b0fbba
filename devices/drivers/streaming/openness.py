"""The openness of the eyes: the second stream of eye trackers that measure it."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from visavis.devices.contracts import Health
from visavis.devices.drivers.streaming.gaze_device import GazeDevice
from visavis.devices.drivers.streaming.gaze_rays import Sample
from visavis.devices.drivers.streaming.screen import NAN
from visavis.lab.schema import Field, SampleBatch, StreamSchema

OPENNESS = StreamSchema(
    "openness",
    (
        Field("left_openness_01", "f4", "1", description="0 closed, 1 wide open; NaN if unknown"),
        Field("right_openness_01", "f4", "1", description="0 closed, 1 wide open; NaN if unknown"),
    ),
    120.0,
)


class GazeAndOpenness(GazeDevice):
    """Deliver gaze, and the openness of both eyes with every sample if `tells_openness`."""

    tells_openness = True

    def describe(self) -> tuple[StreamSchema, ...]:
        """Return the gaze stream, and that of openness if it is measured."""
        gaze = super().describe()
        return (*gaze, self._of_openness) if self.tells_openness else gaze

    def health(self) -> Health:
        """Report the rows of both streams; rate and gaps are those of gaze."""
        health = super().health()
        return replace(health, received=2 * health.received) if self.tells_openness else health

    @property
    def _of_openness(self) -> StreamSchema:
        return replace(OPENNESS, nominal_rate_hz=self._schema.nominal_rate_hz)

    def _values(self, samples: Sequence[Sample]) -> npt.NDArray[np.void]:
        unknown = (NAN, NAN)
        self._openness_rows = [
            s.openness_01 if s.openness_01 is not None else unknown for s in samples
        ]
        return super()._values(samples)

    def _deliver(self, seqs: Any, stamps: Any, arrivals: Any, values: npt.NDArray[np.void]) -> int:
        row_count = super()._deliver(seqs, stamps, arrivals, values)
        if not row_count or self._sink is None or not self.tells_openness:
            return row_count
        schema = self._of_openness
        rows = np.array(self._openness_rows, schema.dtype)
        seq, device, host = (np.asarray(column, np.int64) for column in (seqs, stamps, arrivals))
        self._sink(SampleBatch(schema, seq, device, host, rows))
        return 2 * row_count
