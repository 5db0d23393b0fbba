"""The states of roles and drivers, without opening a device."""

import importlib.util
from dataclasses import dataclass

from visavis.devices.libraries import Library
from visavis.devices.registry import driver_spec, driver_specs
from visavis.devices.spec import AnySpec
from visavis.lab.config import LabConfig

RUNTIMES = {
    "openvr": "SteamVR, started",
    "openxr": "an OpenXR runtime, started",
    "fove": "the FOVE runtime's FoveClient",
}


@dataclass(frozen=True)
class RoleState:
    """One role; `ok` is whether its driver can be used here."""

    role: str
    driver: str
    simulated: bool
    ok: bool
    state: str


@dataclass(frozen=True)
class DriverState:
    """One driver; `ok` is None where nothing has to be installed."""

    driver: str
    kind: str
    wire: str
    ok: bool | None
    state: str


def is_installed(library: Library) -> bool:
    """Tell whether a library can be imported, without importing it."""
    try:
        return importlib.util.find_spec(library.module) is not None
    except (ImportError, ValueError):  # its parent package is missing or incomplete
        return False


def role_states(lab: LabConfig) -> tuple[RoleState, ...]:
    """Return every configured role."""
    states = []
    for role, device in lab.devices.items():
        facts = driver_spec(device.driver)
        missing = _missing(facts)
        if device.simulated:
            needs = missing if facts.wire.runtime in ("openvr", "openxr") else ""
            state = f"simulated, {needs}" if needs else "simulated"
        else:
            needs = missing
            runtime = facts.wire.runtime
            state = f"needs {RUNTIMES[runtime]}" if runtime else "ready to be tested"
            state = missing or state
        states.append(RoleState(role, device.driver, device.simulated, not needs, state))
    return tuple(states)


def driver_states() -> tuple[DriverState, ...]:
    """Return every driver known here, eye trackers first."""
    order = (
        "eye tracker",
        "headset",
        "responses",
        "body tracker",
        "armband",
        "sound output",
        "triggers",
        "other",
    )
    states = []
    for facts in driver_specs():
        missing = _missing(facts)
        library = facts.wire.library.distribution if facts.wire.library else ""
        state = missing or (f"{library} installed" if library else "nothing to install")
        if not missing and facts.wire.runtime:
            state = f"needs {RUNTIMES[facts.wire.runtime]}"
        ok = None if facts.wire.library is None else not missing
        states.append(DriverState(facts.name, facts.kind, facts.wire.medium, ok, state))
    return tuple(sorted(states, key=lambda s: (order.index(s.kind), s.driver)))


def _missing(facts: AnySpec) -> str:
    if facts.wire.library is None or is_installed(facts.wire.library):
        return ""
    return f"missing: {facts.wire.library.install}"
