"""Read the descriptor and the reports of a gamepad or USB button box; pure.

A HID describes its own reports. Buttons (usage page 9), axes and hat switches (page 1) are read, of
any width and at any bit. Source: USB-IF's "Device class definition for HID" 1.11 and usage tables.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from visavis.devices.drivers.buttons.device import Press

BUTTON_PAGE, DESKTOP_PAGE = 0x09, 0x01
AXES = {0x30: "x", 0x31: "y", 0x32: "z", 0x33: "rx", 0x34: "ry", 0x35: "rz"}
HAT = 0x39
HAT_SIDES = ("up", "right", "down", "left")
"""Sides of a hat switch, clockwise; each is a button of its own, and between two both are down."""
STEP_01 = 1 / 16
"""A smaller movement of an axis is not reported."""
MAX_BITS = 8 * 4096
MAX_USAGES = 512

_LENGTHS = (0, 1, 2, 4)
_CONSTANT, _VARIABLE = 0x01, 0x02


@dataclass(frozen=True)
class Control:
    """One value in a report: its report's number, its bits, and the range it may take."""

    name: str
    report: int
    bit: int
    bits: int
    low: int
    high: int
    is_hat: bool = False

    def buttons(self) -> tuple[str, ...]:
        """Return the names of its buttons."""
        if self.is_hat:
            return HAT_SIDES
        return (f"{self.name}-", f"{self.name}+") if self.name in AXES.values() else (self.name,)


@dataclass(frozen=True)
class Layout:
    """The controls of a device, and whether its reports begin with a number."""

    controls: tuple[Control, ...]
    is_numbered: bool

    def buttons(self) -> tuple[str, ...]:
        """Return the names of everything that can be pressed, in the device's order."""
        return tuple(dict.fromkeys(name for c in self.controls for name in c.buttons()))


@dataclass
class _Globals:
    page: int = 0
    low: int = 0
    high: int = 0
    size: int = 0
    count: int = 0
    report: int = 0


def layout_of(descriptor: bytes) -> Layout:
    """Return the positions of buttons and axes in reports; no controls if it is malformed."""
    state, stack = _Globals(), list[_Globals]()
    usages: list[tuple[int, int]] = []
    first = 0
    offset: dict[int, int] = {}
    controls: list[Control] = []
    is_numbered = False
    at = 0
    while at < len(descriptor):
        head = descriptor[at]
        length = _LENGTHS[head & 3]
        raw = descriptor[at + 1 : at + 1 + length]
        if head == 0xFE or len(raw) < length:  # a long item, or the descriptor is cut
            return Layout((), is_numbered=False)
        data, signed = (int.from_bytes(raw, "little", signed=s) for s in (False, True))
        at += 1 + length
        match head & 0xFC:  # tag and type of a short item (HID 1.11, 6.2.2)
            case 0x04:  # usage page
                state.page = data
            case 0x14:  # logical minimum
                state.low = signed
            case 0x24:  # logical maximum
                state.high = signed if state.low < 0 else data
            case 0x74:  # report size, bits
                state.size = data
            case 0x94:  # report count
                state.count = data
            case 0x84:  # report ID
                state.report, is_numbered = data, True
            case 0xA4:  # push
                stack.append(_Globals(**vars(state)))
            case 0xB4 if stack:  # pop
                state = stack.pop()
            case 0x08:  # usage
                usages.append(_usage(data, length, state.page))
            case 0x18:  # usage minimum
                first = data
            case 0x28:  # usage maximum
                page, last = _usage(data, length, state.page)
                start = first & 0xFFFF
                usages += [(page, u) for u in range(start, min(last, start + MAX_USAGES) + 1)]
            case 0x80:  # input
                bit = offset.get(state.report, 0)
                if state.size * state.count + bit > MAX_BITS:
                    return Layout((), is_numbered=False)
                if state.size and data & _VARIABLE and not data & _CONSTANT:
                    controls += _controls(state, usages, bit)
                offset[state.report] = bit + state.size * state.count
                usages, first = [], 0
            case 0xA0 | 0xC0 | 0xB0 | 0x90:  # collection, its end, feature, output
                usages, first = [], 0
            case _:
                pass
    return Layout(tuple(controls), is_numbered)


def _usage(data: int, length: int, page: int) -> tuple[int, int]:
    """Return page and usage; four bytes bring a page of their own."""
    return (data >> 16, data & 0xFFFF) if length == 4 else (page, data)


def _controls(state: _Globals, usages: Sequence[tuple[int, int]], bit: int) -> list[Control]:
    controls = []
    for k in range(state.count if usages else 0):
        page, usage = usages[min(k, len(usages) - 1)]
        place = (state.report, bit + k * state.size, state.size, state.low, state.high)
        if page == BUTTON_PAGE and usage:
            controls.append(Control(f"button_{usage}", *place))
        elif page == DESKTOP_PAGE and usage in AXES:
            controls.append(Control(AXES[usage], *place))
        elif page == DESKTOP_PAGE and usage == HAT:
            controls.append(Control("hat", *place, is_hat=True))
    return controls


class ReportReader:
    """Turn reports into changes of buttons and axes; counts reports that are too short."""

    def __init__(self, layout: Layout) -> None:
        self.unreadable_count = 0
        self._layout = layout
        self._last: dict[str, float] = {}

    def feed(self, report: bytes) -> list[Press]:
        """Return what changed since the report before; axes rest in their middle."""
        number, body = 0, report
        if self._layout.is_numbered:
            number, body = (report[0] if report else 0), report[1:]
        value = int.from_bytes(body, "little")
        presses: list[Press] = []
        for control in self._layout.controls:
            if control.report != number:
                continue
            if control.bit + control.bits > 8 * len(body):
                self.unreadable_count += 1
                return presses
            raw = value >> control.bit & ((1 << control.bits) - 1)
            if control.low < 0 and raw >> (control.bits - 1):
                raw -= 1 << control.bits
            for name, level in _levels(control, raw):
                before = self._last.get(name, 0.0)
                is_end = level in (0.0, 1.0) and level != before
                if is_end or abs(level - before) >= STEP_01:
                    self._last[name] = level
                    presses.append(Press(name, level))
        return presses


def _levels(control: Control, raw: int) -> list[tuple[str, float]]:
    if control.is_hat:
        side = raw - control.low
        eighths = 8 if control.high - control.low >= 7 else 4
        if not 0 <= side < eighths:
            return [(name, 0.0) for name in HAT_SIDES]
        at = side * 8 // eighths
        down = {at // 2, (at + 1) // 2 % 4}
        return [(name, float(k in down)) for k, name in enumerate(HAT_SIDES)]
    if control.name not in AXES.values():
        return [(control.name, float(raw > control.low))]
    span = control.high - control.low
    share = min(max((raw - control.low) / span, 0.0), 1.0) if span > 0 else 0.5
    low, high = control.buttons()
    return [(low, max(0.0, 1 - 2 * share)), (high, max(0.0, 2 * share - 1))]
