"""Examine the computer: versions, disk, clock, load, screens. Never raises."""

import os
import platform
import warnings
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from statistics import median
from typing import NamedTuple

from visavis.cli.doctor.findings import Finding
from visavis.devices.libraries import LSL, Library
from visavis.devices.registry import driver_spec, driver_specs
from visavis.devices.states import is_installed
from visavis.lab.clock import MAX_STEP_NS, NS_PER_MS, Clock, clock_step_ns
from visavis.lab.config import LabConfig, Screen
from visavis.lab.errors import ConfigError, LabError
from visavis.recording.provenance import provenance
from visavis.running.sessions.data_root import data_disk
from visavis.running.sessions.device_setup import (
    NO_PICTURE_REMEDY,
    NO_WINDOW_REMEDY,
    shows_nothing,
    unheard_keyboards,
)

COMPUTER, LIBRARIES = "computer", "libraries"
GB_PER_HOUR = 0.3
"""Size of a session with gaze at 120 Hz and a tracked body; gaze at 1 kHz doubles it."""
FEW_GB = 20.0
NAPS = 20
NAP_NS = NS_PER_MS
LATE_NAP_MS = 2.0
BUSY_01 = 0.7
MAX_RATE_OFF_HZ = 1.5
"""More than rounding explains: systems round refresh rates to whole hertz."""
MAX_PITCH_OFF_01 = 0.02
"""Monitors have square pixels; if width and height disagree by more, one is wrong."""


def computer(lab: LabConfig, clock: Clock) -> tuple[Finding, ...]:
    """Return the findings on this computer that do not depend on its devices."""
    versions = provenance()
    version = versions.packages.get("visavis", "")
    revision = versions.code_revision.removesuffix("+changes")[:10]
    changes_note = ", changed files" if versions.code_revision.endswith("+changes") else ""
    ours = f"{version}" + (f" ({revision}{changes_note})" if revision else "")
    system = f"{platform.system()} {platform.release()}, Python {versions.python}"
    return (
        Finding(COMPUTER, "visavis", "ok", f"{ours}; {system}"),
        _load(),
        _disk(lab),
        _clock(clock),
        _screens(lab),
        *_luminances(lab),
        *_drawing(lab, clock),
        *_keyboards(lab),
        *_lsl_session(lab),
    )


def _keyboards(lab: LabConfig) -> tuple[Finding, ...]:
    """Return a finding for each keyboard whose keys no window receives."""
    text = f"no window hears its keys: display.show is {lab.display.show}"
    return tuple(
        Finding(COMPUTER, role, "missing", text, NO_WINDOW_REMEDY)
        for role in unheard_keyboards(lab)
    )


def _lsl_session(lab: LabConfig) -> tuple[Finding, ...]:
    """Name the LSL session of our streams; other programs must be set to it if it is the lab's."""
    own = lab.sync.session_id
    if not lab.sync.lsl:
        return ()
    if not own:
        return (Finding(COMPUTER, "LSL session", "ok", "LSL's own, where LabRecorder looks"),)
    text = f"{own!r} (sync.session_id): LabRecorder does not see these streams by itself"
    remedy = f"write SessionID = {own} under [lab] in its lsl_api.cfg, or leave sync.session_id out"
    return (Finding(COMPUTER, "LSL session", "note", text, remedy),)


def libraries(lab: LabConfig) -> tuple[Finding, ...]:
    """Return versions and licences of driver libraries; a missing one counts if a role needs it."""
    needed_libraries = {
        driver_spec(d.driver).wire.library for d in lab.devices.values() if not d.simulated
    }
    if lab.sync.lsl:
        needed_libraries.add(LSL)
    driver_libraries = sorted(
        {f.wire.library for f in driver_specs() if f.wire.library}, key=lambda k: k.distribution
    )
    present = [k for k in driver_libraries if is_installed(k)]
    rows = [Finding(LIBRARIES, "installed", "ok", ", ".join(map(_version, present)) or "none")]
    for library in driver_libraries:
        if library not in present and library in needed_libraries:
            text = "not installed, but a configured device needs it"
            rows.append(
                Finding(LIBRARIES, library.distribution, "missing", text, f"run: {library.install}")
            )
    others = [
        k.distribution for k in driver_libraries if k not in present and k not in needed_libraries
    ]
    if others:
        rows.append(Finding(LIBRARIES, "not needed", "note", ", ".join(others)))
    closed_licences = [
        f"{name} ({licence})"
        for k in present
        if (licence := _closed_licence(name := k.distribution))
    ]
    if closed_licences:
        rows.append(
            Finding(LIBRARIES, "licences", "note", "vendor's own: " + ", ".join(closed_licences))
        )
    return tuple(rows)


