"""Recordings are for their owner alone, or for a group that was given the folder."""

import os
import shutil
import stat
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.analysis.gaze.test_import import vive_text
from tests.recording.sessions import record_session
from visavis.analysis.gaze.bids import write_bids
from visavis.analysis.gaze.import_report import read_gaze, report
from visavis.cli.main import app
from visavis.devices.wirelog import ReplayLink, TeeLink
from visavis.lab.clock import SimClock
from visavis.lab.errors import RecordingError
from visavis.protocol.people.ledger import Ledger
from visavis.recording.durable import make_folder, protect, share_with_group
from visavis.recording.sealed import write_sealed

WIRES = Path(__file__).parents[1] / "wire"
pytestmark = pytest.mark.skipif(os.name == "nt", reason="access is inherited there")


def others_may(root: Path) -> list[str]:
    """Return what others may do anything with, the root's parents apart."""
    return [
        f"{p.relative_to(root)} {stat.S_IMODE(p.stat().st_mode):o}"
        for p in [root, *root.rglob("*")]
        if p.stat().st_mode & 0o007
    ]


def modes(root: Path) -> set[str]:
    return {f"{stat.S_IMODE(p.stat().st_mode):o}" for p in root.rglob("*")}


@pytest.fixture(autouse=True)
def _usual_umask():
    before = os.umask(0o022)
    yield
    os.umask(before)


def test_nobody_else_can_read_what_is_recorded(tmp_path: Path) -> None:
    root = tmp_path / "data"
    study = root / "simulated" / "probe"
    label = Ledger(study, SimClock(), prefix="S").add().label
    record_session(root, participant=label)
    write_sealed(study / "study.json", {"study": "probe"})
    assert [] == others_may(root)
    assert {"700", "600", "400"} == modes(root)


def test_a_shared_folder_hands_on_its_group_and_keeps_others_out(tmp_path: Path) -> None:
    root = tmp_path / "data"
    make_folder(root)
    share_with_group(root, tmp_path.group())
    share_with_group(root, tmp_path.group())
    label = Ledger(root / "simulated" / "probe", SimClock(), prefix="S").add().label
    record_session(root, participant=label)
    assert [] == others_may(root)
    assert {"2770", "660", "440"} == modes(root)


def test_a_group_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"nosuchgroup.*privacy\.group"):
        share_with_group(tmp_path, "nosuchgroup")


def test_tables_and_figures_are_protected_afterwards(tmp_path: Path) -> None:
    make_folder(tmp_path / "derived")
    (tmp_path / "derived" / "figures").mkdir()
    (tmp_path / "derived" / "figures" / "a.svg").write_text("x")
    protect(tmp_path / "derived")
    assert [] == others_may(tmp_path / "derived")
    shutil.rmtree(tmp_path / "derived")


def test_what_is_made_of_gaze_from_elsewhere_is_private(tmp_path: Path) -> None:
    file = tmp_path / "v.csv"
    file.write_text(vive_text(n=200))
    gaze = read_gaze(file, "vive")
    report(gaze, tmp_path / "imported" / "one")
    write_bids(gaze, tmp_path / "bids", subject="1", task="look")
    for folder in ("imported", "bids"):
        assert [] == others_may(tmp_path / folder)
        assert {"700", "600"} == modes(tmp_path / folder)


def test_the_answer_of_stats_holds_peoples_rows_and_is_private(tmp_path: Path) -> None:
    table = tmp_path / "table.csv"
    rows = [f"{n},{c},{v}" for n in range(5) for c, v in (("A", n + 1.5), ("B", 2.0 * n))]
    table.write_text("participant,condition,dwell_ms\n" + "\n".join(rows) + "\n")
    asked = ["--dv", "dwell_ms", "--within", "condition", "--subject", "participant"]
    out = tmp_path / "out"
    told = CliRunner().invoke(
        app, ["stats", str(table), "--test", "paired", *asked, "--output", str(out)]
    )
    assert 0 == told.exit_code, told.output
    assert (out / "tested.csv").exists()
    assert [] == others_may(out)


def test_what_crosses_a_wire_is_kept_privately(tmp_path: Path) -> None:
    wire = tmp_path / "eyes.wire"
    played = ReplayLink(WIRES / "neosensory_buzz.wire", SimClock())
    log = TeeLink(played, wire, SimClock())
    log.open(1.0)
    log.end()
    assert 0o600 == stat.S_IMODE(wire.stat().st_mode)
