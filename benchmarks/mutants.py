"""Change the product in small ways that no test should let pass, and count which tests notice.

python -m benchmarks.mutants [--count 40] [--seed 35] [--log MUTANTS.JSONL] [--list]

A mutant is one change in one module: another comparison, sum or product, `and` for `or`, a `not`
left out, a whole number one larger, a choice always made one way. They are drawn with a seed, each
from another module, modules by their length; a smaller count is the beginning of a larger one.
What only words errors is not changed.

Each mutant stands in a copy of the repository, where the test files nearest to its module by the
graph of imports are run: those of the first tier, and those of the second where no test of the
first has failed; where none failed, the first tier of three times as many that lie farther off.
Files differ by how many imports lie between, then by the words their names share.
A mutant is killed when a test fails; at the end the tests that killed one are run on the unchanged
copy, so that none counts that fails there, too. The log keeps what was run: begun again, the
benchmark goes on where it stopped. Machine code of the clone serves the copy.
"""

import argparse
import ast
import json
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import venv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numba.core.caching import UserProvidedCacheLocator

from benchmarks.import_graph import SourceFile, imports_within, read_package
from tests.product_files import PACKAGE, ROOT, product_files
from visavis.lab.compiled import KERNELS

FILES_RUN: Final = 6
"""So many test files are run for a mutant first."""
FURTHER_FILES: Final = 18
"""So many more where none of those noticed it, their first tier alone: what a fixture calls lies
farther off, and whole studies by files that hardly know a module take minutes."""
TIERS: Final = {"first": "not slow", "second": "slow"}
SKIPPED: Final = ("figure", "page", "report", "errors", "panels", "words", "texts", "references")
"""Words of modules that make words and pictures: most of their numbers are matters of taste."""
SLOW_TO_START: Final = ("tests/packaging/", "tests/genuine/", "tests/tools/")
"""Tests of the whole product, which know no module of their own."""
OTHER: Final[Mapping[type[ast.cmpop], str]] = {
    ast.Lt: "<=",
    ast.LtE: "<",
    ast.Gt: ">=",
    ast.GtE: ">",
    ast.Eq: "!=",
    ast.NotEq: "==",
    ast.Is: "is not",
    ast.IsNot: "is",
    ast.In: "not in",
    ast.NotIn: "in",
}
REVERSE: Final[Mapping[type[ast.operator], str]] = {
    ast.Add: "-",
    ast.Sub: "+",
    ast.Mult: "/",
    ast.Div: "*",
}


@dataclass(frozen=True)
class Change:
    """A stretch of one line, from and to columns of its UTF-8, and what stands there instead."""

    line: int
    begin: int
    end: int
    old: str
    new: str


@dataclass(frozen=True)
class Mutant:
    """A change in a module of the product; `file` is relative to the repository."""

    module: str
    file: str
    change: Change

    @property
    def name(self) -> str:
        """What tells it from others."""
        return f"{self.module}:{self.change.line} {self.change.old} => {self.change.new}"


@dataclass(frozen=True)
class Outcome:
    """What became of a mutant: the tier that killed it, by which test; none: it survived."""

    mutant: str
    tier: str
    test: str
    files: tuple[str, ...]
    processor_s: float


def changes_in(text: str) -> list[Change]:
    """Return every change that can be made in a module's functions."""
    tree = ast.parse(text)
    untouched = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.Raise | ast.JoinedStr)
        for inner in ast.walk(node)
    }
    lines = text.split("\n")
    found: dict[tuple[int, int, int], Change] = {}
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef):
            for node in (inner for one in function.body for inner in ast.walk(one)):
                new = _instead(node) if id(node) not in untouched else None
                if new is None or not isinstance(node, ast.expr) or node.lineno != node.end_lineno:
                    continue
                place = node.lineno, node.col_offset, node.end_col_offset or 0
                old = lines[node.lineno - 1].encode()[place[1] : place[2]].decode()
                found.setdefault(place, Change(*place, old, new))
    return [found[place] for place in sorted(found)]


def _instead(node: ast.AST) -> str | None:
    """Return what stands in a node's place in a mutant; None where nothing can."""
    match node:
        case ast.Compare(left=left, ops=[operator], comparators=[right]):
            return f"({ast.unparse(left)} {OTHER[type(operator)]} {ast.unparse(right)})"
        case ast.BinOp(left=ast.Constant(value=str())):
            return None  # texts, which are joined and formatted
        case ast.BinOp(left=left, op=operator, right=right) if type(operator) in REVERSE:
            return f"(({ast.unparse(left)}) {REVERSE[type(operator)]} ({ast.unparse(right)}))"
        case ast.BoolOp(op=operator, values=values):
            word = " or " if isinstance(operator, ast.And) else " and "
            return f"({word.join(f'({ast.unparse(value)})' for value in values)})"
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            return f"({ast.unparse(operand)})"
        case ast.Constant(value=int() as value) if not isinstance(value, bool):
            return str(value + 1)
        case ast.IfExp(body=body):
            return f"({ast.unparse(body)})"
    return None


