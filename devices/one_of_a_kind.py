"""Choose the one device that is meant: where several fit, nobody guesses, and all are named."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

from visavis.lab.errors import DeviceNotFound

T = TypeVar("T")


def the_only(fitting: Sequence[T], name: Callable[[T], str], what: str, remedy: str) -> T:
    """Return the one that fits; raises DeviceNotFound, which names all, where there are more."""
    if len(fitting) == 1:
        return fitting[0]
    names = ", ".join(sorted(map(name, fitting)))
    raise DeviceNotFound(f"{len(fitting)} {what} fit: {names}", remedy=remedy)


def the_only_hid(rows: Sequence[Mapping[str, Any]], what: str) -> Mapping[str, Any]:
    """Return the first row of the one HID that fits, as hidapi's `enumerate` describes it.

    One device may have several rows, for its interfaces and collections. Rows with a serial number
    are one device by it; without one, two rows of the same interface and usage are two devices.
    """
    by_device: dict[tuple[Any, ...], list[Mapping[str, Any]]] = {}
    for row in rows:
        key = (row.get("vendor_id"), row.get("product_id"), row.get("serial_number") or "")
        by_device.setdefault(key, []).append(row)
    devices: list[Mapping[str, Any]] = []
    for (*_, serial), of_device in by_device.items():
        same = Counter(
            (row.get("interface_number"), row.get("usage_page"), row.get("usage"))
            for row in of_device
        )
        count = 1 if serial else max(same.values())
        devices += of_device[:count]
    return the_only(
        devices, _hid_name, what, "give serial_number in lab_config.yaml, or unplug one"
    )


def _hid_name(row: Mapping[str, Any]) -> str:
    ids = f"{row.get('vendor_id') or 0:04x}:{row.get('product_id') or 0:04x}"
    serial = row.get("serial_number") or "without a serial number"
    return f"{row.get('product_string') or 'HID'} {ids} {serial}"
