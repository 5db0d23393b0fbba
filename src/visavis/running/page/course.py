"""The course of a session on a page, as a generator: steps of the page out, its replies in.

The same replies give the same course. Whoever performs it writes every reply down before the next
step goes out, so that after a crash the replies lead it back to the step where it was.
"""

import base64
import hashlib
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Final, TypeAlias

import numpy as np

from visavis.protocol.plan.questionnaires import Question, Questionnaire, read_answer
from visavis.protocol.plan.session_plan import Block, SessionPlan, Trial, name_after_block
from visavis.protocol.plan.steps import EndEarly, Mark, Repeat, Row
from visavis.running.page.flat import USUAL_DISTANCE_MM, measured_screen
from visavis.running.page.headset_information import headset_information
from visavis.running.page.spoken_digits import HOW_MANY, say_digits, spoken_digits
from visavis.running.page.steps import PRELOAD, PageStep, Reply, count, mapping, number, put
from visavis.running.page.trial import FilmFailed, FilmFiles, perform_on_page
from visavis.study.careless_answers import NOT_HEARD
from visavis.study.experiment import HANDS, StudyExperiment
from visavis.study.information import Information, information_on_page
from visavis.study.live import BOTH_PLACES, PLACES, SEEN_IN
from visavis.study.trial import TrialScript
from visavis.study.trial_settings import Settings

QUESTIONS_A_PAGE: Final = 8
CARD_MM: Final = (85.6, 53.98)
"""A bank card (ISO/IEC 7810, ID-1), which everybody has at hand."""
SCREEN_MEASURED: Final = "screen_measured"
HEADSET_ENTERED: Final = "headset_entered"
DISCOMFORT: Final = "discomfort"
MAX_DISCOMFORT: Final = 10
SOUND_CHECKED: Final = "sound_checked"
SOUND_FLAG: Final = "sound interrupted"
"""Flag on a trial in which the browser stopped what sounded."""
FILMS_LOADED: Final = "films_loaded"
"""A page loads films by itself: no person replied to the step before this event."""
SOUND_STREAM: Final = 0x50D
"""Random stream of a session that chooses the spoken digits."""
ASSETS: Final = ("person", "beside", "blend", "room", "poses")
"""The files that a page draws a live figure from."""
DRAWN: Final = ("film", "mould", "live")
"""How columns begin of what the page draws for as long as its reader stays."""
FACTS_OF_ENTERING: Final = (
    *("entered", "rate_hz", "space", "controllers", "profiles", "renderer"),
    "why",
)
NO_FRAMES: Final = dict.fromkeys(
    ("frames", "frames_dropped", "gaze_expected", "gaze_received", "gaze_valid"), 0
)
"""What a row counts of frames where nothing moves, and of gaze, as a page has no eye tracker."""
STOPPED: Final = "stopped"
WITHDRAWN: Final = "withdrawn"
"""Stopped, and what was recorded is to be deleted."""
DECLINED: Final = "declined"
FULL: Final = "full"
"""Consented, or began where no consent is asked for, but all places had been taken meanwhile."""
DONE: Final = "done"


@dataclass(frozen=True)
class Event:
    """Something to be written into the recording."""

    name: str
    payload: Mapping[str, Any]


@dataclass(frozen=True)
class TrialRow:
    """A trial's row to be written into the recording."""

    row: Row


@dataclass
class Notes:
    """What happened around the steps of a trial, flagged in its row."""

    flags: list[str] = field(default_factory=list)
    standing: list[str] = field(default_factory=list)
    """Flags of every trial to come."""
    place: str = ""
    """Where the page is seen, of a study that may enter a headset: one of `PLACES`."""
    trial_places: set[str] = field(default_factory=set)
    """Where it was seen since the trial began."""

    def begin(self) -> None:
        """Begin a trial, about which nothing is noted yet."""
        self.flags.clear()
        self.trial_places = {self.place}

    def move_to(self, place: str) -> None:
        """Note where the page is seen from now on: one of `PLACES`."""
        self.place = place
        self.trial_places.add(place)

    @property
    def seen_in(self) -> str:
        """Where the trial was seen: one of `PLACES`, or both."""
        return self.place if self.trial_places == {self.place} else BOTH_PLACES

    @property
    def all(self) -> list[str]:
        """The flags of a trial."""
        return [*self.standing, *self.flags]

    def add(self, flag: str) -> None:
        """Flag the trial that goes on; each flag once."""
        if flag not in self.flags:
            self.flags.append(flag)


