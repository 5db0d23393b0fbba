"""Incidents between the trials of a session: pauses with their reasons, flags, early ends."""

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
    incidents: list[Incident] = []
    for part in recording.manifest.parts:
        mine = events[events["recording_part"] == part.number]
        trials = [
            _Trial(str(e["row"]["trial_id"]), int(e["row"]["t_start_ns"]), int(e["t_ns"]))
            for e in recording.trial_entries(part.number)
            if e["row"].get("t_start_ns") is not None
        ]
        incidents += _of_part(
            [(int(e["t_ns"]), str(e["name"]), e["payload"]) for e in mine.to_dict("records")],
            trials,
            partial(reason_words, recording=recording),
        )
        if part.status in ("aborted", "crashed"):
            ending = "ended early" if part.status == "aborted" else "broke off"
            where = f"after {trials[-1].name}" if trials else "before the first trial"
            incidents.append(Incident(where, f"part {part.number} {ending}", part.reason))
    return tuple(incidents)


def _of_part(
    events: Sequence[tuple[int, str, Mapping[str, Any]]],
    trials: Sequence[_Trial],
    words: Callable[[str], str],
) -> list[Incident]:
    def why(payload: Mapping[str, Any]) -> str:
        code, text = payload.get("code"), payload.get("text")
        return ": ".join(filter(None, (code and words(str(code)), text and str(text))))

    incidents: list[Incident] = []
    open_incident, began_ns = -1, 0  # the incident that the next reason is about
    for t_ns, name, payload in events:
        action = payload.get("action") if name == "operator" else None
        within = any(t.start_ns <= t_ns <= t.end_ns for t in trials)
        if name == "pause_start":
            began_ns = t_ns
            if open_incident < 0 or incidents[open_incident].what != "pause":
                incidents.append(Incident(_before(t_ns, trials), "pause"))
                open_incident = len(incidents) - 1
            else:
                incidents[open_incident] = replace(
                    incidents[open_incident], where=_before(t_ns, trials)
                )
        elif name == "pause_end" and incidents and incidents[open_incident].what == "pause":
            pause_s = (t_ns - began_ns) / NS_PER_S
            incidents[open_incident] = replace(
                incidents[open_incident], what=f"pause of {pause_s:.0f} s"
            )
        elif action == "pause" and open_incident >= 0 and incidents[open_incident].what == "pause":
            both = "; ".join(filter(None, (incidents[open_incident].why, why(payload))))
            incidents[open_incident] = replace(incidents[open_incident], why=both)
        elif action == "pause":
            incidents.append(Incident(_before(t_ns, trials), "pause", why(payload)))
            open_incident = len(incidents) - 1
        elif action == "flag":
            open_incident = -1
            if not within:
                incidents.append(Incident(_before(t_ns, trials), "moment flagged", why(payload)))
                open_incident = len(incidents) - 1
        elif action == "reason" and open_incident >= 0:
            both = "; ".join(filter(None, (incidents[open_incident].why, why(payload))))
            incidents[open_incident] = replace(incidents[open_incident], why=both)
        elif action == "reason" and not within:
            incidents.append(Incident(_before(t_ns, trials), "reason given", why(payload)))
    return incidents


def _before(t_ns: int, trials: Sequence[_Trial]) -> str:
    """Return where in a part a moment is."""
    earlier = [t for t in trials if t.start_ns <= t_ns]
    if not earlier:
        return "before the first trial"
    return f"{'in' if t_ns <= earlier[-1].end_ns else 'after'} {earlier[-1].name}"
