"""The versions of the software that recorded a session."""

import platform
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from pathlib import Path

from visavis.lab.version import version

PACKAGES = ("numpy", "scipy", "pandas", "pyarrow", "numba", "pyzmq", "msgpack", "visavis")


@dataclass(frozen=True)
class Provenance:
    """Versions of interpreter and packages; `code_revision` is empty outside a checkout.

    A revision ends in "+changes" when tracked files differ from it.
    """

    python: str
    packages: Mapping[str, str]
    code_revision: str


def _package_version(name: str) -> str:
    if name == "visavis":
        return version()
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "not installed"


def _git(*arguments: str) -> str | None:
    root = Path(__file__).resolve().parents[3]
    if not (root / ".git").exists():
        return None
    try:
        process = subprocess.run(  # noqa: S603 - fixed arguments
            ["git", "-C", str(root), *arguments],  # noqa: S607 - git is where the user put it
            capture_output=True,
            text=True,
            timeout=10,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return process.stdout.strip() if process.returncode == 0 else None


@cache
def provenance() -> Provenance:
    """Return the versions in this process."""
    revision = _git("rev-parse", "HEAD") or ""
    if revision and _git("status", "--porcelain", "--untracked-files=no"):
        revision += "+changes"
    return Provenance(
        python=platform.python_version(),
        packages={name: _package_version(name) for name in PACKAGES},
        code_revision=revision,
    )
