"""A session made with what its study no longer has is told by its folder and what to do."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from visavis.lab.errors import DataError
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study


def recorded_with(**parameters: Any) -> Recording:
    manifest = SimpleNamespace(plan={"parameters": parameters}, session=1)
    return cast(Recording, SimpleNamespace(path=Path("sub-S01/ses-001"), manifest=manifest))


def test_parameters_it_has_make_its_experiment() -> None:
    made = find_study("crowd").experiment_of(recorded_with(limit_s=90.0, configuration="[1, 2]"))
    assert (90.0, (1, 2)) == (made.parameters["limit_s"], tuple(made.levels["configuration"]))


def test_a_parameter_that_is_gone_names_session_and_way_out() -> None:
    with pytest.raises(DataError, match=r"ses-001.*no with_control_group.*manifest\.json"):
        find_study("crowd").experiment_of(recorded_with(with_control_group=False))
