"""Kernels compiled before they are called, for types that are written down."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pytest

from visavis.lab.compile_ahead import compile_kernel, kernels_in_use, read_list
from visavis.lab.compiled import compiled
from visavis.people.observer.state import TARGET_DTYPE

HERE = __name__
TARGETS = "visavis.people.observer.state:TARGET_DTYPE"


class Pair(NamedTuple):
    left: npt.NDArray[np.float64]
    right: tuple[float, int]


@compiled
def of_arrays(
    values: npt.NDArray[np.float64], strided: npt.NDArray[np.int16], is_it: bool
) -> float:
    return values[0, 0] + strided[0] + is_it


@compiled
def of_records(targets: npt.NDArray[np.void], pair: Pair) -> float:
    return targets.shape[0] + pair.left[0] + pair.right[0]


def of_here(name: str) -> frozenset[str]:
    return frozenset(line for line in kernels_in_use() if line.startswith(f"{HERE}:{name}("))


def test_types_are_written_as_they_are_read() -> None:
    frozen = np.zeros((2, 2))
    frozen.flags.writeable = False
    of_arrays(frozen, np.zeros(4, np.int16)[::2], True)
    line = f"{HERE}:of_arrays(readonly float64[2], int16[1, A], bool)"
    assert {line} == of_here("of_arrays")
    compile_kernel(line)
    assert {line} == of_here("of_arrays")


def test_records_and_named_tuples_are_written_by_the_module_that_has_them() -> None:
    line = f"{HERE}:of_records({TARGETS}[1], {HERE}:Pair(float64[1], (float64, int64, )))"
    compile_kernel(line)
    assert {line} == of_here("of_records")
    of_records(np.zeros(1, TARGET_DTYPE), Pair(np.zeros(1), (0.0, 1)))
    assert {line} == of_here("of_records")


@pytest.mark.parametrize(
    "line", ["no.such.module:kernel(int64)", f"{HERE}:no_such(int64)", f"{HERE}:of_arrays"]
)
def test_a_line_about_what_is_not_there_is_refused(line: str) -> None:
    with pytest.raises((ImportError, AttributeError, ValueError)):
        compile_kernel(line)


def test_a_list_is_of_studies_and_phases(tmp_path: Path) -> None:
    path = tmp_path / "kernels.txt"
    path.write_text("# a comment\nduel simulating 1 a.b:c(int64, int64)\nduel measuring 0 a:d()\n")
    assert ("a.b:c(int64, int64)",) == read_list(path, "duel", "simulating")
    assert () == read_list(path, "other", "simulating")
