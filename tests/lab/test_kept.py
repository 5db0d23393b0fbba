"""What is kept between runs is found again under its hash, and never trusted when damaged."""

import numpy as np
import pytest

from lab.kept import digest_of, keep, read_kept


@pytest.fixture(autouse=True)
def temporary(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    return tmp_path


def test_arrays_are_found_again_under_their_key():
    keep("study", "key", {"a": np.arange(3)})
    assert [0, 1, 2] == read_kept("study", "key")["a"].tolist()
    assert read_kept("other", "key") is None


def test_a_damaged_file_is_as_none(temporary):
    keep("study", "key", {"a": np.arange(300)})
    path = temporary / "visavis-study" / "key.npz"
    path.write_bytes(path.read_bytes()[:100])
    assert read_kept("study", "key") is None


def test_the_hash_tells_arrays_and_words_apart():
    same = [digest_of(np.arange(3), said="a") for _ in range(2)]
    assert same[0] == same[1]
    assert 3 == len({same[0], digest_of(np.arange(4), said="a"), digest_of(np.arange(3))})
