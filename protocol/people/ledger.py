"""The participant ledger of a study: who takes part, in which order and group, and who left.

`<study_root>/participants.jsonl` only grows: one JSON line per event, flushed and synced under a
lock, so that two rooms cannot issue one identifier or one place in the order. Every line vouches
for all before it, and the file has a copy (visavis.recording.chained). It holds no names; those are
in the key file (visavis.protocol.people.key_file).
"""

import builtins
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import count, islice
from pathlib import Path
from typing import Any, Literal

from visavis.lab.clock import Clock
from visavis.lab.errors import LedgerError
from visavis.protocol.people.exports_register import registered_exports
from visavis.protocol.people.file_lock import locked
from visavis.protocol.people.identifiers import (
    MAX_NUMBER,
    is_one_typo_apart,
    make_label,
    read_label,
)
from visavis.protocol.people.key_file import KeyFile
from visavis.protocol.people.own_body import OwnBody, read_own_body, remove_own_body, write_own_body
from visavis.protocol.people.withdrawal import Removal, may_have_data, remove_participant
from visavis.recording.chained import append_lines, read_lines
from visavis.recording.typed_names import typed_study

LEDGER_NAME = "participants.jsonl"
LOCK_NAME = ".participants.lock"
FORMAT_VERSION = 2
MAX_RUNS_AHEAD = 4
"""How many runs of all groups are searched for a place of a group that lost people."""

Status = Literal["active", "withdrawing", "withdrawn"]


@dataclass(frozen=True)
class Participant:
    """One entry of the ledger.

    `index` counts from 0 in order of entry and decides orders and seeds; `replaces` is the label
    of the withdrawn participant whose index this one took over. A withdrawn entry is the
    tombstone: `withdrawn_at` and `reason` say when and why; `has_freed_place` that nothing had
    been recorded, so that the index may be given to somebody else. `former_labels` are those that
    were corrected, oldest first; nobody else gets them.
    """

    label: str
    number: int
    index: int
    group: str
    consent_version: str
    added_at: str
    status: Status = "active"
    replaces: str = ""
    withdrawn_at: str = ""
    reason: str = ""
    has_freed_place: bool = False
    former_labels: tuple[str, ...] = ()


class UnknownParticipant(LedgerError):
    """No participant has this number; `number` is there for a caller that wants to add it."""

    def __init__(self, message: str, number: int) -> None:
        super().__init__(message)
        self.number = number


class WithdrawnParticipant(LedgerError):
    """The participant has withdrawn; the identifier is never used again."""


