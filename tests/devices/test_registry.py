"""Drivers are found by name, and what is missing is named with its cure."""

import subprocess
import sys
from contextlib import ExitStack
from importlib.metadata import EntryPoint
from types import ModuleType

import pytest

from visavis.devices import registry
from visavis.devices.building import build_device
from visavis.devices.drivers.pupil.spec import PUPIL_CORE
from visavis.devices.libraries import Library
from visavis.devices.options import Options
from visavis.devices.spec import DriverSpec, Wire
from visavis.devices.wiring import Wiring, no_wire
from visavis.lab.clock import SimClock
from visavis.lab.config import DeviceConfig
from visavis.lab.errors import ConfigError, DeviceNotFound

LISTED = """
import sys
from visavis.devices.registry import OPTION_MODELS, driver_specs
models = [OPTION_MODELS[name] for name in OPTION_MODELS]
names = [spec.name for spec in driver_specs()]
light = ("spec", "options", "screen")
print(*(m for m in sys.modules if m.startswith(("visavis.devices.drivers.", "visavis.devices.sim."))
        and m.count(".") > 3 and m.rpartition(".")[2] not in light))
print(*(m for m in sys.modules if m in ("numpy", "zmq", "msgpack", "pylsl", "openvr", "xr")))
"""


def missing(site, wire):
    import no_such_library_here  # noqa: F401 - what the test is about


def odd(**wire):
    return DriverSpec("odd", "responses", Options, wire=Wire(carries="nothing", **wire))


@pytest.fixture
def installed(monkeypatch):
    """Let a package announce the driver `odd`."""

    def announce(value):
        point = EntryPoint("odd", value, registry.ENTRY_POINT_GROUP)
        monkeypatch.setattr(registry, "_others", lambda: {"odd": point})
        registry._loaded.cache_clear()

    return announce


@pytest.fixture
def packaged(installed, monkeypatch):
    """Let a package hold a description in `spec`, and in `wiring` what is built by it."""

    def package(spec, wirings):
        for name, value in (("spec", {"ODD": spec}), ("wiring", {"WIRINGS": wirings})):
            module = ModuleType(f"odd_package.{name}")
            module.__dict__.update(value)
            monkeypatch.setitem(sys.modules, module.__name__, module)
        monkeypatch.setitem(sys.modules, "odd_package", ModuleType("odd_package"))
        installed("odd_package.spec:ODD")

    return package


def test_known_name_gives_its_description():
    assert registry.driver_spec("pupil_core") is PUPIL_CORE


def test_every_driver_is_described_in_full():
    for spec in registry.driver_specs():
        is_real = registry.driver_wiring(spec.name).real is not None
        assert spec.product.vendor or spec.wire.runtime or spec.wire.library, spec.name
        assert spec.product.model, spec.name
        assert bool(spec.claims.checked) == bool(spec.claims.unproven) == is_real, spec.name
        assert spec.options.__doc__, spec.name


def test_looking_drivers_up_imports_none():
    done = subprocess.run(
        [sys.executable, "-c", LISTED], capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout.split() == []


def test_unknown_driver_names_the_nearest():
    with pytest.raises(ConfigError, match="did you mean 'pupil_core'"):
        registry.driver_spec("pupil-core")


@pytest.mark.parametrize(
    ("spec", "cure"),
    [
        (odd(), r"run: pip install no_such_library_here"),
        (odd(library=Library("n", "n", "pip install 'odd[n]'")), r"run: pip install 'odd\[n\]'"),
    ],
)
def test_missing_library_says_what_to_install(packaged, spec, cure):
    packaged(spec, (Wiring(spec, missing, real=no_wire),))
    config = DeviceConfig(role="responses", driver="odd", simulated=False, options={})

    with ExitStack() as stack, pytest.raises(DeviceNotFound, match=cure):
        build_device(config, SimClock(), None, 1, stack)


def test_driver_without_a_simulator_says_so(packaged):
    spec = odd()
    packaged(spec, (Wiring(spec, missing, real=no_wire),))
    config = DeviceConfig(role="responses", driver="odd", simulated=True, options={})

    with ExitStack() as stack, pytest.raises(ConfigError, match="has no simulator"):
        build_device(config, SimClock(), object(), 1, stack)


@pytest.mark.parametrize(
    ("value", "says"),
    [
        ("visavis.devices.pump:Nothing", "cannot be imported"),
        ("no_such_package:SPEC", "cannot be imported"),
        ("visavis.devices.pump:Pump", "not a DriverSpec"),
        ("visavis.devices.drivers.pupil.spec:PUPIL_CORE", "of that name"),
    ],
)
def test_entry_that_leads_to_no_description_is_a_configuration_error(installed, value, says):
    installed(value)

    with pytest.raises(ConfigError, match=says):
        registry.driver_spec("odd")


def test_description_without_a_wiring_names_the_module_that_lacks_it(packaged):
    packaged(odd(), ())

    with pytest.raises(ConfigError, match=r"odd_package\.wiring\.WIRINGS has no Wiring of it"):
        registry.driver_wiring("odd")


def test_package_without_a_module_wiring_is_told_which_to_add(packaged, monkeypatch):
    packaged(odd(), ())
    monkeypatch.delitem(sys.modules, "odd_package.wiring")
    monkeypatch.setattr(sys.modules["odd_package"], "__path__", [], raising=False)

    with pytest.raises(ConfigError, match=r"no module odd_package\.wiring"):
        registry.driver_wiring("odd")


@pytest.mark.parametrize("name", registry.built_in())
def test_every_description_has_its_wiring_beside_it(name):
    assert registry.driver_wiring(name).spec is registry.built_in()[name]
