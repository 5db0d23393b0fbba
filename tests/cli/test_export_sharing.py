"""What leaves the lab bears pseudonyms and no free text, unless asked otherwise."""

import ast
import gzip
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from tests.recording.sessions import new_recorder, probe_batch, probe_manifest
from visavis import cli, devices, experiments, protocol, running, study
from visavis.cli.main import app
from visavis.cli.sharing import losses, names_of_people, shared_recording
from visavis.devices.streams import HEAD, POINTER
from visavis.lab.clock import SimClock, StampClock
from visavis.lab.config import load_config
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import UsageError
from visavis.lab.schema import SampleBatch, empty_values
from visavis.protocol.people.key_file import KeyFile
from visavis.recording.folder import create_session
from visavis.recording.privacy_sheet import privacy_sheet
from visavis.recording.sealed import write_sealed
from visavis.recording.session_times import session_times
from visavis.recording.sharing import (
    EVENT_CLASSES,
    SharedRecording,
    Sharing,
    age_band,
    class_of_field,
)
from visavis.running.sessions.study_folder import SETTINGS_NAME, StudySettings

LABEL = "07H"
PARTS = tuple(
    Path(found.__file__).parent for found in (devices, experiments, protocol, cli, running, study)
)
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


@pytest.mark.parametrize(
    ("question", "given", "leaves"),
    [
        ("birth_year", 1988.0, "1980-1989"),
        ("year_of_birth", "1988", "1980-1989"),
        ("age_years", 37, "30-39"),
        ("date_of_birth", "1988-04-03", None),
        ("stage", "second", "second"),
    ],
)
def test_years_of_birth_are_decades_too(
    question: str, given: object, leaves: object, lab: Path
) -> None:
    clock = SimClock()
    with create_session(lab.parent / "data", probe_manifest(LABEL, is_simulated=False)) as folder:
        recorder = new_recorder(folder, clock, is_simulated=False)
        recorder.trial({"participant": LABEL, "trial_id": "T1", question: given})
        folder.end_part(clock, recorder.close("complete"))
    sharing = Sharing("x", "shared", lambda form, question: False, lambda name, value: True)
    shown = SharedRecording(folder.path, sharing).trials()[question].tolist()
    assert [leaves] == shown


OWN = """
from visavis import Choice, Factor, Number, Scene, Study, Text

study = Study("own", factors=[Factor("level", ["one"])], uses=[], calibrate=False)


@study.trial
def trial(t):
    yield t.show(Scene("person"), seconds=0.2)
    yield t.ask(Choice("side", ["left", "right"]))
    yield t.ask(Number("age"))
    yield t.ask(Text("who"))
"""
OWN_DESIGN = {
    "design": {
        "questions": {
            "side": {"kind": "Choice", "options": ["left", "right"]},
            "age": {"kind": "Number", "options": []},
            "who": {"kind": "Text", "options": []},
        }
    }
}


@pytest.fixture(params=["found", "by its design alone", "unheard of"])
def own_session(lab: Path, request: pytest.FixtureRequest) -> Path:
    """Return a session of a study in a file: at its place, gone, and of a time without designs."""
    clock, has_design = SimClock(), request.param != "unheard of"
    configuration = OWN_DESIGN if has_design else {}
    manifest = replace(probe_manifest(LABEL, is_simulated=False), study="own")
    manifest = replace(manifest, configuration=configuration, configuration_sha256="")
    with create_session(lab.parent / "data", manifest) as folder:
        recorder = new_recorder(folder, clock, is_simulated=False)
        recorder.append(probe_batch(0, 10))
        given = {"side": "left", "age": 37.0, "who": TYPED}
        for question, answer in given.items():
            answered = {"trial_id": "T1", "question": question, "answer": answer}
            recorder.event("answered", 0, **answered)
            page = {"about": {"user_agent": "Zilla"}, "reply": {"answers": {question: answer}}}
            recorder.event("page_event", 0, kind="reply", tab="tab-of-Ann", **page)
        recorder.event("answer", 0, questionnaire="of_the_lab", question="name", answer=TYPED)
        recorder.event("noticed", 0, what=TYPED)
        row = {"participant": LABEL, "trial_id": "T1", "status": "complete", "frames": 77123}
        typed = {"age_typed": f"37, {TYPED}", "level_01": TYPED, "who_by": "keyboard"}
        recorder.trial({**row, **given, **typed})
        folder.end_part(clock, recorder.close("complete"), reason=TYPED)
    study = lab.parent / "own.py"
    if request.param == "found":
        study.write_text(OWN, "utf-8")
        lines = lab.read_text("utf-8") + f"\nstudies:\n  own: {study}\n"
        lab.write_text(lines, "utf-8")
    return folder.path


