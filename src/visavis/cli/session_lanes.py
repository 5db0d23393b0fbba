"""Contacts and vibrations of a session, each with the times at which it began and ended."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np

from visavis.lab.clock import NS_PER_MS
from visavis.recording.reader import Recording

SET, PATTERN, SILENCE = 0, 1, 2
"""Commands of a band that begin or end a vibration."""
MIN_SHOWN_NS: Final = 80 * NS_PER_MS
"""Shorter contacts and vibrations are shown for this long."""


@dataclass(frozen=True, eq=False)
class Lane:
    """What happened to one part of the body: `spans` of begin and end (ns of the part's session
    time) with a text about each.
    """

    name: str
    kind: Literal["contact", "vibration"]
    role: str
    spans: list[tuple[int, int, str]]

    def is_on(self, t_ns: int) -> bool:
        """Tell whether it lasts at a time."""
        return any(a <= t_ns < max(b, a + MIN_SHOWN_NS) for a, b, _ in self.spans)


def lanes_of(recording: Recording, part: int) -> list[Lane]:
    """Return what was touched and what vibrated in a part of a session."""
    return [*_pair_lanes(recording, part), *_vibrations(recording, part)]


def _pair_lanes(recording: Recording, part: int) -> Iterator[Lane]:
    """Yield what began and ended, by the events `…_begin` and `…_end` of one role."""
    lanes: dict[str, Lane] = {}
    open_at: dict[str, tuple[int, str]] = {}
    for event in recording.events().to_dict("records"):
        what, _, kind = str(event["name"]).rpartition("_")
        payload: dict[str, Any] = event["payload"]
        if event["recording_part"] != part or kind not in ("begin", "end") or "role" not in payload:
            continue
        role = str(payload["role"])
        name = _name(f"{what} {role}")
        at_ns = int(payload.get(f"t_{what}_ns", event["t_ns"]))
        lane = lanes.setdefault(name, Lane(name, "contact", role, []))
        if name in open_at:
            begin_ns, text = open_at.pop(name)
            lane.spans.append((begin_ns, at_ns, text))
        if kind == "begin":
            details = {k: v for k, v in payload.items() if not k.endswith("_ns")}
            open_at[name] = at_ns, json.dumps(details, ensure_ascii=False, default=str)
    for name, (begin_ns, text) in open_at.items():
        lanes[name].spans.append((begin_ns, begin_ns, text))
    yield from (lanes[name] for name in sorted(lanes))


def _vibrations(recording: Recording, part: int) -> Iterator[Lane]:
    """Yield when each band vibrated: from a command to what ended it."""
    for stream in recording.stream_names:
        if not stream.startswith("haptics_"):
            continue
        rows = recording.stream_arrays(stream, part=part)
        spans: list[tuple[int, int, str]] = []
        order = np.argsort(rows.get("t_commanded_ns", np.empty(0)), kind="stable")
        order = (
            order[np.isin(rows["kind"][order], (SET, PATTERN, SILENCE))] if len(order) else order
        )
        begins = [int(rows["t_commanded_ns"][i]) for i in order]
        for k, i in enumerate(order.tolist()):
            strength = float(np.nanmax([0.0, *rows["amplitudes_01"][i]]))
            if rows["kind"][i] == SILENCE or strength <= 0:
                continue
            end_ns = begins[k] + int(rows["duration_ms"][i]) * NS_PER_MS
            end_ns = min([end_ns, *begins[k + 1 : k + 2]])
            note = "" if rows["acknowledged"][i] else ", not acknowledged"
            spans.append((begins[k], end_ns, f"{100 * strength:.0f} %{note}"))
        role = stream.removeprefix("haptics_")
        yield Lane(_name(f"vibration {role}"), "vibration", role, spans)


def _name(lane: str) -> str:
    return lane.replace("armband_", "").replace("_", " ")
