"""What a participant saw of a trial on a page, and when: its films, questions and answers.

The recorded replies run the trial's own script again, so the content of the page is what the script
put there, and the times are those from which the trial's row was made.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from visavis.lab.errors import DesignError
from visavis.lab.screen import FlatScreen
from visavis.protocol.plan.session_plan import Trial
from visavis.protocol.plan.steps import Mark
from visavis.recording.page_clock import PageClocks
from visavis.recording.reader import Recording
from visavis.results.opened_study import OpenedStudy, overrides_of
from visavis.running.film_store import FilmStore, film_store
from visavis.running.page.flat import (
    MAX_VIEW_PX,
    PageScreen,
    before_eyes,
    flat_scene,
    read_lit,
    read_screen,
    screen_of,
    view_turns,
)
from visavis.running.page.steps import PageError, PageStep, Reply
from visavis.running.page.trial import FilmFailed, perform_on_page
from visavis.stimuli.scenes.flat import FlatScene
from visavis.study.actions import Action
from visavis.study.experiment import StudyExperiment
from visavis.study.films import Film, LiveFilm, Viewing, films_of
from visavis.study.trial import TrialScript

USUAL_VIEW_PX: Final = (1280, 720)
"""Size of a page of which the recording does not say it."""


@dataclass(frozen=True)
class Question:
    """A question below a film: its options as (value, label), none where it is typed."""

    name: str
    prompt: str
    options: tuple[tuple[str, str], ...]
    answer: str | None
    answered_ns: int | None


@dataclass(frozen=True, eq=False)
class SeenPart:
    """Flat stimuli that were lit from `on_ns` to `off_ns`, on a page that was `screen`; where the
    recording has no `window_px`, its pixels are those of a usual page.
    """

    on_ns: int
    off_ns: int
    scene: FlatScene
    screen: FlatScreen
    page: PageScreen
    window_px: tuple[int, int] | None


@dataclass(frozen=True, eq=False)
class SeenStep:
    """One step of a page, in session time: from `shown_ns` to `gone_ns`.

    `films` holds the films by place on the page; they repeat from `films_on_ns` on. `parts` are the
    flat stimuli that it showed one after another.
    """

    shown_ns: int
    gone_ns: int
    films_on_ns: int
    films: Mapping[str, Film]
    caption: str
    questions: tuple[Question, ...]
    parts: tuple[SeenPart, ...] = ()

    def film_time_s(self, film: Film, t_ns: int) -> float:
        """Return which second of a film was on the page at a session time."""
        passed_s = max(0, t_ns - self.films_on_ns) / 1e9
        return passed_s % (film.frame_count / film.rate_hz)


@dataclass(frozen=True, eq=False)
class SeenTrial:
    """A trial as its page showed it; `row` is its recorded row, `store` has its films. `problem`
    says what of it the study does not show again, and why.
    """

    row: Mapping[str, Any]
    steps: tuple[SeenStep, ...]
    store: FilmStore
    problem: str = ""

    @property
    def span_ns(self) -> tuple[int, int]:
        """When its first step appeared and its last one disappeared."""
        if not self.steps:
            return int(self.row["t_start_ns"]), int(self.row["t_end_ns"])
        return self.steps[0].shown_ns, self.steps[-1].gone_ns

    def step_at(self, t_ns: int) -> SeenStep | None:
        """Return what stood on the page at a time."""
        return next((s for s in self.steps if s.shown_ns <= t_ns < s.gone_ns), None)


def is_on_page(recording: Recording) -> bool:
    """Tell whether a session was performed on a page in a browser."""
    return bool(recording.manifest.configuration.get("on") == "browser")


def seen_trial(study: OpenedStudy, recording: Recording, row: Mapping[str, Any]) -> SeenTrial:
    """Return a trial, by its recorded row, as its page showed it.

    If a restart of the server interrupted it, only the steps after the restart are returned.
    """
    plan = recording.manifest.plan
    experiment: StudyExperiment = study.experiment(overrides_of(plan), is_recorded=True)
    trial_content = next(
        t for block in plan["blocks"] for t in block["trials"] if t["trial_id"] == row["trial_id"]
    )
    # A staircase stood where the rows of the trials before lead it.
    earlier = recording.trials().to_dict("records")
    before: list[Mapping[str, Any]] = [
        {str(name): value for name, value in r.items()}
        for r in earlier
        if int(r["t_start_ns"]) < int(row["t_start_ns"])
    ]
    settings = replace(experiment.settings, memory={}, rows=before)
    script = TrialScript(Trial(**trial_content), settings)
    watched_steps: list[Viewing | None] = []

    def note_steps(t: TrialScript) -> Any:
        """Perform the study's own steps, and note what each puts on the page."""
        steps: Any = experiment.study.trial_plan(t)
        reply: Any = None
        while True:
            try:
                action = steps.send(reply)
            except StopIteration as end:
                return end.value
            if isinstance(action, Action) and action.name != "mark":
                watched_steps.append(action.viewing)
            reply = yield action

    replies = _replies(recording, str(row["trial_id"]), int(row["attempt"]))
    performing = perform_on_page(script, note_steps, lambda film: {"film": "", "sha256": ""})
    seen_steps: list[SeenStep] = []
    reply: Reply | None = None
    again, problem = script.row, ""
    try:
        for part, t_ns, payload, t_ns_of, moves in replies:
            out = performing.send(reply)
            while isinstance(out, Mark):
                out = performing.send(None)
            reply = Reply(payload["reply"], t_ns, t_ns_of, moves)
            if part == int(row["recording_part"]):
                watched = watched_steps[-1] if out.kind == "watch" else None
                seen_steps.append(_step(out, watched, reply, settings.folder))
        out = performing.send(reply)  # columns of the last reply
        while isinstance(out, Mark):
            out = performing.send(None)
    except StopIteration as end:
        again = end.value or again
    except FilmFailed:
        pass
    except (PageError, DesignError) as error:
        problem = str(error)
    missing = _shown_otherwise(row, again)
    if missing:
        # An earlier version of the study was performed.
        why = problem or "the study shows something else today"
        problem = f"not shown again: {', '.join(missing)}; {why}"
    return SeenTrial(row, tuple(seen_steps), film_store(experiment), problem)