def licence_of(distribution: str) -> str:
    """Return the licence in a package's metadata, shortened; "not stated" where there is none."""
    try:
        package_fields = metadata.metadata(distribution)
    except metadata.PackageNotFoundError:
        return "not stated"
    for key in ("License-Expression", "License"):
        text = (package_fields[key] if key in package_fields else "").strip()
        if text and text.upper() != "UNKNOWN":
            return text.splitlines()[0][:40]
    licence_classifiers = [
        c for c in package_fields.get_all("Classifier") or () if c.startswith("License ::")
    ]
    return licence_classifiers[0].rpartition(":: ")[2] if licence_classifiers else "not stated"


def _version(library: Library) -> str:
    try:
        return f"{library.distribution} {metadata.version(library.distribution)}"
    except metadata.PackageNotFoundError:
        return library.distribution


def _closed_licence(distribution: str) -> str:
    licence = licence_of(distribution)
    return licence if "propriet" in licence.lower() or "sr research" in licence.lower() else ""


def _load() -> Finding:
    cores = os.cpu_count() or 1
    text = f"{cores} cores"
    if hasattr(os, "getloadavg"):
        load = os.getloadavg()[0]
        text += f", load {load:.1f}"
        if load / cores > BUSY_01:
            return Finding(
                COMPUTER, "processor", "warning", text, "close other programs before a session"
            )
    return Finding(COMPUTER, "processor", "ok", text)


def _disk(lab: LabConfig) -> Finding:
    disk = data_disk(lab)
    if disk.free_gb is None or disk.problem:
        return Finding(COMPUTER, "disk", "missing", disk.problem, disk.remedy)
    hours = disk.free_gb / GB_PER_HOUR
    text = (
        f"{disk.free_gb:.0f} GB free for {_short(lab.data_root)}: about {hours:.0f} h of sessions"
    )
    if disk.free_gb < FEW_GB:
        return Finding(COMPUTER, "disk", "warning", text, "move old sessions to an archive")
    return Finding(COMPUTER, "disk", "ok", text)


def _clock(clock: Clock) -> Finding:
    if clock.is_virtual:
        return Finding(COMPUTER, "clock", "ok", "virtual")
    late_ms = []
    for _ in range(NAPS):
        wake_ns = clock.now_ns() + NAP_NS
        clock.sleep_until_ns(wake_ns)
        late_ms.append((clock.now_ns() - wake_ns) / NS_PER_MS)
    step_ms = clock_step_ns(clock) / NS_PER_MS
    if step_ms > MAX_STEP_NS / NS_PER_MS:
        return Finding(
            COMPUTER,
            "clock",
            "missing",
            f"moves in steps of {step_ms:g} ms: too coarse",
            "switch the high precision event timer on in the computer's firmware",
        )
    text = f"wakes {median(late_ms):.2f} ms late (worst {max(late_ms):.1f}); {clock.wall_iso()}"
    if median(late_ms) > LATE_NAP_MS:
        return Finding(
            COMPUTER,
            "clock",
            "warning",
            text,
            "close other programs; on Windows choose the high-performance power plan",
        )
    return Finding(COMPUTER, "clock", "ok", text)


def _screens(lab: LabConfig) -> Finding:
    show_mode = lab.display.show
    monitor_list: list[Monitor] = []
    try:
        monitor_list = monitors()
        modes = [str(monitor) for monitor in monitor_list]
    except Exception as problem:  # the graphics library's own errors are of any kind
        modes = []
        text = f"no screen can be asked ({type(problem).__name__})"
    else:
        text = ", ".join(modes) or "no screen"
    text += f"; display.show is {show_mode}"
    if shows_nothing(lab):
        return Finding(COMPUTER, "display", "missing", text, NO_PICTURE_REMEDY)
    if show_mode == "screen" and lab.display.screen is not None and monitor_list:
        text += f" on monitor {lab.display.screen.monitor}"
        return _of_screen(lab.display.screen, monitor_list, text)
    if not modes and show_mode in ("window", "screen"):
        remedy = "log in on a desktop, or set display.show to none or offscreen"
        return Finding(COMPUTER, "display", "missing", text, remedy)
    return Finding(COMPUTER, "display", "ok", text)


