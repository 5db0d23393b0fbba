import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.store import Store


@pytest.fixture
def store(tmp_path: Path) -> Store:
    made = Store()
    made.folder = tmp_path / "store"
    return made


def recorder(times: list[Path]) -> Callable[[Path], Path]:
    def record(place: Path) -> Path:
        times.append(place)
        session = place / "stare" / "ses-001"
        session.mkdir(parents=True)
        (session / "trials.jsonl").write_text("recorded", "utf-8")
        return session

    return record


def test_a_session_is_recorded_once_and_everybody_may_change_their_copy(
    store: Store, tmp_path: Path
) -> None:
    times: list[Path] = []
    first = store.copy("session", recorder(times), tmp_path / "a")
    (first / "trials.jsonl").write_text("changed", "utf-8")
    second = store.copy("session", recorder(times), tmp_path / "b")
    assert 1 == len(times)
    assert tmp_path / "b" / "stare" / "ses-001" == second
    assert "recorded" == (second / "trials.jsonl").read_text("utf-8")


def test_what_recording_took_counts_for_everybody_who_gets_a_copy(
    store: Store, tmp_path: Path
) -> None:
    times_s = iter((10.0, 14.5, 20.0))
    store.processor_s = lambda: next(times_s)
    store.copy("session", recorder([]), tmp_path / "a")
    assert 0.0 == store.saved_s
    store.copy("session", recorder([]), tmp_path / "b")
    assert 4.5 == store.saved_s


def test_another_name_is_another_session(store: Store, tmp_path: Path) -> None:
    times: list[Path] = []
    for name in ("one", "other"):
        store.copy(name, recorder(times), tmp_path / name)
    assert 2 == len(times)


def test_what_was_stopped_half_way_is_recorded_anew(store: Store, tmp_path: Path) -> None:
    def stop(place: Path) -> Path:
        recorder([])(place)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        store.copy("session", stop, tmp_path / "a")
    times: list[Path] = []
    assert store.copy("session", recorder(times), tmp_path / "b").is_dir()
    assert 1 == len(times)


def test_two_workers_that_need_a_session_at_once_record_it_once(
    store: Store, tmp_path: Path
) -> None:
    times: list[Path] = []

    def record_late(place: Path) -> Path:
        second.start()
        # The other worker gets as far as the lock meanwhile; without one it would record, too.
        assert not second_has_copy.wait(0.2)
        return recorder(times)(place)

    second_has_copy = threading.Event()

    def copy_too() -> None:
        store.copy("session", recorder(times), tmp_path / "b")
        second_has_copy.set()

    second = threading.Thread(target=copy_too)
    store.copy("session", record_late, tmp_path / "a")
    second.join()
    assert 1 == len(times)


def test_without_a_folder_everybody_records_their_own(tmp_path: Path) -> None:
    times: list[Path] = []
    for name in ("a", "b"):
        Store().copy("session", recorder(times), tmp_path / name)
    assert [tmp_path / "a", tmp_path / "b"] == times


def test_what_is_shared_is_made_once_and_is_the_same_folder_for_everybody(
    store: Store, tmp_path: Path
) -> None:
    times: list[Path] = []
    first, second = (store.share("wheel", recorder(times), tmp_path / who) for who in "ab")
    assert 1 == len(times)
    assert first == second
    assert "recorded" == (first / "trials.jsonl").read_text("utf-8")


def test_without_a_store_everybody_makes_their_own_to_share(tmp_path: Path) -> None:
    made_at = Store().share("wheel", recorder([]), tmp_path / "alone")
    assert tmp_path / "alone" / "stare" / "ses-001" == made_at
