"""Listen by a device of the lab's configuration: an EEG amplifier through LSL, for instance."""

from collections.abc import Mapping

import numpy as np

from visavis.devices.contracts import Device
from visavis.devices.sync.sensing import Trace
from visavis.lab.clock_fit import fit_clock
from visavis.lab.errors import DeviceError
from visavis.lab.schema import SampleBatch

OPENING_S = 10.0


class RoleSensor:
    """Every column of numbers that a device delivers; a `Sensor`.

    Stamps are the device's own, mapped to the session's clock by its time exchanges; without
    exchanges they are times of arrival, and the link's delay is in what is measured.
    """

    def __init__(self, device: Device) -> None:
        self._device = device
        self._batches: list[SampleBatch] = []

    @property
    def display_name(self) -> str:
        """Name the role and the driver."""
        return f"{self._device.info.role} ({self._device.info.driver})"

    def open(self) -> None:
        """Open and start the device."""
        self._device.open(OPENING_S)
        self._device.start(self._batches.append)

    def poll(self) -> None:
        """Take what has come."""
        self._device.poll(0.0)

    def close(self) -> None:
        """Close the device."""
        self._device.close()

    def loss_count(self) -> int:
        """Return the gaps that the device's meter counted."""
        return self._device.health().gaps

    def traces(self) -> Mapping[str, Trace]:
        """Return all scalar columns of the first stream; raises DeviceError without samples."""
        batches = [b for b in self._batches if b.schema.name == self._batches[0].schema.name]
        if not batches:
            raise DeviceError(
                "the sensor delivered nothing",
                role=self._device.info.role,
                remedy="look at it with: visavis devices test",
            )
        pairs = self._device.clock_pairs()
        t_ns = np.concatenate([b.t_device_ns if pairs else b.t_host_ns for b in batches])
        if pairs:
            t_ns = fit_clock(pairs).to_host_ns(t_ns)
        values = np.concatenate([b.values for b in batches])
        order = np.argsort(t_ns, kind="stable")
        traces = {}
        for column in batches[0].schema.fields:
            level = values[column.name]
            if level.ndim == 1 and np.issubdtype(level.dtype, np.number):
                traces[column.name] = Trace(t_ns[order], level[order].astype(np.float64))
        return traces
