"""The package equals the reference results, file by file, and the runner notices when not."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.reference.stats_map import main, run_file

FOLDER = Path(__file__).parents[2] / "reference" / "stats"
FILES = sorted(FOLDER.glob("*.json"))


def test_reference_files_are_there() -> None:
    assert 73 == len(FILES)


@pytest.mark.parametrize("path", FILES, ids=[p.stem for p in FILES])
def test_every_entry_equals_its_reference(path: Path) -> None:
    outcome = run_file(path)
    assert outcome.compared > 0
    assert [] == [str(f) for f in outcome.failures]


def test_runner_reports_a_wrong_value_and_an_unknown_entry(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = json.loads((FOLDER / "shapiro_a.json").read_text(encoding="utf-8"))
    file["results"][0]["expected"]["W"] += 1e-3
    file["results"][1]["procedure"] = "unheard_of"
    file["results"][2]["expected"]["extra"] = 1.0
    changed = tmp_path / "changed.json"
    changed.write_text(json.dumps(file), encoding="utf-8")
    assert 1 == main([str(changed)])
    lines = capsys.readouterr().out.splitlines()
    assert 3 == sum(line.startswith("FAIL ") for line in lines)
    assert "3 failed" in lines[-1]


def test_runner_is_a_command() -> None:
    command = [sys.executable, "-m", "tests.reference.stats_map", str(FOLDER / "power_a.json")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert 0 == done.returncode, done.stderr
    assert "0 failed" in done.stdout


@pytest.mark.parametrize("name", ["art_mixed_three_a", "rm_twoway_a", "art_missing_a"])
def test_runner_depends_on_no_name(name: str, tmp_path: Path) -> None:
    text = (FOLDER / f"{name}.json").read_text(encoding="utf-8")
    file = json.loads(text)
    words = [*file["design"]["within"], *file["design"]["between"], "Subject", "Y"]
    words += [level for levels in file["data"]["levels"].values() for level in levels]
    for i, word in enumerate(sorted(words, key=len, reverse=True)):
        text = re.sub(rf"(?<![A-Za-z0-9_]){re.escape(word)}(?![A-Za-z0-9_])", f"q{99 - i}x", text)
    renamed = json.loads(text)
    for entry in renamed["results"]:  # strata keep the files' word for the subject
        if "stratum" in entry["expected"]:
            strata = entry["expected"]["stratum"]
            subject = renamed["design"]["subject"]
            entry["expected"]["stratum"] = [s.replace(subject, "Subject", 1) for s in strata]
    path = tmp_path / "anything.json"
    path.write_text(json.dumps(renamed), encoding="utf-8")
    outcome = run_file(path)
    assert outcome.compared > 100
    assert [] == [str(f) for f in outcome.failures]
