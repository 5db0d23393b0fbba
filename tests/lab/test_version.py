"""The version as installed, and of a tree that never was."""

from importlib import metadata
from pathlib import Path

import pytest

from visavis.lab import version as module


def _absent(name: str) -> str:
    raise metadata.PackageNotFoundError(name)


def test_the_version_is_the_installed_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(metadata, "version", {"visavis": "3.1"}.__getitem__)
    assert "3.1" == module.version()


def test_a_tree_never_installed_says_what_its_project_file_says(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(metadata, "version", _absent)
    monkeypatch.setattr(module, "__file__", str(tmp_path / "src/visavis/lab/version.py"))
    assert "unknown" == module.version()
    (tmp_path / "pyproject.toml").write_text('[project]\nname = "another"\nversion = "9"\n')
    assert "unknown" == module.version()
    (tmp_path / "pyproject.toml").write_text('[project]\nname = "visavis"\nversion = "0.9"\n')
    assert "0.9 (not installed)" == module.version()