@dataclass(frozen=True, eq=False)
class Visit:
    """Everything the course of one participant's session depends on.

    `files` returns what a page must know about a film, `now_ns` the session time.
    """

    experiment: StudyExperiment
    plan: SessionPlan
    participant_label: str
    session: int
    part: int
    questionnaires: Sequence[Questionnaire]
    files: FilmFiles
    now_ns: Callable[[], int]
    notes: Notes = field(default_factory=Notes)
    attempt_of: Callable[[str, int], int] = lambda trial_id, nth: nth
    """Returns the attempt that a trial's nth performance in this course is."""
    performances: Counter[str] = field(default_factory=Counter)
    """How often each trial has been performed in this course."""
    endings: dict[int | None, str] = field(default_factory=dict)
    """Why blocks, by index, or the whole session (None) ended before their end."""

    @cached_property
    def settings(self) -> Settings:
        """What the trials of this visit share: the study's, with a memory and rows of its own."""
        return replace(self.experiment.settings, memory={}, rows=[], repeats={})


Out: TypeAlias = PageStep | Event | TrialRow
Course: TypeAlias = Generator[Out, Reply | None, str]


class NoPlace(Exception):
    """Somebody began as all places had been taken."""


class StopRequest(Exception):
    """A participant stopped; `keep` says whether what was recorded may stay."""

    def __init__(self, keep: bool) -> None:
        super().__init__()
        self.keep = keep


@dataclass(frozen=True)
class Consent:
    """What participants read and consent to: the study's texts, and what is recorded."""

    information: str
    recorded: Information
    text: str

    @property
    def version(self) -> str:
        """The beginning of the SHA-256 of all they read: another text is another version."""
        texts = (self.information, self.recorded.as_text, self.text)
        return hashlib.sha256("\n".join(texts).encode()).hexdigest()[:12]


def consent_of(
    experiment: StudyExperiment, plan: SessionPlan, questionnaires: Sequence[Questionnaire]
) -> Consent | None:
    """Return what participants read and consent to; None where the study asks for no consent."""
    values = experiment.values_of(plan)
    text = experiment.texts.find("consent", values=values)
    if text is None:
        return None
    information = experiment.texts.find("information", values=values) or ""
    return Consent(information, information_on_page(experiment, questionnaires), text)


def course(visit: Visit) -> Course:
    """Perform a session on a page; returns how it ended: DONE or one of the other outcomes."""
    experiment, texts = visit.experiment, visit.experiment.texts
    try:
        consent = consent_of(experiment, visit.plan, visit.questionnaires)
        if consent is not None:
            reply = yield from _step(
                PageStep(
                    "consent",
                    {
                        "title": texts.find("page.consent_title") or "",
                        "information": consent.information,
                        "recorded": {
                            "before": consent.recorded.before,
                            "lines": list(consent.recorded.lines),
                            "after": consent.recorded.after,
                        },
                        "text": consent.text,
                        "version": consent.version,
                    },
                )
            )
            has_consented = reply.content.get("agreed") is True
            yield Event("consent", {"version": consent.version, "agreed": has_consented})
            if not has_consented:
                return DECLINED
        is_flat = experiment.fills_screen
        if is_flat or "card" in experiment.study.procedure.screening:
            asks = {"usual_distance_mm": USUAL_DISTANCE_MM} if is_flat else {}
            reply = yield from _step(PageStep("card", {"card_mm": CARD_MM, **asks}))
            px_per_mm = reply.content["px_per_mm"]
            sizes = _sizes(px_per_mm, reply.content.get("distance_mm")) if is_flat else {}
            yield Event(SCREEN_MEASURED, {"px_per_mm": px_per_mm, **sizes})
        if "sound" in experiment.study.procedure.screening:
            yield from _sound(visit)
        films = [visit.files(film) for film in experiment.films]
        films += [visit.files(video) for video in experiment.videos]
        lives = [visit.files(live) for live in experiment.lives]
        parts = [part for live in lives for part in (live, *live.get("people", ()))]
        files = [part[name] for part in parts for name in ASSETS if name in part]
        assets = [*{file["name"]: file for file in files}.values()]  # each once
        pictures = [visit.files(picture) for picture in experiment.pictures]
        pictures += [visit.files(panorama) for panorama in experiment.panoramas]
        sounds = [visit.files(sound) for sound in experiment.audibles]
        if films or lives or pictures or sounds:
            more = {"assets": assets} if assets else {}
            more |= {"pictures": pictures} if pictures else {}
            more |= {"sounds": sounds} if sounds else {}
            reply = yield from _step(PageStep(PRELOAD, {"films": films, **more}))
            yield Event(FILMS_LOADED, dict(mapping(reply.content.get("films", {}), "films")))
        has_entered = yield from _enter(visit)
        for block in visit.plan.blocks:
            yield from _block(visit, block)
        of_blocks = {name for block in visit.plan.blocks for name in block.questionnaires}
        for questionnaire in visit.questionnaires:
            if questionnaire.name not in of_blocks:
                yield from _questionnaire(visit, questionnaire, questionnaire.name)
        if has_entered:
            yield from _discomfort(visit, "after")
    except StopRequest as stop:
        yield Event("stopped", {"keep": stop.keep})
        return STOPPED if stop.keep else WITHDRAWN
    except NoPlace:
        yield Event("full", {})
        return FULL
    return DONE


