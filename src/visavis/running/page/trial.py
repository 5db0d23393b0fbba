"""A trial of the kit as a page performs it: its steps become steps of the page."""

from collections.abc import Callable, Generator, Mapping
from typing import Any, Final, TypeAlias

from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.errors import DesignError
from visavis.protocol.plan.steps import Mark, Row, TrialInterrupted
from visavis.protocol.session.boards import NOTHING_IN_TIME
from visavis.running.live_store import until_on_page
from visavis.running.page.flat import (
    Sequence,
    panorama_events,
    pointer_events,
    shown_columns,
    sound_events,
)
from visavis.running.page.steps import (
    Drawn,
    FilmPlayback,
    PageStep,
    Reply,
    mapping,
    ns_of_ms,
    number,
    page_question,
    put,
    read_drawn,
    read_film,
    read_page_answer,
)
from visavis.stimuli.audible import Audible
from visavis.stimuli.flat import Image, Panorama, Video
from visavis.study.actions import Action
from visavis.study.asking import Answer
from visavis.study.dry_run import still_view
from visavis.study.films import Film, LiveFilm, Viewing, films_of, seconds_of, voiced_film
from visavis.study.live import (
    LIVE_COLUMNS,
    MOULD_COLUMNS,
    Live,
    LiveScene,
    Moulded,
    Moulding,
    SliderMove,
)
from visavis.study.responses import Keys, Response
from visavis.study.trial import TrialPlan, TrialScript

OnPage: TypeAlias = Generator[PageStep | Mark, Reply | None, Any]
FilmFiles: TypeAlias = Callable[
    [Film | Live | LiveFilm | Image | Video | Panorama | Audible], Mapping[str, Any]
]
"""Returns what a page must know about a film, a live figure, a picture or a sound: files' names,
hashes, sizes.
"""
SHOWS: Final = "it shows t.show without a condition, t.watch, t.mould, t.ask, t.wait, t.dark"


class FilmFailed(TrialInterrupted):
    """A browser could not play a film; it says which and why."""


def perform_on_page(script: TrialScript, plan: TrialPlan, files: FilmFiles) -> OnPage:
    """Perform a study's trial on a page; the generator returns the trial's row.

    Raises:
        FilmFailed: a film could not be played.
        DesignError: the trial has a step that no page can show.
    """
    steps: Any = plan(script)
    reply: Any = None
    coming = Sequence()
    try:
        while True:
            step = steps.send(reply)
            if isinstance(step, Action) and _joins(step, coming):
                reply = yield from _show(script, step, coming, files)
                continue
            yield from _shown(script, coming, None)
            if isinstance(step, Action):
                reply = yield from _perform_action(script, step, files)
            elif isinstance(step, Mark):
                reply = yield step
            else:
                raise DesignError(
                    f"{type(step).__name__} is a step frame by frame; on a page {SHOWS}"
                )
    except StopIteration as end:
        yield from _shown(script, coming, None)
        row: Row = {**script.row, **(end.value or {})}
        return row


def _joins(action: Action, coming: Sequence) -> bool:
    """Tell whether a step is shown in one go with what is coming, or begins it."""
    goes_on = bool(coming.parts) and action.name in ("dark", "wait", "key")
    return action.showing is not None or goes_on


def _show(script: TrialScript, action: Action, coming: Sequence, files: FilmFiles) -> OnPage:
    """Add a step to what is coming; at a key let the page show it all, and return the answer."""
    keys = action.response
    if action.name == "dark":
        coming.add_dark(action.seconds)
        return None
    if action.name == "wait":
        coming.add_wait(action.seconds)
        return None
    scene = None
    if action.showing is not None:
        scene = coming.show(action, script.next_prefix(action.column), files)
    if not isinstance(keys, Keys):
        return scene
    since = None
    if action.name == "key":
        since = len(coming.parts)
        coming.add_wait(None)
    elif coming.parts[-1].is_limited:
        coming.add_dark(None)
    return (yield from _shown(script, coming, keys, since))


