"""Count what makes the product hard to find one's way in: its lines, circles, giants and names.

    python -m benchmarks.source_lines [--json | --list]

The product is the package `visavis` with the folders at the top of the repository that belong to
it; tests, benchmarks and tools are not counted. `--list` shows what stands behind each figure that
has a limit. "Ratio" is limit / value: 1 or more is within the limit.

- Modules in circles: modules that reach each other by imports, also by those for types only and
  those inside functions (`benchmarks.import_graph`).
- Deferred imports: statements inside functions that import a module of the product.
- Fields: those of a dataclass and of the dataclasses of the product that it extends. A dataclass
  that serves as an argument of `takes_keywords_of` and for nothing else has no instances: it is
  the signature of a thing made of parts, whose fields are counted in the parts.
- Bare participles: of all places that bind a name (assignments, loops, parameters, fields,
  functions, classes), how many bind one that is a participle and nothing else: `told`, `known`,
  `asked`. Words of the trade, such as `sorted` or `calibrated`, are names like others.
- Parameters: `self` and `cls` apart.
- Comments: lines with nothing else but a comment, of all lines; directives to tools apart.
"""

import argparse
import ast
import io
import re
import sys
import tokenize
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from benchmarks.import_graph import (
    SourceFile,
    circles,
    deferred_statements,
    imports_within,
    read_package,
)
from benchmarks.table import Row, show

PACKAGE: Final = Path(__file__).resolve().parent.parent / "src" / "visavis"
MAX_DEFERRED: Final = 60
MAX_FIELDS: Final = 20
MAX_PARTICIPLES_PER_MILLE: Final = 5
MANY_PARAMETERS: Final = 12
MAX_FUNCTIONS_OF_MANY_PARAMETERS: Final = 8
GIANTS_SHOWN: Final = 5

IRREGULAR_PARTICIPLES: Final = frozenset(
    "begun bent borne bought broken brought built caught chosen come done drawn driven eaten "
    "fallen fed felt forgotten fought found given gone got grown heard held hung kept known laid "
    "lent lit lost made meant met overrun paid proven ridden risen said seen sent shaken shown "
    "shut sold sought spent split spoken spun stolen stood struck stuck sunk sworn swept swung "
    "taken taught thrown told torn understood unseen withdrawn woken won worn woven written".split()
)
"""Past participles that do not end in -ed."""
NOT_PARTICIPLES: Final = frozenset(
    "bed biped bleed breed embed exceed feed heed indeed led malformed naked need proceed red reed "
    "sacred seed shed sled speed succeed unfinished weed".split()
)
"""Words in -ed that are nouns, plain verbs or adjectives."""
WORDS_OF_THE_TRADE: Final = frozenset(
    # States and results that at least three of 23 other packages name so (NumPy, pandas, SciPy,
    # aiohttp, click, rich, hypothesis …); but `found`, `known` and `given` do not say of what.
    "accepted allowed applied changed cleaned closed combined compiled connected converted decoded "
    "elapsed enabled encoded escaped evaluated expected failed filled filtered finished fixed "
    "loaded locked mapped matched merged observed ordered padded parsed paused registered rejected "
    "released required resampled resolved rounded scaled shifted signed sorted stacked started "
    "stored stripped supported truncated unwrapped weighted wrapped "
    # Terms of statistics, eye tracking and devices.
    "adjusted armed averted balanced blinded calibrated correlated corrected damped mixed paired "
    "pooled ranked simulated standardised tracked unbalanced uncalibrated untracked".split()
)
"""Participles that a reader of the field takes as the name of a state or a quantity."""
ONE_WORD: Final = re.compile("[A-Za-z][a-z]+|[A-Z]+")
DIRECTIVE: Final = re.compile(r"#\s*(fmt|noqa|type|pragma|ruff|mypy|pyright|isort)\b|#!")


@dataclass(frozen=True)
class Binding:
    """A place that binds a name."""

    module: str
    line: int
    name: str


def is_bare_participle(name: str) -> bool:
    """Return whether a name is one past participle and nothing else but underscores around it."""
    word = name.strip("_")
    if not ONE_WORD.fullmatch(word) or word.lower() in NOT_PARTICIPLES | WORDS_OF_THE_TRADE:
        return False
    return is_irregular(name) or word.lower().endswith("ed")


