"""Every movement of sliders and camera, and every round, in a session with live figures."""

from collections.abc import Iterator, Mapping
from typing import Any

import pandas as pd

from visavis.protocol.plan.columns import Column
from visavis.recording.page_clock import PageClocks
from visavis.recording.reader import Recording
from visavis.study.moulding import FIGURE_ON, FIGURE_TURNED, SLIDER_MOVED

MOVE_COLUMNS = (
    Column("trial_id", "", "the trial"),
    Column(
        "step",
        "1",
        "number that tells figures of one trial apart: of the page's step, or of the figure",
    ),
    Column("t_ns", "ns", "session time of the movement"),
    Column(
        "what",
        "",
        "the slider's name; camera for the view; round, or round_beside of the other figure, where "
        "the motion of a watched figure began again",
    ),
    Column("value", "1", "the slider's value; else empty"),
    Column("x_m", "m", "where the camera was, the figure at the origin facing −z; else empty"),
    Column("y_m", "m", "likewise, up"),
    Column("z_m", "m", "likewise, behind the figure"),
)


def moves_of(recording: Recording) -> pd.DataFrame:
    """Return the movements (`MOVE_COLUMNS`) of a session, step by step in order of time.

    Those of a step that was begun again, after a page was reloaded, are all there.
    """
    rows = list(_rows(recording))
    return pd.DataFrame(rows, columns=[c.name for c in MOVE_COLUMNS])


def _rows(recording: Recording) -> Iterator[dict[str, Any]]:
    for part in recording.manifest.parts:
        trial_id, figure = "", 0
        clocks = PageClocks()
        waiting: list[tuple[str, Mapping[str, Any]]] = []
        for event in recording.journal(part.number).events:
            payload, t_ns = event["payload"], int(event["t_ns"])
            if event["name"] == "trial_start":
                trial_id = str(payload["trial_id"])
            if event["name"] == FIGURE_ON:
                figure += 1
            elif event["name"] in (SLIDER_MOVED, FIGURE_TURNED):
                yield _before_a_screen(payload, figure)
            if event["name"] != "page_event":
                continue
            # The page's clock is placed as the trial's row has it: when its step is over.
            clocks.follow(payload, t_ns)
            if payload["kind"] == "moved":
                waiting.append((trial_id, payload))
            elif payload["kind"] == "reply":
                yield from _placed(waiting, clocks)
                waiting = []
        yield from _placed(waiting, clocks)


def _before_a_screen(payload: Mapping[str, Any], figure: int) -> dict[str, Any]:
    """Return a movement before a monitor or in a headset; turning a figure is walking round it."""
    own = {"trial_id": payload["trial_id"], "step": figure, "t_ns": int(payload["heard_ns"])}
    if "slider" in payload:
        return own | {"what": payload["slider"], "value": payload["value"]}
    place = {axis: payload[axis] for axis in ("x_m", "y_m", "z_m")}
    return own | {"what": "camera", **place}


def _placed(
    waiting: list[tuple[str, Mapping[str, Any]]], clocks: PageClocks
) -> Iterator[dict[str, Any]]:
    """Yield the rows of some events, each in order of time."""
    rows: list[dict[str, Any]] = []
    for trial_id, payload in waiting:
        own = {"trial_id": trial_id, "step": payload["step"]}
        t_ns_of = clocks.of(str(payload["tab"])).placing()
        for at_ms, i, value in payload["sliders"]:
            t_ns = t_ns_of(at_ms)
            rows.append(own | {"t_ns": t_ns, "what": payload["names"][int(i)], "value": value})
        for at_ms, x, y, z in payload["camera"]:
            t_ns = t_ns_of(at_ms)
            rows.append(own | {"t_ns": t_ns, "what": "camera", "x_m": x, "y_m": y, "z_m": z})
        for at_ms, i in payload.get("rounds", ()):
            t_ns = t_ns_of(at_ms)
            rows.append(own | {"t_ns": t_ns, "what": "round_beside" if i else "round"})
    yield from sorted(rows, key=lambda row: int(row["t_ns"]))
