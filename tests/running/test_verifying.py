"""A session that is performed again: equal bit for bit, or the place where it is not."""

import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.faults.sessions import CONFIG, ScriptedOperator, lab
from tests.sessions import opened, perform
from visavis.devices.registry import OPTION_MODELS
from visavis.lab.clock import SimClock
from visavis.lab.config import LabConfig, load_config
from visavis.lab.errors import DataError, SessionAborted, UsageError
from visavis.lab.luminance import LUMINANCE_KEY
from visavis.protocol.session.operator import Action, Command, UnattendedOperator
from visavis.protocol.session.states import SessionState
from visavis.recording.cached import CachedRecording
from visavis.recording.manifest import write_manifest
from visavis.recording.reader import Recording
from visavis.recording.stream_file import Columns
from visavis.results.opened_study import find_study
from visavis.running.sessions.perform import perform_new, perform_rest
from visavis.running.sessions.session_request import simulated_request
from visavis.running.sessions.verification import compare_recordings, verify

SHORT: dict[str, dict[str, Any]] = {
    "stare": {"repetitions": 1, "trial_s": 0.5, "intertrial_s": 0.1, "practice_s": 0.5},
    "crowd": {"configurations": 1, "intertrial_s": 0.5, "limit_s": 3.0},
    "waving": {
        "clerk": ["clerk_left"], "participant_place": ["place_3"], "increment": 0.1,
        "before_s": 0.3, "wave_s": 0.6, "after_s": 0.1, "intertrial_s": 0.1, "blocks": 1,
    },
}  # fmt: skip


class Tampered(CachedRecording):
    """A recording in which one number was changed."""

    def __init__(self, path: Path, stream: str, column: str, row: int, *, part: int = 1) -> None:
        super().__init__(path)
        self._place = stream, column, row
        self._in_part = part

    def stream_arrays(self, name: str, **limits: Any) -> Columns:
        """Return a stream, changed."""
        arrays = dict(super().stream_arrays(name, **limits))
        stream, column, row = self._place
        if name == stream and limits.get("part", 1) in (self._in_part, None):
            arrays[column] = arrays[column].copy()
            arrays[column][row] += 0.25
        return arrays


def every_device(data_root: Path) -> LabConfig:
    return load_config(CONFIG, OPTION_MODELS).model_copy(update={"data_root": data_root})


@pytest.fixture(scope="module")
def duel(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    return perform("duel", tmp_path_factory.mktemp("duel"), repetitions=1, practice=0)


def test_a_fresh_session_is_the_same_bit_for_bit(duel: Recording, tmp_path: Path) -> None:
    verdict = verify(duel, opened("duel"), lab(tmp_path), tmp_path)
    assert verdict.first is None
    assert {} == verdict.differing
    assert {"gaze", "head", "frames", "scene_states", "events", "trial rows"} <= set(
        verdict.row_counts
    )


@pytest.mark.parametrize("study", ["stare", "crowd", "waving"])
def test_a_fresh_session_of_every_study_is_the_same_bit_for_bit(study: str, tmp_path: Path) -> None:
    chosen = find_study(study)
    request = simulated_request(
        chosen,
        chosen.experiment(SHORT[study]),
        every_device(tmp_path / "first"),
        label="S01B",
        index=0,
        seed=3,
    )
    recording = Recording(perform_new(request))
    verdict = verify(recording, chosen, every_device(tmp_path), tmp_path / "again")
    assert verdict.first is None
    assert sum(verdict.row_counts.values()) > 1000


def test_the_first_frame_row_and_column_of_a_change_are_named(duel: Recording) -> None:
    at = int(duel.stream_arrays("head")["t_host_ns"][700])
    difference = compare_recordings(Tampered(duel.path, "head", "position_m", 700), duel).first
    assert difference is not None
    assert ("head", 700, "position_x_m", at) == (
        difference.where,
        difference.row,
        difference.column,
        difference.t_ns,
    )
    frames = duel.stream_arrays("frames")
    here = frames["t_host_ns"] <= at
    assert int(frames["frame_index"][here][-1]) == difference.frame
    assert "head, row 700, position_x_m" in difference.as_sentence()


def test_of_several_changes_the_earliest_is_named(duel: Recording) -> None:
    late = Tampered(duel.path, "gaze", "confidence_01", 900)
    both = Tampered(duel.path, "head", "position_m", 20)
    arrays = late.stream_arrays("gaze")
    both._arrays["gaze", 1] = arrays
    verdict = compare_recordings(both, duel)
    assert verdict.first is not None
    assert "head" == verdict.first.where
    assert {"gaze": 1, "head": 1} == verdict.differing


def test_a_file_that_was_damaged_differs_from_where_its_damage_begins(
    duel: Recording, tmp_path: Path
) -> None:
    folder = tmp_path / "ses-001"
    shutil.copytree(duel.path, folder)
    file = folder / "part-01" / "gaze.arrows"
    file.chmod(0o600)
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)
    difference = compare_recordings(Recording(folder), duel).first
    assert difference is not None
    assert ("gaze", "seq") == (difference.where, difference.column)
    assert difference.row == int(difference.new_value) < int(difference.old_value)


