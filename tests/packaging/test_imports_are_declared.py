"""What the installed packages import is installed with them."""

import ast
import re
import sys
import tomllib
from collections.abc import Iterable, Iterator
from importlib import metadata
from pathlib import Path

from tests.product_files import ROOT, name_in_repository, product_files

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
NAMES_ITS_EXTRA = {
    "src/visavis/running/page/client.py": "aiohttp",
    "src/visavis/running/page/own_certificate.py": "cryptography",
    "src/visavis/running/page/behind_code.py": "aiohttp",
    "src/visavis/running/page/playground.py": "aiohttp",
    "src/visavis/running/page/server.py": "aiohttp",
    "src/visavis/cli/desk/server.py": "aiohttp",
}
"""Files that need a library of an extra; who imports them says first which one to install."""
BESIDE = {p.name for p in ROOT.iterdir() if (p / "__init__.py").exists()}
"""Names that mean something at the top of the repository alone."""


def modules(file: Path) -> Iterator[str]:
    """Yield the first part of the name of every module that a file imports, wherever in it."""
    for node in ast.walk(ast.parse(file.read_bytes())):
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield from modules_of(node)


def modules_of(node: ast.Import | ast.ImportFrom) -> list[str]:
    """Return the first part of the names of the modules that a statement imports."""
    if isinstance(node, ast.ImportFrom):
        return [(node.module or "").partition(".")[0]]
    return [name.name.partition(".")[0] for name in node.names]


def modules_at_once(file: Path) -> Iterator[str]:
    """Yield the first part of the name of every module whose import makes that of a file fail."""
    for node in ast.parse(file.read_bytes()).body:
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield from modules_of(node)


def declared() -> set[str]:
    """Return the names of all libraries that Visavis or an extra for its users asks for."""
    extras = PROJECT["project"]["optional-dependencies"]
    asked = [library for name, some in extras.items() if name != "dev" for library in some]
    wanted = [*PROJECT["project"]["dependencies"], *asked]
    return names_of(wanted)


def names_of(wanted: Iterable[str]) -> set[str]:
    return {plain(re.split(r"[\[<>=;~! ]", text)[0]) for text in wanted}


def plain(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def test_installed_packages_import_each_other_and_declared_libraries_alone() -> None:
    provided = metadata.packages_distributions()
    undeclared, wanted = set(), declared()
    for file in product_files():
        for name in set(modules(file)) - {"visavis"} - set(sys.stdlib_module_names):
            of = {plain(d) for d in provided.get(name, ())}
            if name in BESIDE or (of and not of & wanted):
                undeclared.add(f"{name_in_repository(file)}: {name}")
    assert set() == undeclared


def test_what_a_file_needs_at_once_comes_without_any_extra() -> None:
    always = names_of(PROJECT["project"]["dependencies"])
    provided = metadata.packages_distributions()
    missing = {}
    for file in product_files():
        for name in set(modules_at_once(file)) - {"visavis"} - set(sys.stdlib_module_names):
            if not {plain(d) for d in provided.get(name, ())} & always:
                missing[name_in_repository(file)] = name
    assert missing == NAMES_ITS_EXTRA
