"""How far simulated sessions are, shown in trials while they go on."""

import threading
from pathlib import Path

import pytest

from visavis.running.sessions.trial_counter import TrialCounter, repeating

LINE = b'{"kind":"trial","trial_id":"T01"}\n'
OTHER = b'{"kind":"event","name":"trial_start"}\n'


def test_whole_lines_of_trials_are_counted_in_every_part(tmp_path: Path) -> None:
    counter = TrialCounter([tmp_path / "a", tmp_path / "b"])
    assert 0 == counter.count()  # before anything is there
    first, second = (tmp_path / "a" / part / "events.jsonl" for part in ("part-01", "part-02"))
    first.parent.mkdir(parents=True)
    first.write_bytes(OTHER + LINE + LINE[:20])
    assert 1 == counter.count()
    with first.open("ab") as file:
        file.write(LINE[20:] + OTHER)
    assert 2 == counter.count()
    second.parent.mkdir(parents=True)
    second.write_bytes(LINE)
    assert 3 == counter.count()
    second.unlink()
    assert 3 == counter.count()


def test_progress_is_shown_while_the_work_goes_on_and_once_at_its_end() -> None:
    came_twice, count = threading.Event(), 0

    def act() -> None:
        nonlocal count
        count += 1
        if count == 2:
            came_twice.set()

    with repeating(act, every_s=0.001):
        assert came_twice.wait(10)
        ends_with = threading.active_count()
    assert ends_with - 1 == threading.active_count()
    assert count > 2


def test_an_error_ends_the_repetition_and_passes() -> None:
    calls: list[int] = []
    with pytest.raises(ValueError, match="stop"), repeating(lambda: calls.append(1), every_s=60):
        raise ValueError("stop")
    assert [] == calls
