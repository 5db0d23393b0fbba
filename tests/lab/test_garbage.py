"""How often Python looks for garbage."""

import gc
import sys
from pathlib import Path

import pytest

from visavis.lab.garbage import import_to_stay


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Name a module that says whether Python looks for garbage while it is imported."""
    monkeypatch.syspath_prepend(tmp_path)
    name = "module_that_stays"
    (tmp_path / f"{name}.py").write_text("import gc\nLOOKS = gc.isenabled()\nOBJECTS = [[]]\n")
    monkeypatch.delitem(sys.modules, name, raising=False)
    return name


def test_python_looks_for_no_garbage_while_a_module_that_stays_is_imported(module: str) -> None:
    assert not import_to_stay(module).LOOKS
    assert gc.isenabled()


def test_later_looks_for_garbage_pass_over_a_module_that_stays(module: str) -> None:
    objects = import_to_stay(module).OBJECTS
    assert not any(objects is thing for thing in gc.get_objects())


def test_python_looks_for_garbage_again_after_a_module_that_ends_in_an_error(
    module: str, tmp_path: Path
) -> None:
    (tmp_path / f"{module}.py").write_text("raise ValueError\n")
    with pytest.raises(ValueError):
        import_to_stay(module)
    assert gc.isenabled()


def test_garbage_that_is_there_when_a_module_is_asked_for_again_is_found(module: str) -> None:
    import_to_stay(module)
    objects: list[object] = []
    objects.append(objects)
    import_to_stay(module)
    assert any(objects is thing for thing in gc.get_objects())
