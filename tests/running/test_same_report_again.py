"""A report prints the command that made its sessions only where that makes the same ones."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from tests.sessions import opened
from visavis.lab.clock import SIMULATED_EPOCH_ISO
from visavis.recording.folder import study_dir
from visavis.recording.manifest import Manifest
from visavis.running.sessions.studies import _from_root, _origin
from visavis.running.sessions.study_folder import settle, wanted_settings

VIRTUAL, LIVED = (SIMULATED_EPOCH_ISO, 1), ("2026-03-02T10:00:00+01:00", 1)
RESUMED = (SIMULATED_EPOCH_ISO, 2)


def manifest(began_iso: str, parts: int) -> Manifest:
    told: Any = SimpleNamespace(
        is_simulated=True, created_wall_iso=began_iso, parts=tuple(range(parts))
    )
    return cast(Manifest, told)


@pytest.mark.parametrize(
    ("sessions", "is_told"),
    [((VIRTUAL,), True), ((VIRTUAL, LIVED), False), ((VIRTUAL, RESUMED), False)],
)
def test_sessions_in_real_time_or_resumed_come_of_no_simulate_command(
    sessions: tuple[tuple[str, int], ...], is_told: bool, tmp_path: Path
) -> None:
    study = opened("duel")
    folder = study_dir(tmp_path, study.name, is_simulated=True)
    settle(folder, wanted_settings(folder, study, is_simulated=True), seed_given=False)
    commands = _origin(folder, [manifest(*one) for one in sessions])
    assert is_told == any(line.startswith("visavis simulate duel") for line in commands)


def test_commands_name_the_folder_as_it_is_typed_where_the_labs_file_lies(tmp_path: Path) -> None:
    study = opened("duel")
    root = tmp_path / "data" / "dry_runs" / "duel_n12_seed1"
    folder = study_dir(root, study.name, is_simulated=True)
    settle(folder, wanted_settings(folder, study, is_simulated=True), seed_given=False)

    elsewhere = _origin(folder, [manifest(*VIRTUAL)])[0]
    assert elsewhere.endswith("--output duel_n12_seed1")
    (tmp_path / "lab_config.yaml").write_text("lab: Example\n", "utf-8")
    assert "data/dry_runs/duel_n12_seed1/simulated/duel" == _from_root(folder)
    here = _origin(folder, [manifest(*VIRTUAL)])[0]
    assert here.endswith("--output data/dry_runs/duel_n12_seed1")
