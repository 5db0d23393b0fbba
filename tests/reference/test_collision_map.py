"""Known answers of collisions and cells; all three files also run as a command."""

import json
from pathlib import Path
from typing import Any

import pytest

from tests.reference.collision_map import main, run_file
from tests.reference.stats_compare import Outcome

FOLDER = Path(__file__).parent / "collision"


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


BOXES: dict[str, Any] = {
    "a": [{"type": "box", "c": [0, 0, 0], "half": [0.1, 0.1, 0.1]}],
    "b": [{"type": "box", "c": [0.1, 0, 0], "half": [0.1, 0.1, 0.1], "colour": "red"}],
    "volume": 0.004,
}


def run(folder: Path, content: object) -> tuple[int, Outcome]:
    path = folder / "own.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return main([str(path)]), run_file(path)


def test_case_with_the_exact_volume_alone_is_compared(tmp_path: Path) -> None:
    status, outcome = run(tmp_path, {"cases": [BOXES]})
    assert (0, 3) == (status, outcome.compared)
    status, outcome = run(tmp_path, {"cases": [{**BOXES, "volume": 0.00401}]})
    assert (1, 2) == (status, len(outcome.failures))


def test_file_of_dice_alone_is_compared(tmp_path: Path) -> None:
    one, other = [[0, 1, 2], [1, 2, 3]], [[1, 2, 3], [2, 3, 4]]
    assert 0 == run(tmp_path, {"dice": [{"a": [one], "b": [other], "dice": 0.5}]})[0]
    assert 1 == run(tmp_path, {"dice": [{"a": [one], "b": [other], "dice": 0.6}]})[0]


def test_fields_that_are_not_compared_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert 0 == run(tmp_path, {"cases": [{**BOXES, "id": "x", "depth": 0.1}]})[0]
    assert "nothing is compared with field 'depth'" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"cases": []}, "none in it"),
        ({"version": 1}, "none in it"),
        ([], "AttributeError"),
        ('{"cases": [', "JSONDecodeError"),
        ({"cases": [3]}, "known kind"),
        ({"cases": [{"a": BOXES["a"], "volume": 0.1}]}, "KeyError: 'b'"),
        ({"cases": [{**BOXES, "a": [{"type": "torus"}]}]}, "unknown shape"),
    ],
)
def test_what_cannot_be_compared_fails_and_says_so(
    content: object, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status, outcome = run(tmp_path, content)
    assert (1, 1) == (status, len(outcome.failures))
    assert said in capsys.readouterr().out


def test_file_that_is_not_there_fails(tmp_path: Path) -> None:
    assert 1 == main([str(tmp_path / "gone.json")])


SHIFTS = {"here": 0.0, "a kilometre away": 1000.0}


@pytest.mark.parametrize("away_m", SHIFTS.values(), ids=SHIFTS)
def test_new_pairs_with_known_answers_are_reached(away_m: float, tmp_path: Path) -> None:
    def block(x: float, half: float, *, hole: bool = False) -> dict[str, Any]:
        at = {"type": "box", "c": [x + away_m, away_m, -away_m], "half": [half] * 3}
        return {**at, "inverted": True} if hole else at

    hollow = [block(0, 0.5), block(0, 0.4, hole=True)]
    pairs: list[tuple[list[dict[str, Any]], list[dict[str, Any]], float]] = [
        (hollow, [block(0, 0.3)], 0.0),
        (hollow, [block(0, 0.45)], 0.9**3 - 0.8**3),
        ([*hollow, block(0, 0.2)], [block(0, 0.3)], 0.4**3),
        ([block(0, 0.5), block(0, 0.5), block(0.1, 0.5)], [block(0, 1)], 1.1),
        ([block(0, 0.5), block(0, 0.5), block(0, 0.2, hole=True)], [block(0, 1)], 1.0),
        ([block(0, 0.1)], [block(0.2, 0.1)], 0.0),
        ([block(0, 1e-3)], [block(1e-3, 1e-3)], 4e-9),
        ([block(0, 0.1)] * 3, [block(0, 0.1)] * 2, 8e-3),
    ]
    cases = [{"id": k, "a": a, "b": b, "volume": v} for k, (a, b, v) in enumerate(pairs)]
    status, outcome = run(tmp_path, {"cases": cases})
    assert () == outcome.failures
    assert 0 == status


def test_a_case_of_cells_without_shoulders_is_compared_and_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = json.loads((FOLDER / "cells.json").read_text(encoding="utf-8"))["cases"][0]
    whole = run(tmp_path, {"cases": [case]})[1].compared
    bare = {k: v for k, v in case.items() if k not in ("shoulder_axis", "alpha_sa_deg")}
    status, outcome = run(tmp_path, {"cases": [bare]})
    assert (0, whole - 1) == (status, outcome.compared)
    assert "own kite_straight: no angles to the shoulders compared" in capsys.readouterr().out
