import importlib
import pkgutil
import sys
import tomllib
from pathlib import Path

import pytest

import benchmarks
from tests.product_files import ROOMS_AT_THE_TOP, ROOT

MODULES = sorted(
    f"{module.name}.__main__" if module.ispkg else module.name
    for module in pkgutil.iter_modules(benchmarks.__path__)
)


@pytest.mark.parametrize("name", MODULES)
def test_a_benchmark_imports_and_says_what_it_takes(name, monkeypatch, capsys):
    module = importlib.import_module(f"benchmarks.{name}")
    source = Path(module.__file__).read_text(encoding="utf-8")
    if "__main__" not in source and not name.endswith("__main__"):
        return  # a piece that benchmarks share
    monkeypatch.setattr(sys, "argv", [name, "--help"])
    for measuring in ("measure", "rows", "rows_of"):
        if hasattr(module, measuring):  # whoever asks what it takes does not wait for figures
            monkeypatch.setattr(module, measuring, lambda *_, **__: pytest.fail("it measured"))
    assert "argparse" in source  # without, --help would begin to measure
    with pytest.raises(SystemExit) as ended:
        module.main(*([["--help"]] if module.main.__code__.co_argcount else []))
    assert ended.value.code == 0
    assert "usage:" in capsys.readouterr().out


def test_types_are_checked_wherever_code_of_ours_lies():
    """A benchmark that calls what has changed is found by mypy, before somebody needs it."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    packages = settings["tool"]["mypy"]["packages"]
    beside = {path.parent.name for path in ROOT.glob("*/__init__.py")} - {
        "tests",
        "character_making",  # checked by the command in its README
        *ROOMS_AT_THE_TOP,
    }
    assert {"visavis", *beside} == set(packages)