def test_nothing_leaves_of_which_nobody_can_say_what_it_is(
    own_session: Path, lab: Path, request: pytest.FixtureRequest
) -> None:
    public = shared_recording(own_session, load_config(lab), tier="public", keep_label=False)
    blurred = public.trials().to_csv() + public.events().to_csv()
    for written in (blurred, export(own_session, lab)):
        assert "neighbour" not in written
        assert "Zilla" not in written
        assert "tab-of-Ann" not in written
        assert "37.0" not in written
        assert "77123" in written
        assert ("30-39" in written) is ("unheard" not in request.node.callspec.id)


def test_what_is_withheld_is_named(
    own_session: Path, lab: Path, request: pytest.FixtureRequest
) -> None:
    arguments = ["export", str(own_session), "-o", str(lab.parent / "o"), "--config", str(lab)]
    said = " ".join(CliRunner().invoke(app, arguments).output.split())
    assert "withheld, as free text or because nothing says what it is:" in said
    assert "column level_01" in said
    assert ("the study own cannot be read" in said) is ("[found" not in request.node.name)


def calls_that_record(folder: Path) -> Iterator[tuple[str, str, set[str]]]:
    """Yield where an event of a constant name is made in a folder's code, its name and fields."""
    for file in sorted(folder.rglob("*.py")):
        for call in ast.walk(ast.parse(file.read_text("utf-8"))):
            if not isinstance(call, ast.Call) or not call.args:
                continue
            name = getattr(call.func, "attr", getattr(call.func, "id", ""))
            first = call.args[0]
            if name not in ("event", "Event", "Mark") or not isinstance(first, ast.Constant):
                continue
            fields = {k.arg for k in call.keywords if k.arg}
            for argument in call.args[1:]:
                if isinstance(argument, ast.Dict):
                    fields |= {k.value for k in argument.keys if isinstance(k, ast.Constant)}
            yield f"{file.name}:{call.lineno}", str(first.value), {str(f) for f in fields}


def test_every_event_that_our_code_records_has_a_class() -> None:
    made = [c for part in PARTS for c in calls_that_record(part) if c[1] != "trial"]
    assert len(made) > 40
    assert [] == [(place, name) for place, name, _ in made if name not in EVENT_CLASSES]
    unclassed = [
        (place, name, field)
        for place, name, fields in made
        for field in sorted(fields)
        if not class_of_field(name, field)
    ]
    assert [] == unclassed


def dry_run(session: Path, lab: Path, tier: str) -> str:
    arguments = ["export", str(session), "--dry-run", "--tier", tier, "--config", str(lab)]
    done = CliRunner().invoke(app, [*arguments, "-o", str(lab.parent / "nothing")])
    assert done.exception is None, done.exception
    assert not (lab.parent / "nothing").exists()
    return " ".join(done.output.split())


