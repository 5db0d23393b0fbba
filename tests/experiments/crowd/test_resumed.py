"""Walks after an interruption are those of a session that was never interrupted, bit for bit."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.experiments.crowd.sessions import request
from visavis.experiments.crowd.haptics import BAND_ROLES
from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import SessionAborted
from visavis.recording.reader import Recording
from visavis.running.sessions.perform import perform_new, perform_rest

PARAMETERS = {"configurations": [1, 2], "limit_s": 16.0}
"""Nothing touches when the walk before the break ends: memory is kept before bands fall silent."""
DONE_BEFORE = 4
"""The practice, two walks of the first block and one of two that vibrate."""


def whole(folder: Path, **lab: Any) -> Recording:
    return Recording(perform_new(request(folder, **lab, **PARAMETERS)))


def broken_and_resumed(folder: Path, **lab: Any) -> Recording:
    def interrupt(_: str, done: int, __: int) -> None:
        if done == DONE_BEFORE:
            raise KeyboardInterrupt

    wanted = request(folder, **lab, **PARAMETERS)
    with pytest.raises(SessionAborted):
        perform_new(replace(wanted, on_trial=interrupt))
    (path,) = folder.glob("simulated/crowd/sub-*/ses-001")
    again = request(folder, **lab, **PARAMETERS)
    return Recording(perform_rest(again, path))


def what_happened(recording: Recording) -> dict[str, dict[str, Any]]:
    """Return by trial everything that was measured or sent, with times from the walk's start."""
    events = recording.events()
    found = {}
    for row in recording.trials().to_dict("records"):
        start_ns, end_ns, part = row["t_start_ns"], row["t_end_ns"], row["part"]
        contacts = [
            {**payload, "t_contact_ns": payload["t_contact_ns"] - start_ns, "name": name}
            for name, payload in zip(events["name"], events["payload"], strict=True)
            if name.startswith("contact_") and payload["trial_id"] == row["trial_id"]
        ]
        streams = {"body": _within(recording, "body", part, start_ns, end_ns)}
        for role in BAND_ROLES:
            streams[role] = _within(recording, f"haptics_{role}", part, start_ns, end_ns)
        kept = ("contacts_online", "track", "came_back", "condition", "scene_frames")
        found[row["trial_id"]] = {
            "row": {name: row[name] for name in kept},
            "lasted_ns": end_ns - start_ns,
            "contacts": contacts,
            "streams": streams,
        }
    return found


def _within(
    recording: Recording, stream: str, part: int, start_ns: int, end_ns: int
) -> dict[str, Any]:
    arrays = recording.stream_arrays(stream, part=part)
    asked = "t_commanded_ns" if "t_commanded_ns" in arrays else "t_host_ns"
    # what is asked for at the very end may be answered after the session has ended
    during = (arrays[asked] >= start_ns) & (arrays[asked] <= end_ns - NS_PER_S // 10)
    return {
        name: arrays[name][during] - (start_ns if name.startswith("t_") else 0)
        for name in arrays
        # numbers of commands and samples, and the device's own clock, go on from connection
        if name not in ("seq", "command", "valid", "acknowledged", "t_device_ns", "recording_part")
    }


def differences(one: Recording, other: Recording) -> list[str]:
    expected, got = what_happened(one), what_happened(other)
    assert sorted(expected) == sorted(got)
    differing = []
    for trial_id, walk in expected.items():
        differing += [
            f"{trial_id} {name}"
            for name in ("row", "lasted_ns", "contacts")
            if walk[name] != got[trial_id][name]
        ]
        for stream, columns in walk["streams"].items():
            differing += [
                f"{trial_id} {stream} {column}"
                for column, values in columns.items()
                if not np.array_equal(values, got[trial_id]["streams"][stream][column], True)
            ]
    return differing


def test_walks_after_a_break_equal_those_without_one(tmp_path: Path) -> None:
    resumed = broken_and_resumed(tmp_path / "broken")
    assert [1, 1, 1, 1, 2, 2, 2] == resumed.trials()["part"].tolist()
    vibrated = resumed.trials().query("part == 2 and vibrates")
    assert 5 < vibrated["contacts_online"].sum()
    assert [] == differences(whole(tmp_path / "whole"), resumed)
