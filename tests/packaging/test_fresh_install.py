"""Benchmarks and tools run with what `pip install -e .[dev]` brings, whatever else is installed."""

import re
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
CHILD = """
import sys
from importlib.abc import MetaPathFinder

class Absent(MetaPathFinder):
    names = frozenset({absent!r})
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in self.names:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Absent())
import benchmarks.statistics as ours
ours.import_s = lambda name: bool(__import__(name)) + 0.0
sys.argv[1:] = ["--studies", "3"]
ours.main()
for module in {modules!r}:
    __import__(module)
"""
MODULES = [f"benchmarks.{p.stem}" for p in (ROOT / "benchmarks").glob("[!_]*.py")]


def plain(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def brought(*texts: str) -> set[str]:
    """Return the distributions that requirements bring with them, directly or by another."""
    names: set[str] = set()
    left = [(Requirement(text), "") for text in texts]
    while left:
        requirement, extra = left.pop()
        if requirement.marker and not requirement.marker.evaluate({"extra": extra}):
            continue
        name = plain(requirement.name)
        if name == plain(PROJECT["name"]):
            left += [(Requirement(t), "") for e in requirement.extras for t in EXTRAS[e]]
            continue
        if name in names and not requirement.extras:
            continue
        names.add(name)
        try:
            requirements = metadata.requires(name) or []
        except metadata.PackageNotFoundError:
            continue
        left += [(Requirement(t), e) for t in requirements for e in ("", *requirement.extras)]
    return names


def absent_without(present: set[str]) -> set[str]:
    """Return the modules that are installed here by no distribution of `present`."""
    return {
        module
        for module, of in metadata.packages_distributions().items()
        if not {plain(name) for name in of} & (present | {plain(PROJECT["name"])})
    }


def measured(absent: set[str]) -> subprocess.CompletedProcess[str]:
    """Run the benchmark where some modules are not installed."""
    return subprocess.run(
        [sys.executable, "-c", CHILD.format(absent=sorted(absent), modules=MODULES)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        encoding="utf-8",
    )


def test_statistics_are_measured_and_benchmarks_found_in_a_fresh_development_install() -> None:
    requirements = [*PROJECT["dependencies"], *EXTRAS["dev"]]
    done = measured(absent_without(brought(*requirements)))
    assert 0 == done.returncode, done.stderr
    assert "import of the package" in done.stdout


def test_what_is_not_brought_is_not_found() -> None:
    requirements = [
        t for t in PROJECT["dependencies"] if plain(Requirement(t).name) != "statsmodels"
    ]
    without = absent_without(brought(*requirements))
    assert "statsmodels" in without
    done = measured({"statsmodels"})
    assert 0 != done.returncode
    assert "No module named 'statsmodels" in done.stderr
