import multiprocessing
import os
from dataclasses import replace
from itertools import pairwise
from string import ascii_uppercase, digits

import pytest
from hypothesis import given
from hypothesis import strategies as st

from visavis.lab.clock import SIMULATED_EPOCH_ISO, SimClock
from visavis.lab.errors import LedgerError
from visavis.protocol.people.identifiers import (
    MAX_NUMBER,
    is_one_typo_apart,
    make_label,
    read_label,
)
from visavis.protocol.people.ledger import Ledger, UnknownParticipant, WithdrawnParticipant
from visavis.recording.chained import append_lines
from visavis.recording.sealed import copy_path

numbers = st.integers(1, MAX_NUMBER)
prefixes = st.sampled_from(["", "S"])


def ledger(tmp_path, **options):
    return Ledger(tmp_path / "stare", SimClock(), **options)


# ---- labels ----------------------------------------------------------------------------------


@given(numbers, prefixes)
def test_a_label_reads_back_and_is_letters_and_digits(number, prefix):
    label = make_label(number, prefix)
    assert number == read_label(label, prefix) == read_label(f" {label.lower()} ", prefix)
    assert label.isalnum()
    assert label.isascii()


@given(numbers, prefixes)
def test_every_single_substitution_is_detected(number, prefix):
    label = make_label(number, prefix)
    for i in range(len(label)):
        for c in digits + ascii_uppercase:
            if c != label[i]:
                assert read_label(label[:i] + c + label[i + 1 :], prefix) is None


@given(numbers, prefixes)
def test_every_exchange_of_neighbours_is_detected(number, prefix):
    label = make_label(number, prefix)
    for i, (a, b) in enumerate(pairwise(label)):
        if a != b:
            assert read_label(label[:i] + b + a + label[i + 2 :], prefix) is None


@given(numbers)
def test_leading_zeros_do_not_change_a_label(number):
    assert number == read_label(f"0{make_label(number)}"[-7:])


@pytest.mark.parametrize(
    ("typed", "near"),
    [("07X", True), ("70H", True), ("7H", True), ("071H", True), ("17X", False), ("H07", False)],
)
def test_one_slip_is_one_character_or_one_exchange(typed, near):
    assert near is is_one_typo_apart(typed, "07H")


# ---- adding and finding ----------------------------------------------------------------------


def test_seven_and_zero_seven_and_the_label_are_one_person(tmp_path):
    book = ledger(tmp_path)
    added = book.add(7, group="on", consent_version="2")
    assert "07H" == added.label
    for text in ("7", "07", "007", "07H", "7h", " 07h "):
        assert added == book.resolve(text)


def test_numbers_and_indices_count_on_from_the_last(tmp_path):
    book = ledger(tmp_path)
    added = [book.add(), book.add(7), book.add()]
    assert [1, 7, 8] == [p.number for p in added]
    assert [0, 1, 2] == [p.index for p in added]
    assert tuple(added) == book.list()


def test_an_entry_survives_a_new_ledger_object_and_carries_clock_time(tmp_path):
    added = ledger(tmp_path).add(3, group="off", consent_version="1.2")
    assert SIMULATED_EPOCH_ISO == added.added_at
    assert (added,) == ledger(tmp_path).list()


def test_group_may_be_a_function_of_the_index(tmp_path):
    book = ledger(tmp_path)
    assert ["g0", "g1"] == [book.add(group=lambda i: f"g{i}").group for _ in range(2)]


def test_unknown_number_names_the_command_that_adds_it(tmp_path):
    with pytest.raises(UnknownParticipant, match="participant add stare 7") as caught:
        ledger(tmp_path).resolve("07")
    assert 7 == caught.value.number


def test_a_wrong_check_letter_is_refused_with_the_likely_label(tmp_path):
    book = ledger(tmp_path)
    book.add(7)
    book.add(12)
    for typed in ("07X", "70H", "7X"):
        with pytest.raises(LedgerError, match="did you mean 07H"):
            book.resolve(typed)


@pytest.mark.parametrize("typed", ["", "Anna", "sub-07H", "٧", "07*", "-7", "7.0"])
def test_what_is_no_identifier_is_refused(tmp_path, typed):
    book = ledger(tmp_path)
    book.add(7)
    with pytest.raises(LedgerError, match="check letter"):
        book.resolve(typed)


@pytest.mark.parametrize("typed", ["0", "00", "1000000"])
def test_numbers_nobody_can_have_are_not_merely_unknown(tmp_path, typed):
    with pytest.raises(LedgerError, match="numbers go from 1") as caught:
        ledger(tmp_path).resolve(typed)
    assert not isinstance(caught.value, UnknownParticipant)


def test_a_number_is_never_issued_twice(tmp_path):
    book = ledger(tmp_path)
    book.add(7)
    with pytest.raises(LedgerError, match=r"07H of stare is in the ledger.*never used twice"):
        book.add(7)
    assert 1 == len(book.list())