def changed(text: str, change: Change) -> str:
    """Return a module's text with one change."""
    lines = text.split("\n")
    line = lines[change.line - 1].encode()
    made = line[: change.begin] + change.new.encode() + line[change.end :]
    lines[change.line - 1] = made.decode()
    return "\n".join(lines)


def draw(modules: Mapping[str, SourceFile], count: int, seed: int) -> list[Mutant]:
    """Draw mutants, each from another module; a smaller count draws the first of a larger."""
    named = sorted(
        name
        for name in modules
        if not any(word in name.rpartition(".")[2] for word in SKIPPED) and modules[name].text
    )
    lengths = np.array([len(modules[name].text) for name in named], float)
    rng = np.random.default_rng(seed)
    order = np.argsort(rng.exponential(size=len(named)) / lengths)  # the longer, the sooner
    drawn = []
    for i in order:
        module = modules[named[i]]
        changes = changes_in(module.text)
        chosen = rng.integers(max(len(changes), 1))  # drawn in any case
        if changes:
            file = module.path.resolve().relative_to(ROOT).as_posix()
            drawn.append(Mutant(module.name, file, changes[chosen]))
        if len(drawn) == count:
            break
    return drawn


def importers_in(modules: Mapping[str, SourceFile]) -> dict[str, set[str]]:
    """Return for each module those that import it."""
    importers: dict[str, set[str]] = {}
    for one in imports_within(modules):
        importers.setdefault(one.target, set()).add(one.source)
    return importers


def nearest_tests(module: str, importers: Mapping[str, set[str]]) -> list[str]:
    """Return the test files nearest to a module by imports, then by the words of their names.

    After those that import it, however far off, come those that share words with its name: a
    command or a driver that is loaded by its name is imported by nobody.
    """
    distance, edge = {module: 0}, [module]
    while edge:
        above = {name for below in edge for name in importers.get(below, ())} - set(distance)
        distance |= dict.fromkeys(above, distance[edge[0]] + 1)
        edge = sorted(above)
    words, beyond = _words(module), len(distance) + 1
    sources = {name for several in importers.values() for name in several}
    ranked = sorted(
        (distance.get(name, beyond), -len(words & _words(name)), f"{name.replace('.', '/')}.py")
        for name in sources
        if name.startswith("tests.") and name.rpartition(".")[2].startswith("test_")
        if name in distance or words & _words(name)
    )
    return [file for *_, file in ranked if not file.startswith(SLOW_TO_START)][
        : FILES_RUN + FURTHER_FILES
    ]


def _words(name: str) -> set[str]:
    return {word.rstrip("s") for word in name.replace("_", ".").split(".")}


def caches_of(folder: Path, source: Path) -> Path:
    """Return where numba keeps machine code of a folder of sources."""
    of: Any = UserProvidedCacheLocator  # which has no types
    return folder / str(of.get_suitable_cache_subpath(str(source / "any.py")))


