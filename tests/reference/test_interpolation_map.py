"""The runner passes the stored vectors and notices every kind of miss."""

import json
from pathlib import Path

import pytest

from tests.reference.interpolation_map import main, run_file

FOLDER = Path(__file__).parent / "interpolation"
FILES = sorted(FOLDER.glob("*.json"))


def test_all_stored_vectors_pass(capsys: pytest.CaptureFixture[str]) -> None:
    assert 0 == main([str(f) for f in FILES])
    assert "730 values compared in 5 files, 0 failed" == capsys.readouterr().out.strip()


@pytest.mark.parametrize("kind", ["slerp", "lineuler", "mirror", "spring", "squad"])
def test_a_value_off_by_a_millionth_fails(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = json.loads((FOLDER / f"{kind}.json").read_text())
    case = file["cases"][0]
    values = case.get("expected") or case.get("t_x_v") or case["samples"][1]["expected"]
    inner = values if isinstance(values[0], float) else values[1]
    inner[1] += 1e-6
    changed = tmp_path / "changed.json"
    changed.write_text(json.dumps(file))

    assert 1 == main([str(changed)])
    assert 1 == capsys.readouterr().out.count("FAIL")


@pytest.mark.parametrize("where", ["case", "sample", "kind", "cases"])
def test_what_the_runner_does_not_know_fails(where: str, tmp_path: Path) -> None:
    file = json.loads((FOLDER / "squad.json").read_text())
    if where == "case":
        file["cases"][0]["tangents"] = []
    elif where == "sample":
        file["cases"][0]["samples"][0]["speed"] = 0.0
    elif where == "kind":
        file["meta"]["kind"] = "hermite"
    else:
        file["cases"] = []
    changed = tmp_path / "changed.json"
    changed.write_text(json.dumps(file))

    assert 1 == sum(not check.passed for check in run_file(changed))


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"meta": {"kind": "slerp"}}', "\x00"])
def test_file_that_holds_no_cases_fails_in_a_line(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = tmp_path / "broken.json"
    broken.write_text(text)

    assert 1 == main([str(broken), str(tmp_path / "missing.json")])
    assert 2 == capsys.readouterr().out.count("a file of cases")


@pytest.mark.parametrize(
    "case", [3, {}, {"name": "x", "p": 1, "q": "a", "h": [0], "expected": [[0]]}]
)
def test_malformed_case_fails_in_its_own_line(case: object, tmp_path: Path) -> None:
    file = json.loads((FOLDER / "slerp.json").read_text())
    passing = len(run_file(FOLDER / "slerp.json"))
    file["cases"].append(case)
    changed = tmp_path / "changed.json"
    changed.write_text(json.dumps(file))

    assert passing == sum(check.passed for check in run_file(changed))
    assert 1 == sum(not check.passed for check in run_file(changed))