def test_a_privacy_sheet_lists_what_leaves_and_writes_nothing(session: Path, lab: Path) -> None:
    sheet = dry_run(session, lab, "shared")
    for line in ("trials dwell_ms public 1 3.5", "event answer answer answer 2 30-39 | woman"):
        assert line in sheet
    assert "neighbour" not in sheet
    assert "no e-mail address" in sheet
    assert "age 30-39, gender woman: 1" in sheet


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("write to ann@example.org please", "an e-mail address"),
        ("call 0049 (30) 901820 or", "a telephone number"),
        ("+44 20 7946 0958", "a telephone number"),
        ("I am ann Example", "a name of the ledger"),
        ("ANN EXAMPLE", "a name of the ledger"),
        ("ann (at) example.org", "an e-mail address"),
        ("(415) 555-2671", "a telephone number"),
        ("415-555-2671", "a telephone number"),
        ("030.90 18 20", "a telephone number"),
        ("06 12 34 56 78", "a telephone number"),
        ("+33 6 12 34 56 78", "a telephone number"),
        ("01511234567", "a telephone number"),
        ("I am 28, 1.75 m, and saw 2026 of 3000", ""),
        ("01/02/2026 10", ""),
        ("2026-11-28", ""),
        ("0.12345678", ""),
        ("0 1 0 1 1 0 1 0 1", ""),
        ("00 10 20 30 40 50", ""),
        ("0-10, 10-20", ""),
        ("192.168.178.200", ""),
        ("00000012345", ""),
        ("1280 x 1024 of 1234567", ""),
    ],
)
def test_what_tells_who_somebody_is_is_found_also_where_a_lab_asked_for_it(
    session: Path, lab: Path, text: str, what: str
) -> None:
    key_file = KeyFile(lab.parent / "keys", "stare", [])
    key_file.identify(LABEL, {"name": "Ann Example", "contact": "ann@example.org"})
    sharing = Sharing(LABEL, "raw", lambda form, question: False)
    recording = SharedRecording(session, sharing)
    names = names_of_people([recording], load_config(lab))
    events = recording.events().iloc[:1]
    noted = events.assign(name="answer", payload=[{"answer": text}])
    recording.events = lambda: noted  # type: ignore[method-assign]  # one text alone
    recording.trials = lambda: pd.DataFrame()  # type: ignore[method-assign]  # and no rows
    findings = privacy_sheet([recording], names).findings
    assert bool(what) == bool(findings)
    assert all(what in finding for finding in findings[:1])


def test_labels_that_are_meant_to_be_there_are_no_alarm(session: Path, lab: Path) -> None:
    for keep_label, is_alarm in ((True, False), (False, True)):
        recording = shared_recording(session, load_config(lab), tier="raw", keep_label=keep_label)
        names = names_of_people([recording], load_config(lab))
        assert (LABEL in names) is is_alarm


def test_the_sheet_shows_values_of_streams_and_what_is_said_of_session_and_devices(
    session: Path, lab: Path
) -> None:
    sheet = dry_run(session, lab, "shared")
    assert "stream probe angle_deg stream 10 nan | 1.33333 | 3" in sheet
    assert "stream probe position_m stream 10 0.25 0.5 0.75 |" in sheet
    assert "session study public 1 stare" in sheet


def people_who_answered(
    lab: Path, answers: Sequence[tuple[str, str, str]], group: str = ""
) -> list[SharedRecording]:
    """Return sessions of people, each of whom gives one answer: questionnaire, question, answer."""
    recordings = []
    for number, (name, question, answer) in enumerate(answers, 1):
        manifest = replace(probe_manifest(f"{number:02d}A", is_simulated=True), study="stare")
        clock = SimClock()
        with create_session(lab.parent / "data", manifest) as folder:
            recorder = new_recorder(folder, clock)
            recorder.event("answer", 0, questionnaire=name, question=question, answer=answer)
            for trial in ("T1", "T2"):
                recorder.trial({"trial_id": trial, "status": "complete", "group": group})
            folder.end_part(clock, recorder.close("complete"))
        sharing = Sharing(manifest.participant, "raw", lambda form, question: False)
        recordings.append(SharedRecording(folder.path, sharing))
    return recordings


def test_rare_answers_are_named_whatever_asked_for_them(lab: Path) -> None:
    answers = [*[("about_you", "hand", "right")] * 5, ("about_you", "hand", "both")]
    assert ("about_you hand: both 1",) == privacy_sheet(people_who_answered(lab, answers)).rare


def test_what_every_person_has_and_an_empty_group_are_not_rare(lab: Path) -> None:
    answers = [("about_you", "hand", "right")] * 3
    assert () == privacy_sheet(people_who_answered(lab, answers)).rare


def test_a_raw_export_says_that_it_names_somebody(session: Path, lab: Path) -> None:
    KeyFile(lab.parent / "keys", "stare", []).identify(LABEL, {"name": "Ann Example"})
    assert "holds a name of the ledger or key file" in dry_run(session, lab, "raw")
    assert "holds a name" not in dry_run(session, lab, "public")


def test_a_pseudonym_of_digits_is_no_telephone_number(session: Path) -> None:
    sharing = Sharing("095795668203", "raw", lambda form, question: False)
    findings = " ".join(privacy_sheet([SharedRecording(session, sharing)]).findings)
    assert "telephone number: '095795668203'" not in findings