def _enter(visit: Visit) -> Generator[Out, Reply | None, bool]:
    """Let somebody enter a headset, where the study may; tell whether they did."""
    xr = visit.experiment.study.procedure.xr
    if xr == "never":
        return False
    information = headset_information(visit.experiment.texts)
    needs = [HANDS] if HANDS in visit.experiment.headset_streams else []
    about = {"lines": list(information.lines), "version": information.version}
    reply = yield from _step(PageStep("enter", {"xr": xr, "needs": needs, **about}))
    has_entered = reply.content["entered"] is True
    visit.notes.move_to(PLACES[0] if has_entered else PLACES[1])
    facts = {name: reply.content[name] for name in FACTS_OF_ENTERING if name in reply.content}
    yield Event(HEADSET_ENTERED, {"version": information.version, **facts})
    if has_entered:
        yield from _discomfort(visit, "before")
    return has_entered


def _discomfort(visit: Visit, moment: str) -> Generator[Out, Reply | None, None]:
    """Ask how somebody feels, before the first trial in a headset or after the last one."""
    values = [str(n) for n in range(MAX_DISCOMFORT + 1)]
    question = {
        "name": DISCOMFORT,
        "prompt": visit.experiment.texts.get("page.vr_discomfort"),
        "kind": "rating",
        "options": [{"value": value, "label": value} for value in values],
        "is_optional": True,
    }
    reply = yield from _step(
        PageStep("questions", {"title": "", "text": "", "questions": [question]})
    )
    answer = mapping(reply.content.get("answers"), "answers").get(DISCOMFORT)
    rating = None if answer is None else int(answer)
    yield Event(DISCOMFORT, {"moment": moment, "rating": rating})


def _sizes(px_per_mm: float | None, distance_mm: float | None) -> dict[str, Any]:
    """Return how sizes in degrees follow from what somebody measured, and how sure that is."""
    screen = measured_screen(px_per_mm, distance_mm)
    return {
        "distance_mm": distance_mm,
        "size_by": screen.size_by,
        "distance_by": screen.distance_by,
        "px_per_deg": round(screen.px_per_deg, 3),
        "size_error_01": screen.size_error_01,
    }


def _sound(visit: Visit) -> Generator[Out, Reply | None, None]:
    """Play spoken digits; flag a participant who types other digits or none."""
    experiment, plan = visit.experiment, visit.plan
    files = spoken_digits(experiment.language, experiment.settings.folder)
    rng = np.random.default_rng([plan.seed, plan.participant_index, SOUND_STREAM])
    digits = [int(digit) for digit in rng.integers(0, 10, HOW_MANY)]
    wav = base64.b64encode(say_digits(digits, files)).decode()
    reply = yield from _step(PageStep("sound", {"wav": wav}))
    typed_digits, correct_digits = reply.content["heard"], "".join(map(str, digits))
    yield Event(
        SOUND_CHECKED,
        {
            "said": correct_digits,
            "heard": typed_digits,
            "is_right": typed_digits == correct_digits,
            "played": reply.content["played"],
        },
    )
    if typed_digits != correct_digits:
        visit.notes.standing.append(NOT_HEARD)


