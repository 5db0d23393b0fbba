"""Devices that say when they are due deliver what they would when polled at every frame."""

from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
import pytest

import visavis.devices.pump
from tests.experiments.crowd.sessions import session


@runtime_checkable
class Nobody(Protocol):
    def a_method_no_device_has(self) -> None: ...


def test_recording_is_the_same_however_often_devices_are_polled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    foreseen = session(tmp_path / "foreseen", limit_s=12.0)
    monkeypatch.setattr(visavis.devices.pump, "Foreseeing", Nobody)
    polled = session(tmp_path / "polled", limit_s=12.0)
    trials = foreseen.trials().set_index("condition")
    assert trials.loc["Haptic", "contacts_online"] > 5
    assert foreseen.stream_names == polled.stream_names
    for name in foreseen.stream_names:
        one, other = foreseen.stream_arrays(name), polled.stream_arrays(name)
        assert {k: v.shape for k, v in one.items()} == {k: v.shape for k, v in other.items()}
        for column in one:
            assert np.array_equal(
                one[column], other[column], equal_nan=one[column].dtype.kind == "f"
            ), (name, column)
