"""The version of Visavis."""

import tomllib
from importlib import metadata
from pathlib import Path

UNKNOWN = "unknown"


def version() -> str:
    """Return the installed version, or the one in pyproject.toml for a source tree that is not
    installed.
    """
    try:
        return metadata.version("visavis")
    except metadata.PackageNotFoundError:
        return _of_source_tree(Path(__file__).resolve().parents[3])


def _of_source_tree(folder: Path) -> str:
    try:
        project = tomllib.loads((folder / "pyproject.toml").read_text("utf-8"))["project"]
    except (OSError, KeyError, tomllib.TOMLDecodeError):
        return UNKNOWN
    return f"{project['version']} (not installed)" if project.get("name") == "visavis" else UNKNOWN