def _block(visit: Visit, block: Block) -> Generator[Out, Reply | None, None]:
    if None in visit.endings:
        yield from _skip(visit, block.trials, visit.endings[None])
        return
    pause = visit.experiment.pause_before(visit.plan, block) if block.index else ""
    for text in filter(None, (pause, block.instruction)):
        yield from _step(PageStep("text", {"title": block.name, "text": text}))
    yield Event(
        "block_start",
        {"block": block.index, "block_name": block.name, "trials_left": len(block.trials)},
    )
    queue, rounds = deque(block.trials), 1
    while queue:
        trial = queue.popleft()
        wish = yield from _trial(visit, block, trial)
        if isinstance(wish, Repeat):
            queue.append(trial)
        elif wish is not None:
            yield from _end(visit, trial, wish, queue)
        if not queue and block.is_practice and not visit.endings:
            queue.extend((yield from _further_practice(visit, block, rounds)))
            rounds += 1
    yield Event("block_end", {"block": block.index})
    if None in visit.endings:
        return
    for questionnaire in visit.questionnaires:
        if questionnaire.name in block.questionnaires:
            yield from _questionnaire(
                visit, questionnaire, name_after_block(questionnaire.name, block)
            )


def _end(
    visit: Visit, trial: Trial, ending: EndEarly, queue: deque[Trial]
) -> Generator[Out, Reply | None, None]:
    """Leave out the trials that an early end leaves in its block; later blocks follow suit."""
    visit.endings[trial.block if ending.of == "block" else None] = ending.reason
    about = {"trial_id": trial.trial_id, "block": trial.block}
    yield Event("ended_early", {**about, "of": ending.of, "reason": ending.reason})
    yield from _skip(visit, queue, ending.reason)
    queue.clear()


def _skip(visit: Visit, trials: Iterable[Trial], reason: str) -> Generator[Out, Reply | None, None]:
    """Write the rows of trials that are left out."""
    for trial in trials:
        visit.performances[trial.trial_id] += 1
        attempt = visit.attempt_of(trial.trial_id, visit.performances[trial.trial_id])
        about = {"trial_id": trial.trial_id, "attempt": attempt, "block": trial.block}
        yield Event("trial_start", about)
        now_ns = visit.now_ns()
        outcome = {"status": "skipped", "reason": reason, "flags": ""}
        times = {"t_start_ns": now_ns, "t_end_ns": now_ns}
        yield _row(visit, trial, attempt, {**outcome, **trial.factors, **times, **NO_FRAMES})


def _further_practice(
    visit: Visit, block: Block, rounds: int
) -> Generator[Out, Reply | None, tuple[Trial, ...]]:
    """Return the trials of another round of practice, where the study asks for one."""
    after = visit.experiment.after_practice(block, rounds, visit.settings.rows)
    if after.ends:
        yield from _end(visit, block.trials[-1], EndEarly(after.ends), deque())
    if not after.again:
        return ()
    names = [trial.trial_id for trial in block.trials]
    yield Event("practice_again", {"block": block.index, "trial_ids": names})
    yield from _step(PageStep("text", {"title": block.name, "text": after.again}))
    return block.trials


