import csv
import json
import os
import stat
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from visavis.lab.clock import SimClock
from visavis.lab.errors import LedgerError
from visavis.protocol.people.exports_register import ANALYSIS, register_export
from visavis.protocol.people.key_file import KeyFile
from visavis.protocol.people.ledger import Ledger, WithdrawnParticipant
from visavis.protocol.people.own_body import OwnBody
from visavis.recording.chained import append_lines, read_lines
from visavis.recording.durable import sha256_of
from visavis.recording.lock import SessionLock
from visavis.recording.sealed import read_sealed, seal

ROWS = [("07H", "1,5"), ("08J", 'with "quotes", and\na line'), ("07h", "x"), ("107Q", "y")]


def record(root, label, session=1, *, study="stare", kind="real"):
    folder = root / kind / study / f"sub-{label}" / f"ses-{session:03d}"
    folder.mkdir(parents=True)
    (folder / "manifest.json").write_text(json.dumps({"participant": label, "study": study}))
    (folder / "part-01").mkdir()
    raw = folder / "part-01" / "gaze.arrows"
    raw.write_bytes(b"raw")
    raw.chmod(0o444)
    return folder


@pytest.fixture
def book(tmp_path):
    book = Ledger(tmp_path / "data" / "real" / "stare", SimClock())
    book.add(7)
    book.add(8)
    return book


@pytest.fixture
def data(tmp_path):
    return tmp_path / "data"


def test_withdrawal_removes_every_session_of_that_person_and_study_only(book, data):
    mine = [record(data, "07H", s) for s in (1, 2)] + [record(data, "07H", kind="simulated")]
    others = [record(data, "08J"), record(data, "107Q"), record(data, "07H", study="waving")]
    removal = book.withdraw("07", [data])
    assert [False] * 3 == [f.exists() for f in mine]
    assert [True] * 3 == [f.exists() for f in others]
    assert sorted({f.parent for f in mine}) == sorted(removal.removed_paths)


def test_a_session_under_another_folder_name_is_found_by_its_manifest(book, data):
    folder = record(data, "07H")
    moved = data / "real" / "stare" / "copy of first"
    folder.rename(moved)
    book.withdraw("7", [data])
    assert not moved.exists()


def test_a_manifest_that_cannot_be_read_is_reported(book, data):
    odd = data / "real" / "stare" / "odd"
    odd.mkdir()
    (odd / "manifest.json").write_text("{torn")
    assert [odd / "manifest.json"] == book.withdraw("7", [data]).unreadable


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
@pytest.mark.parametrize(("name", "delimiter"), [("t.csv", ","), ("t.csv", ";"), ("t.tsv", "\t")])
def test_rows_go_from_text_tables_and_the_others_stay(book, data, name, delimiter, ending):
    table = data / "real" / "stare" / "derived" / "tables" / name
    table.parent.mkdir(parents=True)
    with table.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, delimiter=delimiter, lineterminator=ending).writerows(
            [("participant", "note"), *ROWS]
        )
    removal = book.withdraw("7", [data])
    with table.open(newline="", encoding="utf-8") as file:
        left = [tuple(row) for row in csv.reader(file, delimiter=delimiter)]
    assert [("participant", "note"), ROWS[1], ROWS[3]] == left
    assert {table: 2} == removal.rows


def test_a_table_saved_by_a_spreadsheet_with_a_byte_order_mark_loses_its_rows(book, data):
    table = data / "real" / "stare" / "derived" / "t.csv"
    table.parent.mkdir()
    table.write_text("﻿participant;x\n07H;1\n08J;2\n", encoding="utf-8")
    book.withdraw("7", [data])
    assert "﻿participant;x\n08J;2\n" == table.read_text(encoding="utf-8")