def _shown(
    script: TrialScript, coming: Sequence, keys: Keys | None, since: int | None = None
) -> OnPage:
    """Let the page show what is coming; return the answer to keys, if they are waited for."""
    if not coming.parts:
        return None
    reply = yield from put(coming.step(keys, since))
    content = reply.content
    if content.get("failed") is not None:
        failure = mapping(content["failed"], "what failed")
        what = "sound" if failure.get("sound") else f"file {failure.get('file')}"
        raise FilmFailed(f"{what}: {failure.get('why')}"[:300])
    columns = shown_columns(coming, reply)
    first = next(part.name for part in coming.parts if part.name)
    last = [part for part in coming.parts if f"{part.name}_on_ns" in columns][-1]
    end_ns = columns[f"{last.name}_off_ns"]
    from_ns = columns[f"{last.name}_{'sound_on_ns' if last.is_heard_alone else 'on_ns'}"]
    script.row.setdefault("t_start_ns", columns[f"{first}_on_ns"])
    if "stimuli_outside" in columns:
        columns["stimuli_outside"] += script.row.get("stimuli_outside", 0)
    script.row |= columns | {"t_end_ns": end_ns}
    script.view = still_view(end_ns)
    trial_id = script.trial.trial_id
    yield from panorama_events(coming, reply, script.settings.folder, trial_id)
    yield from pointer_events(coming, reply, script.settings.folder, trial_id)
    yield from sound_events(coming, reply, trial_id)
    coming.parts.clear()
    if keys is None:
        return None
    pressed = content.get("answer")
    if pressed is None:
        answer = Answer(None, NOTHING_IN_TIME, from_ns, end_ns, script.view)
    else:
        at_ns = reply.t_ns_of(number(pressed["at_ms"], "at_ms"))
        answer = Answer(pressed["option"], pressed["by"], from_ns, at_ns, still_view(at_ns))
    answer = script.take(keys, answer)
    script.row["t_end_ns"] = max(end_ns, answer.answered_ns)
    yield _answered(script, keys.name, answer)
    return answer


def _answered(
    script: TrialScript, question: str, answer: Answer, released_ns: int | None = None
) -> Mark:
    return Mark(
        "answered",
        {
            "trial_id": script.trial.trial_id,
            "question": question,
            "answer": answer.option,
            "by": answer.by,
            "asked_ns": answer.asked_ns,
            "answered_ns": answer.answered_ns,
            **({} if released_ns is None else {"released_ns": released_ns}),
        },
    )


def _perform_action(script: TrialScript, action: Action, files: FilmFiles) -> OnPage:
    if action.viewing is not None:
        return (yield from _watch(script, action.viewing, files))
    if action.moulding is not None:
        return (yield from _mould(script, action.moulding, files))
    if action.name == "ask" and action.response is not None:
        answers = yield from _ask(script, (action.response,))
        return answers[action.response.name]
    if action.name in ("dark", "wait"):
        reply = yield from put(PageStep("blank", {"seconds": action.seconds}))
        script.view = still_view(reply.t_ns)
        return None
    if action.name == "hush":
        yield from put(PageStep("hush"))
        return None
    if action.name in ("mark", "repeat", "end"):
        script.view = script.view or still_view()
        return (yield from action.perform())  # type: ignore[misc]  # marks alone
    raise DesignError(f"t.{action.name} cannot be performed on a page; {SHOWS}")


def _questions(script: TrialScript, responses: tuple[Response, ...]) -> list[dict[str, Any]]:
    held = script.settings.held_answers
    return [
        page_question(r, *script.words_of(r)) | ({"is_held": True} if r.name in held else {})
        for r in responses
    ]


def _ask(script: TrialScript, responses: tuple[Response, ...]) -> OnPage:
    step = {"films": [], "questions": _questions(script, responses), "caption": "", "min_rounds": 0}
    reply = yield from put(PageStep("watch", step))
    return (
        yield from _answers(
            script, responses, reply, number(reply.content.get("shown_ms"), "shown_ms")
        )
    )


