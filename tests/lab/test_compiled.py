"""Compiled kernels: what is cached is used again, and never after what it rests on has changed."""

import os
import subprocess
import sys
from pathlib import Path

from visavis.lab.compiled import KERNELS, forget_old_kernels

ROOT = Path(__file__).resolve().parents[2]
INNER = (
    "from visavis.lab.compiled import compiled\n\n\n@compiled\ndef inner(x):\n    return x + {}\n"
)
OUTER = """
from inner_kernel import inner
import rows_of_numbers as rows
from numbers_taken_in import SHIFT, Pair
from visavis.lab.compiled import compiled, announce_compiling


@compiled
def outer(x, pair):
    return 10 * inner(x) + SHIFT + rows.FIRST + pair.left


told = []
announce_compiling(lambda: told.append(None))
print(outer(1, Pair(left=0, right=7)), sum(outer.stats.cache_hits.values()), len(told))
"""


def without_numbas_own(cache: Path) -> dict[str, str]:
    """Return this process's environment with another cache folder, and none that numba is told."""
    kept = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    return {**kept, "XDG_CACHE_HOME": str(cache)}


def outer_of(
    folder: Path, *, added: int, shift: int, first: int = 0, fields: str = "left right"
) -> tuple[int, int, int]:
    """Return what the outer kernel gives in a new process, how often its cache was used, and
    how often it was told that something is compiled.
    """
    for name, text in (
        ("inner_kernel", INNER.format(added)),
        (
            "numbers_taken_in",
            f"from collections import namedtuple\nSHIFT = {shift}\n"
            f"Pair = namedtuple('Pair', {fields!r})\n",
        ),
        ("rows_of_numbers", f"FIRST = {first}\n"),
        ("outer_kernel", OUTER),
    ):
        path = folder / f"{name}.py"
        if not path.exists() or path.read_text() != text:
            path.write_text(text)
    path_line = f"import sys; sys.path[:0] = [{str(folder)!r}, {str(ROOT)!r}]"
    process = subprocess.run(
        [sys.executable, "-B", "-c", f"{path_line}; import outer_kernel"],
        env=without_numbas_own(folder / "cache"),
        capture_output=True,
        text=True,
        check=True,
    )
    value, hits, told = map(int, process.stdout.split())
    return value, hits, told


def test_cached_code_is_used_until_a_kernel_or_number_it_takes_in_changes(tmp_path: Path) -> None:
    assert outer_of(tmp_path, added=1, shift=0) == (20, 0, 1)
    assert outer_of(tmp_path, added=1, shift=0) == (20, 1, 0)
    assert outer_of(tmp_path, added=1000, shift=0) == (10010, 0, 1)
    assert outer_of(tmp_path, added=1000, shift=5) == (10015, 0, 1)
    assert outer_of(tmp_path, added=1000, shift=5) == (10015, 1, 0)
    # So, too, a number of a whole module that is imported by a name, which holds no kernels.
    assert outer_of(tmp_path, added=1000, shift=5, first=2) == (10017, 0, 1)
    # A kernel reads the fields of a named tuple by their places.
    assert outer_of(tmp_path, added=1000, shift=5, first=2, fields="right left") == (10017, 0, 1)
    machine_code = {path.parents[2] for path in tmp_path.rglob("*.nbc")}
    assert {tmp_path / "cache" / "visavis" / "kernels"} == machine_code  # nothing beside modules


PAIR = """
from typing import NamedTuple


class {}(NamedTuple):
    {}: float
    {}: float
"""
OF_PAIR = """
import pairs
from visavis.lab.compiled import compiled


@compiled
def left_of(pair):
    return pair.left


print(left_of(pairs.{}(left=1.0, right=2.0)))
"""


def test_cached_code_is_not_used_when_a_tuple_has_other_fields_or_another_name(
    tmp_path: Path,
) -> None:
    path_line = f"import sys; sys.path[:0] = [{str(tmp_path)!r}, {str(ROOT)!r}]"
    for name, *fields in ("A", "left", "right"), ("A", "right", "left"), ("B", "right", "left"):
        (tmp_path / "pairs.py").write_text(PAIR.format(name, *fields))
        (tmp_path / "of_pair.py").write_text(OF_PAIR.format(name))
        process = subprocess.run(
            [sys.executable, "-B", "-c", f"{path_line}; import of_pair"],
            env=without_numbas_own(tmp_path / "cache"),
            capture_output=True,
            text=True,
            check=True,
        )
        assert "1.0" == process.stdout.strip()


NESTED = """
import pairs
from typing import NamedTuple


class Outer(NamedTuple):
    pair: pairs.A
    scale: float
"""
OF_NESTED = """
from outers import Outer
from visavis.lab.compiled import compiled


@compiled
def left_of(outer):
    return outer.scale * outer.pair.left


Inner = Outer.__annotations__['pair']
print(left_of(Outer(Inner(left=1.0, right=2.0), 3.0)))
"""


def test_cached_code_is_not_used_when_a_tuple_within_a_tuple_has_other_fields(
    tmp_path: Path,
) -> None:
    path_line = f"import sys; sys.path[:0] = [{str(tmp_path)!r}, {str(ROOT)!r}]"
    (tmp_path / "outers.py").write_text(NESTED)
    (tmp_path / "of_nested.py").write_text(OF_NESTED)
    for fields in (("left", "right"), ("right", "left")):
        (tmp_path / "pairs.py").write_text(PAIR.format("A", *fields))
        process = subprocess.run(
            [sys.executable, "-B", "-c", f"{path_line}; import of_nested"],
            env=without_numbas_own(tmp_path / "cache"),
            capture_output=True,
            text=True,
            check=True,
        )
        assert "3.0" == process.stdout.strip()


MATRICES = """
import sys

import numpy as np
from visavis.lab.compiled import compiled


@compiled
def plus(x):
    return x + 1


@compiled
def times(a):
    return np.dot(a, a)


print(plus(1), "scipy.linalg" in sys.modules, times(2 * np.eye(2)).trace())
"""


def test_scipy_is_not_loaded_for_kernels_that_multiply_no_matrices(tmp_path: Path) -> None:
    (tmp_path / "matrices.py").write_text(MATRICES)
    path_line = f"import sys; sys.path[:0] = [{str(tmp_path)!r}, {str(ROOT)!r}]"
    for _ in "compiled", "kept":
        process = subprocess.run(
            [sys.executable, "-c", f"{path_line}; import matrices"],
            env=without_numbas_own(tmp_path / "cache"),
            capture_output=True,
            text=True,
            check=True,
        )
        assert ["2", "False", "8.0"] == process.stdout.split()


def test_of_kept_machine_code_the_oldest_modules_are_forgotten_whole(tmp_path: Path) -> None:
    for age, module in enumerate(("oldest", "older", "newest")):
        folder = tmp_path / "py311-numba1" / module
        folder.mkdir(parents=True)
        for name in ("kernel.nbi", "kernel.1.nbc"):
            (folder / name).write_bytes(bytes(100))
            os.utime(folder / name, (1000 + age, 1000 + age))
    forget_old_kernels(tmp_path, max_bytes=450)
    left = {path.parent.name for path in tmp_path.rglob("*.nb*")}
    assert {"older", "newest"} == left
    forget_old_kernels(tmp_path / "nothing there", max_bytes=0)


def test_machine_code_lies_in_the_users_cache() -> None:
    assert ("visavis", "kernels") == KERNELS.parts[-2:]