def test_rows_go_from_parquet_and_types_and_metadata_stay(book, data):
    table = data / "real" / "stare" / "derived" / "trials.parquet"
    table.parent.mkdir()
    schema = pa.schema(
        [
            pa.field("participant", pa.dictionary(pa.int8(), pa.string())),
            pa.field("dwell_ms", pa.int64(), metadata={"unit": "ms"}),
        ],
        metadata={"is_simulated": "false"},
    )
    columns = [pa.array(["07H", "08J", None]).dictionary_encode(), pa.array([1, None, 3])]
    pq.write_table(pa.table([columns[0].cast(schema.types[0]), columns[1]], schema=schema), table)
    removal = book.withdraw("7", [data])
    left = pq.read_table(table)
    assert ["08J", None] == left["participant"].to_pylist()
    assert [None, 3] == left["dwell_ms"].to_pylist()
    assert schema.equals(left.schema, check_metadata=True)
    assert {table: 1} == removal.rows


def test_a_pandas_table_reads_back_after_the_withdrawal(book, data):
    table = data / "real" / "stare" / "derived" / "trials.parquet"
    table.parent.mkdir()
    pd.DataFrame({"participant": ["07H", "08J"], "x": [1.5, 2.5]}).to_parquet(table)
    book.withdraw("7", [data])
    assert [2.5] == pd.read_parquet(table)["x"].tolist()


def test_own_derived_files_go_and_common_ones_are_called_stale(book, data):
    derived = data / "real" / "stare" / "derived"
    (derived / "sub-07H").mkdir(parents=True)
    (derived / "sub-07H" / "scan.csv").write_text("x\n1\n")
    own = derived / "gaze_07H.png"
    common, other = derived / "report.html", derived / "gaze_107H.png"
    for file in (own, common, other):
        file.write_bytes(b"")
    removal = book.withdraw("7", [data])
    assert not own.exists()
    assert not (derived / "sub-07H").exists()
    assert [other, common] == removal.stale


def test_tables_without_that_person_are_left_byte_for_byte(book, data):
    table = data / "real" / "stare" / "derived" / "t.csv"
    table.parent.mkdir()
    table.write_bytes(b'participant,x\r\n"08J",1\n')
    assert {} == book.withdraw("7", [data]).rows
    assert b'participant,x\r\n"08J",1\n' == table.read_bytes()


# ---- what goes wrong -------------------------------------------------------------------------


def test_a_missing_data_root_leaves_the_withdrawal_pending_and_repeatable(book, data, tmp_path):
    mine = record(data, "07H")
    with pytest.raises(LedgerError, match=r"not finished.*\n.*unplugged: the data root is not"):
        book.withdraw("7", [data, tmp_path / "unplugged"], reason="asked")
    assert not mine.exists()
    assert "withdrawing" == book.list()[0].status
    with pytest.raises(WithdrawnParticipant, match="repeat: visavis participant withdraw"):
        book.resolve("7")
    (tmp_path / "unplugged").mkdir()
    book.withdraw("7", [data, tmp_path / "unplugged"])
    assert ("withdrawn", "asked") == (book.list()[0].status, book.list()[0].reason)


def test_a_running_session_is_not_pulled_away(book, data):
    running = record(data, "07H")
    lock = SessionLock(running)
    with pytest.raises(LedgerError, match=r"ses-001: this session is running"):
        book.withdraw("7", [data])
    assert running.exists()
    lock.release()
    book.withdraw("7", [data])
    assert not running.exists()


def test_a_file_that_cannot_be_removed_is_named(book, data, monkeypatch):
    mine = record(data, "07H")
    real_unlink = os.unlink

    def unlink(path, **options):
        if str(path).endswith("gaze.arrows"):
            raise PermissionError(13, "Permission denied", path)
        real_unlink(path, **options)

    with monkeypatch.context() as patch:
        patch.setattr(os, "unlink", unlink)
        with pytest.raises(LedgerError, match=r"gaze\.arrows: Permission denied"):
            book.withdraw("7", [data])
    assert "withdrawing" == book.list()[0].status
    book.withdraw("7", [data])
    assert not mine.exists()