def test_a_label_that_is_a_telephone_number_is_one(lab: Path) -> None:
    label = "095795668203"
    manifest = replace(probe_manifest(label, is_simulated=False), study="stare")
    clock = SimClock()
    with create_session(lab.parent / "data", manifest) as folder:
        folder.end_part(clock, new_recorder(folder, clock, is_simulated=False).close("complete"))
    shared = SharedRecording(folder.path, Sharing(label, "raw", lambda form, question: False))
    assert "holds a telephone number" in " ".join(privacy_sheet([shared]).findings)


@pytest.mark.parametrize("came_ns", [1_800_000_000 * 10**9, 14 * 3600 * 10**9])
def test_times_tell_neither_a_day_nor_who_came_first(came_ns: int, lab: Path) -> None:
    """Those of an imported session count from 1970, others from the computer's start."""
    clock = StampClock(came_ns / 10**6)
    manifest = replace(probe_manifest(LABEL, is_simulated=False), study="stare")
    with create_session(lab.parent / "data", manifest) as folder:
        recorder = new_recorder(folder, clock, is_simulated=False)
        recorder.event("trial_start", came_ns, trial_id="T1", attempt=1)
        recorder.append(replace(probe_batch(0, 10), t_host_ns=probe_batch(0, 10).seq + came_ns))
        row = {"participant": LABEL, "trial_id": "T1", "status": "complete"}
        recorder.trial({**row, "t_start_ns": came_ns + 5, "t_end_ns": came_ns + 7})
        folder.end_part(clock, recorder.close("complete"))
    as_recorded, shared = (
        shared_recording(folder.path, load_config(lab), tier=tier, keep_label=False)
        for tier in ("raw", "shared")
    )
    assert [[5, 7]] == shared.trials()[["t_start_ns", "t_end_ns"]].to_numpy().tolist()
    assert 0 == shared.events()["t_ns"].iloc[0]
    assert list(range(10)) == shared.stream("probe")["t_host_ns"].tolist()
    assert () == privacy_sheet([shared]).findings
    tells_day = "tells the day" in " ".join(privacy_sheet([as_recorded]).findings)
    assert tells_day is (came_ns > 10**18)


def test_each_part_and_each_device_has_a_clock_that_begins_with_it(lab: Path) -> None:
    """A device that was on for days would tell the order of sessions as well."""
    device_ns, starts_ns = 94_000 * 10**9, (10**13, 7 * 10**11)
    manifest = replace(probe_manifest(LABEL, is_simulated=False), study="stare")
    with create_session(lab.parent / "data", manifest) as folder:
        for start_ns in starts_ns:
            clock = StampClock(start_ns / 10**6)
            recorder = new_recorder(folder, clock, is_simulated=False)
            batch = probe_batch(0, 10)
            host_ns = batch.seq + start_ns
            times = {"t_host_ns": host_ns, "t_device_ns": batch.seq + device_ns}
            recorder.append(replace(batch, **times))
            rows = [[start_ns, device_ns + 3, start_ns + 6]]
            recorder.event("clock_exchanges", start_ns, role="probe", send_device_receive_ns=rows)
            folder.end_part(clock, recorder.close("complete"))
    shared = shared_recording(folder.path, load_config(lab), tier="shared", keep_label=False)
    stream = shared.stream("probe")
    assert [*range(10)] * 2 == stream["t_host_ns"].tolist()
    assert [*range(10)] * 2 == stream["t_device_ns"].tolist()
    exchanges = [p["send_device_receive_ns"] for p in shared.events()["payload"]]
    assert [[[0, 3, 6]]] * 2 == exchanges
    assert [0, 0] == shared.events()["t_ns"].tolist()


def test_streams_of_a_page_keep_the_one_clock_that_dates_them(lab: Path) -> None:
    start_ns, page_ns = 10**13, 5 * 10**12
    manifest = replace(
        probe_manifest(LABEL, is_simulated=False), study="stare", configuration={"on": "browser"}
    )
    with create_session(lab.parent / "data", manifest) as folder:
        clock = StampClock(start_ns / 10**6)
        recorder = new_recorder(folder, clock, is_simulated=False)
        for schema, begins_ns in ((HEAD, 0), (POINTER, 700 * 10**6)):
            recorder.declare(schema)
            seq = np.arange(10)
            at_ns = seq * 10**7 + begins_ns
            values = empty_values(schema, 10)
            recorder.append(SampleBatch(schema, seq, page_ns + at_ns, start_ns + at_ns, values))
        rows = [[start_ns, page_ns, start_ns]]
        recorder.event("clock_exchanges", start_ns, role="page", send_device_receive_ns=rows)
        folder.end_part(clock, recorder.close("complete"))
    shared = shared_recording(folder.path, load_config(lab), tier="shared", keep_label=False)
    for stream, begins_ns in (("head", 0), ("pointer", 700 * 10**6)):
        dated_ns = session_times(shared, stream, 1).t_ns
        assert [begins_ns + i * 10**7 for i in range(10)] == dated_ns.tolist()


