"""A crowd session whose process is killed after a walk goes on to its end with `visavis resume`."""

import os
import signal
import subprocess
from pathlib import Path

import pytest

from tests.commands import COMMANDS
from tests.faults.sessions import CONFIG, REPOSITORY
from visavis.experiments.crowd.design import CONDITIONS, HAPTIC
from visavis.recording.folder import study_dir
from visavis.recording.reader import Recording

SHORT_WALKS = "--set=limit_s=12"
"""Long enough to touch some of the crowd, and to learn from it."""
KILLED_AFTER = """
import os, signal, sys
from visavis.recording.writer import Recorder

written, last = Recorder.trial, int(sys.argv.pop(1))

def trial(recorder, row):
    written(recorder, row)
    if recorder._trials == last:
        os.kill(os.getpid(), signal.SIGKILL)

Recorder.trial = trial
from visavis.cli.main import main
main()
"""


def visavis(folder: Path, *arguments: str, kill_after: int = 0) -> subprocess.CompletedProcess[str]:
    """Run the command line; a positive `kill_after` ends the process after so many trial rows."""
    begin = ["-c", KILLED_AFTER, str(kill_after)] if kill_after else ["-m", "visavis.cli.main"]
    return COMMANDS.run(
        *[*begin, *arguments, "--config", str(folder / "lab_config.yaml")],
        cwd=REPOSITORY,
        env={**os.environ, "COLUMNS": "200"},
    )


def killed_session(folder: Path, *settings: str, after: int) -> Path:
    """Simulate one participant until killed after so many walks; return the session's folder."""
    (folder / "lab_config.yaml").write_text(CONFIG.read_text("utf-8"), "utf-8")
    one = ("simulate", "crowd", "--participants", "1", "--processes", "1")
    killed = visavis(folder, *one, "--output", str(folder / "data"), *settings, kill_after=after)
    assert -signal.SIGKILL == killed.returncode, killed.stderr
    study = study_dir(folder / "data", "crowd", is_simulated=True)
    (path,) = study.glob("sub-*/ses-001")
    assert after == len(Recording(path).trials())
    return path


def resumed(folder: Path, path: Path) -> Recording:
    done = visavis(folder, "resume", str(path), "--fast")
    assert 0 == done.returncode, done.stderr
    return Recording(path)


def cautions(recording: Recording) -> list[float]:
    events = recording.events()
    return [
        payload["memory"]["caution"]
        for payload in events.loc[events["name"] == "participant_memory", "payload"]
    ]


def test_a_killed_session_ends_with_every_walk_once_and_with_what_was_learned(
    tmp_path: Path,
) -> None:
    path = killed_session(tmp_path, "--set=configurations=1", SHORT_WALKS, after=3)
    learned = cautions(Recording(path))
    assert 0 < learned[-1]

    recording = resumed(tmp_path, path)

    rows = recording.trials()
    assert "complete" == recording.status
    assert [1, 1, 1, 2] == rows["part"].tolist()
    assert ["Training", *CONDITIONS] == rows["condition"].tolist()
    assert (rows["status"] == "complete").all()
    assert learned == cautions(recording)[:3]
    # nothing vibrates in the last block: it is a little forgotten, and never begun anew
    assert learned[-1] == pytest.approx(cautions(recording)[3], rel=0.15)


@pytest.mark.timeout(600)
def test_all_24_walks_of_a_session_killed_in_its_haptic_block_are_there_once(
    tmp_path: Path,
) -> None:
    path = killed_session(tmp_path, SHORT_WALKS, after=14)
    learned = cautions(Recording(path))

    recording = resumed(tmp_path, path)

    rows = recording.trials()
    walks = rows[~rows["is_practice"].astype(bool)]
    assert "complete" == recording.status
    assert 24 == len(walks) == walks["trial_id"].nunique()
    assert dict.fromkeys(CONDITIONS, 8) == walks["condition"].value_counts().to_dict()
    assert (walks["status"] == "complete").all()
    assert learned == cautions(recording)[:14]
    in_block = cautions(recording)[9:17]
    assert HAPTIC == walks["condition"].iloc[8]
    assert in_block == sorted(in_block)