class Copy:
    """A copy of the repository with a Python that runs it."""

    def __init__(self, folder: Path) -> None:
        self.root = folder / "repository"
        self._kernels = folder / "kernels"
        # git as found
        subprocess.run(["git", "clone", "-q", str(ROOT), str(self.root)], check=True)  # noqa: S607
        for file in self._files():
            own = ROOT / file
            if own.is_file() and not own.is_symlink():  # what is not committed, too; and its time
                shutil.copy2(own, self.root / file)
        venv.create(folder / "python", with_pip=False)
        self._python = folder / "python" / "bin" / "python"
        packages = Path(sysconfig.get_path("purelib", vars={"base": str(folder / "python")}))
        paths = [self.root / "src", *(p for p in sys.path if p.endswith("site-packages"))]
        (packages / "copy.pth").write_text("\n".join(map(str, paths)), "utf-8")

    def _files(self) -> Iterator[str]:
        listed = subprocess.run(
            ["git", "-C", str(ROOT), "ls-files"],  # noqa: S607 - git as found
            capture_output=True,
            text=True,
            check=True,
        )
        return iter(listed.stdout.splitlines())

    def _lend_kernels(self) -> None:
        """Let machine code of the clone serve the copy: numba keeps it by the path of a folder."""
        shutil.rmtree(self._kernels, ignore_errors=True)
        there = Path(os.environ.get("NUMBA_CACHE_DIR", str(KERNELS / "tests")))
        package = self.root / "src" / "visavis"
        for source in product_files():
            inner = source.parent.relative_to(ROOT)
            inner = inner.relative_to("src/visavis") if inner.parts[0] == "src" else inner
            lent, source = (
                caches_of(self._kernels, package / inner),
                caches_of(there, PACKAGE / inner),
            )
            if source.is_dir() and not lent.exists():
                # a mutant's code is written beside these files, never into them
                shutil.copytree(source, lent, copy_function=os.link)

    def run(self, words: Sequence[str]) -> str:
        """Run tests until one fails; return its name, nothing: all passed."""
        self._lend_kernels()
        environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
        environment |= {"NUMBA_CACHE_DIR": str(self._kernels), "CI": "1"}
        options = ["-n0", "-p", "no:cacheprovider", "-rfE", "--timeout", "600"]
        done = subprocess.run(
            [str(self._python), "-m", "pytest", *options, *words],
            cwd=self.root,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode in (0, 5):  # 5: no test of this tier
            return ""
        failed = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
        return failed[0].split(" - ")[0].split(" ", 1)[1] if failed else "pytest itself"

    def with_mutant(self, mutant: Mutant, files: Sequence[str]) -> Outcome:
        """Make a change, run the tests nearest to it, take it back."""
        path = self.root / mutant.file
        text, begin_s = path.read_text("utf-8"), _processor_s()
        times = path.stat()
        path.write_text(changed(text, mutant.change), "utf-8")
        try:
            near, far = files[:FILES_RUN], files[FILES_RUN:]
            for tier, some in (("first", near), ("second", near), ("first", far)):
                test = self.run(["-x", "-m", TIERS[tier], *some]) if some else ""
                if test:
                    took_s = _processor_s() - begin_s
                    return Outcome(mutant.name, tier, test, tuple(some), took_s)
        finally:
            path.write_text(text, "utf-8")
            os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
        return Outcome(mutant.name, "", "", tuple(files), _processor_s() - begin_s)

    def failing(self, tests: Sequence[str]) -> set[str]:
        """Return which tests fail without any mutant."""
        return {test for test in tests if self.run([test])}


def _processor_s() -> float:
    """Return the processor time of this process and of the child processes that ended."""
    return sum(os.times()[:4])


def read_log(log: Path) -> dict[str, Outcome]:
    """Return what was run before."""
    lines = log.read_text("utf-8").splitlines() if log.exists() else []
    read = (json.loads(line) for line in lines)
    return {one["mutant"]: Outcome(**{**one, "files": tuple(one["files"])}) for one in read}


def table(outcomes: Sequence[Outcome], doubtful: set[str]) -> str:
    """Return a Markdown table by room, and the survivors; a doubtful test kills nothing."""
    rooms = sorted({room_of(one) for one in outcomes})
    lines = [
        "| room | mutants | killed by the first tier | by the second | survived |",
        "| --- | --- | --- | --- | --- |",
    ]
    for room in (*rooms, "all"):
        here = [one for one in outcomes if room in ("all", room_of(one))]
        tiers = [one.tier if one.test not in doubtful else "" for one in here]
        counts = (len(here), *(tiers.count(tier) for tier in (*TIERS, "")))
        lines.append("| " + " | ".join(map(str, (room, *counts))) + " |")
    alive = [one for one in outcomes if not one.tier or one.test in doubtful]
    return "\n".join([*lines, "", "survived:", *(f"- `{one.mutant}`" for one in alive)])


def room_of(outcome: Outcome) -> str:
    """Return the room of the product in which a mutant was made."""
    return outcome.mutant.split(":")[0].split(".")[1]


def main() -> None:
    """Run mutants and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--seed", type=int, default=35)
    parser.add_argument("--log", type=Path, default=Path("mutants.jsonl"))
    parser.add_argument("--list", action="store_true", help="show the mutants, run nothing")
    chosen = parser.parse_args()
    product = read_package(PACKAGE)
    importers = importers_in({**product, **read_package(ROOT / "tests")})
    mutants = draw(product, chosen.count, chosen.seed)
    if chosen.list:
        for mutant in mutants:
            print(mutant.name, *nearest_tests(mutant.module, importers), sep="\n    ")
        return
    before = read_log(chosen.log)
    with tempfile.TemporaryDirectory() as folder:
        copy = Copy(Path(folder))
        for mutant in mutants:
            if mutant.name not in before:
                outcome = copy.with_mutant(mutant, nearest_tests(mutant.module, importers))
                with chosen.log.open("a", encoding="utf-8") as file:
                    file.write(f"{json.dumps(asdict(outcome))}\n")
                print(f"{outcome.tier or 'survived'}: {outcome.mutant} {outcome.test}", flush=True)
                before[mutant.name] = outcome
        outcomes = [before[mutant.name] for mutant in mutants]
        doubtful = copy.failing(sorted({one.test for one in outcomes if one.test}))
    for test in sorted(doubtful):
        print(f"fails without a mutant, too: {test}")
    print(table(outcomes, doubtful))


if __name__ == "__main__":
    main()