def test_a_damaged_table_is_named_and_the_rest_is_done(book, data):
    derived = data / "real" / "stare" / "derived"
    derived.mkdir()
    (derived / "a.parquet").write_bytes(b"not parquet")
    (derived / "b.csv").write_text("participant\n07H\n")
    with pytest.raises(LedgerError, match=r"a\.parquet: its rows cannot be removed"):
        book.withdraw("7", [data])
    assert "participant\n" == (derived / "b.csv").read_text()


def test_nothing_that_tells_of_a_body_is_left(book, data, tmp_path):
    book.describe_body("7", OwnBody("female", 1.83))
    book.describe_body("8", OwnBody("male", 1.74))
    record(data, "07H")
    book.withdraw("7", [data])
    left = b"".join(p.read_bytes() for p in data.rglob("*") if p.is_file())
    assert b"1.83" not in left
    assert OwnBody() == book.own_body("07H")
    assert OwnBody("male", 1.74) == book.own_body("08J")


def test_a_body_goes_where_the_study_lies_in_none_of_the_data_roots(book, tmp_path):
    book.describe_body("7", OwnBody("female", 1.83))
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    removal = book.withdraw("7", [elsewhere])
    assert {"own_body.json", "own_body.copy.json"} == {p.name for p in removal.removed_paths}
    assert OwnBody() == book.own_body("07H")


def test_who_was_only_asked_for_their_body_frees_their_place(book, data):
    book.describe_body("7", OwnBody("female", None))
    book.withdraw("7", [data])
    assert [True, False] == [p.has_freed_place for p in book.list()]


def test_a_ledger_that_held_bodies_is_read(book):
    line = {"event": "body", "label": "07H", "at": "x", "body": "female", "stature_m": 1.83}
    append_lines(book.path, [line])
    assert "active" == book.resolve("7").status
    assert OwnBody() == book.own_body("07H")


# ---- the key file ----------------------------------------------------------------------------


def test_the_key_file_is_for_its_owner_only_and_keeps_its_salt(tmp_path, data):
    keys = KeyFile(tmp_path / "keys", "stare", [data])
    assert 0o600 == stat.S_IMODE(keys.path.stat().st_mode)
    keys.identify("07H", {"name": "Åsa"})
    assert 0o600 == stat.S_IMODE(keys.path.stat().st_mode)
    again = KeyFile(tmp_path / "keys", "stare", [data])
    assert {"name": "Åsa"} == again.identity("07H")
    assert keys.pseudonym("07H") == again.pseudonym("07H")
    assert "*\n" == (tmp_path / "keys" / ".gitignore").read_text()


def test_pseudonyms_differ_between_labels_and_studies(tmp_path):
    a, b = (KeyFile(tmp_path / "keys", study, []) for study in ("stare", "waving"))
    assert 4 == len({k.pseudonym(label) for k in (a, b) for label in ("07H", "08J")})


def test_a_key_folder_inside_the_data_is_refused(tmp_path, data):
    data.mkdir()
    (tmp_path / "link").symlink_to(data)
    for folder in (data, data / "keys", data / "a" / ".." / "keys", tmp_path / "link" / "keys"):
        with pytest.raises(LedgerError, match="inside the data root"):
            KeyFile(folder, "stare", [data])
    assert [] == list(data.iterdir())


def test_a_key_file_that_others_can_read_is_refused(tmp_path):
    path = KeyFile(tmp_path / "keys", "stare", []).path
    path.chmod(0o640)
    with pytest.raises(LedgerError, match="chmod 600"):
        KeyFile(tmp_path / "keys", "stare", [])


def test_a_damaged_key_file_is_refused_and_kept(tmp_path):
    path = KeyFile(tmp_path / "keys", "stare", []).path
    path.write_text("{}")
    with pytest.raises(LedgerError, match="restore it from its backup"):
        KeyFile(tmp_path / "keys", "stare", [])
    assert "{}" == path.read_text()


