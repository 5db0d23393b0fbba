"""A disk that lost or reordered what was not synced still holds every acknowledged trial."""

from pathlib import Path

import numpy as np

from benchmarks.power_loss import Outcome, Step, measure, replay


def test_no_acknowledged_trial_is_lost_when_the_power_fails(tmp_path: Path) -> None:
    found = measure(40, 1, tmp_path)
    assert Outcome(cuts=40, trials=found.trials) == found
    assert 400 < found.trials < 1200


def test_the_model_keeps_what_was_synced_and_loses_of_the_rest() -> None:
    path = Path("file")
    log = [Step("write", path, b"a" * 600), Step("sync", path), Step("write", path, b"b" * 6000)]
    left = [replay(log, 3, np.random.default_rng(s))[path] for s in range(30)]
    assert all(data.startswith(b"a" * 600) for data in left)
    assert {True, False} == {data.endswith(b"b") for data in left}
    assert any(b"\0b" in data for data in left)
    assert b"" == replay(log, 0, np.random.default_rng(1)).get(path, b"")