@pytest.mark.parametrize(
    "study",
    ["interpolation", "hybrid", "cameras", "adjectives", "matching", "gestures", "gesture_pairs"],
)
def test_a_fresh_session_on_a_page_is_the_same_bit_for_bit(study: str, tmp_path: Path) -> None:
    chosen = find_study(study)
    request = simulated_request(
        chosen, chosen.experiment({}), lab(tmp_path / "first"), label="S01B", index=0, seed=3
    )
    recording = Recording(perform_new(request))
    verdict = verify(recording, chosen, lab(tmp_path), tmp_path / "again")
    assert verdict.first is None
    assert verdict.row_counts["events"] > 20


class Killed(UnattendedOperator):
    """Nobody; after so many frames the process is gone."""

    def __init__(self, frames: int) -> None:
        self._left = frames

    def poll(self) -> Sequence[Command]:
        """Wait for the end."""
        self._left -= 1
        if not self._left:
            raise KeyboardInterrupt
        return ()


@pytest.fixture(scope="module")
def resumed(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """Return a session of two parts; the first was cut off."""
    folder = tmp_path_factory.mktemp("resumed")
    study = opened("duel")
    experiment = study.experiment({"repetitions": 1, "practice": 0})
    session_request = simulated_request(
        study, experiment, lab(folder), label="S01", index=0, seed=1
    )
    with pytest.raises(SessionAborted):
        perform_new(replace(session_request, operator=Killed(900)))
    path = next(folder.glob("simulated/duel/sub-*/ses-001"))
    return Recording(perform_rest(replace(session_request, clock=SimClock()), path))


def test_a_resumed_session_is_the_same_bit_for_bit_part_by_part(
    resumed: Recording, tmp_path: Path
) -> None:
    assert 2 == len(resumed.manifest.parts)
    verdict = verify(resumed, opened("duel"), lab(tmp_path), tmp_path)
    assert verdict.first is None
    assert (1,) == verdict.ended_early
    assert 0.99 < verdict.row_counts["gaze"] / len(resumed.stream_arrays("gaze")["seq"]) <= 1.0


def test_a_change_in_a_later_part_is_named_with_its_part(
    resumed: Recording, tmp_path: Path
) -> None:
    first = len(resumed.stream_arrays("head", part=1)["seq"])
    changed = Tampered(resumed.path, "head", "position_m", 5, part=2)
    difference = verify(changed, opened("duel"), lab(tmp_path), tmp_path).first
    assert first > 100
    assert difference is not None
    assert (2, "head", 5, "position_x_m") == (
        difference.part,
        difference.where,
        difference.row,
        difference.column,
    )
    assert difference.as_sentence().startswith("part 2, ")


def test_a_resumed_session_is_the_same_whatever_was_measured_of_the_screen_since(
    resumed: Recording, tmp_path: Path
) -> None:
    path = shutil.copytree(resumed.path, tmp_path / "ses-001")
    measured = {**resumed.manifest.configuration, LUMINANCE_KEY: {"sha256": "f" * 64}}
    write_manifest(path, replace(resumed.manifest, configuration=measured))
    again = verify(Recording(path), opened("duel"), lab(tmp_path), tmp_path / "again")
    assert again.first is None


def test_what_an_operator_did_is_done_again(tmp_path: Path) -> None:
    study = opened("duel")
    experiment = study.experiment({"repetitions": 1, "practice": 0})
    session_request = simulated_request(
        study, experiment, lab(tmp_path / "a"), label="S01", index=0, seed=1
    )
    keys = ScriptedOperator(
        (SessionState.TRIAL, 1, 9, Command(Action.REPEAT)),
        (SessionState.TRIAL, 3, 5, Command(Action.NOTE, "yawned")),
        (SessionState.TRIAL, 4, 5, Command(Action.ABORT)),
    )
    with pytest.raises(SessionAborted):
        perform_new(replace(session_request, operator=keys))
    recording = Recording(next((tmp_path / "a").glob("simulated/duel/sub-*/ses-001")))
    assert {"repeat", "note", "abort"} <= {
        e["payload"]["action"] for e in recording.journal(1).events if e["name"] == "operator"
    }
    verdict = verify(recording, study, lab(tmp_path), tmp_path / "again")
    assert verdict.first is None
    assert () == verdict.ended_early


def of_people(recording: Recording) -> Recording:
    """Take a simulated session for one of somebody with real devices."""
    recording.manifest = replace(recording.manifest, is_simulated=False)
    return recording


def test_gaze_of_people_is_evaluated_again_from_what_was_measured(
    duel: Recording, tmp_path: Path
) -> None:
    verdict = verify(of_people(Recording(duel.path)), opened("duel"), lab(tmp_path), tmp_path)
    assert verdict.first is None
    assert verdict.is_fed
    assert {"gaze_targets": len(duel.stream_arrays("gaze_targets")["seq"])} == verdict.row_counts


@pytest.mark.parametrize(
    ("stream", "column"), [("gaze", "direction_head"), ("gaze_targets", "origin_world_m")]
)
def test_a_change_in_what_people_did_is_named_where_their_gaze_fell(
    stream: str, column: str, duel: Recording, tmp_path: Path
) -> None:
    real = of_people(Tampered(duel.path, stream, column, 500))
    difference = verify(real, opened("duel"), lab(tmp_path), tmp_path).first
    assert difference is not None
    seq = duel.stream_arrays("gaze")["seq"][500]
    targets = duel.stream_arrays("gaze_targets")
    row = int(np.flatnonzero(targets["gaze_seq"] == seq)[0]) if stream == "gaze" else 500
    assert ("gaze_targets", row) == (difference.where, difference.row)
    assert int(targets["frame_index"][row]) == difference.frame


def test_people_without_gaze_are_not_performed_again(duel: Recording, tmp_path: Path) -> None:
    without = Without(duel.path)
    with pytest.raises(UsageError, match="recorded with people"):
        verify(of_people(without), opened("duel"), lab(tmp_path), tmp_path)


class Without(Recording):
    """A recording without gaze."""

    @property
    def stream_names(self) -> tuple[str, ...]:
        """Return the streams but those of gaze."""
        return tuple(name for name in super().stream_names if "gaze" not in name)


def in_real_time(recording: Recording) -> Recording:
    """Take a session for one that ran on the machine's clock."""
    manifest = recording.manifest
    parts = (replace(p, started_wall_iso="2026-11-23T09:00:00+01:00") for p in manifest.parts)
    recording.manifest = replace(manifest, parts=tuple(parts))
    return recording


def test_what_was_simulated_in_real_time_is_fed_and_its_plan_compared(
    duel: Recording, tmp_path: Path
) -> None:
    verdict = verify(in_real_time(Recording(duel.path)), opened("duel"), lab(tmp_path), tmp_path)
    assert verdict.is_fed
    assert verdict.first is None
    assert [] == list(tmp_path.iterdir())
    changed = in_real_time(Recording(duel.path))
    changed.manifest = replace(changed.manifest, seed=changed.manifest.seed + 1)
    with pytest.raises(DataError, match="plans another session"):
        verify(changed, opened("duel"), lab(tmp_path), tmp_path)


def test_real_time_without_gaze_says_what_repeats(duel: Recording, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--fast"):
        verify(in_real_time(Without(duel.path)), opened("duel"), lab(tmp_path), tmp_path)


def test_never_more_rows_differ_than_there_are(duel: Recording) -> None:
    class Longer(CachedRecording):
        def stream_arrays(self, name: str, **limits: Any) -> Columns:
            arrays = super().stream_arrays(name, **limits)
            if name != "head":
                return arrays
            return {k: np.concatenate([v, v[-1:] + (v.dtype != bool)]) for k, v in arrays.items()}

    n = len(duel.stream_arrays("head")["seq"])
    for recorded, again in ((duel, Longer(duel.path)), (Longer(duel.path), duel)):
        verdict = compare_recordings(recorded, again)
        assert (1, n + 1) == (verdict.differing["head"], verdict.row_counts["head"])