def test_withdrawal_forgets_who_it_was(book, data, tmp_path):
    keys = KeyFile(tmp_path / "keys", "stare", [data])
    keys.identify("07H", {"name": "A"})
    keys.identify("08J", {"name": "B"})
    book.withdraw("7", [data], key_file=keys)
    assert keys.identity("07H") is None
    assert {"name": "B"} == keys.identity("08J")
    assert "07H" not in keys.path.read_text()


def test_the_key_is_kept_until_the_data_are_gone(book, data, tmp_path):
    keys = KeyFile(tmp_path / "keys", "stare", [data])
    keys.identify("07H", {"name": "A"})
    with pytest.raises(LedgerError):
        book.withdraw("7", [tmp_path / "unplugged"], key_file=keys)
    assert {"name": "A"} == keys.identity("07H")


def test_the_study_folder_may_be_named_relative_to_the_working_folder(book, data, monkeypatch):
    mine = record(data, "07H")
    monkeypatch.chdir(data / "real" / "stare")
    here = Ledger(Path(), SimClock())
    assert "stare" == here.study
    here.withdraw("7", [Path()])
    assert not mine.exists()


# ---- exports ---------------------------------------------------------------------------------


@pytest.fixture
def out(tmp_path, book, data):
    """Export 07H to a folder outside the study, and an analysis of two people to another."""
    study = data / "real" / "stare"
    own, common = tmp_path / "out" / "bids", tmp_path / "out" / "analysis"
    for folder in (own / "sub-x", common):
        folder.mkdir(parents=True)
    (own / "sub-x" / "eye.tsv").write_text("1\n")
    (own / "participants.tsv").write_text("participant_id\nsub-x\n")
    (common / "trials.csv").write_text("participant,x\n07H,1\n08J,2\n")
    (common / "report.html").write_text("all of them")
    register_export(study, SimClock(), "bids", own, ["07H"], sorted(own.rglob("*.tsv")))
    register_export(study, SimClock(), ANALYSIS, common, ["07H", "08J"], common.iterdir())
    return tmp_path / "out"


def test_registered_exports_of_the_person_go(book, data, out):
    removal = book.withdraw("7", [data])
    assert not (out / "bids").exists()
    assert "participant,x\n08J,2\n" == (out / "analysis" / "trials.csv").read_text()
    assert [out / "analysis" / "report.html"] == removal.stale
    assert [] == removal.unreached_exports


def test_a_film_goes_and_leaves_what_lies_beside_it(book, data, tmp_path, monkeypatch):
    study, desk = data / "real" / "stare", tmp_path / "desk"
    (desk / "empty").mkdir(parents=True)
    film, alone = desk / "trial.mp4", tmp_path / "alone" / "page.html"
    alone.parent.mkdir()
    for path in (film, alone):
        path.write_text("07H")
        register_export(study, SimClock(), "film", path.parent, ["07H"], [path])
    monkeypatch.chdir(alone.parent)
    removal = book.withdraw("7", [data])
    assert {film, alone} <= set(removal.removed_paths)
    assert [desk / "empty"] == list(desk.iterdir())
    assert alone.parent.is_dir()


def test_what_lies_beside_an_export_of_several_is_not_touched(book, data, tmp_path):
    study, desk = data / "real" / "stare", tmp_path / "desk"
    of_both = [desk / "sub-07H" / "eye.tsv", desk / "sub-08J" / "eye.tsv", desk / "people.csv"]
    others = [desk / "data" / "real" / "waving" / "sub-07H" / "gaze.arrows", desk / "mine.csv"]
    for path in (*of_both, *others):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("participant,x\n07H,1\n08J,2\n")
    register_export(study, SimClock(), "parquet", desk, ["07H", "08J"], of_both)
    removal = book.withdraw("7", [data])
    assert ["participant,x\n07H,1\n08J,2\n"] * 2 == [path.read_text() for path in others]
    assert not (desk / "sub-07H").exists()
    assert "participant,x\n08J,2\n" == (desk / "people.csv").read_text()
    assert {desk / "people.csv"} == set(removal.rows)


