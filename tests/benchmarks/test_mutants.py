"""Mutants are one small change each, drawn again the same, and run where a test may notice."""

import ast
from pathlib import Path

import pytest

from benchmarks.import_graph import SourceFile, read_package
from benchmarks.mutants import (
    FILES_RUN,
    Change,
    Copy,
    Mutant,
    Outcome,
    changed,
    changes_in,
    draw,
    importers_in,
    nearest_tests,
    table,
)
from tests.product_files import PACKAGE


@pytest.mark.parametrize(
    ("line", "mutants"),
    [
        ("return a < b", ["return (a <= b)"]),
        ("return a is not b", ["return (a is b)"]),
        ("return a + b * c", ["return ((a) - (b * c))", "return a + ((b) / (c))"]),
        ("return (a + b) * c", ["return ((a + b) / (c))", "return (((a) - (b))) * c"]),
        ("return a and b or c", ["return ((a and b) and (c))", "return ((a) or (b)) or c"]),
        ("return not a", ["return (a)"]),
        ("return [2, True, 0.5]", ["return [3, True, 0.5]"]),
        ("return a if b else c", ["return (a)"]),
        ("return 'é' if a == b else 'ü'", ["return ('é')", "return 'é' if (a != b) else 'ü'"]),
        ("raise ValueError(1 + a)", []),
        ("return f'{a + 1}'", []),
    ],
)
def test_a_mutant_changes_one_place(line: str, mutants: list[str]) -> None:
    text = f"def f(a, b, c):\n    {line}\n"
    made = [changed(text, change) for change in changes_in(text)]
    for one in made:
        ast.parse(one)
    assert sorted(f"def f(a, b, c):\n    {one}\n" for one in mutants) == sorted(made)


def module(name: str, text: str) -> SourceFile:
    path = PACKAGE / "lab" / "clock.py"  # of which the place alone is read
    return SourceFile(name, path, text, ast.parse(text))


def test_fewer_mutants_are_the_first_of_more_and_no_two_stand_in_one_module() -> None:
    texts = {f"visavis.lab.m{i}": f"def f(a):\n    return a + {i}\n" * 3 for i in range(9)}
    modules = {name: module(name, text) for name, text in texts.items()}
    modules["visavis.lab.report_words"] = module(
        "visavis.lab.report_words", texts["visavis.lab.m1"]
    )
    modules["visavis.lab.plain"] = module("visavis.lab.plain", "A = 1\n")
    many = draw(modules, 9, 7)
    assert set(texts) == {mutant.module for mutant in many}
    assert many[:4] == draw(modules, 4, 7)
    assert many != draw(modules, 9, 8)


def test_the_nearest_tests_are_those_that_import_a_module_then_those_that_share_its_words(
    tmp_path: Path,
) -> None:
    files = {
        "visavis/__init__.py": "",
        "visavis/gaze.py": "",
        "visavis/looks.py": "from visavis.gaze import a",
        "tests/__init__.py": "",
        "tests/made.py": "from visavis.gaze import a",
        "tests/test_far.py": "from visavis.looks import b",
        "tests/test_gaze.py": "from visavis.gaze import a",
        "tests/test_any.py": "import visavis.gaze",
        "tests/test_other.py": "import json",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text, "utf-8")
    modules = {**read_package(tmp_path / "visavis"), **read_package(tmp_path / "tests")}
    nearest = nearest_tests("visavis.gaze", importers_in(modules))
    assert ["tests/test_gaze.py", "tests/test_any.py", "tests/test_far.py"] == nearest


def test_a_module_that_nobody_imports_is_tried_by_tests_that_share_its_words() -> None:
    importers = {
        "visavis.lab.clock": {"tests.lab.test_clock", "tests.devices.bands.test_wiring"},
        "visavis.devices.own": {"tests.devices.test_own", "tests.devices.wires"},
    }
    nearest = nearest_tests("visavis.devices.bands.wiring", importers)
    assert ["tests/devices/bands/test_wiring.py", "tests/devices/test_own.py"] == nearest


def test_a_test_that_fails_without_a_mutant_kills_none() -> None:
    outcomes = [
        Outcome("visavis.lab.a:1 a < b => (a <= b)", "first", "t.py::test_1", ("t.py",), 1.0),
        Outcome("visavis.stage.b:1 0 => 1", "second", "t.py::test_2", ("t.py",), 1.0),
        Outcome("visavis.stage.c:1 1 => 2", "", "", ("t.py",), 1.0),
    ]
    assert "| stage | 2 | 0 | 1 | 1 |" in table(outcomes, set())
    made = table(outcomes, {"t.py::test_1"})
    assert "| lab | 1 | 0 | 0 | 1 |" in made
    assert "| all | 3 | 0 | 1 | 2 |" in made
    assert "- `visavis.lab.a:1 a < b => (a <= b)`" in made


@pytest.mark.parametrize(
    ("tier", "where", "kills"),
    [("first", "near", {0}), ("second", "near", {1}), ("first", "far", {2}), ("", "far", {9})],
)
def test_files_farther_off_are_run_where_the_nearest_notice_nothing(
    tmp_path: Path, tier: str, where: str, kills: set[int]
) -> None:
    near, far = [f"tests/near_{i}.py" for i in range(FILES_RUN)], ["tests/far.py"]
    (tmp_path / "product.py").write_text("def f(a):\n    return a + 1\n", "utf-8")
    copy, runs = object.__new__(Copy), []

    def run(words: list[str]) -> str:
        runs.append(words[3:])
        return "a test" if len(runs) - 1 in kills else ""

    copy.root, copy.run = tmp_path, run  # type: ignore[method-assign]
    mutant = Mutant("product", "product.py", Change(2, 11, 16, "a + 1", "a - 1"))
    outcome = copy.with_mutant(mutant, [*near, *far])
    assert tier == outcome.tier
    assert (near if where == "near" else far) == runs[-1]
    assert "def f(a):\n    return a + 1\n" == (tmp_path / "product.py").read_text("utf-8")
