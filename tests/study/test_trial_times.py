"""What the columns of a trial's times and frames say is what they hold."""

import pytest

from tests.sessions import perform
from visavis.lab.clock import NS_PER_MS
from visavis.protocol.plan.columns import DELIVERY_COLUMNS
from visavis.recording.reader import Recording
from visavis.results.tables.dictionary import scene_column
from visavis.study.frames import DRAIN_MS

SAID = {c.name: c.description for c in DELIVERY_COLUMNS}


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    return perform("greeting", tmp_path_factory.mktemp("times"), repetitions=1, practice=0)


def test_a_trial_is_measured_from_its_first_scene_after_the_event_that_begins_it(
    session: Recording,
) -> None:
    assert "first scene on display" in SAID["t_start_ns"]
    assert "trial_start" in SAID["t_start_ns"]
    begun = session.events_named("trial_start", 1)["t_ns"].tolist()
    rows = session.trials()
    assert rows["scene_on_ns"].tolist() == rows["t_start_ns"].tolist()
    for begun_ns, row in zip(begun, rows.to_dict("records"), strict=True):
        assert 500 * NS_PER_MS <= row["t_start_ns"] - begun_ns  # t.dark(0.5)


def test_frames_are_counted_from_the_event_and_those_of_a_scene_to_its_last_samples(
    session: Recording,
) -> None:
    assert "trial_start" in SAID["frames"]
    said = scene_column("scene_frames")
    assert said is not None
    assert "waited for" in said.description
    frames = session.stream_arrays("frames")
    begun = session.events_named("trial_start", 1)["t_ns"].tolist()
    for begun_ns, row in zip(begun, session.trials().to_dict("records"), strict=True):
        t_ns = frames["t_host_ns"][frames["trial_number"] == row["number"]]
        assert t_ns[0] >= begun_ns
        assert abs(len(t_ns) - row["frames"]) <= 1
        on, off = row["scene_on_ns"], row["scene_off_ns"]
        inside = int(((t_ns >= on) & (t_ns < off)).sum())
        waited = int(((t_ns >= off) & (t_ns <= off + DRAIN_MS * NS_PER_MS)).sum())
        assert inside < row["scene_frames"] <= inside + waited