def test_who_left_before_the_first_trial_stops_no_public_export(lab: Path) -> None:
    clock = SimClock()
    manifest = replace(probe_manifest(LABEL, is_simulated=False), study="stare")
    with create_session(lab.parent / "data", manifest) as folder:
        recorder = new_recorder(folder, clock, is_simulated=False)
        folder.end_part(clock, recorder.close("aborted"))
    config = load_config(lab)
    public = shared_recording(folder.path, config, tier="public", keep_label=False)
    assert losses([public], config).empty


@pytest.mark.parametrize("keep_label", [True, False])
def test_a_place_in_the_order_does_not_undo_the_pseudonym(keep_label: bool, lab: Path) -> None:
    clock = SimClock()
    manifest = replace(probe_manifest(LABEL, is_simulated=False), study="stare")
    with create_session(lab.parent / "data", manifest) as folder:
        recorder = new_recorder(folder, clock, is_simulated=False)
        row = {"participant": LABEL, "trial_id": "T1", "status": "complete"}
        recorder.trial({**row, "participant_index": 6})
        folder.end_part(clock, recorder.close("complete"))
    config = load_config(lab)
    shared = shared_recording(folder.path, config, tier="shared", keep_label=keep_label)
    assert ([6] if keep_label else [None]) == shared.trials()["participant_index"].tolist()


@pytest.mark.parametrize("event", ["session_end", "pause_start", "full", "films_loaded"])
def test_what_nobody_declared_does_not_leave_with_an_event_of_ours(event: str) -> None:
    """A browser says what it loaded, in its own words; the others have no fields at all."""
    assert event in EVENT_CLASSES
    assert class_of_field(event, "what_a_browser_wrote") in ("", "private")


@pytest.mark.parametrize(("tier", "n_sessions"), [("shared", 1), ("public", 1), ("raw", 2)])
def test_who_gave_nothing_is_named_and_leaves_in_the_tier_raw_alone(
    tier: str, n_sessions: int, session: Path, lab: Path
) -> None:
    clock = SimClock()
    manifest = replace(probe_manifest("08J", is_simulated=False), study="stare")
    with create_session(lab.parent / "data", manifest) as folder:
        recorder = new_recorder(folder, clock, is_simulated=False)
        recorder.event("consent", 0, version="1", agreed=False)
        folder.end_part(clock, recorder.close("aborted"))
    study = session.parents[1]
    write_sealed(study / SETTINGS_NAME, asdict(StudySettings("stare", 1, is_simulated=False)))
    arguments = ["export", str(study), "--dry-run", "--tier", tier]
    done = CliRunner().invoke(app, [*arguments, "--config", str(lab)])
    assert done.exception is None, done.exception
    sheet = " ".join(done.output.split())
    assert f"session session public {n_sessions} 1" in sheet
    named = "left out: 1 session; holds neither trial nor answer (declined): sub-08J/ses-001"
    assert (named in sheet) is (tier != "raw")


def test_who_wants_their_data_deleted_leaves_in_no_tier(session: Path, lab: Path) -> None:
    clock = SimClock()
    manifest = replace(probe_manifest("08J", is_simulated=False), study="stare")
    with create_session(lab.parent / "data", manifest) as folder:
        recorder = new_recorder(folder, clock, is_simulated=False)
        recorder.trial({"participant": "08J", "trial_id": "T1", "status": "complete"})
        recorder.event("stopped", 0, keep=False)
        folder.end_part(clock, recorder.close("aborted"))
    for tier in ("raw", "shared", "public"):
        arguments = ["export", str(folder.path), "--dry-run", "--tier", tier]
        done = CliRunner().invoke(app, [*arguments, "--config", str(lab)])
        assert 0 != done.exit_code
        assert "wanted their data deleted" in str(done.exception)