def _watch(script: TrialScript, watch: Viewing, files: FilmFiles) -> OnPage:
    if isinstance(watch.stimulus, LiveScene | LiveFilm):
        return (yield from _watch_drawn(script, watch, watch.stimulus, files))
    films = films_of(watch.stimulus)
    film_entries = [{"place": place, **files(film)} for place, film in films.items()]
    step = {
        "films": film_entries,
        "questions": _questions(script, watch.responses),
        "caption": watch.caption,
        "min_rounds": watch.min_rounds,
        **({} if watch.replay else {"once": True}),
    }
    reply = yield from put(PageStep("watch", step))
    content = reply.content
    if content.get("failed") is not None:
        failure = mapping(content["failed"], "what failed")
        raise FilmFailed(f"film {failure.get('film')}: {failure.get('why')}"[:300])
    film_replies = mapping(content.get("films"), "films")
    playback = {place: read_film(film_replies.get(place)) for place in films}
    first_ms = max(t.first_ms for t in playback.values())
    name = script.next_prefix("film")
    on_ns = reply.t_ns_of(first_ms)
    script.row.setdefault("t_start_ns", on_ns)
    script.row |= _film_columns(name, playback, content, on_ns, first_ms)
    if (voiced := voiced_film(watch.stimulus)) is not None:
        film_playback = playback[next(place for place, film in films.items() if film is voiced)]
        began_ms = film_playback.sound_ms
        script.row[f"{name}_sound_on_ns"] = None if began_ms is None else reply.t_ns_of(began_ms)
        script.row[f"{name}_volume_01"] = film_playback.volume_01
    script.row[f"{name}_sha256"] = (
        ",".join(f["sha256"] for f in film_entries if f["sha256"]) or None
    )
    script.row["t_end_ns"] = script.row[f"{name}_off_ns"]
    return (yield from _answers(script, watch.responses, reply, first_ms))


def _watch_drawn(
    script: TrialScript, watch: Viewing, scene: LiveScene | LiveFilm, files: FilmFiles
) -> OnPage:
    live, motions = (scene, ()) if isinstance(scene, LiveFilm) else (scene.live, scene.motions)
    step = {
        "films": [],
        "live": dict(files(live)),
        "motions": [motion.weights.tolist() for motion in motions],
        "cycle_s": seconds_of(scene),
        **({} if watch.replay else {"once": True}),
        "questions": _questions(script, watch.responses),
        "caption": watch.caption,
        "min_rounds": watch.min_rounds,
    }
    reply = yield from put(PageStep("watch", step))
    drawing = _drawing_of(reply)
    name = script.next_prefix("live")
    columns = _drawing_columns(drawing, reply) | {"rounds": drawing.rounds}
    script.row.setdefault("t_start_ns", columns["on_ns"])
    script.row |= {f"{name}_{c.name}": columns[c.name] for c in LIVE_COLUMNS}
    script.row["t_end_ns"] = columns["off_ns"]
    from_ms = drawing.first_ms
    if isinstance(scene, LiveFilm) and drawing.opened_ms is not None:
        from_ms = drawing.opened_ms
    return (yield from _answers(script, watch.responses, reply, from_ms))


def _drawing_of(reply: Reply) -> Drawn:
    """Return what a browser drew of live figures.

    Raises:
        FilmFailed: it could not draw them.
    """
    if reply.content.get("failed") is not None:
        failure = mapping(reply.content["failed"], "what failed")
        raise FilmFailed(f"figure: {failure.get('why')}"[:300])
    return read_drawn(reply.content)


def _drawing_columns(drawing: Drawn, reply: Reply) -> dict[str, Any]:
    """Return the columns of any live figure on a page."""
    return {
        "on_ns": reply.t_ns_of(drawing.first_ms),
        "off_ns": reply.t_ns_of(drawing.off_ms),
        "turns": max(0, sum(len(event["camera"]) for event in reply.moves) - 1),
        "frames": drawing.frames,
        "frames_dropped": drawing.frames_dropped,
        "wait_ms": drawing.first_ms - number(reply.content.get("shown_ms"), "shown_ms"),
        "hidden_ms": number(reply.content.get("hidden_ms"), "hidden_ms"),
        "renderer": drawing.renderer,
    }


