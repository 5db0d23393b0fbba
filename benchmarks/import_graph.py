"""Which module of a package imports which, wherever the import stands, and where that is a circle.

An import under `TYPE_CHECKING` and one inside a function count like any other: a reader follows
them all. `from package import name` leads to the module `package.name` where there is one, else to
`package`. `import_module` of a name that is written out counts, too.
"""

import ast
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

PACKAGE_FILE: Final = "__init__.py"


@dataclass(frozen=True)
class Import:
    """An import of a module of the same package: in `source`, of `target`, at `line`."""

    source: str
    target: str
    line: int
    is_deferred: bool
    """Whether it runs only when a function is called."""


@dataclass(frozen=True)
class SourceFile:
    """A module with its text and syntax tree."""

    name: str
    path: Path
    text: str
    tree: ast.Module

    @property
    def package(self) -> str:
        """The package from which relative imports start."""
        return self.name if self.path.name == PACKAGE_FILE else self.name.rpartition(".")[0]


def read_package(folder: Path) -> dict[str, SourceFile]:
    """Return every module of a package by its name; a folder that two links reach is read once."""
    modules = {}
    for path in _python_files(folder, set()):
        inner = path.relative_to(folder.parent).with_suffix("").parts
        name = ".".join(inner[:-1] if path.name == PACKAGE_FILE else inner)
        text = path.read_text("utf-8")
        modules[name] = SourceFile(name, path, text, ast.parse(text, str(path)))
    return modules


def _python_files(folder: Path, visited: set[Path]) -> Iterator[Path]:
    real = folder.resolve()
    if real in visited:
        return
    visited.add(real)
    with os.scandir(folder) as entries:
        inside = sorted(entries, key=lambda entry: entry.name)
    for entry in inside:
        if entry.is_dir():
            yield from _python_files(folder / entry.name, visited)
        elif entry.name.endswith(".py"):
            yield folder / entry.name


def imports_within(modules: Mapping[str, SourceFile]) -> list[Import]:
    """Return the imports between the modules, in the order of the files."""
    return [
        Import(name, target, line, is_deferred)
        for name, module in modules.items()
        for target, line, is_deferred in _imports(module, modules)
        if target != name
    ]


def _imports(
    module: SourceFile, modules: Mapping[str, SourceFile]
) -> Iterator[tuple[str, int, bool]]:
    waiting: list[tuple[ast.AST, bool]] = [(module.tree, False)]
    while waiting:
        node, is_deferred = waiting.pop()
        for target in sorted(_targets(node, module.package, modules)):
            yield target, getattr(node, "lineno", 0), is_deferred
        inner = is_deferred or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        waiting.extend((child, inner) for child in ast.iter_child_nodes(node))


def _targets(node: ast.AST, package: str, modules: Mapping[str, SourceFile]) -> set[str]:
    if isinstance(node, ast.Import):
        return {alias.name for alias in node.names} & modules.keys()
    if isinstance(node, ast.Call):
        return _named_in_a_call(node) & modules.keys()
    if not isinstance(node, ast.ImportFrom):
        return set()
    parts = package.split(".")
    above = parts[: len(parts) - node.level + 1] if node.level else []
    base = ".".join([*above, *filter(None, [node.module])])
    targets = {base if (full := f"{base}.{a.name}") not in modules else full for a in node.names}
    return targets & modules.keys()


def _named_in_a_call(call: ast.Call) -> set[str]:
    """Return the module of `import_module("package.module")`: a string hides an import only."""
    if ast.unparse(call.func) not in ("import_module", "importlib.import_module"):
        return set()
    return {a.value for a in call.args if isinstance(a, ast.Constant) and isinstance(a.value, str)}


def deferred_statements(imports: list[Import]) -> int:
    """Return how many import statements stand inside functions; one of three names is one."""
    return len({(each.source, each.line) for each in imports if each.is_deferred})


def circles(imports: list[Import]) -> list[list[str]]:
    """Return the sets of modules that reach each other, the largest first (Tarjan, 1972)."""
    graph: dict[str, set[str]] = {}
    for each in imports:
        graph.setdefault(each.source, set()).add(each.target)
        graph.setdefault(each.target, set())
    order: dict[str, int] = {}
    lowest: dict[str, int] = {}
    path: list[str] = []  # modules whose circle may still grow
    groups: list[list[str]] = []
    for start in graph:
        if start in order:
            continue
        order[start] = lowest[start] = len(order)
        path.append(start)
        # A stack of our own in the place of recursion: chains of imports can be long.
        stack = [(start, iter(sorted(graph[start])))]
        while stack:
            module, targets = stack[-1]
            target = next(targets, None)
            if target is None:
                stack.pop()
                if stack:
                    above = stack[-1][0]
                    lowest[above] = min(lowest[above], lowest[module])
                if lowest[module] == order[module]:  # nothing leads further up: a group is whole
                    at = path.index(module)
                    groups.append(sorted(path[at:]))
                    del path[at:]
            elif target not in order:
                order[target] = lowest[target] = len(order)
                path.append(target)
                stack.append((target, iter(sorted(graph[target]))))
            elif target in path:
                lowest[module] = min(lowest[module], order[target])
    return sorted((g for g in groups if len(g) > 1), key=lambda group: (-len(group), group))
