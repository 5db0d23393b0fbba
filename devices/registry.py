"""Find drivers by the name written in `lab_config.yaml`; none is imported until it is built.

Drivers of Visavis are described in the module `spec` of their folder, as `SPECS`; installed
packages name theirs under the entry-point group `visavis.drivers` (`name = "package.spec:SPEC"`).
The module `wiring` next to a `spec` imports drivers and simulators and holds `WIRINGS`.
"""

import difflib
import importlib
import importlib.util
import pkgutil
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import TYPE_CHECKING

from pydantic import BaseModel

from visavis.devices.spec import AnySpec, DriverSpec
from visavis.lab.errors import ConfigError

if TYPE_CHECKING:
    from visavis.devices.wiring import AnyWiring

ENTRY_POINT_GROUP = "visavis.drivers"
FOLDERS = ("visavis.devices.drivers", "visavis.devices.sim")


@cache
def built_in() -> Mapping[str, AnySpec]:
    """Return the drivers that ship with Visavis, by name."""
    return {name: spec for name, (spec, _) in _specs_and_modules().items()}


def driver_names() -> tuple[str, ...]:
    """Return every driver name known here, sorted."""
    return tuple(sorted({*built_in(), *_others()}))


def driver_spec(name: str) -> AnySpec:
    """Return the description of a driver.

    Raises ConfigError for an unknown name, with the nearest one, and for an installed package
    whose entry point leads to no `DriverSpec`.
    """
    if name in built_in():
        return built_in()[name]
    others = _others()
    if name not in others:
        names = driver_names()
        near = difflib.get_close_matches(name, names, n=1, cutoff=0.4)
        hint = f"did you mean {near[0]!r}? " if near else ""
        raise ConfigError(f"unknown driver {name!r}; {hint}Known: {', '.join(names)}")
    return _loaded(others[name])


def driver_wiring(name: str) -> "AnyWiring":
    """Return how a driver is put together; driver and simulator are imported only now.

    Raises ConfigError as `driver_spec` and where the module `wiring` is not there or lacks this
    driver, ImportError where that module imports a library which is not installed.
    """
    spec = driver_spec(name)
    spec_module = _specs_and_modules()[name][1] if name in built_in() else _others()[name].module
    module = f"{spec_module.rpartition('.')[0]}.wiring".removeprefix(".")
    try:
        wirings: tuple[AnyWiring, ...] = importlib.import_module(module).WIRINGS
    except ModuleNotFoundError as cause:
        if cause.name != module:
            raise
        raise ConfigError(
            f"driver {name!r} is described in {spec_module}, but there is no module {module} that "
            "puts it together; docs/add-a-device.md shows one"
        ) from cause
    for wiring in wirings:
        if wiring.spec is spec:
            return wiring
    raise ConfigError(
        f"driver {name!r} is described in {spec_module}, but {module}.WIRINGS has no Wiring of it; "
        "add one: docs/add-a-device.md shows how"
    )


def driver_specs() -> tuple[AnySpec, ...]:
    """Return every driver known here, by name; raises as `driver_spec`."""
    return tuple(driver_spec(name) for name in driver_names())


class _OptionModels(Mapping[str, type[BaseModel]]):
    """Options by driver name; a package's description is loaded when a role asks for it."""

    def __getitem__(self, name: str) -> type[BaseModel]:
        if name not in self:
            raise KeyError(name)
        options: type[BaseModel] = driver_spec(name).options
        return options

    def __iter__(self) -> Iterator[str]:
        return iter(driver_names())

    def __len__(self) -> int:
        return len(driver_names())

    def __contains__(self, name: object) -> bool:
        return name in built_in() or name in _others()


OPTION_MODELS: Mapping[str, type[BaseModel]] = _OptionModels()
"""The options of every driver known here, as `visavis.lab.config` checks them."""


@cache
def _specs_and_modules() -> Mapping[str, tuple[AnySpec, str]]:
    """Return the descriptions that ship with Visavis, by name, each with its module's name."""
    by_name: dict[str, tuple[AnySpec, str]] = {}
    for folder in FOLDERS:
        for part in pkgutil.iter_modules(importlib.import_module(folder).__path__):
            module = f"{folder}.{part.name}.spec"
            if part.ispkg and importlib.util.find_spec(module) is not None:
                specs: tuple[AnySpec, ...] = importlib.import_module(module).SPECS
                by_name |= {spec.name: (spec, module) for spec in specs}
    return by_name


@cache
def _others() -> Mapping[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=ENTRY_POINT_GROUP)}


@cache
def _loaded(point: EntryPoint) -> AnySpec:
    try:
        spec = point.load()
    except (ImportError, AttributeError, TypeError) as cause:  # TypeError: an older DriverSpec
        raise ConfigError(
            f"driver {point.name!r} names {point.value!r}, which cannot be imported: {cause}"
        ) from cause
    if not isinstance(spec, DriverSpec) or spec.name != point.name:
        raise ConfigError(
            f"driver {point.name!r} names {point.value!r}, which is not a DriverSpec of that name; "
            "docs/add-a-device.md shows one"
        )
    return spec
