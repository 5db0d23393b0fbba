"""A session that is performed again: equal bit for bit, or the place where it is not."""

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from devices.registry import OPTION_MODELS
from lab.config import LabConfig, load_config
from lab.errors import UsageError
from recording.kept import KeptRecording
from recording.reader import Recording
from recording.stream_file import Columns
from tests.faults.sessions import CONFIG, lab
from tests.visavis.sessions import opened, perform
from visavis.catalogue import find_study
from visavis.sessions.perform import perform_new, simulated_request
from visavis.sessions.verifying import compared, verify

SHORT: dict[str, dict[str, Any]] = {
    "stare": {"repetitions": 1, "trial_s": 0.5, "intertrial_s": 0.1, "practice_s": 0.5},
    "crowd": {"configurations": 1, "intertrial_s": 0.5, "limit_s": 3.0},
    "waving": {
        "clerk": ["clerk_left"], "increment": 0.1, "before_s": 0.3, "wave_s": 0.6,
        "after_s": 0.1, "intertrial_s": 0.1, "blocks": 1,
    },
}  # fmt: skip


class Tampered(KeptRecording):
    """A recording in which one number was changed."""

    def __init__(self, path: Path, stream: str, column: str, row: int) -> None:
        super().__init__(path)
        self._place = stream, column, row

    def stream_arrays(self, name: str, **limits: Any) -> Columns:
        """Return a stream, changed."""
        arrays = dict(super().stream_arrays(name, **limits))
        stream, column, row = self._place
        if name == stream:
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
        verdict.compared
    )


@pytest.mark.slow
@pytest.mark.parametrize("study", ["stare", "crowd", "waving"])
def test_a_fresh_session_of_every_study_is_the_same_bit_for_bit(study: str, tmp_path: Path) -> None:
    chosen = find_study(study)
    request = simulated_request(
        chosen, chosen.experiment(SHORT[study]), every_device(tmp_path / "first"), label="S01B",
        index=0, seed=3,
    )  # fmt: skip
    recording = Recording(perform_new(request))
    verdict = verify(recording, chosen, every_device(tmp_path), tmp_path / "again")
    assert verdict.first is None
    assert sum(verdict.compared.values()) > 1000


def test_the_first_frame_row_and_column_of_a_change_are_named(duel: Recording) -> None:
    at = int(duel.stream_arrays("head")["t_host_ns"][700])
    found = compared(Tampered(duel.path, "head", "position_m", 700), duel).first
    assert found is not None
    assert ("head", 700, "position_x_m", at) == (found.where, found.row, found.column, found.t_ns)
    frames = duel.stream_arrays("frames")
    here = frames["t_host_ns"] <= at
    assert int(frames["frame_index"][here][-1]) == found.frame
    assert "head, row 700, position_x_m" in found.told()


def test_of_several_changes_the_earliest_is_named(duel: Recording) -> None:
    late = Tampered(duel.path, "gaze", "confidence_01", 900)
    both = Tampered(duel.path, "head", "position_m", 20)
    arrays = late.stream_arrays("gaze")
    both._arrays["gaze", None] = arrays
    verdict = compared(both, duel)
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
    found = compared(Recording(folder), duel).first
    assert found is not None
    assert ("gaze", "seq") == (found.where, found.column)
    assert found.row == int(found.again) < int(found.recorded)


def test_people_are_not_performed_again(duel: Recording, tmp_path: Path) -> None:
    real = Recording(duel.path)
    real.manifest = replace(real.manifest, is_simulated=False)
    with pytest.raises(UsageError, match="recorded with people"):
        verify(real, opened("duel"), lab(tmp_path), tmp_path)
