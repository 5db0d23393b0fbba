"""What leaves the lab bears pseudonyms and no free text, unless asked otherwise."""

import gzip
import json
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner

from tests.recording.sessions import new_recorder, probe_batch, probe_manifest
from visavis.cli.main import app
from visavis.lab.clock import SimClock
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import UsageError
from visavis.protocol.people.key_file import KeyFile
from visavis.recording.folder import create_session
from visavis.recording.sharing import age_band

LABEL = "07H"
TYPED = "my neighbour Ann Example did it"


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    path = tmp_path / "lab_config.yaml"
    path.write_text(EXAMPLE.read_text("utf-8"), "utf-8")
    return path


@pytest.fixture
def session(lab: Path) -> Path:
    clock = SimClock()
    manifest = replace(probe_manifest(LABEL, is_simulated=False), study="stare")
    with create_session(lab.parent / "data", manifest) as folder:
        recorder = new_recorder(folder, clock, is_simulated=False)
        recorder.append(probe_batch(0, 10))
        answers = (
            ("demographics", "age", "37"),
            ("demographics", "gender", "woman"),
            ("free_comment", "comment", TYPED),
            ("unheard_of", "what", TYPED),
        )
        for name, question, answer in answers:
            recorder.event("answer", 0, questionnaire=name, question=question, answer=answer)
        recorder.event("operator", 0, action="note", text=TYPED)
        recorder.event("who", 0, label=LABEL)
        recorder.trial(
            {
                "participant": LABEL,
                "trial_id": "T1",
                "status": "skipped",
                "reason": TYPED,
                "dwell_ms": 3.5,
            }
        )
        folder.end_part(clock, recorder.close("aborted"), reason=TYPED)
        return folder.path


def export(session: Path, lab: Path, *more: str) -> str:
    """Export in every format; return everything written, names too, as one text."""
    out = lab.parent / "out"
    for name in ("parquet", "bids", "xdf"):
        arguments = ["export", str(session), "--format", name, "-o", str(out / name)]
        done = CliRunner().invoke(app, [*arguments, "--config", str(lab), *more])
        if done.exception is not None and not isinstance(done.exception, SystemExit):
            raise done.exception
        assert 0 == done.exit_code, done.output
    said = []
    for path in sorted(p for p in out.rglob("*") if p.is_file()):
        data = path.read_bytes()
        if path.suffix == ".parquet":
            data = pd.read_parquet(path).to_csv().encode() + data
        said.append(path.name.encode() + (gzip.decompress(data) if path.suffix == ".gz" else data))
    return b"\n".join(said).decode("utf-8", "replace")


def test_people_bear_a_pseudonym_and_free_text_stays_in_the_lab(session: Path, lab: Path) -> None:
    written = export(session, lab)
    pseudonym = KeyFile(lab.parent / "keys", "stare", []).pseudonym(LABEL)
    assert pseudonym in written
    assert LABEL not in written
    assert "neighbour" not in written
    assert '"37"' not in written
    assert "30-39" in written
    assert "woman" in written
    assert "3.5" in written


def test_the_raw_tier_holds_everything_but_the_label(session: Path, lab: Path) -> None:
    written = export(session, lab, "--tier", "raw")
    assert LABEL not in written
    assert TYPED in written
    assert '"37"' in written


def test_the_label_can_be_kept(session: Path, lab: Path) -> None:
    assert f"sub-{LABEL}" in export(session, lab, "--keep-label")


def test_another_tier_is_refused(session: Path, lab: Path) -> None:
    with pytest.raises(UsageError, match="raw, shared or public"):
        export(session, lab, "--tier", "secret")


def test_the_recording_stays_as_it_is(session: Path, lab: Path) -> None:
    before = {p: p.read_bytes() for p in session.rglob("*") if p.is_file()}
    export(session, lab)
    assert before == {p: p.read_bytes() for p in session.rglob("*") if p.is_file()}
    assert LABEL == json.loads(before[session / "manifest.json"])["participant"]


@pytest.mark.parametrize(
    ("age", "band"), [("37", "30-39"), (40, "40-49"), ("9", "0-9"), ("old", None), ("-3", None)]
)
def test_ages_are_bands_of_ten_years(age: object, band: str | None) -> None:
    assert band == age_band(age)
