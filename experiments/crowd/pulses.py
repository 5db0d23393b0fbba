"""Every contact answered: when it happened, was commanded, sent, acknowledged, and felt."""

from collections.abc import Callable
from typing import Any, Final

import numpy as np
import pandas as pd

from visavis.devices.contracts import NO_DEVICE_TIME
from visavis.experiments.crowd.haptics import BAND_ROLES
from visavis.lab.clock import NS_PER_MS
from visavis.lab.clock_fit import fit_one_way
from visavis.lab.errors import DataError
from visavis.recording.reader import Recording

PATTERN: Final = 1
SILENCE: Final = 2
MOTOR_RISE_MS: Final = 30.0
"""First-order rise of a coin motor; added to the time the band applied a command."""
ASKED_WITHIN_NS: Final = 100 * NS_PER_MS


def pulse_rows(recording: Recording) -> list[dict[str, Any]]:
    """Return one row per contact that drove a band, in order of time.

    `commanded_ms`, `sent_ms`, `acknowledged_ms` and `risen_ms` count from the body sample that
    showed the contact; None where the command never left, was not answered, or the band sent no
    time. `attempt` is that of the walk. `risen_ms` is when a motor had reached 63 %: the band's own
    time of applying the command, on the host's clock by the envelope of its answers, plus the
    modelled rise. `held_ms` is how long the contact lasted.
    """
    commands = {
        (part.number, role): _commands(recording, part.number, role)
        for part in recording.manifest.parts
        for role in BAND_ROLES
        if f"haptics_{role}" in recording.stream_names
    }
    attempt_at = _attempts(recording)
    rows: list[dict[str, Any]] = []
    next_ns: dict[tuple[int, str], int] = {}
    vibrating_spans = [span for span in contact_spans(recording) if span["vibrates"]]
    for span in reversed(
        vibrating_spans
    ):  # a command belongs to the contact that began last before it
        part, role, begin_ns, end_ns = (
            span[name] for name in ("recording_part", "role", "begin_ns", "end_ns")
        )
        row = {
            "recording_part": part,
            "trial_id": span["trial_id"],
            "attempt": attempt_at(part, span["trial_id"], begin_ns),
            "role": role,
            "segment": span["segment"],
            "person": span["person"],
            "motors": span["motors"],
            "t_contact_ns": begin_ns,
            "held_ms": None if end_ns is None else (end_ns - begin_ns) / NS_PER_MS,
        }
        rows.append(row | _fate(commands.get((part, role)), begin_ns, next_ns.get((part, role))))
        next_ns[part, role] = begin_ns
    return rows[::-1]


def contact_spans(recording: Recording) -> list[dict[str, Any]]:
    """Return one row per contact on a band's segment: what was recorded of its beginning, with
    `recording_part`, `begin_ns` and `end_ns`, None where the contact's end was not recorded.
    """
    events = recording.events()
    rows: list[dict[str, Any]] = []
    open_at: dict[tuple[int, str], dict[str, Any]] = {}
    for event in events[events["name"].isin(["contact_begin", "contact_end"])].to_dict("records"):
        payload, part = event["payload"], int(event["recording_part"])
        key, t_ns = (part, str(payload["role"])), int(payload["t_contact_ns"])
        if event["name"] == "contact_begin":
            rows.append({**payload, "recording_part": part, "begin_ns": t_ns, "end_ns": None})
            open_at[key] = rows[-1]
        elif key in open_at:
            open_at.pop(key)["end_ns"] = t_ns
    return rows


def _attempts(recording: Recording) -> Callable[[int, str, int], int | None]:
    """Return a function from part, trial and time to the attempt; None where none is recorded."""
    starts: dict[tuple[int, str], list[tuple[int, int]]] = {}
    events = recording.events()
    for event in events[events["name"] == "trial_start"].to_dict("records"):
        payload = event["payload"]
        key = (int(event["recording_part"]), str(payload["trial_id"]))
        starts.setdefault(key, []).append((int(event["t_ns"]), int(payload["attempt"])))

    def attempt_at(part: int, trial_id: str, t_ns: int) -> int | None:
        before = [n for start_ns, n in starts.get((part, trial_id), ()) if start_ns <= t_ns]
        return before[-1] if before else None

    return attempt_at


def _commands(recording: Recording, part: int, role: str) -> pd.DataFrame:
    arrays = recording.stream_arrays(f"haptics_{role}", part=part)
    names = ("kind", "t_commanded_ns", "t_sent_ns", "acknowledged", "t_device_ns", "t_host_ns")
    table = pd.DataFrame({name: arrays[name] for name in names})
    has_answer = table["acknowledged"].to_numpy()
    device = table["t_device_ns"].to_numpy(np.int64)
    host = np.full(len(table), np.nan)
    if has_answer.sum() > 1:
        try:
            fit = fit_one_way(device[has_answer], table["t_host_ns"].to_numpy(np.int64)[has_answer])
        except DataError:
            fit = None
        if fit is not None:
            host[has_answer] = fit.to_host_ns(device[has_answer])
    table["t_applied_ns"] = host
    return table[table["kind"] == PATTERN].sort_values("t_commanded_ns").reset_index(drop=True)


def _fate(
    commands: pd.DataFrame | None, contact_ns: int, next_ns: int | None = None
) -> dict[str, Any]:
    times = ("commanded_ms", "sent_ms", "acknowledged_ms", "risen_ms")
    nothing = {**dict.fromkeys(times), "acknowledged": False}
    if commands is None or commands.empty:
        return nothing
    commanded_ns = commands["t_commanded_ns"].to_numpy(np.int64)
    at = int(np.searchsorted(commanded_ns, contact_ns))
    if at == len(commanded_ns) or commanded_ns[at] - contact_ns > ASKED_WITHIN_NS:
        return nothing
    if next_ns is not None and commanded_ns[at] >= next_ns:
        return nothing
    row = commands.iloc[at]
    sent_ns = int(row["t_sent_ns"])
    has_answer = bool(row["acknowledged"])
    applied_ns = float(row["t_applied_ns"])
    return {
        "commanded_ms": (int(commanded_ns[at]) - contact_ns) / NS_PER_MS,
        "sent_ms": None if sent_ns == NO_DEVICE_TIME else (sent_ns - contact_ns) / NS_PER_MS,
        "acknowledged_ms": (int(row["t_host_ns"]) - contact_ns) / NS_PER_MS if has_answer else None,
        "risen_ms": (applied_ns - contact_ns) / NS_PER_MS + MOTOR_RISE_MS if has_answer else None,
        "acknowledged": has_answer,
    }