class Ledger:
    """The ledger of the study whose folder is `study_root` (the folder's name is the study's).

    `prefix` (capital letters) sets the labels of simulated participants apart: "S07H". `typed` is
    what commands call the study, as messages name it; left out, it follows from the folder.
    """

    def __init__(
        self, study_root: Path, clock: Clock, *, prefix: str = "", typed: str = ""
    ) -> None:
        if prefix and not (prefix.isascii() and prefix.isalpha() and prefix.isupper()):
            raise LedgerError(f"prefix {prefix!r} must be capital letters A to Z")
        self.path = study_root / LEDGER_NAME
        self.study = study_root.resolve().name
        self.prefix = prefix
        self._typed = typed
        self._root = study_root
        self._clock = clock

    @property
    def typed(self) -> str:
        """The study as commands name it here."""
        return self._typed or typed_study(self._root)

    def add(
        self,
        number: int | None = None,
        *,
        group: str | Callable[[int], str] = "",
        consent_version: str = "",
        index: int | None = None,
        replaces: str | None = None,
    ) -> Participant:
        """Issue an identifier never used before and a place in the order.

        Without `number`, the next free one. `group` is a name, or a function of the index that
        is called while the ledger is held (visavis.protocol.plan.design.group_of). The place is the
        first free one (see `next_place`); `index` asks for a certain place, and `replaces` takes
        over index and group of a withdrawn participant.

        Raises:
            LedgerError: the number was issued already, or the study's folder holds somebody whom
                the ledger does not know.
        """
        with self._lock():
            entries = self._read()
            self._refuse_unknown_folders(entries)
            new_number = (
                1 + max((p.number for p in entries), default=0) if number is None else number
            )
            self._check_number(new_number, entries)
            if replaces is not None:
                leaver = self._replaceable(replaces, entries)
                place, own_group, replaced_label = leaver.index, leaver.group, leaver.label
            else:
                place = self._place(index, entries, group)
                own_group = group if isinstance(group, str) else group(place)
                replaced_label = ""
            person = Participant(
                label=make_label(new_number, self.prefix),
                number=new_number,
                index=place,
                group=own_group,
                consent_version=consent_version,
                added_at=self._clock.wall_iso(),
                replaces=replaced_label,
            )
            self._append(
                "added",
                label=person.label,
                at=person.added_at,
                number=person.number,
                index=person.index,
                group=person.group,
                consent_version=person.consent_version,
                replaces=person.replaces,
            )
        return person

    def next_place(self, group: Callable[[int], str] | None = None) -> int:
        """Return the index that `add` would give now; nothing is registered.

        It is the first place that nobody has. A place is free again when its participant withdrew
        before anything was recorded. Where people of one group (`group` of an index) dropped out
        after that, the first free place of that group comes before those of other groups.
        """
        return _first_free(self._read(), group)

    def resolve(self, text: str) -> Participant:
        """Return the participant meant by a number ("7", "07") or a label ("07H").

        A label may be typed without the ledger's prefix, as a number is.

        Raises UnknownParticipant, WithdrawnParticipant, or LedgerError for a label whose check
        letter is wrong, with the labels probably meant.
        """
        person = self._find(text, self._read())
        if person.status == "withdrawing":
            raise WithdrawnParticipant(
                f"participant {person.label} of {self.study} is being withdrawn and the removal is "
                f"not finished; repeat: visavis participant withdraw {self.typed} {person.label}"
            )
        if person.status == "withdrawn":
            raise WithdrawnParticipant(
                f"participant {person.label} of {self.study} withdrew on {person.withdrawn_at}; "
                "the identifier is never used again, add a new participant: "
                f"visavis participant add {self.typed}"
            )
        return person

    def list(self) -> tuple[Participant, ...]:
        """Return every entry in order of entry, tombstones included."""
        return self._read()

    def consent(self, text: str, version: str) -> Participant:
        """Record that a participant agreed to another version of the consent form."""
        with self._lock():
            person = self.resolve(text)
            if person.consent_version != version:
                self._append(
                    "consented",
                    label=person.label,
                    at=self._clock.wall_iso(),
                    consent_version=version,
                )
        return replace(person, consent_version=version)

    def rename(self, text: str, number: int, *, reason: str, author: str) -> Participant:
        """Correct somebody's identifier: theirs is `number` from now on; place and group stay.

        The former identifier is kept and never issued. A call that was interrupted afterwards may
        be repeated: it changes nothing.

        Raises:
            LedgerError: the number was issued already, or the participant withdrew.
        """
        with self._lock():
            entries = self._read()
            new_label = make_label(number, self.prefix)
            own = next((p for p in entries if p.label == new_label and p.former_labels), None)
            if own is not None and self._number(text, entries) == read_label(
                own.former_labels[-1], self.prefix
            ):
                return own
            person = self.resolve(text)
            self._check_number(number, entries)
            self._append(
                "renamed",
                label=person.label,
                to=new_label,
                number=number,
                at=self._clock.wall_iso(),
                reason=reason,
                author=author,
            )
        former = (*person.former_labels, person.label)
        return replace(person, label=new_label, number=number, former_labels=former)

    def own_body(self, label: str) -> OwnBody:
        """Return which body a participant sees as their own, and how tall they said they are."""
        return read_own_body(self._folder_of(label))

    def describe_body(self, text: str, own: OwnBody) -> None:
        """Store it in the participant's folder; the ledger notes only that they were asked."""
        with self._lock():
            person = self.resolve(text)
            write_own_body(self._folder_of(person.label), own)
            self._append("body", label=person.label, at=self._clock.wall_iso())

    def begin_withdrawal(
        self, text: str, data_roots: Sequence[Path], *, reason: str = ""
    ) -> Participant:
        """Note that somebody withdraws, so that the server of their page ends and deletes it.

        Nothing is removed yet; `withdraw` goes on from here.
        """
        with self._lock():
            person = self._find(text, self._read())
            if person.status == "withdrawn":
                raise WithdrawnParticipant(
                    f"participant {person.label} of {self.study} has withdrawn already, on "
                    f"{person.withdrawn_at}; nothing is left to remove"
                )
            if person.status == "active":
                self._append(
                    "withdrawing",
                    label=person.label,
                    at=self._clock.wall_iso(),
                    reason=reason,
                    had_data=may_have_data(self.study, person.label, data_roots),
                )
        return person

    def withdraw(
        self,
        text: str,
        data_roots: Sequence[Path],
        *,
        reason: str = "",
        derived_roots: Sequence[Path] | None = None,
        key_file: KeyFile | None = None,
    ) -> Removal:
        """Remove a participant's data everywhere and leave a tombstone.

        Session folders of this study go from `data_roots` (data roots or study folders, real and
        simulated), rows from CSV and Parquet tables below `derived_roots` (default: every folder
        in the study's that holds no sessions) and in registered exports, those under the
        pseudonym, too, and the entry from the key file. Whatever cannot be removed is named in
        a LedgerError; the ledger then says "withdrawing" and the call can be repeated. The
        ledger stores what was done and what could not be reached.
        """
        person = self.begin_withdrawal(text, data_roots, reason=reason)
        # not under the lock: removing hours of recordings must not stop other rooms
        default = self._derived_folders()
        aliases = () if key_file is None else (key_file.pseudonym(person.label),)
        removal = remove_participant(
            self.study,
            person.label,
            data_roots,
            default if derived_roots is None else derived_roots,
            required_derived=derived_roots is not None,
            aliases=aliases,
            exports=registered_exports(self._root),
        )
        failures = builtins.list(removal.failures)
        try:  # where the folder of the study lies in none of the data roots
            removal.removed_paths += remove_own_body(self._folder_of(person.label))
        except OSError as error:
            failures.append(f"{error.filename}: {error.strerror}")
        if key_file is not None and not failures:
            try:
                key_file.forget(person.label)
            except (LedgerError, OSError) as error:
                failures.append(str(error))
        if failures:
            raise LedgerError(
                f"the withdrawal of {person.label} is not finished, the ledger keeps it as "
                "withdrawing; correct this and repeat the command:\n  " + "\n  ".join(failures)
            )
        with self._lock():
            if self._find(person.label, self._read()).status != "withdrawn":
                record = removal.record()
                self._append(
                    "withdrawn", label=person.label, at=self._clock.wall_iso(), done=record
                )
        return removal

    def _folder_of(self, label: str) -> Path:
        return self._root / f"sub-{label}"

    def _derived_folders(self) -> tuple[Path, ...]:
        inside = sorted(self._root.iterdir()) if self._root.is_dir() else []
        return tuple(
            p
            for p in inside
            if p.is_dir() and not p.is_symlink() and not p.name.startswith((".", "sub-"))
        )

    # ---- rules ---------------------------------------------------------------------------------

    def _check_number(self, number: int, entries: Sequence[Participant]) -> None:
        if not 1 <= number <= MAX_NUMBER:
            raise LedgerError(
                f"number {number} is not possible; give one from 1 to {MAX_NUMBER}, or none"
            )
        corrected = self._corrected(number, entries)
        if corrected is not None:
            raise LedgerError(
                f"number {number} of {self.study} was corrected to {corrected.label}; identifiers "
                "are never used twice: give another number, or none"
            )
        for entry in entries:
            if entry.number == number:
                state = "is in the ledger" if entry.status == "active" else "has withdrawn"
                raise LedgerError(
                    f"participant {entry.label} of {self.study} {state} (added {entry.added_at}); "
                    "identifiers are never used twice: add without a number to get the next free "
                    "one, or run another session of the same person"
                )

    def _corrected(self, number: int, entries: Sequence[Participant]) -> Participant | None:
        """Return who had this number before it was corrected."""
        label = make_label(number, self.prefix)
        return next((p for p in entries if label in p.former_labels), None)

    def _refuse_unknown_folders(self, entries: Sequence[Participant]) -> None:
        """Refuse to issue while the ledger knows less than the folders: it was emptied or lost.

        What it forgot it would issue a second time.
        """
        known_labels = {entry.label for entry in entries}
        folders = sorted(self._root.glob("sub-*")) if self._root.is_dir() else []
        unknown_names = [p.name for p in folders if p.name[4:] not in known_labels]
        if unknown_names:
            raise LedgerError(
                f"{self.path} does not know {', '.join(unknown_names[:5])}, whose folder is there, "
                "so nobody is added: an identifier could be issued twice. Restore the ledger from "
                f"a backup (`visavis recover {self._root}` if its copy is intact); sessions that "
                "were copied here from elsewhere belong into a folder of their own"
            )

    def _place(
        self,
        index: int | None,
        entries: Sequence[Participant],
        group: str | Callable[[int], str],
    ) -> int:
        if index is None:
            return _first_free(entries, None if isinstance(group, str) else group)
        if index < 0:
            raise LedgerError(f"index {index} is not possible; indices count from 0")
        for entry in entries:
            if entry.index == index and not entry.has_freed_place:
                raise LedgerError(
                    f"index {index} of {self.study} belongs to {entry.label}; leave the index out "
                    "to get the next free one"
                )
        return index

    def _replaceable(self, text: str, entries: Sequence[Participant]) -> Participant:
        leaver = self._find(text, entries)
        if leaver.status == "active":
            raise LedgerError(
                f"participant {leaver.label} of {self.study} has not withdrawn and cannot be "
                "replaced; withdraw first, or add without replacing"
            )
        for entry in entries:
            if entry.replaces == leaver.label:
                raise LedgerError(f"{leaver.label} has been replaced already, by {entry.label}")
            if entry.index == leaver.index and not entry.has_freed_place and entry is not leaver:
                raise LedgerError(
                    f"the place of {leaver.label}, who withdrew before anything was recorded, was "
                    f"given to {entry.label}; nobody is missing, add without replacing"
                )
        return leaver

    def number_of(self, text: str) -> int:
        """Return the number meant by a number or a label, registered or not.

        Raises:
            LedgerError: it is neither, or its check letter is wrong.
        """
        return self._number(text, self._read())

    def _find(self, text: str, entries: Sequence[Participant]) -> Participant:
        number = self._number(text, entries)
        for entry in entries:
            if entry.number == number:
                return entry
        corrected = self._corrected(number, entries)
        if corrected is not None:
            raise LedgerError(
                f"participant {make_label(number, self.prefix)} of {self.study} was corrected to "
                f"{corrected.label}; say {corrected.label}"
            )
        raise UnknownParticipant(
            f"participant {number:02d} is not in the ledger of {self.study}; add it: "
            f"visavis participant add {self.typed} {number}",
            number,
        )

    def _number(self, text: str, entries: Sequence[Participant]) -> int:
        label_text = text.strip().upper()
        number = int(label_text) if label_text.isascii() and label_text.isdigit() else None
        if number is None:
            number = read_label(label_text, self.prefix) or read_label(label_text)
        elif not 1 <= number <= MAX_NUMBER:
            raise LedgerError(
                f"there is no participant {text.strip()}: numbers go from 1 to {MAX_NUMBER}"
            )
        if number is None:
            near = [p.label for p in entries if is_one_typo_apart(label_text, p.label)]
            if not near:
                digits = label_text.removeprefix(self.prefix)[:-1]
                near = [p.label for p in entries if digits.isdecimal() and p.number == int(digits)]
            hint = (
                f"did you mean {' or '.join(near[:3])}?"
                if near
                else f"list the participants: visavis participant list {self.typed}"
            )
            raise LedgerError(
                f"{text!r} is not a participant of {self.study}: neither a number nor a label with "
                f"the right check letter; {hint}"
            )
        return number

    # ---- the file ------------------------------------------------------------------------------

    def _lock(self) -> Any:
        return locked(self._root / LOCK_NAME)

    def _read(self) -> tuple[Participant, ...]:
        entries: dict[str, Participant] = {}
        for line_number, record in self._records():
            try:
                _apply(record, entries, self)
            except (KeyError, TypeError, ValueError) as error:
                raise self._damage_error(line_number, f"lacks or misstates {error}") from error
        return tuple(entries.values())

    def _records(self) -> builtins.list[tuple[int, dict[str, Any]]]:
        try:
            lines = read_lines(self.path)
        except OSError as error:
            raise LedgerError(
                f"{self.path} cannot be read: {error.strerror}; check its rights and the disk"
            ) from error
        if lines.damaged_line is not None:
            line_number, what = lines.damaged_line
            raise self._damage_error(line_number, what)
        return builtins.list(enumerate(lines.records, start=1))

    def _damage_error(self, line_number: int, what: str) -> LedgerError:
        return LedgerError(
            f"{self.path}:{line_number}: the ledger is damaged, the line {what}; "
            f"`visavis recover {self._root}` puts its copy in its place where that is intact. "
            "Do not edit it by hand"
        )

    def _append(self, event: str, **content: object) -> None:
        """Write one line durably; the caller holds the lock."""
        lines = [{"event": event, **content}]
        if not read_lines(self.path).records:
            head = {"event": "ledger", "format": FORMAT_VERSION, "study": self.study}
            lines.insert(0, {**head, "prefix": self.prefix})
        try:
            append_lines(self.path, lines)
        except OSError as error:
            raise LedgerError(
                f"{self.path} cannot be written: {error.strerror}; nothing was registered, check "
                "the disk and try again"
            ) from error


