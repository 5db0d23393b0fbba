import numpy as np
import pytest

from visavis.lab.schema import Field, SampleBatch, StreamSchema
from visavis.protocol.session.row_buffer import RowBuffer

SCHEMA = StreamSchema("numbers", (Field("x", "i4", ""), Field("v_m", "f4", "m", "", (3,))), 90.0)


def filled(hold_ns: int, capacity: int, counts: list[int]) -> list[SampleBatch]:
    batches: list[SampleBatch] = []
    buffer = RowBuffer(SCHEMA, batches.append, hold_ns=hold_ns, capacity=capacity)
    value = 0
    for frame, n in enumerate(counts):
        i = buffer.room(n)
        buffer.columns["x"][i : i + n] = np.arange(value, value + n)
        value += n
        buffer.commit(n, frame * 10)
    buffer.flush()
    return batches


def test_no_row_is_lost_or_repeated_whatever_the_hold_and_capacity() -> None:
    for hold_ns, capacity in [(0, 4), (35, 4), (10**9, 4), (10**9, 512)]:
        batches = filled(hold_ns, capacity, [1, 2, 3, 1, 4, 2])
        joined = np.concatenate([b.values["x"] for b in batches])

        assert list(range(13)) == joined.tolist()
        assert list(range(13)) == np.concatenate([b.seq for b in batches]).tolist()


@pytest.mark.parametrize("counts", [[700, 1, 2], [3, 700, 1], [1, 2, 5000, 600]])
def test_more_rows_at_once_than_the_buffer_ever_held_are_all_kept(counts: list[int]) -> None:
    batches = filled(10**9, 512, counts)
    joined = np.concatenate([b.values["x"] for b in batches])

    assert list(range(sum(counts))) == joined.tolist()
    assert list(range(sum(counts))) == np.concatenate([b.seq for b in batches]).tolist()
    assert [len(b.t_host_ns) for b in batches] == [len(b.values) for b in batches]


def test_rows_are_handed_over_once_the_hold_has_passed() -> None:
    batches = filled(30, 512, [1, 1, 1, 1, 1])

    assert [4, 1] == [len(b) for b in batches]


def test_a_batch_handed_over_does_not_change_afterwards() -> None:
    batches = filled(0, 4, [2, 2])

    assert [0, 1] == batches[0].values["x"].tolist()


def test_rows_added_together_are_those_added_one_by_one() -> None:
    def added(together: bool) -> tuple[bytes, list[int]]:
        batches: list[SampleBatch] = []
        buffer = RowBuffer(SCHEMA, batches.append, hold_ns=25, capacity=8)
        rows = [(i, (i, i / 2, -i)) for i in range(20)]
        for first in (0, 6, 13):
            some = rows[first : first + 7 if first else 6]
            if together:
                buffer.add_rows(some, [10 * row[0] for row in some])
            else:
                for row in some:
                    buffer.add(row, 10 * row[0])
        buffer.flush()
        times = np.concatenate([b.t_host_ns for b in batches]).tolist()
        return np.concatenate([b.values for b in batches]).tobytes(), times

    assert added(False) == added(True)
