"""Data of a study that are looked for by its name."""

import shutil
from pathlib import Path

import pytest

from visavis.cli.studies import folder_of
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import UsageError


def test_data_of_a_simulated_study_are_named_where_only_those_lie(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = tmp_path / "lab_config.yaml"
    shutil.copy(EXAMPLE, config)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UsageError, match="the whole study: visavis simulate stare"):
        folder_of(Path("stare"), config)
    simulated = tmp_path / "data" / "dry_runs" / "stare_n3_seed1" / "simulated" / "stare"
    simulated.mkdir(parents=True)
    with pytest.raises(UsageError) as refused:
        folder_of(Path("stare"), config)
    assert str(simulated) in str(refused.value)
