"""The note in a `.wire` file, which lets it be played back without the lab it is from."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from visavis.devices.registry import driver_names, driver_spec
from visavis.devices.wirelog import WireLog
from visavis.lab.config import DeviceConfig
from visavis.lab.errors import DataError, UsageError

ROLE = "replayed"


def note_of(device: DeviceConfig) -> Mapping[str, Any]:
    """Return driver and options of the device that was captured.

    A simulated band is noted as the driver of the real one, whose protocol it speaks.
    """
    options = {k: v for k, v in device.options.items() if k not in ("faults", "drift_ppm")}
    spec = driver_spec(device.driver)
    if spec.dialect.driver:
        spec = driver_spec(spec.dialect.driver)
        options = {k: v for k, v in options.items() if k in spec.options.model_fields}
    elif device.simulated:
        options |= spec.dialect.options
    return {"role": device.role, "driver": spec.name, "options": options}


def device_of(path: Path, log: WireLog, driver: str | None = None) -> DeviceConfig:
    """Return the device to build for a replay; `driver` is used where the file names none.

    Raises:
        UsageError: the file names no driver and none was given.
        DataError: the file names a driver that is not installed.
    """
    driver_name = driver or str(log.note.get("driver", ""))
    if not driver_name:
        raise UsageError(
            f"{path} does not name its driver; add --driver NAME (see `visavis devices list`)"
        )
    if driver_name not in driver_names():
        choices = f"known here: {', '.join(driver_names())}"
        if driver:
            raise UsageError(f"unknown driver {driver_name!r}; {choices}")
        raise DataError(f"{path} is from driver {driver_name!r}, which is not installed; {choices}")
    options = log.note.get("options", {}) if driver_name == log.note.get("driver") else {}
    role = str(log.note.get("role", ROLE))
    return DeviceConfig(role=role, driver=driver_name, simulated=False, options=_lists(options))


def _lists(value: Any) -> Any:
    """Turn tuples back into lists: msgpack returns tuples, which strict options refuse."""
    if isinstance(value, Mapping):
        return {key: _lists(inner) for key, inner in value.items()}
    if isinstance(value, tuple | list):
        return [_lists(inner) for inner in value]
    return value
