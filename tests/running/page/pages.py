"""A desk with a recording of its own, and a page that answers as somebody simulated would."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from tests.faults.sessions import lab
from visavis.lab.clock import SimClock
from visavis.lab.config import LabConfig
from visavis.recording.folder import SessionFolder, create_session, open_session
from visavis.recording.manifest import Manifest
from visavis.recording.provenance import provenance
from visavis.recording.reader import Recording
from visavis.recording.writer import VIRTUAL_TIME_BATCH_NS, Recorder
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.running.film_store import film_store
from visavis.running.page.course import Notes, Visit, course
from visavis.running.page.desk import PageDesk
from visavis.running.page.earlier_parts import EarlierParts, back_to
from visavis.running.page.steps import PageStep
from visavis.running.page.visitor import Visitor, visitor_of
from visavis.study.experiment import StudyExperiment
from visavis.study.returning import Resumes

STUDY = Path(__file__).parents[2] / "studies" / "films.py"
SEED = 1
TAB = "one"


@cache
def study() -> OpenedStudy:
    """Return the study of films."""
    found = find_study(str(STUDY))
    assert isinstance(found, OpenedStudy)
    return found


@cache
def experiment() -> StudyExperiment:
    """Return it with its usual parameters."""
    return study().experiment({})


def config(root: Path) -> LabConfig:
    """Return a laboratory that records into a folder."""
    return lab(root)


@dataclass
class Page:
    """A page that answers one step after another."""

    desk: PageDesk
    visitor: Visitor
    clock: SimClock

    def event(self) -> dict[str, Any]:
        """Return the reply to the step that is told."""
        state = self.desk.state()
        step = dict(state["step"])
        content = self.visitor.reply(PageStep(step.pop("kind"), step))
        self.clock.sleep_until_ns(round(self.visitor.now_ms * 1e6))
        return {
            "n": state["ack"] + 1,
            "kind": "reply",
            "at_ms": self.visitor.now_ms,
            "step": state["number"],
            "reply": content,
        }

    def answer(self) -> None:
        """Answer the step; what is acknowledged then is on the disk."""
        self.desk.take(TAB, [self.event()])
        self.desk.recorder.checkpoint()

    def answer_all(self) -> int:
        """Answer every step to the end; return how many there were."""
        count = 0
        while not self.desk.is_over:
            self.answer()
            count += 1
        return count


@contextmanager
def begin_session(root: Path, label: str = "S01") -> Iterator[tuple[Page, Path]]:
    """Begin a session and give its page; nothing is closed at the end, as after a power cut."""
    plan = experiment().plan(0, SEED)
    manifest = Manifest(
        "films", label, 1, True, plan, SEED, {"on": "browser"}, (), "", "", provenance()
    )
    with create_session(root, manifest) as folder:
        yield page_of(folder, None), folder.path


@contextmanager
def go_on_with(
    path: Path, checkpoint: Resumes = "step", *, says_hello: bool = True
) -> Iterator[Page]:
    """Go on with a session that broke off; the page says hello, unless it noticed nothing."""
    folder, _ = open_session(path)
    with folder:
        yield page_of(folder, back_to(Recording(path), checkpoint), says_hello=says_hello)


def page_of(folder: SessionFolder, past: EarlierParts | None, *, says_hello: bool = True) -> Page:
    """Return a page with a desk that records into a new part of a session."""
    clock = SimClock()
    part = folder.begin_part(clock)
    recorder = Recorder(
        part, clock, threaded=False, max_batch_ns=VIRTUAL_TIME_BATCH_NS, is_simulated=True
    )
    made, notes = experiment(), Notes()
    store = film_store(made)
    visit = Visit(
        made,
        made.plan(0, SEED),
        folder.manifest.participant,
        1,
        folder.manifest.parts[-1].number,
        study().questionnaires(config(folder.path)),
        lambda film: store.describe(film, is_simulated=True),
        clock.now_ns,
        notes,
        EarlierParts().attempt_of if past is None else past.attempt_of,
    )
    desk = PageDesk(course(visit), recorder, clock, notes, past, key="key")
    person = study().participant(0, SEED, effect=True, experiment=made)
    visitor = visitor_of(person, made, store)
    for step in desk.trial_steps[:-1]:
        if step.kind == "watch":
            visitor.look(step.content)
    if says_hello:
        desk.hello(TAB)
    return Page(desk, visitor, clock)