def _trial(
    visit: Visit, block: Block, trial: Trial
) -> Generator[Out, Reply | None, Repeat | EndEarly | None]:
    """Perform a trial; return what it asks for: its repetition, or an early end."""
    visit.performances[trial.trial_id] += 1
    nth = visit.performances[trial.trial_id]
    number_of = {
        "trial": trial.number,
        "trials": sum(t.is_practice == trial.is_practice for t in visit.plan.trials),
        "is_practice": trial.is_practice,
        **({"again": nth - 1} if nth > 1 else {}),
    }
    start_ns = visit.now_ns()
    attempt = visit.attempt_of(trial.trial_id, nth)
    about = {"trial_id": trial.trial_id, "attempt": attempt, "block": block.index}
    yield Event("trial_start", about)
    visit.notes.begin()
    script = TrialScript(trial, visit.settings)
    performing = perform_on_page(script, visit.experiment.study.trial_plan, visit.files)
    row: Row = {}
    status, reason = "complete", None
    try:
        reply: Reply | None = None
        while True:
            out = performing.send(reply)
            reply = None
            if isinstance(out, Mark):
                yield Event(out.name, out.payload)
            else:
                reply = yield from _step(PageStep(out.kind, {**out.content, **number_of}))
                if number(reply.content.get("hidden_ms", 0), "hidden_ms") > 0:
                    visit.notes.add("page hidden")
                if count(reply.content.get("sound_breaks", 0), "sound_breaks"):
                    visit.notes.add(SOUND_FLAG)
    except StopIteration as end:
        row = end.value or {}
        script.remember(row)
        if isinstance(script.wish, Repeat):
            status, reason = "repeated", script.wish.reason
    except FilmFailed as problem:
        # The row keeps what was done before the film failed.
        row, status, reason = dict(script.row), "skipped", problem.reason
        script.wish = None
    # The row counts frames of all films and figures of the trial together.
    films = {
        k: int(v or 0)
        for k, v in row.items()
        if k.endswith(("_frames", "_frames_dropped"))
        and (
            k.startswith(("film", "mould", "live"))
            or f"{k.removesuffix('_dropped')}_dropped" in row
        )
    }
    dropped_frames = sum(v for k, v in films.items() if k.endswith("_dropped"))
    yield _row(
        visit,
        trial,
        attempt,
        {
            "status": status,
            "reason": reason,
            "flags": ";".join(visit.notes.all),
            **({SEEN_IN.name: visit.notes.seen_in} if visit.notes.place else {}),
            **trial.factors,
            **row,
            "t_start_ns": row.get("t_start_ns", start_ns),
            "t_end_ns": row.get("t_end_ns", visit.now_ns()),
            **NO_FRAMES,
            "frames": sum(films.values()) - dropped_frames,
            "frames_dropped": dropped_frames,
        },
    )
    return script.wish


def _row(visit: Visit, trial: Trial, attempt: int, columns: Row) -> TrialRow:
    return TrialRow(
        {
            "participant": visit.participant_label,
            "participant_index": visit.plan.participant_index,
            "session": visit.session,
            "group": visit.plan.group,
            "part": visit.part,
            "trial_id": trial.trial_id,
            "number": trial.number,
            "block": trial.block,
            "is_practice": trial.is_practice,
            "attempt": attempt,
            **columns,
        }
    )


def _step(step: PageStep) -> Generator[Out, Reply | None, Reply]:
    reply = yield from put(step)
    if reply.content.get("is_full") is True:
        raise NoPlace
    if reply.content.get("stop") is not None:
        raise StopRequest(reply.content["stop"] == "keep")
    return reply


def _questionnaire(
    visit: Visit, questionnaire: Questionnaire, name: str
) -> Generator[Out, Reply | None, None]:
    questions = list(questionnaire.questions())
    for begin in range(0, len(questions), QUESTIONS_A_PAGE):
        part = questions[begin : begin + QUESTIONS_A_PAGE]
        reply = yield from _step(
            PageStep(
                "questions",
                {
                    "title": questionnaire.title,
                    "text": questionnaire.instruction if begin == 0 else "",
                    "questions": [_question(q) for q in part],
                },
            )
        )
        answers = mapping(reply.content.get("answers"), "answers")
        for question in part:
            yield Event(
                "answer",
                {
                    "questionnaire": name,
                    "question": question.question_id,
                    "answer": _read(question, answers.get(question.question_id)),
                },
            )
    yield Event("questionnaire_complete", {"questionnaire": name})


def _question(question: Question) -> dict[str, Any]:
    scale = question.scale
    bounds = {"low": scale.minimum, "high": scale.maximum} if scale.kind == "number" else {}
    return {
        "name": question.question_id,
        "prompt": question.prompt,
        "kind": {"options": "list", "number": "number", "text": "text"}[scale.kind],
        "options": [{"value": str(v), "label": label} for v, label in scale.options.items()],
        "is_optional": True,
        **bounds,
    }


def _read(question: Question, content: Any) -> str | None:
    read = read_answer(question, content)
    return None if read is None else str(read)


def texts_of_page(experiment: StudyExperiment) -> Iterator[tuple[str, str]]:
    """Yield the page's own words by name, in the study's language; the page fills {n} and {m}."""
    for name in experiment.texts.below("page"):
        yield name, experiment.texts.entries[f"page.{name}"]
