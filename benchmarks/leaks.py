"""Plant a mark of its own in everything a session keeps, export it, and look for the marks.

python -m benchmarks.leaks [--only TEXT] [--json]

For every shipped study, and for a study of its own that is known by its file, by the laboratory's
configuration, or not any more, a session is written that holds each column which a trial's row of
it can have, each field of every event, answers to each of its questions and questionnaires, and
what surrounds a session: manifest, reasons, configuration, devices, files of a part, remarks, and
the key file. Each value is a text found nowhere else. The session is exported in the tiers shared
and public to Parquet, BIDS and XDF, and its privacy sheet is made; every byte, name, and text of
what comes out is searched. `leaks` counts marks that came out and may not: free text, what is
private or what nobody declared, ages, days, labels. `marks` are those that may not, `leave` those
that may and do: an export of nothing would leak nothing.
"""

import argparse
import gzip
import json
import struct
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from itertools import count
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
import pyarrow.parquet as pq

from visavis.cli.sharing import dataset_about, names_of_people, shared_recording
from visavis.lab.clock import SimClock
from visavis.lab.config import LabConfig, load_config
from visavis.lab.config_files import EXAMPLE
from visavis.lab.schema import Field, SampleBatch, StreamSchema, empty_values
from visavis.protocol.people.key_file import KeyFile
from visavis.recording.durable import make_folder
from visavis.recording.export import export_recording, export_together
from visavis.recording.folder import create_session
from visavis.recording.manifest import DESIGN_KEY, Manifest
from visavis.recording.privacy_sheet import privacy_sheet
from visavis.recording.provenance import Provenance
from visavis.recording.remarks import Remark, add_remark
from visavis.recording.sealed import write_sealed
from visavis.recording.sharing import ANY, EVENT_CLASSES, SharedRecording
from visavis.recording.writer import Recorder
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.results.tables.dictionary import trial_columns
from visavis.running.sessions.recorded_design import design_of
from visavis.running.sessions.study_folder import SETTINGS_NAME, StudySettings
from visavis.study.catalogue import SHIPPED_STUDIES
from visavis.study.responses import FreeText

TIERS: Final = ("shared", "public")
FORMATS: Final = ("parquet", "bids", "xdf", "sheet")
LABEL: Final = "QZX99L"
DAY: Final = "2031-03-17"
AGE: Final = 37.262144
LENGTH_M: Final = 98765.4375
"""Kept whole by single and double precision, so that its bytes can be looked for."""
TYPED: Final = ("text", "reason", "message")
"""What the operator or participant types."""
OWN: Final = """
from visavis import Choice, Factor, FreeText, Number, Scene, Study

study = Study("own", factors=[Factor("level", ["one"])], uses=[], calibrate=False)


@study.trial
def trial(t):
    yield t.show(Scene("person"), seconds=0.2)
    yield t.ask(Choice("side", ["left", "right"]))
    yield t.ask(Number("age"))
    yield t.ask(FreeText("who"))
"""
BODY: Final = StreamSchema(
    name="limbs",
    nominal_rate_hz=100.0,
    fields=(Field("position_m", "f8", "m", "world", (3,)), Field("valid", "?", "")),
)


@dataclass
class Marks:
    """What was planted: texts and numbers that may not leave, by place, and texts that may."""

    closed: dict[str, str | float] = field(default_factory=dict)
    open: dict[str, str] = field(default_factory=dict)
    public_only: dict[str, float] = field(default_factory=dict)
    """What the public tier alone holds back."""
    _numbers: Iterator[int] = field(default_factory=count)

    def text(self, where: str, *, may_leave: bool = False) -> str:
        """Return a text that stands nowhere else."""
        mark = f"mark{next(self._numbers):05d}q"
        (self.open if may_leave else self.closed)[where] = mark
        return mark


@dataclass(frozen=True)
class Case:
    """A study as an export meets it: how it is known, and the study while it can be read."""

    name: str
    known_by: str
    study: OpenedStudy
    source: str = ""
    of_lab: str = ""


@dataclass
class Outcome:
    """What came out of a study's exports."""

    marks: int = 0
    leave: int = 0
    leaks: list[str] = field(default_factory=list)


def cases(root: Path) -> Iterator[Case]:
    """Yield every shipped study, and one of a file in the ways an export may know it."""
    for name in SHIPPED_STUDIES:
        yield Case(name, "shipped", find_study(name))
    path = root / "own.py"
    path.write_text(OWN, "utf-8")
    own = find_study(str(path))
    yield Case("own", "file", own, source=str(path))
    yield Case("own", "registered", own, of_lab=str(path))
    yield Case("own", "lost", own, source=str(root / "gone.py"))


