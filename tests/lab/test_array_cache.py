"""What is kept between runs is found again under its hash, and never trusted when damaged."""

import os

import numpy as np
import pytest

from visavis.lab.array_cache import _folder, digest_of, read_cache, write_cache


@pytest.fixture(autouse=True)
def temporary(tmp_path, monkeypatch):
    monkeypatch.setattr("visavis.lab.array_cache.user_cache_path", lambda *_, **__: tmp_path)
    return tmp_path


def test_arrays_are_found_again_under_their_key():
    write_cache("study", "key", {"a": np.arange(3)})
    assert [0, 1, 2] == read_cache("study", "key")["a"].tolist()
    assert read_cache("other", "key") is None


def test_a_damaged_file_is_as_none(temporary):
    write_cache("study", "key", {"a": np.arange(300)})
    path = temporary / "study" / "key.npz"
    path.write_bytes(path.read_bytes()[:100])
    assert read_cache("study", "key") is None


def test_the_hash_tells_arrays_and_words_apart():
    same = [digest_of(np.arange(3), text="a") for _ in range(2)]
    assert same[0] == same[1]
    assert 3 == len({same[0], digest_of(np.arange(4), text="a"), digest_of(np.arange(3))})


def test_what_was_used_last_is_kept_when_there_is_too_much(temporary, monkeypatch):
    for age, key in enumerate(("used_again", "old", "new")):
        write_cache("study", key, {"a": np.zeros(1000)})
        os.utime(temporary / "study" / f"{key}.npz", (1000 + age, 1000 + age))
    assert read_cache("study", "used_again") is not None
    monkeypatch.setattr("visavis.lab.array_cache.MAX_CACHE_BYTES", 26_000)
    write_cache("study", "newest", {"a": np.zeros(1000)})
    assert {"used_again", "new", "newest"} == {p.stem for p in temporary.glob("study/*.npz")}


def test_what_is_kept_lies_in_the_users_cache(monkeypatch, tmp_path):
    monkeypatch.undo()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert "visavis" in _folder("study").parts
    assert "study" == _folder("study").name