def _first_free(entries: Sequence[Participant], group: Callable[[int], str] | None = None) -> int:
    """Return the first free place, or the first of a group that lost people if there is one."""
    group_by_place = {p.index: p.group for p in entries if not p.has_freed_place}
    first = next(index for index in count() if index not in group_by_place)
    replaced_labels = {p.replaces for p in entries}
    losses = Counter(
        p.group
        for p in entries
        if p.status != "active" and not p.has_freed_place and p.label not in replaced_labels
    )
    if group is None or not losses:
        return first
    losses.subtract(
        name for index, name in group_by_place.items() if index > first
    )  # made up for already
    missing = max(losses.values())
    groups = len({p.group for p in entries})
    if missing <= 0 or groups < 2:
        return first
    free = (index for index in count(first) if index not in group_by_place)
    for index in islice(free, MAX_RUNS_AHEAD * groups):
        if losses[group(index)] == missing:
            return index
    return first


def _apply(record: dict[str, Any], entries: dict[str, Participant], ledger: Ledger) -> None:
    """Bring the entries up to date with one line of the ledger."""
    event = record["event"]
    if event == "ledger":
        if record["study"] != ledger.study:
            raise LedgerError(
                f"{ledger.path} is the ledger of {record['study']}, not of {ledger.study}; put "
                "back the one that belongs here, or name the folder as the study is named"
            )
        if int(record["format"]) > FORMAT_VERSION:
            raise LedgerError(
                f"{ledger.path} was written by a newer Visavis (format {record['format']}); "
                "install that version"
            )
        if record["prefix"] != ledger.prefix:
            raise LedgerError(
                f"{ledger.path} issues labels with prefix {record['prefix']!r}, not "
                f"{ledger.prefix!r}; simulated and real participants have ledgers of their own"
            )
    elif event == "added":
        entries[str(record["label"])] = Participant(
            label=str(record["label"]),
            number=int(record["number"]),
            index=int(record["index"]),
            group=str(record["group"]),
            consent_version=str(record["consent_version"]),
            added_at=str(record["at"]),
            replaces=str(record["replaces"]),
        )
    elif event == "renamed":
        _rename(entries, str(record["label"]), str(record["to"]), int(record["number"]))
    else:
        label, at = str(record["label"]), str(record["at"])
        changes: dict[str, Callable[[], dict[str, Any]]] = {
            "consented": lambda: {"consent_version": str(record["consent_version"])},
            "body": dict,  # what they said is in their folder
            "withdrawing": lambda: {
                "status": "withdrawing",
                "withdrawn_at": at,
                "reason": str(record["reason"]),
                # a ledger from before this was noted keeps the place
                "has_freed_place": record.get("had_data", True) is False,
            },
            "withdrawn": lambda: {"status": "withdrawn", "withdrawn_at": at},
        }
        entries[label] = replace(entries[label], **changes[event]())


def _rename(entries: dict[str, Participant], label: str, new_label: str, number: int) -> None:
    """Give an entry its corrected identifier, in its place, also where another replaces it."""
    before = list(entries.values())
    entries.clear()
    for person in before:
        one = replace(person, replaces=new_label) if person.replaces == label else person
        if person.label == label:
            former = (*person.former_labels, label)
            one = replace(one, label=new_label, number=number, former_labels=former)
        entries[one.label] = one