def is_irregular(name: str) -> bool:
    """Return whether a name is a participle that does not end in -ed, as `told` and `known`."""
    return name.strip("_").lower() in IRREGULAR_PARTICIPLES


def bindings(module: SourceFile) -> Iterator[Binding]:
    """Yield every place of a module that binds a name; imports bind names of other modules."""
    for node in ast.walk(module.tree):
        names: list[str | None] = []
        match node:
            case ast.Name(id=name, ctx=ast.Store()) | ast.Attribute(attr=name, ctx=ast.Store()):
                names = [name]
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name):
                names = [name]
            case ast.ClassDef(name=name) | ast.ExceptHandler(name=name):
                names = [name]
            case ast.arg(arg=name) | ast.MatchAs(name=name) | ast.MatchStar(name=name):
                names = [name]
        yield from (Binding(module.name, getattr(node, "lineno", 0), n) for n in names if n)


def count_parameters(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Return how many parameters a function has, `self` and `cls` apart."""
    arguments = function.args
    named = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]
    gathered = [arguments.vararg, arguments.kwarg]
    every = [*named, *(each for each in gathered if each is not None)]
    return sum(each.arg not in ("self", "cls") for each in every)


def functions_of_many_parameters(modules: Mapping[str, SourceFile]) -> dict[str, int]:
    """Return the functions with `MANY_PARAMETERS` or more, as module and name, and how many."""
    return {
        f"{module.name}.{node.name}": count
        for module in modules.values()
        for node in ast.walk(module.tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        if (count := count_parameters(node)) >= MANY_PARAMETERS
    }


def dataclass_fields(modules: Mapping[str, SourceFile]) -> dict[str, int]:
    """Return how many fields each dataclass has, by module and name, inherited ones too.

    Signatures of things made of parts are left out (`signature_classes`).
    """
    own = {
        f"{module.name}.{node.name}": (module, node)
        for module in modules.values()
        for node in ast.walk(module.tree)
        if isinstance(node, ast.ClassDef) and any(map(_is_dataclass, node.decorator_list))
    }

    signatures = signature_classes(modules)

    def fields(name: str) -> set[str]:
        module, node = own[name]
        inherited = (_full_name(base, module) for base in node.bases)
        return _own_fields(node).union(*(fields(base) for base in inherited if base in own))

    return {name: len(fields(name)) for name in own if name not in signatures}


def signature_classes(modules: Mapping[str, SourceFile]) -> set[str]:
    """Return the classes, as module and name, that only give `takes_keywords_of` its signature.

    Their name stands in no other place of their module, and no other module imports it.
    """
    imported_names = {
        f"{node.module}.{alias.name}"
        for module in modules.values()
        for node in ast.walk(module.tree)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    signatures: set[str] = set()
    for module in modules.values():
        uses: Counter[str] = Counter()
        as_signature: Counter[str] = Counter()
        for node in ast.walk(module.tree):
            match node:
                case ast.Name(id=name, ctx=ast.Load()):
                    uses[name] += 1
                case ast.Call(func=ast.Name(id="takes_keywords_of"), args=[ast.Name(id=name)]):
                    as_signature[name] += 1
        signatures |= {
            f"{module.name}.{name}" for name, n in as_signature.items() if uses[name] == n
        }
    return signatures - imported_names


def _is_dataclass(decorator: ast.expr) -> bool:
    called = decorator.func if isinstance(decorator, ast.Call) else decorator
    return ast.unparse(called) in ("dataclass", "dataclasses.dataclass")


def _own_fields(node: ast.ClassDef) -> set[str]:
    return {
        line.target.id
        for line in node.body
        if isinstance(line, ast.AnnAssign) and isinstance(line.target, ast.Name)
        if not re.search(r"\b(ClassVar|InitVar|KW_ONLY)\b", ast.unparse(line.annotation))
    }


def _full_name(base: ast.expr, module: SourceFile) -> str:
    name = ast.unparse(base).partition("[")[0]
    for node in module.tree.body:
        if isinstance(node, ast.ImportFrom) and name in {a.asname or a.name for a in node.names}:
            return f"{node.module}.{name}"
    return f"{module.name}.{name}"


def count_comment_lines(text: str) -> int:
    """Return the lines that hold a comment and nothing else; `# fmt: off` and the like apart."""
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    return sum(
        token.type == tokenize.COMMENT
        and not token.line[: token.start[1]].strip()
        and DIRECTIVE.match(token.string) is None
        for token in tokens
    )


@dataclass(frozen=True)
class Figures:
    """What was counted of a package."""

    lines: Mapping[str, int]
    """Lines of each room: the first name below the package."""
    comment_lines: int
    circles: list[list[str]]
    deferred_imports: int
    fields: Mapping[str, int]
    bindings: int
    participles: list[Binding]
    functions_of_many_parameters: Mapping[str, int]


def count(package: Path) -> Figures:
    """Count everything in a package's folder."""
    modules = read_package(package)
    imports = imports_within(modules)
    names = [binding for module in modules.values() for binding in bindings(module)]
    lines: Counter[str] = Counter()
    for module in modules.values():
        rooms = module.package.split(".")[1:]
        lines[rooms[0] if rooms else "(at the top)"] += len(module.text.splitlines())
    return Figures(
        lines=lines,
        comment_lines=sum(count_comment_lines(module.text) for module in modules.values()),
        circles=circles(imports),
        deferred_imports=deferred_statements(imports),
        fields=dataclass_fields(modules),
        bindings=len(names),
        participles=[binding for binding in names if is_bare_participle(binding.name)],
        functions_of_many_parameters=functions_of_many_parameters(modules),
    )


def _largest(sizes: Mapping[str, int]) -> list[tuple[str, int]]:
    return sorted(sizes.items(), key=lambda item: (-item[1], item[0]))


def rows(figures: Figures) -> list[Row]:
    """Return the figures as a table."""
    lines = sum(figures.lines.values())
    giants = _largest(figures.fields)[:GIANTS_SHOWN]
    words = [binding.name for binding in figures.participles]
    irregular = list(filter(is_irregular, words))
    many = len(figures.functions_of_many_parameters)
    title = f"functions with {MANY_PARAMETERS} parameters or more"

    def per_mille(some: list[str]) -> float:
        return 1000 * len(some) / max(figures.bindings, 1)

    return [
        Row("product", lines, "lines"),
        *(Row(f"  {room}", size, "lines") for room, size in sorted(figures.lines.items())),
        Row("comments", 100 * figures.comment_lines / max(lines, 1), "% of lines"),
        Row("modules in circles", sum(map(len, figures.circles)), "modules", 0),
        Row("deferred imports of the product", figures.deferred_imports, "imports", MAX_DEFERRED),
        *(Row(f"  {name.rpartition('.')[2]}", n, "fields", MAX_FIELDS) for name, n in giants),
        Row("bare participles", per_mille(words), "‰ of names", MAX_PARTICIPLES_PER_MILLE),
        Row("  those that do not end in -ed", per_mille(irregular), "‰ of names"),
        Row(title, many, "functions", MAX_FUNCTIONS_OF_MANY_PARAMETERS),
    ]


def details(figures: Figures) -> list[str]:
    """Return what stands behind the figures, a line each."""
    words = Counter(binding.name for binding in figures.participles)
    return [
        *(f"circle of {len(each)}: {', '.join(each)}" for each in figures.circles),
        *(f"{n} fields: {name}" for name, n in _largest(figures.fields) if n > MAX_FIELDS),
        *(f"{n} parameters: {name}" for name, n in _largest(figures.functions_of_many_parameters)),
        *(f"{n} times {name}" for name, n in _largest(words)),
    ]


def main() -> int:
    """Print the figures; return 1 where a limit is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--list", action="store_true", help="show what stands behind the figures")
    arguments = parser.parse_args()
    figures = count(PACKAGE)
    if arguments.list:
        print("\n".join(details(figures)))
        return 0
    return show(rows(figures), as_json=arguments.json)


if __name__ == "__main__":
    sys.exit(main())
