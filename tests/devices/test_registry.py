"""Drivers are found by name, and what is missing is named with its cure."""

import pytest

from devices import registry
from devices.drivers.pupil.driver import PupilCore
from lab.errors import ConfigError, DeviceNotFound


def test_every_built_in_driver_can_be_loaded():
    for name in registry.BUILT_IN:
        assert callable(registry.load(name))


def test_known_name_gives_its_class():
    assert registry.load("pupil_core") is PupilCore


def test_unknown_driver_names_the_nearest():
    with pytest.raises(ConfigError, match="did you mean 'pupil_core'"):
        registry.load("pupil-core")


def test_missing_library_says_what_to_install(monkeypatch, tmp_path):
    (tmp_path / "driver_without_library.py").write_text("import no_such_library_here\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(registry.BUILT_IN, "odd", "driver_without_library:Odd")
    monkeypatch.setitem(registry.EXTRA_OF_LIBRARY, "no_such_library_here", "visavis[odd]")

    with pytest.raises(DeviceNotFound, match=r"run: pip install visavis\[odd\]"):
        registry.load("odd")


def test_entry_that_names_no_class_is_a_configuration_error(monkeypatch):
    monkeypatch.setitem(registry.BUILT_IN, "odd", "devices.pump:Nothing")

    with pytest.raises(ConfigError, match="has no 'Nothing'"):
        registry.load("odd")