def _mould(script: TrialScript, moulding: Moulding, files: FilmFiles) -> OnPage:
    live, sliders, until = moulding.live, moulding.sliders, moulding.until
    step = {
        "live": dict(files(live)),
        "questions": _questions(script, sliders),
        "caption": moulding.caption,
        "limit_s": moulding.limit_s,
        "until": None if until is None else until_on_page(live, until),
        "is_blind": moulding.is_blind,
    }
    reply = yield from put(PageStep("mould", step))
    drawing = _drawing_of(reply)
    moves = tuple(
        SliderMove(sliders[int(i)].name, float(value), reply.t_ns_of(at_ms))
        for event in reply.moves
        for at_ms, i, value in event["sliders"]
        if at_ms >= drawing.first_ms  # earlier ones: the step was left, and begun again
    )
    name = script.next_prefix("mould")
    columns = _drawing_columns(drawing, reply) | {
        "ended_by": drawing.ended_by,
        "moves": len(moves),
        "slider_frames": drawing.slider_frames,
        "distance_m": drawing.distance_m,
    }
    on_ns, off_ns = columns["on_ns"], columns["off_ns"]
    script.row.setdefault("t_start_ns", on_ns)
    script.row |= {f"{name}_{c.name}": columns[c.name] for c in MOULD_COLUMNS}
    answers = yield from _answers(script, sliders, reply, drawing.first_ms)
    script.row["t_end_ns"] = off_ns
    values = {s.name: float(answers[s.name].option) for s in sliders}
    seconds = (off_ns - on_ns) / NS_PER_S
    return Moulded(values, moves, drawing.ended_by, seconds, drawing.distance_m)


def _film_columns(
    name: str,
    playback: Mapping[str, FilmPlayback],
    content: Mapping[str, Any],
    on_ns: int,
    first_ms: float,
) -> dict[str, Any]:
    off_ms = number(content.get("off_ms"), "off_ms")
    shown_ms = number(content.get("shown_ms"), "shown_ms")
    apart = content.get("apart_ms")
    first_at_ms = [t.first_at_ms for t in playback.values() if t.first_at_ms is not None]
    columns = {
        "on_ns": on_ns,
        "off_ns": on_ns + ns_of_ms(off_ms - first_ms),
        "frames": sum(t.frames for t in playback.values()),
        "wait_ms": first_ms - shown_ms,
        "first_at_ms": max(first_at_ms, default=None),
        "rounds": min(t.rounds for t in playback.values()),
        "frames_dropped": sum(t.frames_dropped for t in playback.values()),
        "stalls": sum(t.stalls for t in playback.values()),
        "hidden_ms": number(content.get("hidden_ms"), "hidden_ms"),
        "apart_ms": None if len(playback) < 2 or apart is None else number(apart, "apart_ms"),
    }
    return {f"{name}_{column}": value for column, value in columns.items()}


def _answers(
    script: TrialScript, responses: tuple[Response, ...], reply: Reply, from_ms: float
) -> OnPage:
    contents = mapping(reply.content.get("answers"), "answers")
    answers = {}
    for response in responses:
        page_answer = read_page_answer(response, contents.get(response.name))
        asked_ns = reply.t_ns_of(from_ms)
        answered_ns = asked_ns + ns_of_ms(page_answer.at_ms - from_ms)
        script.view = still_view(answered_ns)
        answer = Answer(page_answer.option, page_answer.by, asked_ns, answered_ns, script.view)
        script.row.setdefault("t_start_ns", asked_ns)
        answer = script.take(response, answer)
        script.row[f"{response.name}_ms"] = (answered_ns - asked_ns) / NS_PER_MS
        released_ms = page_answer.released_ms
        released_ns = None if released_ms is None else reply.t_ns_of(released_ms)
        yield _answered(script, response.name, answer, released_ns)
        answers[response.name] = answer
    return answers
