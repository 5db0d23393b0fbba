"""What happened in a session besides its trials: pauses and their reasons, ends before the end."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from visavis.lab.clock import NS_PER_S
from visavis.lab.config import INCIDENTS
from visavis.recording.reader import Recording


@dataclass(frozen=True)
class Incident:
    """Something between trials; `where` is the trial before it, `why` is empty where nobody said.

    Notes are not among them: they may say who somebody is.
    """

    where: str
    what: str
    why: str = ""


@dataclass(frozen=True)
class _Trial:
    name: str
    start_ns: int
    end_ns: int


def reason_words(code: str, recording: Recording) -> str:
    """Return a reason in the words of the lab that recorded it, with its code."""
    configuration = recording.manifest.configuration
    own = configuration.get("incidents") if isinstance(configuration, Mapping) else None
    words = (own if isinstance(own, Mapping) else INCIDENTS).get(code)
    return code if words is None else f"{words} ({code})"


def incidents_of(recording: Recording) -> tuple[Incident, ...]:
    """Return what happened outside trials, in order.

    A reason belongs to the last pause, wherever it was given, or to the last flag outside a trial;
    flags and reasons within trials stand in their rows.
    """
    events = recording.events()
    found: list[Incident] = []
    for part in recording.manifest.parts:
        mine = events[events["recording_part"] == part.number]
        trials = [
            _Trial(str(e["row"]["trial_id"]), int(e["row"]["t_start_ns"]), int(e["t_ns"]))
            for e in recording.trial_entries(part.number)
            if e["row"].get("t_start_ns") is not None
        ]
        found += _of_part(
            [(int(e["t_ns"]), str(e["name"]), e["payload"]) for e in mine.to_dict("records")],
            trials,
            partial(reason_words, recording=recording),
        )
        if part.status in ("aborted", "crashed"):
            ended = "ended early" if part.status == "aborted" else "broke off"
            where = f"after {trials[-1].name}" if trials else "before the first trial"
            found.append(Incident(where, f"part {part.number} {ended}", part.reason))
    return tuple(found)


def _of_part(
    events: Sequence[tuple[int, str, Mapping[str, Any]]],
    trials: Sequence[_Trial],
    words: Callable[[str], str],
) -> list[Incident]:
    def why(payload: Mapping[str, Any]) -> str:
        code, text = payload.get("code"), payload.get("text")
        return ": ".join(filter(None, (code and words(str(code)), text and str(text))))

    found: list[Incident] = []
    explained, began_ns = -1, 0  # which of those found the next reason is about
    for t_ns, name, payload in events:
        action = payload.get("action") if name == "operator" else None
        within = any(t.start_ns <= t_ns <= t.end_ns for t in trials)
        if name == "pause_start":
            began_ns = t_ns
            if explained < 0 or found[explained].what != "pause":
                found.append(Incident(_before(t_ns, trials), "pause"))
                explained = len(found) - 1
            else:
                found[explained] = replace(found[explained], where=_before(t_ns, trials))
        elif name == "pause_end" and found and found[explained].what == "pause":
            lasted_s = (t_ns - began_ns) / NS_PER_S
            found[explained] = replace(found[explained], what=f"pause of {lasted_s:.0f} s")
        elif action == "pause" and explained >= 0 and found[explained].what == "pause":
            both = "; ".join(filter(None, (found[explained].why, why(payload))))
            found[explained] = replace(found[explained], why=both)
        elif action == "pause":
            found.append(Incident(_before(t_ns, trials), "pause", why(payload)))
            explained = len(found) - 1
        elif action == "flag":
            explained = -1
            if not within:
                found.append(Incident(_before(t_ns, trials), "moment flagged", why(payload)))
                explained = len(found) - 1
        elif action == "reason" and explained >= 0:
            both = "; ".join(filter(None, (found[explained].why, why(payload))))
            found[explained] = replace(found[explained], why=both)
        elif action == "reason" and not within:
            found.append(Incident(_before(t_ns, trials), "reason given", why(payload)))
    return found


def _before(t_ns: int, trials: Sequence[_Trial]) -> str:
    """Return where in a part a moment is."""
    begun = [t for t in trials if t.start_ns <= t_ns]
    if not begun:
        return "before the first trial"
    return f"{'in' if t_ns <= begun[-1].end_ns else 'after'} {begun[-1].name}"
