"""The timing of this computer: locked once it is known to be good, then compared at every start.

The file of a station lies under the data root and has the computer's name. An earlier one is kept
beside it with its date. It holds the timing figures, the delays of the newest synchronisation
test, and what both depend on: system, processors and monitors.
"""

import json
import os
import platform
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import Final

from visavis.cli.doctor.findings import Finding
from visavis.cli.doctor.machine import monitors
from visavis.cli.sync_records import newest
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.config import LabConfig
from visavis.lab.errors import RecordingError, UsageError
from visavis.recording.durable import make_folder, replace_file

STATION: Final = "station"
FOLDER: Final = "stations"
FRAME_HZ: Final = 90.0
FRAMES: Final = 45
LATE_FRAME_MS: Final = 2.0
"""A frame that begins so much after its time counts as late: a fifth of a frame at 90 Hz."""
WRITES: Final = 10
WRITE_BYTES: Final = 65_536
MAX_DELAY_OFF_MS: Final = 3.0
"""A delay of picture, sound or vibration that differs by more means other devices."""
LOCK_AGAIN: Final = "visavis doctor --lock"


@dataclass(frozen=True)
class Limit:
    """How much larger than its locked value a figure may be: `times` as large, plus `more`."""

    words: str
    unit: str
    times: float
    more: float


LIMITS: Final[Mapping[str, Limit]] = {
    "wake_ms": Limit("wakes late by (median)", "ms", 2.0, 0.5),
    "late_frames_01": Limit("frames begun late", "%", 1.0, 0.05),
    "write_ms": Limit("64 kB safe on disk after (median)", "ms", 3.0, 10.0),
}
"""Wide enough for a busy moment, and narrow enough to notice another computer, mode or disk."""


@dataclass(frozen=True)
class Station:
    """One measurement: figures by name, delays by modality in ms, and what they depend on."""

    made: str
    figures: Mapping[str, float]
    delays_ms: Mapping[str, float]
    depends_on: Mapping[str, str]


def measure(lab: LabConfig, clock: Clock) -> Station:
    """Measure this computer now; takes about a second of a real clock.

    Raises:
        RecordingError: nothing can be written to the data root.
    """
    late_ms = _late_ms(clock)
    test = newest(lab)
    delays = {} if test is None else test.get("offsets_ms", {})
    return Station(
        clock.wall_iso(),
        {
            "wake_ms": round(median(late_ms), 3),
            "late_frames_01": round(sum(ms > LATE_FRAME_MS for ms in late_ms) / FRAMES, 3),
            "write_ms": round(_write_ms(lab, clock), 3),
        },
        {str(name): float(ms) for name, ms in delays.items()},
        {
            "system": f"{platform.system()} {platform.release()}",
            "processors": str(os.cpu_count() or 1),
            "monitors": _monitors(),
        },
    )


def lock(lab: LabConfig, clock: Clock) -> Path:
    """Measure this computer and save it as locked; return the file. An earlier file is kept.

    Raises:
        RecordingError: nothing can be written to the data root.
    """
    path = station_path(lab)
    station = measure(lab, clock)
    make_folder(path.parent, exist_ok=True)
    if path.exists():
        replace_file(_former(path), path.read_bytes())
    text = json.dumps(asdict(station), ensure_ascii=False, indent=1) + "\n"
    replace_file(path, text.encode())
    return path


def locked(lab: LabConfig) -> Station | None:
    """Return the locked station of this computer; None where none was locked.

    Raises:
        UsageError: the file cannot be read.
    """
    path = station_path(lab)
    try:
        document = json.loads(path.read_text("utf-8"))
        figures, delays = (
            {str(k): float(v) for k, v in document[name].items()}
            for name in ("figures", "delays_ms")
        )
        depends = {str(k): str(v) for k, v in document["depends_on"].items()}
        return Station(str(document["made"]), figures, delays, depends)
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise UsageError(
            f"{path} is not a locked station ({type(error).__name__}: {error}); delete it and lock "
            f"again: {LOCK_AGAIN}"
        ) from error


def station_findings(lab: LabConfig, clock: Clock) -> tuple[Finding, ...]:
    """Compare this computer with its locked station: one line in all, or one per difference."""
    if clock.is_virtual:
        return ()
    try:
        locked_station = locked(lab)
        if locked_station is None:
            text = "its timing was never locked, so nothing is compared"
            remedy = f"once sessions run well: {LOCK_AGAIN}"
            return (Finding(STATION, "timing", "note", text, remedy),)
        return compare_stations(locked_station, measure(lab, clock))
    except (RecordingError, UsageError) as problem:
        return (Finding(STATION, "timing", "warning", str(problem)),)


