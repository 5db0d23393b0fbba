"""The runner passes the stored values of synthesis and notices every kind of miss."""

import json
from pathlib import Path
from typing import Any

import pytest

from tests.reference.synthesis_map import main

FOLDER = Path(__file__).parent / "synthesis"
FILES = sorted(FOLDER.glob("*.json"))


@pytest.mark.parametrize("file", FILES, ids=lambda f: f.stem)
def test_all_stored_values_pass(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert 0 == main([str(file)])
    assert " 0 failed" in capsys.readouterr().out


def _changed(case: dict[str, Any]) -> None:
    if case["mode"] == "one_axis":
        case["samples"][1]["thesis_deg"] += 1e-6
    elif case["mode"] == "crouch":
        case["overshoot"] += 1e-8
    else:
        case["segments_by_increment"][2] += 1


@pytest.mark.parametrize("mode", ["one_axis", "crouch", "increments"])
def test_a_changed_value_of_a_hybrid_motion_fails(
    mode: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = json.loads((FOLDER / "hybrid.json").read_text())
    _changed(next(c for c in file["cases"] if c["mode"] == mode))
    changed = tmp_path / "changed.json"
    changed.write_text(json.dumps(file))

    assert 1 == main([str(changed)])
    assert 1 == capsys.readouterr().out.count("FAIL")


@pytest.mark.parametrize(
    ("kind", "path"),
    [
        ("gapfill", ("second_best_gap",)),
        ("gapfill", ("fill", 3, 1)),
        ("matching", ("sum_m",)),
        ("matching", ("samples",)),
        ("posture", ("ask", 1, "p_joint", 4)),
        ("posture", ("ask", 0, "rules_com", 0, 3)),
        ("weights", ("queries", 2, "weights", 0)),
    ],
)
def test_a_changed_value_fails(
    kind: str, path: tuple[Any, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = json.loads((FOLDER / f"{kind}.json").read_text())
    inner = file["cases"][0]
    for step in path[:-1]:
        inner = inner[step]
    inner[path[-1]] += 1 if isinstance(inner[path[-1]], int) else 1e-6
    changed = tmp_path / "changed.json"
    changed.write_text(json.dumps(file))

    assert 1 == main([str(changed)])
    assert 1 == capsys.readouterr().out.count("FAIL")


def test_mode_and_entry_without_a_meaning_fail(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = json.loads((FOLDER / "hybrid.json").read_text())
    file["cases"][0]["samples"][0]["speed"] = 1.0
    file["cases"].append({"name": "x", "mode": "jump", "tol": 1.0})
    changed = tmp_path / "changed.json"
    changed.write_text(json.dumps(file))

    assert 1 == main([str(changed)])
    lines = capsys.readouterr().out.splitlines()
    assert {"speed", "mode"} == {line.split(":")[0].rsplit(".", 1)[-1] for line in lines[:-1]}


CAMERA_ENTRIES = {
    "shot_distance": "distance_m",
    "cut": "flow_cosine",
    "critical_follow": "peak_speed_mps",
    "log_normal": "mean_s",
    "corridor": "axis_length_m",
    "topology": "area_m2",
    "visibility_2d": "share",
}


@pytest.mark.parametrize("mode", CAMERA_ENTRIES)
def test_a_changed_value_of_a_camera_fails_alone(
    mode: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = json.loads((FOLDER / "camera.json").read_text())
    case = next(c for c in file["cases"] if c["mode"] == mode)
    case[CAMERA_ENTRIES[mode]] += 0.05
    changed = tmp_path / "changed.json"
    changed.write_text(json.dumps({"meta": file["meta"], "cases": [case]}))

    assert 1 == main([str(changed)])
    (line,) = (x for x in capsys.readouterr().out.splitlines() if x.startswith("FAIL"))
    assert CAMERA_ENTRIES[mode] in line
