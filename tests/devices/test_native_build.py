"""Simulated runtimes that have to be compiled, where there is no compiler."""

import re
from contextlib import ExitStack

import pytest

from tests.devices.body_rigs import WalkingBody
from tests.devices.every_driver import config_of
from visavis.devices.building import build_device
from visavis.devices.registry import built_in
from visavis.devices.sim import native_build
from visavis.lab.clock import SimClock
from visavis.lab.errors import DeviceNotFound

COMPILED = sorted(
    name for name, spec in built_in().items() if spec.wire.runtime in ("openvr", "openxr")
)
SYSTEMS = {"linux": "apt-get install gcc", "darwin": "xcode-select --install", "win32": None}


@pytest.fixture(params=SYSTEMS)
def system(request, monkeypatch):
    monkeypatch.setattr(native_build, "find_compiler", lambda: None)
    monkeypatch.setattr(native_build.sys, "platform", request.param)
    return request.param


def remedy():
    with pytest.raises(DeviceNotFound, match="needs a C compiler") as refused:
        native_build.build_library("vrclient/vrclient.c", {}, "vrclient.so")
    return refused.value.remedy


def test_without_a_compiler_each_system_is_told_how_to_get_one(system):
    told = [command for command in SYSTEMS.values() if command and command in remedy()]

    assert [SYSTEMS[system]] * (SYSTEMS[system] is not None) == told


def test_what_it_says_to_rehearse_with_is_built_without_a_compiler(system):
    named = [name for name in re.findall(r"\w+", remedy()) if name in built_in()]

    assert ["simulated_headset", "simulated_responses", "simulated_body", "pupil_core"] == named
    for name in named:
        with ExitStack() as stack:
            device = build_device(config_of(name), SimClock(), WalkingBody(), 1, stack)
            device.open(1.0)
            device.close()


@pytest.mark.parametrize("driver", COMPILED)
def test_without_a_compiler_every_simulated_runtime_names_the_driver_to_rehearse_with(
    driver, monkeypatch
):
    library = built_in()[driver].wire.library
    pytest.importorskip(library.module, reason=library.install)
    monkeypatch.setattr(native_build, "find_compiler", lambda: None)
    with ExitStack() as stack, pytest.raises(DeviceNotFound, match="simulated_headset"):
        build_device(config_of(driver), SimClock(), WalkingBody(), 1, stack).open(1.0)
