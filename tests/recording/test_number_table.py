"""Tables of numbers are written as pandas writes them, byte for byte."""

import numpy as np
import pandas as pd
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from visavis.recording.number_table import holds_numbers, tsv_of_numbers

EDGES = [
    0.0,
    -0.0,
    1.0,
    1e-3,
    1e6,
    1234567.5,
    1e-4,
    9.999e-5,
    1e-5,
    1e10,
    1e10 + 0.5,
    1e16,
    -7.25,
    np.nan,
    np.inf,
    0.1,
]


def as_pandas(table: pd.DataFrame) -> list[bytes]:
    text = table.to_csv(sep="\t", index=False, header=False, na_rep="n/a", lineterminator="\n")
    return text.encode().split(b"\n")


def ours(table: pd.DataFrame) -> list[bytes]:
    return tsv_of_numbers(table, na_rep="n/a").split(b"\n")


def test_numbers_of_every_size_are_written_alike() -> None:
    rng = np.random.default_rng(4)
    wide = rng.standard_normal(3000) * 10.0 ** rng.integers(-12, 20, 3000)
    table = pd.DataFrame(
        {
            "f8": np.concatenate([EDGES, wide]),
            "f4": np.concatenate([EDGES, wide]).astype(np.float32),
            "of_f4": np.concatenate([EDGES, wide]).astype(np.float32).astype(np.float64),
            "i8": rng.integers(-(2**62), 2**62, 3000 + len(EDGES)),
        }
    )

    assert as_pandas(table) == ours(table)


@given(arrays(np.float64, st.integers(1, 40), elements=st.floats(width=64)))
def test_any_fraction_is_written_alike(values: np.ndarray) -> None:
    table = pd.DataFrame({"a": values, "b": values[::-1]})

    assert as_pandas(table) == ours(table)


def test_texts_and_truths_are_no_numbers() -> None:
    assert holds_numbers(pd.DataFrame({"a": [1], "b": [0.5]}))
    assert not holds_numbers(pd.DataFrame({"a": [True]}))
    assert not holds_numbers(pd.DataFrame({"a": ["1"]}))