def events(study: OpenedStudy, marks: Marks) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield every event with each of its fields, one that nobody declared, and all answers."""
    for name, classes in EVENT_CLASSES.items():
        content = {}
        for field_name, kind in classes.items():
            known = "anything" if field_name == ANY else field_name
            if kind != "answer":
                content[known] = marks.text(f"{name}: {known}", may_leave=kind == "public")
        if ANY not in classes:
            content["undeclared"] = marks.text(f"{name}: undeclared")
        content |= {"scene_name": "one"} if "scene_name" in content else {}
        yield name, {k: [v] if k in ("agents", "people") else v for k, v in content.items()}
    yield "undeclared", {"field": marks.text("undeclared: field")}


def answers(
    study: OpenedStudy, lab: LabConfig, marks: Marks
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield an answer to every question of a study and its questionnaires, and to unknown ones."""
    for name, response in study.experiment({}).responses.items():
        is_typed = isinstance(response, FreeText)
        value = AGE if name == "age" else marks.text(f"answered {name}", may_leave=not is_typed)
        yield "answered", {"trial_id": "T1", "question": name, "answer": value}
    for form in study.questionnaires(lab):
        for question in form.questions():
            at = {"questionnaire": form.name, "question": question.question_id}
            is_typed = question.scale.kind == "text"
            where = f"answer {form.name} {question.question_id}"
            is_age = question.question_id == "age"
            value = AGE if is_age else marks.text(where, may_leave=not is_typed)
            yield "answer", {**at, "answer": value, "said": marks.text(f"{where}: said")}
    yield "answer", {"questionnaire": "x", "question": "y", "answer": marks.text("answer unknown")}
    yield "answered", {"question": "z", "answer": marks.text("answered unknown")}


def trial_row(study: OpenedStudy, marks: Marks) -> dict[str, Any]:
    """Return a row with every column that the study's trials can have, and some of nobody's."""
    experiment = study.experiment({})
    typed = {n for n, r in experiment.responses.items() if isinstance(r, FreeText)}
    known = trial_columns(experiment, study.measures(experiment))
    row: dict[str, Any] = {}
    for name in (*known, "undeclared", "remark", *(f"{q}_typed" for q in experiment.responses)):
        if name == "age":
            row[name] = AGE
        elif name not in ("participant", "trial_id", "status"):
            may_leave = name in known and name not in (*TYPED, *typed, "participant_index")
            is_wrong_kind = name.endswith(("_ns", "_typed", "_renderer"))
            row[name] = marks.text(f"column {name}", may_leave=may_leave and not is_wrong_kind)
            if may_leave and is_wrong_kind:
                del marks.closed[f"column {name}"]
                row[name] = None
    return {**row, "participant": LABEL, "trial_id": "T1", "status": "complete"}


def manifest_of(case: Case, marks: Marks) -> Manifest:
    """Return a manifest whose texts are marks, but for what it takes to find the study."""
    design = design_of(case.study.experiment({}))
    parts = ("lab", "operator", "address", "data_root", "key_root")
    device = {"vendor": "maker", "model": "model", "serial": "serial", "driver_version": "1"}
    private = ("port", "message", "host", "user")
    return Manifest(
        study=case.name,
        participant=LABEL,
        session=1,
        is_simulated=False,
        plan={"trials": ["T1"], "note": marks.text("plan: note")},
        seed=7,
        configuration={
            DESIGN_KEY: design,
            **{part: marks.text(f"configuration: {part}") for part in parts},
        },
        devices=[{"role": "gaze", **device, **{p: marks.text(f"device: {p}") for p in private}}],
        calibrations=[{"note": marks.text("calibration: note")}],
        consent_version=marks.text("consent_version"),
        created_wall_iso=f"{DAY}T10:11:12+00:00",
        provenance=Provenance("3.11", {"numpy": "2"}, ""),
    )