def _luminances(lab: LabConfig) -> tuple[Finding, ...]:
    """Say by which table of luminances greys are drawn where people sit before a screen."""
    if lab.display.on_screen is None:
        return ()
    try:
        table = lab.luminance
    except ConfigError as problem:
        remedy = f"mend or delete {lab.luminance_path}"
        return (Finding(COMPUTER, "luminances", "missing", str(problem), remedy),)
    if table is None:
        remedy = "run: visavis devices luminance (docs/screens.md)"
        text = "not measured: contrasts are of values, not of light"
        return (Finding(COMPUTER, "luminances", "note", text, remedy),)
    return (Finding(COMPUTER, "luminances", "ok", table.summary),)


def _drawing(lab: LabConfig, clock: Clock) -> tuple[Finding, ...]:
    """Measure the time of a stereo frame where a headset is used; recommend a quality."""
    if lab.display.show != "headset" or clock.is_virtual:
        return ()
    try:
        # Late: it loads what draws, which `serve` and sessions on a page do without.
        from visavis.cli.doctor.drawing import measure_drawing

        return (measure_drawing(lab, clock),)
    except (ImportError, LabError) as problem:
        text = f"no frame could be measured: {problem}"
        return (Finding(COMPUTER, "drawing", "warning", text, "update the graphics driver"),)


def _of_screen(screen: Screen, monitor_list: Sequence["Monitor"], text: str) -> Finding:
    """Compare the participants' monitor with display.screen of the configuration."""
    remedy = "correct display.screen, or the monitor's mode in the system's settings"
    if screen.monitor >= len(monitor_list):
        text += f": there is none of this number, counted from 0 to {len(monitor_list) - 1}"
        return Finding(COMPUTER, "display", "missing", text, remedy)
    monitor = monitor_list[screen.monitor]
    if screen.fullscreen and (monitor.width_px, monitor.height_px) != (
        screen.width_px,
        screen.height_px,
    ):
        text += f": it has other pixels than {screen.width_px}×{screen.height_px}"
        return Finding(COMPUTER, "display", "missing", text, remedy)
    if monitor.rate_hz and abs(monitor.rate_hz - screen.rate_hz) > MAX_RATE_OFF_HZ:
        text += f": it refreshes otherwise than display.screen.rate_hz {screen.rate_hz:g}"
        return Finding(COMPUTER, "display", "warning", text, remedy)
    if not screen.fullscreen:
        text += ", in a window: sizes are wrong"
        return Finding(
            COMPUTER,
            "display",
            "warning",
            text,
            "set fullscreen: true for people",
        )
    pitches_mm = (
        screen.width_m / screen.width_px * 1e3,
        screen.height_m / screen.height_px * 1e3,
    )
    if abs(pitches_mm[0] / pitches_mm[1] - 1) > MAX_PITCH_OFF_01:
        text += f": pixels of {pitches_mm[0]:.3f} × {pitches_mm[1]:.3f} mm are not square"
        return Finding(
            COMPUTER, "display", "warning", text, "measure width_m and height_m of the lit area"
        )
    return Finding(COMPUTER, "display", "ok", text)


class Monitor(NamedTuple):
    """A monitor as the system shows it now."""

    width_px: int
    height_px: int
    rate_hz: int

    def __str__(self) -> str:
        return f"{self.width_px}×{self.height_px} at {self.rate_hz} Hz"


def monitors() -> list[Monitor]:
    """Return the monitors of this computer; raises what the graphics library raises."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # glfw warns where there is no screen
        import glfw

        if not glfw.init():
            return []
        try:
            monitor_list = []
            for monitor in glfw.get_monitors():
                mode = glfw.get_video_mode(monitor)
                monitor_list.append(Monitor(mode.size.width, mode.size.height, mode.refresh_rate))
            return monitor_list
        finally:
            # An open context means that a session draws in a window: leave glfw running.
            if glfw.get_current_context() is None:
                glfw.terminate()


def _short(path: Path) -> str:
    try:
        return f"~/{path.relative_to(Path.home())}"
    except ValueError:
        return str(path)
