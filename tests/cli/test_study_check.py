"""Every changed byte of a study's folder is named, and what has an intact copy comes back."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.recording.sessions import record_session
from tests.sessions import perform
from visavis.cli.main import app
from visavis.lab.clock import SimClock
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import DataError, UsageError
from visavis.protocol.people.ledger import Ledger
from visavis.protocol.people.own_body import OwnBody, write_own_body
from visavis.recording.annotations import ANNOTATIONS_NAME, Annotation, place_annotations
from visavis.recording.manifest import read_manifest, write_manifest
from visavis.running.sessions.folder_check import repair_study, study_problems
from visavis.running.sessions.study_folder import (
    StudySettings,
    read_settings,
    sessions_of,
    settle,
)


@pytest.fixture
def study(tmp_path: Path) -> Path:
    folder = tmp_path / "simulated" / "probe"
    settle(folder, StudySettings("probe", 5, True, parameters={"trial_s": 8}), seed_given=True)
    ledger = Ledger(folder, SimClock(), prefix="S")
    for _ in range(4):
        ledger.add()
    for person in ("S01B", "S02C"):
        record_session(tmp_path, 2, participant=person)
        write_own_body(folder / f"sub-{person}", OwnBody("female", 1.7))
    return folder


def test_a_session_in_the_place_of_its_study_is_told_which_folder_is_meant(study: Path) -> None:
    session = study / "sub-S01B" / "ses-001"
    with pytest.raises(UsageError, match=rf"did you mean {study}, the study that it lies in\?$"):
        sessions_of(session)
    with pytest.raises(UsageError, match=rf"did you mean {study}, "):
        sessions_of(session.parent)


def files(study: Path) -> list[Path]:
    return [p for p in sorted(study.rglob("*")) if p.is_file() and p.stat().st_size]


def put(path: Path, data: bytes) -> None:
    path.chmod(0o644)
    path.write_bytes(data)


def test_an_intact_study_has_no_problems(study: Path) -> None:
    assert () == study_problems(study)
    checked = CliRunner().invoke(app, ["check", str(study)])
    assert 0 == checked.exit_code, checked.output
    assert "2 sessions, every file verified" in checked.output


def test_every_flipped_bit_is_named(study: Path) -> None:
    rng = np.random.default_rng(3)
    everything = files(study)
    for _ in range(300):
        path = everything[int(rng.integers(len(everything)))]
        data = path.read_bytes()
        at, bit = int(rng.integers(len(data))), 1 << int(rng.integers(8))
        put(path, data[:at] + bytes([data[at] ^ bit]) + data[at + 1 :])
        assert study_problems(study), f"{path.name}: bit {bit} of byte {at}"
        put(path, data)


def test_every_cut_and_every_swap_of_files_is_named(study: Path) -> None:
    everything = files(study)
    rng = np.random.default_rng(4)
    for path in everything:
        data = path.read_bytes()
        for cut in (0, *rng.integers(1, len(data), 4).tolist()):
            put(path, data[:cut])
            assert study_problems(study), f"{path.name} cut to {cut} bytes"
        put(path, data)
        same_kind = [p for p in everything if p.name == path.name and p != path]
        for other in same_kind:
            theirs = other.read_bytes()
            if theirs == data:
                continue
            put(path, theirs)
            put(other, data)
            assert study_problems(study), f"{path} swapped with {other}"
            put(path, data)
            put(other, theirs)


@pytest.mark.parametrize(
    "name",
    [
        "study.json",
        "participants.jsonl",
        "sub-S01B/own_body.json",
        "sub-S01B/ses-001/manifest.json",
    ],
)
def test_recover_puts_damaged_files_back(study: Path, name: str) -> None:
    path = study / name
    data = path.read_bytes()
    put(path, data[:50] + b"#" + data[51:])

    checked = CliRunner().invoke(app, ["check", str(study)])
    assert 5 == checked.exit_code
    assert "visavis recover" in checked.output
    done = CliRunner().invoke(app, ["recover", str(study)])

    assert 0 == done.exit_code, done.output
    assert "put back from its copy" in done.output
    assert data == path.read_bytes()
    assert () == study_problems(study)


@pytest.mark.parametrize("name", ["study.copy.json", "sub-S01B/own_body.copy.json"])
def test_recover_renews_a_damaged_copy_and_leaves_the_original(study: Path, name: str) -> None:
    path = study / name
    data = path.read_bytes()
    put(path, b"{}")
    assert (f"{path} was renewed",) == repair_study(study)
    assert data == path.read_bytes()
    assert () == study_problems(study)


def test_damaged_settings_are_not_taken(study: Path) -> None:
    path = study / "study.json"
    put(path, path.read_bytes().replace(b'"seed": 5', b'"seed": 4'))
    with pytest.raises(DataError, match=r"checksum disagrees.*visavis recover"):
        read_settings(study)
    repair_study(study)
    settings = read_settings(study)
    assert settings is not None
    assert 5 == settings.seed


def test_settings_of_an_earlier_version_are_read(study: Path) -> None:
    (study / "study.copy.json").unlink()
    (study / "study.json").write_text(
        '{"study": "probe", "seed": 9, "is_simulated": true, "effect": true, "parameters": {}, '
        '"format_version": 1}\n'
    )
    settings = read_settings(study)
    assert settings is not None
    assert 9 == settings.seed
    assert () == study_problems(study)


def test_exchanged_manifests_go_back_to_their_sessions(study: Path) -> None:
    first, second = (p / "ses-001" / "manifest.json" for p in sorted(study.glob("sub-*")))
    data = first.read_bytes(), second.read_bytes()
    put(first, data[1])
    put(second, data[0])
    assert "is of sub-S02C/ses-001, not of sub-S01B/ses-001" in " ".join(study_problems(study))
    assert 2 == len(repair_study(study))
    assert data == (first.read_bytes(), second.read_bytes())
    assert () == study_problems(study)


def test_trials_of_every_session_of_a_study_are_listed_on_demand(tmp_path: Path) -> None:
    folder = perform("asking", tmp_path).path.parents[1]
    settle(folder, StudySettings("asking", 1, True), seed_given=True)

    listed = CliRunner().invoke(app, ["check", str(folder), "--trials"]).output
    as_json = CliRunner().invoke(app, ["check", str(folder), "--trials", "--json"])

    assert 1 == listed.count("attempts")
    trials = json.loads(as_json.stdout)["trials"]["sub-S01/ses-001"]
    assert {"complete"} == {trial["status"] for trial in trials}


def test_sessions_drawn_by_different_tables_of_luminances_are_named_with_their_table(
    study: Path,
) -> None:
    first, second = sorted(study.glob("sub-*/ses-*"))
    manifest = read_manifest(second)
    table = {"sha256": "ab" * 32, "screen": "640 x 480 px", "rows": []}
    screen = {**manifest.configuration, "screen": {"width_px": 640}}
    for path, entry in ((first, {"sha256": ""}), (second, table)):
        own = replace(read_manifest(path), configuration={**screen, "luminance": entry})
        write_manifest(path, own)

    checked = CliRunner().invoke(app, ["check", str(study)])

    assert 0 == checked.exit_code, checked.output
    assert "! sessions were drawn by different tables of luminances" in checked.output
    assert "no table: sub-S01B/ses-001\n" in checked.output
    assert "table abababababab of 640 x 480 px: sub-S02C/ses-001\n" in checked.output
    write_manifest(
        first, replace(read_manifest(first), configuration={**screen, "luminance": table})
    )
    again = CliRunner().invoke(app, ["check", str(study)])
    assert "luminances" not in again.output
    as_json = CliRunner().invoke(app, ["check", str(study), "--json"])
    assert {"ab" * 32: [str(first), str(second)]} == json.loads(as_json.stdout)["luminances"]


def test_data_are_found_by_the_name_of_their_study_alone(
    study: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    lab = tmp_path_factory.mktemp("lab") / "lab_config.yaml"
    text = EXAMPLE.read_text("utf-8")
    assert "data_root: data" in text
    lab.write_text(text.replace("data_root: data", f"data_root: {study.parents[1]}"), "utf-8")

    checked = CliRunner().invoke(app, ["check", "probe", "--config", str(lab)])

    assert "2 sessions, every file verified" in checked.output


def test_what_people_coded_is_checked_row_by_row(tmp_path: Path) -> None:
    recording = perform("asking", tmp_path)
    person, study = recording.path.parent, recording.path.parents[1]
    settle(study, StudySettings("asking", 1, True), seed_given=True)
    row = recording.trials().iloc[0]
    begin_ns, end_ns, trial_id = int(row["t_start_ns"]), int(row["t_end_ns"]), row["trial_id"]
    part = int(row["recording_part"])
    whole = Annotation("S01", 1, part, str(trial_id), "AM", "smile", begin_ns, end_ns, "")
    place_annotations(person, [whole, replace(whole, trial_id="", label="frown")])
    assert () == tuple(p for p in study_problems(study) if ANNOTATIONS_NAME in p)
    wrong = {
        "there is no session 7": replace(whole, session=7),
        "it is about S02C, in the folder of S01": replace(whole, participant="S02C"),
        "session 1 has no part 9": replace(whole, recording_part=9),
        "the span is not within part 1": replace(whole, end_ns=end_ns + 10**15),
        "the span does not begin within trial X9": replace(whole, trial_id="X9"),
        f"the span does not begin within trial {trial_id}": replace(
            whole, begin_ns=begin_ns - 5 * 10**6
        ),
        "spelled differently, 'smile' in row 2 and 'Smile' in row 3": replace(
            whole, label="Smile", coder="BK"
        ),
    }
    for problem, span in wrong.items():
        (person / ANNOTATIONS_NAME).unlink()
        place_annotations(person, [whole, replace(span, coder="BK")])
        (said,) = (p for p in study_problems(study) if ANNOTATIONS_NAME in p)
        assert problem in said
        assert "row 3" in said
    (person / ANNOTATIONS_NAME).write_text("participant,label\n", "utf-8")
    (said,) = (p for p in study_problems(study) if ANNOTATIONS_NAME in p)
    assert "has no column session" in said
    checked = CliRunner().invoke(app, ["check", str(study)])
    assert 1 <= checked.exit_code
    assert "annotations.csv" in checked.output.replace("\n", "")