def test_exports_that_moved_or_changed_are_listed(book, data, out):
    (out / "bids" / "participants.tsv").rename(out / "elsewhere.tsv")
    (out / "bids" / "sub-x" / "eye.tsv").write_text("2\n")
    removal = book.withdraw("7", [data])
    assert 2 == len(removal.unreached_exports)
    assert "it is not there any more" in removal.unreached_exports[0]
    assert "changed since" in removal.unreached_exports[1]
    assert (out / "bids" / "sub-x" / "eye.tsv").exists()


def test_exports_in_the_studys_folder_go_under_the_pseudonym_too(book, data, tmp_path):
    key_file = KeyFile(tmp_path / "keys", "stare", [data])
    alias = key_file.pseudonym("07H")
    inside = data / "real" / "stare" / "for_colleagues"
    (inside / f"sub-{alias}").mkdir(parents=True)
    (inside / f"sub-{alias}" / "beh.tsv").write_text("x\n")
    (inside / "participants.tsv").write_text(f"participant_id\nsub-{alias}\nsub-other\n")
    book.withdraw("7", [data], key_file=key_file)
    assert not (inside / f"sub-{alias}").exists()
    assert "participant_id\nsub-other\n" == (inside / "participants.tsv").read_text()


def test_the_tombstone_says_what_was_done(book, data, out):
    (out / "bids" / "participants.tsv").unlink()
    removal = book.withdraw("7", [data])
    done = read_lines(book.path).records[-1]["done"]
    assert removal.record() == done
    assert "participants.tsv" in done["unreached"][0]
    assert [str(p) for p in removal.removed_paths] == done["removed"]
    assert "withdrawn" == book.list()[0].status


def test_every_place_is_listed_with_what_became_of_it_and_its_hash(book, data, out):
    record(data, "07H")
    eye, report = out / "bids" / "sub-x" / "eye.tsv", out / "analysis" / "report.html"
    digests = {path: sha256_of(path) for path in (eye, report)}
    removal = book.withdraw("7", [data])
    fates = {path: fate for fate, path in removal.places()}
    assert "removed" == fates[eye]
    assert "1 rows cut" == fates[out / "analysis" / "trials.csv"]
    assert "made with it, make it again" == fates[report]
    assert digests == {path: removal.sha256[path] for path in digests}
    stored = read_lines(book.path).records[-1]["done"]["sha256"]
    assert {str(path): digest for path, digest in removal.sha256.items()} == stored
    sessions = [path for path in fates if path.name.startswith("ses-")]
    assert sessions
    assert all(len(removal.sha256[path]) == 64 for path in sessions)


def test_a_changed_salt_is_noticed(tmp_path):
    keys = KeyFile(tmp_path / "keys", "stare", [])
    data = keys.path.read_bytes()
    at = data.index(b'"salt": "') + 12
    for bit in (1, 2, 4):
        keys.path.write_bytes(data[:at] + bytes([data[at] ^ bit]) + data[at + 1 :])
        with pytest.raises(LedgerError, match=r"cannot be read.*backup"):
            keys.pseudonym("07H")


@pytest.mark.parametrize("changed", [{"identities": None}, {"salt": 7}, {"salt": "no hex"}])
def test_a_key_file_whose_values_were_changed_under_a_checksum_is_refused(tmp_path, changed):
    key_file = KeyFile(tmp_path / "keys", "stare", [])
    content = read_sealed(key_file.path).content
    key_file.path.write_bytes(seal({**content, **changed}))
    for ask in (key_file.identity, key_file.pseudonym):
        with pytest.raises(LedgerError, match="lacks its salt or identities"):
            ask("07H")
