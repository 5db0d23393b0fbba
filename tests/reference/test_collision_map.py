"""Known answers of collisions and cells; all three files also run as a command."""

import json
from pathlib import Path

import pytest

from tests.reference.collision_map import main, run_file

FOLDER = Path(__file__).parent / "collision"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cells", "volumes", "series"])
def test_every_known_answer_is_reached(name: str) -> None:
    outcome = run_file(FOLDER / f"{name}.json")
    assert () == outcome.failures
    assert outcome.compared > 100


def test_wrong_answer_and_unknown_case_fail(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = json.loads((FOLDER / "cells.json").read_text(encoding="utf-8"))
    case = file["cases"][0]
    case["crossings"][0]["s"] += 1e-6
    changed = tmp_path / "changed.json"
    changed.write_text(json.dumps({"cases": [case, {"id": "odd", "thing": 1}]}), encoding="utf-8")
    assert main([str(changed)]) == 1
    printed = capsys.readouterr().out
    assert "crossings[0].s" in printed
    assert "odd" in printed
    assert printed.strip().endswith("2 failed")
