"""What the installed packages import is installed with them."""

import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
PACKAGES = [p.rstrip("*") for p in PROJECT["tool"]["setuptools"]["packages"]["find"]["include"]]
TESTING = ROOT / "devices" / "testing"
"""The other ends of wires, for the tests of drivers."""
OWN = {p.name for p in ROOT.iterdir() if (p / "__init__.py").exists()}


def modules(file: Path) -> Iterator[str]:
    """Yield the first part of the name of every module that a file imports, wherever in it."""
    for node in ast.walk(ast.parse(file.read_bytes())):
        if isinstance(node, ast.Import):
            yield from (name.name.partition(".")[0] for name in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield (node.module or "").partition(".")[0]


def declared(*, for_developers: bool) -> set[str]:
    """Return the names of all libraries that Visavis or an extra asks for."""
    extras = PROJECT["project"]["optional-dependencies"]
    asked = [a for name, some in extras.items() if for_developers or name != "dev" for a in some]
    wanted = [*PROJECT["project"]["dependencies"], *asked]
    return {plain(re.split(r"[\[<>=;~! ]", text)[0]) for text in wanted}


def plain(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def test_installed_packages_import_each_other_and_declared_libraries_alone() -> None:
    provided = metadata.packages_distributions()
    undeclared = set()
    for package in PACKAGES:
        files = list((ROOT / package).rglob("*.py"))
        assert files
        for file in files:
            wanted = declared(for_developers=TESTING in file.parents)
            for name in set(modules(file)) - set(PACKAGES) - set(sys.stdlib_module_names):
                of = {plain(d) for d in provided.get(name, ())}
                if name in OWN or (of and not of & wanted):
                    undeclared.add(f"{file.relative_to(ROOT)}: {name}")
    assert set() == undeclared