@pytest.mark.parametrize("number", [0, -1, MAX_NUMBER + 1])
def test_numbers_outside_the_range_are_refused(tmp_path, number):
    with pytest.raises(LedgerError, match="not possible"):
        ledger(tmp_path).add(number)


def test_an_index_is_never_issued_twice(tmp_path):
    book = ledger(tmp_path)
    book.add(index=4)
    with pytest.raises(LedgerError, match="index 4 of stare belongs to 01B"):
        book.add(index=4)
    assert [0, 1, 2, 3, 5] == [book.add().index for _ in range(5)]


def test_the_next_place_is_the_one_given_next_whatever_the_number(tmp_path):
    book = ledger(tmp_path)
    for number in (7, 3, 12):
        foreseen = book.next_place()
        assert foreseen == book.add(number).index
    assert [0, 1, 2] == [p.index for p in book.list()]


def test_a_group_function_that_fails_registers_nothing(tmp_path):
    book = ledger(tmp_path)
    with pytest.raises(ZeroDivisionError):
        book.add(group=lambda i: str(1 // i))
    assert () == book.list()


def test_simulated_participants_have_labels_and_ledgers_of_their_own(tmp_path):
    book = ledger(tmp_path, prefix="S")
    assert "S07H" == book.add(7).label
    assert ["S07H"] * 3 == [book.resolve(text).label for text in ("7", "07H", "s07h")]
    with pytest.raises(LedgerError, match="did you mean S07H"):
        book.resolve("07X")
    with pytest.raises(LedgerError, match="ledgers of their own"):
        ledger(tmp_path).list()


def test_consent_keeps_the_latest_version(tmp_path):
    book = ledger(tmp_path)
    added = book.add(7, consent_version="1")
    assert replace(added, consent_version="2") == book.consent("7", "2") == book.resolve("7")


# ---- the file --------------------------------------------------------------------------------


def test_the_ledger_only_grows(tmp_path):
    book = ledger(tmp_path)
    before = b""
    for _ in range(3):
        book.add()
        after = book.path.read_bytes()
        assert after.startswith(before)
        before = after


@pytest.mark.parametrize("cut", [1, 5, 40])
def test_a_torn_last_line_was_never_issued_and_is_replaced(tmp_path, cut):
    book = ledger(tmp_path)
    first = book.add()
    whole = book.path.read_bytes()
    book.add()
    # the copy is written first, so a writer that dies in the middle leaves this:
    os.truncate(copy_path(book.path), len(book.path.read_bytes()) - cut)
    os.truncate(book.path, len(whole))
    assert (first,) == book.list()
    second = book.add()
    assert 1 == second.index
    assert book.path.read_bytes().startswith(whole)
    assert (first, second) == book.list()


def test_a_ledger_cut_short_loses_nobody(tmp_path):
    book = ledger(tmp_path)
    both = (book.add(), book.add())
    os.truncate(book.path, 40)
    assert both == book.list()
    assert (*both, book.add()) == book.list()


def test_a_ledger_of_another_study_is_refused(tmp_path):
    book = ledger(tmp_path)
    book.add()
    other = tmp_path / "other"
    book.path.parent.rename(other)
    with pytest.raises(LedgerError, match="is the ledger of stare, not of other"):
        Ledger(other, SimClock()).list()


def test_a_torn_head_leaves_an_empty_ledger(tmp_path):
    book = ledger(tmp_path)
    book.add()
    book.path.unlink()
    os.truncate(copy_path(book.path), 10)
    assert () == book.list()
    assert 0 == book.add().index


@pytest.mark.parametrize("line", ["{broken", "[1]", '{"event": "added"}', '{"event": "what"}'])
def test_a_damaged_line_is_named(tmp_path, line):
    book = ledger(tmp_path)
    book.add()
    with book.path.open("a") as file:
        file.write(line + "\n")
    with pytest.raises(LedgerError, match=r"participants\.jsonl:3: the ledger is damaged"):
        book.list()


def test_a_newer_format_is_refused(tmp_path):
    book = ledger(tmp_path)
    book.path.parent.mkdir()
    append_lines(book.path, [{"event": "ledger", "format": 99, "study": "stare", "prefix": ""}])
    with pytest.raises(LedgerError, match="newer Visavis"):
        book.list()


def test_a_ledger_that_cannot_be_written_says_nothing_was_registered(tmp_path):
    book = ledger(tmp_path)
    book.path.mkdir(parents=True)
    with pytest.raises(LedgerError, match="cannot be"):
        book.add()


def _add_some(root, barrier, count):
    book = Ledger(root, SimClock())
    barrier.wait()
    for _ in range(count):
        book.add(group=lambda i: f"g{i % 2}")


def test_processes_at_once_never_share_a_number_or_an_index(tmp_path):
    context = multiprocessing.get_context("spawn")
    barrier = context.Barrier(3)
    root = tmp_path / "stare"
    rooms = [context.Process(target=_add_some, args=(root, barrier, 8)) for _ in range(3)]
    for room in rooms:
        room.start()
    for room in rooms:
        room.join()
    assert [0, 0, 0] == [room.exitcode for room in rooms]
    entries = Ledger(root, SimClock()).list()
    assert list(range(24)) == [p.index for p in entries]
    assert list(range(1, 25)) == [p.number for p in entries]
    assert [f"g{i % 2}" for i in range(24)] == [p.group for p in entries]


# ---- withdrawal, as the ledger tells it ------------------------------------------------------


def test_a_withdrawn_identifier_is_a_tombstone_and_never_issued_again(tmp_path):
    book = ledger(tmp_path)
    book.add(7, group="on")
    book.withdraw("07", [tmp_path], reason="asked")
    tombstone = book.list()[0]
    assert ("07H", "withdrawn", SIMULATED_EPOCH_ISO, "asked") == (
        tombstone.label,
        tombstone.status,
        tombstone.withdrawn_at,
        tombstone.reason,
    )
    with pytest.raises(WithdrawnParticipant, match="never used again"):
        book.resolve("7")
    with pytest.raises(LedgerError, match="has withdrawn"):
        book.add(7)
    with pytest.raises(WithdrawnParticipant, match="already"):
        book.withdraw("7", [tmp_path])


def test_a_replacement_takes_over_index_and_group_once(tmp_path):
    book = ledger(tmp_path)
    book.add(1, group="on")
    book.add(2, group="off")
    with pytest.raises(LedgerError, match="has not withdrawn"):
        book.add(replaces="01B")
    book.withdraw("1", [tmp_path])
    new = book.add(replaces="1")
    assert (3, 0, "on", "01B") == (new.number, new.index, new.group, new.replaces)
    with pytest.raises(LedgerError, match="replaced already, by 03D"):
        book.add(replaces="1")
    assert 2 == book.add().index


def record_something(root, label):
    (root / "stare" / f"sub-{label}" / "ses-001").mkdir(parents=True)


def test_a_place_is_free_again_when_nothing_was_recorded(tmp_path):
    book = ledger(tmp_path)
    for _ in range(3):
        book.add()
    record_something(tmp_path, "01B")
    book.withdraw("1", [tmp_path])
    book.withdraw("2", [tmp_path])
    assert [False, True, False] == [p.has_freed_place for p in book.list()]
    assert [1, 3] == [book.add().index for _ in range(2)]
    with pytest.raises(LedgerError, match="given to 04E; nobody is missing"):
        book.add(replaces="2")


def test_a_place_stays_taken_where_its_data_could_not_be_looked_for(tmp_path):
    book = ledger(tmp_path)
    book.add()
    with pytest.raises(LedgerError, match="connect its disk"):
        book.withdraw("1", [tmp_path / "unplugged"])
    book.withdraw("1", [tmp_path])
    assert 1 == book.next_place()


def test_a_group_that_lost_people_is_filled_first_and_the_hole_after_it(tmp_path):
    book = ledger(tmp_path)

    def group(index):
        return "ab"[index % 2]

    for _ in range(4):
        book.add(group=group)
    for label in ("02C", "04E"):
        record_something(tmp_path, label)
        book.withdraw(label, [tmp_path])
    added = []
    for _ in range(6):
        foreseen = book.next_place(group)
        added.append(book.add(group=group))
        assert foreseen == added[-1].index
    assert "bbabab" == "".join(p.group for p in added)
    assert set(range(12)) - {8, 10} == {p.index for p in book.list()}
    assert 8 == book.add(group=group).index


def test_groups_of_other_sizes_keep_their_order_while_nobody_left(tmp_path):
    book = ledger(tmp_path)
    for index in range(9):
        assert index == book.add(group=lambda i: "aab"[i % 3]).index


@pytest.mark.parametrize("loss", ["emptied", "gone", "cut by a line"])
def test_a_ledger_that_knows_less_than_the_folders_issues_nothing(tmp_path, loss):
    first = ledger(tmp_path)
    labels = [first.add().label for _ in range(2)]
    for label in labels:
        (first.path.parent / f"sub-{label}").mkdir()
    for path in (first.path, copy_path(first.path)):
        lines = path.read_bytes().splitlines(keepends=True)
        match loss:
            case "emptied":
                path.write_bytes(b"")
            case "gone":
                path.unlink()
            case _:
                path.write_bytes(b"".join(lines[:-1]))
    with pytest.raises(LedgerError, match=f"does not know .*sub-{labels[-1]}.*issued twice"):
        ledger(tmp_path).add()