def _shown_otherwise(row: Mapping[str, Any], again: Mapping[str, Any]) -> list[str]:
    """Return what a recorded row says was on the page, by the names of its columns, and was not
    shown then when its trial was performed again.
    """
    return [
        column.removesuffix("_on_ns")
        for column, t_ns in row.items()
        if column.endswith("_on_ns") and t_ns is not None and t_ns == t_ns
        if again.get(column) != t_ns
    ]


def _step(step: PageStep, watch: Viewing | None, reply: Reply, folder: Path) -> SeenStep:
    content = reply.content
    shown_ns = reply.t_ns_of(float(content.get("shown_ms") or 0.0))
    if step.kind == "blank":
        shown_ns = reply.t_ns - round(1e9 * float(step.content.get("seconds", 0.0)))
    films: Mapping[str, Film] = {}
    film_replies = content.get("films") or {}
    if watch is not None and not content.get("failed"):
        films = films_of(watch.stimulus)
        if isinstance(watch.stimulus, LiveFilm):
            films, film_replies = {"film": watch.stimulus.film}, {"film": content}
    first = [float(film_replies[place]["first_ms"]) for place in films if place in film_replies]
    answers = content.get("answers") or {}
    questions = []
    for question in step.content.get("questions", ()):
        answer = answers.get(question["name"]) or {}
        at_ms = answer.get("at_ms")
        questions.append(
            Question(
                question["name"],
                question["prompt"],
                tuple((o["value"], o["label"]) for o in question.get("options") or ()),
                answer.get("option"),
                None if at_ms is None else reply.t_ns_of(float(at_ms)),
            )
        )
    films_on_ns = reply.t_ns_of(max(first)) if first else shown_ns
    return SeenStep(
        shown_ns,
        reply.t_ns,
        films_on_ns,
        films,
        str(step.content.get("caption", "")),
        tuple(questions),
        _parts(step, reply, folder) if step.kind == "show" and "parts" in content else (),
    )


def _parts(step: PageStep, reply: Reply, folder: Path) -> tuple[SeenPart, ...]:
    """Return the flat stimuli that a step showed, as large as the page said that it was."""
    screen, page = screen_of(reply.content, USUAL_VIEW_PX), read_screen(reply.content.get("screen"))
    window_px = (screen.width_px, screen.height_px) if "view_px" in reply.content else None
    parts, since_ns, lights = [], 0, list[Mapping[str, Any]]()
    lightings = read_lit(reply.content)
    if len(lightings) > len(step.content["parts"]):
        raise PageError(f"{len(lightings)} parts were shown, not {len(step.content['parts'])}")
    for k, (part, light) in enumerate(zip(step.content["parts"], lightings, strict=False)):
        on_ns, off_ns = reply.t_ns_of(light.on_ms), reply.t_ns_of(light.off_ms)
        if not part.get("goes_on"):
            since_ns = on_ns
            lights.clear()
        scene = flat_scene(part, folder)
        scene = replace(scene, surface=before_eyes(screen), moves_since_ns=since_ns)
        if scene.panorama is not None:
            lights.append(reply.content["parts"][k])
            scene = replace(scene, turns=view_turns(lights, reply))
        parts.append(SeenPart(on_ns, off_ns, scene, screen, page, window_px))
    return tuple(parts)


def _replies(
    recording: Recording, trial_id: str, attempt: int
) -> Iterator[
    tuple[int, int, Mapping[str, Any], Callable[[float], int], tuple[Mapping[str, Any], ...]]
]:
    """Yield the replies of an attempt at a trial, whose beginning may lie in an earlier part than
    its end: part, session time, payload, the conversion from the page's clock to session time, and
    the events with movements during the step. A reply that does not say how large the window was
    has what the page said of it before.
    """
    is_here = False
    sizes_px: dict[str, Any] = {}
    moves: list[Mapping[str, Any]] = []
    for part in recording.manifest.parts:
        clocks = PageClocks()
        for event in recording.journal(part.number).events:
            payload, t_ns = event["payload"], int(event["t_ns"])
            if event["name"] == "trial_start":
                is_here = (payload["trial_id"], payload["attempt"]) == (trial_id, attempt)
            if event["name"] != "page_event":
                continue
            clocks.follow(payload, t_ns)
            if payload["kind"] == "moved":
                moves.append(payload)
            if "view_px" in (about := payload.get("about") or payload):
                sizes_px[str(payload["tab"])] = about["view_px"]
            if payload["kind"] == "reply":
                is_own = {"step": payload["step"], "tab": payload["tab"]}
                step_moves = tuple(m for m in moves if is_own.items() <= m.items())
                moves.clear()
                if is_here:
                    size_px = sizes_px.get(str(payload["tab"]))
                    if _is_size(size_px):
                        payload = {**payload, "reply": {"view_px": size_px, **payload["reply"]}}
                    placing = clocks.of(str(payload["tab"])).placing()
                    yield part.number, t_ns, payload, placing, step_moves


def _is_size(size_px: Any) -> bool:
    """Tell whether somebody's page said how large it is: what it says is as it was sent."""
    is_pair = isinstance(size_px, list) and len(size_px) == 2
    return is_pair and all(isinstance(px, int) and 0 < px <= MAX_VIEW_PX for px in size_px)