def recorded(case: Case, lab: LabConfig, marks: Marks) -> Path:
    """Write the session, and what stands around it; return its folder."""
    clock = SimClock()
    with create_session(lab.data_root, manifest_of(case, marks)) as folder:
        part = folder.begin_part(clock)
        recorder = Recorder(part, clock, threaded=False, max_batch_ns=10**9, is_simulated=False)
        recorder.declare(BODY)
        seq = np.arange(3, dtype=np.int64)
        values = empty_values(BODY, 3)
        values["position_m"] = LENGTH_M
        values["valid"] = True
        recorder.append(SampleBatch(BODY, seq, seq, seq, values))
        marks.public_only["stream limbs"] = LENGTH_M
        for name, content in (*events(case.study, marks), *answers(case.study, lab, marks)):
            recorder.event(name, 0, **content)
        recorder.trial(trial_row(case.study, marks))
        folder.end_part(clock, recorder.close("complete"), reason=marks.text("part: reason"))
        session = folder.path
    marks.closed |= {"age": AGE, "label": LABEL, "day": DAY}
    person, study = session.parent, session.parent.parent
    identity = {key: marks.text(f"key file: {key}") for key in ("name", "contact")}
    KeyFile(lab.key_root, case.name, [lab.data_root]).identify(LABEL, identity)
    text, author = marks.text("remark: text"), marks.text("remark: author")
    add_remark(person, Remark("note", LABEL, 1, "T1", text, author, DAY))
    settings = StudySettings(case.name, 7, False, source=case.source)
    write_sealed(study / SETTINGS_NAME, asdict(settings))
    return session


def written(recording: SharedRecording, form: str, target: Path, lab: LabConfig) -> bytes:
    """Export a recording and return all that came out, names of files too, as bytes."""
    if form == "sheet":
        sheet = privacy_sheet([recording], names_of_people([recording], lab))
        return repr(sheet).encode()
    if form == "bids":
        export_together([recording], target, dataset_about(recording, lab))
    else:
        export_recording(recording, form, target)
    return b"\n".join(_content(path) for path in sorted(target.rglob("*")))


def _content(path: Path) -> bytes:
    if path.is_dir():
        return path.name.encode()
    data = path.read_bytes()
    if path.suffix == ".gz":
        data = gzip.decompress(data)
    if path.suffix == ".parquet":
        about = repr(pq.read_schema(path).metadata).encode()
        data += pd.read_parquet(path).to_csv().encode() + about
    return b"\n".join((path.name.encode(), data))


def is_in(mark: str | float, content: bytes) -> bool:
    """Tell whether a text, or a number in words or as eight or four bytes, stands in bytes."""
    if isinstance(mark, str):
        return mark.encode() in content
    forms = (repr(mark).encode(), struct.pack("<d", mark), struct.pack("<f", mark))
    return any(form in content for form in forms)


def measure(case: Case, root: Path, tiers: Sequence[str] = TIERS) -> Outcome:
    """Export a study's session in tiers and all formats; return what came out."""
    lab = _lab(case, root)
    marks, outcome = Marks(), Outcome()
    session = recorded(case, lab, marks)
    everything = b""
    for tier in tiers:
        closed = marks.closed | (marks.public_only if tier == "public" else {})
        for form in FORMATS:
            recording = shared_recording(session, lab, tier=tier, keep_label=False)
            content = written(recording, form, root / f"{tier}-{form}", lab)
            outcome.marks += len(closed)
            outcome.leaks += [
                f"{case.name} ({case.known_by}), {tier}, {form}: {where}"
                for where, mark in closed.items()
                if is_in(mark, content)
            ]
            everything += content
    outcome.leave = sum(is_in(mark, everything) for mark in marks.open.values())
    return outcome


def _lab(case: Case, root: Path) -> LabConfig:
    make_folder(root, exist_ok=True)
    path = root / "lab_config.yaml"
    of_lab = f"\nstudies:\n  own: {case.of_lab}\n" if case.of_lab else ""
    path.write_text(EXAMPLE.read_text("utf-8") + of_lab, "utf-8")
    found = {"data_root": root / "data", "key_root": root / "keys"}
    return load_config(path).model_copy(update=found)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a row per study; 1 if anything leaked."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", default="", help="studies whose name holds this")
    parser.add_argument("--json", action="store_true", help="print JSON instead")
    chosen = parser.parse_args(arguments)
    outcomes: dict[str, Outcome] = {}
    with tempfile.TemporaryDirectory(prefix="leaks-") as root:
        for case in cases(Path(root)):
            if chosen.only in case.name:
                name = f"{case.name} ({case.known_by})"
                outcomes[name] = measure(case, Path(root) / f"{case.name}-{case.known_by}")
    if chosen.json:
        print(json.dumps({name: asdict(outcome) for name, outcome in outcomes.items()}))
    else:
        print(f"{'':28}{'marks':>8}{'leave':>8}{'leaks':>8}")
        for name, o in outcomes.items():
            print(f"{name:28}{o.marks:>8}{o.leave:>8}{len(o.leaks):>8}")
        for leak in (leak for o in outcomes.values() for leak in o.leaks):
            print(f"leak  {leak}")
    return 1 if any(outcome.leaks for outcome in outcomes.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