def compare_stations(before: Station, now: Station) -> tuple[Finding, ...]:
    """Return one finding per difference from the locked station, or one that there is none."""
    findings = [
        *_worse(before, now),
        *_changed_delays(before, now),
        *_changed(before, now),
    ]
    if findings:
        return tuple(findings)
    figures_text = ", ".join(
        _figure_text(name, now.figures[name]) for name in LIMITS if name in now.figures
    )
    return (Finding(STATION, "timing", "ok", f"as locked on {before.made[:10]}: {figures_text}"),)


def station_path(lab: LabConfig) -> Path:
    """Return the file of this computer."""
    name = re.sub(r"[^\w.-]+", "_", platform.node()) or "this_computer"
    return lab.data_root / FOLDER / f"{name}.json"


# ---- within ----------------------------------------------------------------------------------


def _worse(before: Station, now: Station) -> list[Finding]:
    findings = []
    for name, limit in LIMITS.items():
        was, is_now = before.figures.get(name), now.figures.get(name)
        if was is None or is_now is None or is_now <= was * limit.times + limit.more:
            continue
        text = (
            f"{_figure_text(name, is_now)}; locked on {before.made[:10]}: {_figure_text(name, was)}"
        )
        remedy = "close other programs, look at the power plan and the disk; then visavis doctor"
        findings.append(Finding(STATION, "timing", "warning", text, remedy))
    return findings


def _changed_delays(before: Station, now: Station) -> list[Finding]:
    return [
        Finding(
            STATION,
            "delays",
            "warning",
            f"{name} {now.delays_ms[name]:g} ms late; locked on {before.made[:10]}: {was:g} ms",
            f"find what changed (cable, mode, driver), or lock what is right now: {LOCK_AGAIN}",
        )
        for name, was in before.delays_ms.items()
        if name in now.delays_ms and abs(now.delays_ms[name] - was) > MAX_DELAY_OFF_MS
    ]


def _changed(before: Station, now: Station) -> list[Finding]:
    return [
        Finding(
            STATION,
            name,
            "warning",
            f"{now.depends_on[name]}; locked on {before.made[:10]} with {was}",
            f"measure delays again (visavis sync-test), then lock anew: {LOCK_AGAIN}",
        )
        for name, was in before.depends_on.items()
        if name in now.depends_on and now.depends_on[name] != was
    ]


def _figure_text(name: str, value: float) -> str:
    limit = LIMITS[name]
    value_text = f"{100 * value:.0f} %" if limit.unit == "%" else f"{value:.1f} {limit.unit}"
    return f"{limit.words} {value_text}"


def _late_ms(clock: Clock) -> list[float]:
    """Wait for the beginning of each frame; return how late each wait ended, in ms."""
    begin_ns, late_ms = clock.now_ns(), []
    for k in range(1, FRAMES + 1):
        wake_ns = begin_ns + round(k * NS_PER_S / FRAME_HZ)
        clock.sleep_until_ns(wake_ns)
        late_ms.append((clock.now_ns() - wake_ns) / NS_PER_MS)
    return late_ms


def _write_ms(lab: LabConfig, clock: Clock) -> float:
    """Return the median time until 64 kB are safe on the disk of the data root, in ms."""
    make_folder(lab.data_root / FOLDER, exist_ok=True)
    path = lab.data_root / FOLDER / f".write_test.{os.getpid()}"
    took_ms, content = [], bytes(WRITE_BYTES)
    try:
        for _ in range(WRITES):
            begin_ns = clock.now_ns()
            replace_file(path, content)
            took_ms.append((clock.now_ns() - begin_ns) / NS_PER_MS)
    finally:
        path.unlink(missing_ok=True)
    return median(took_ms)


def _monitors() -> str:
    try:
        return ", ".join(map(str, monitors())) or "none"
    except Exception:  # the graphics library's own errors are of any kind
        return "none can be asked"


def _former(path: Path) -> Path:
    """Return a new path for the earlier station, named by its date; nothing is overwritten."""
    try:
        date_text = re.sub(r"\D", "", str(json.loads(path.read_text("utf-8"))["made"])[:19])
    except (OSError, ValueError, KeyError, TypeError):
        date_text = "damaged"
    number, new_path = 1, path.with_name(f"{path.stem}.until_{date_text}.json")
    while new_path.exists():
        number += 1
        new_path = path.with_name(f"{path.stem}.until_{date_text}-{number}.json")
    return new_path
