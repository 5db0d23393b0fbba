"""When the samples of a recorded stream were taken, by all time exchanges with its device."""

from collections.abc import Iterable
from typing import Any, Final

from visavis.lab.device_clock import DeviceTimes, device_times
from visavis.recording.page_clock import PAGE_ROLE
from visavis.recording.reader import Recording

EXCHANGE_EVENT: Final = "clock_exchanges"
STREAM_OF_ROLE: Final = {"eye_tracker": "gaze", "body_tracker": "body", PAGE_ROLE: "head"}
"""Streams that are not called like their device."""
STREAMS_OF_PAGE: Final = ("head", "frame_timing", "pointer", "responses", "hands")
"""Streams that a page dates by its one clock."""


def session_times(recording: Recording, stream: str, part: int) -> DeviceTimes:
    """Date a stream's samples of one part, in order of arrival, on the session's clock.

    The whole part is fitted at once: drift is followed between exchanges, and jumps are told.
    A device without exchanges is dated by its quickest arrivals. Raw stamps stay as recorded.
    """
    columns = recording.stream_arrays(stream, part=part)
    events = recording.events_named(EXCHANGE_EVENT, part)
    exchanges = exchanges_by_stream(events["payload"]).get(stream, ())
    return device_times(columns["t_device_ns"], columns["t_host_ns"], exchanges)


def exchanges_by_stream(payloads: Iterable[dict[str, Any]]) -> dict[str, list[list[int]]]:
    """Return the recorded exchanges (send, device, receive) of every stream, in order."""
    exchanges: dict[str, list[list[int]]] = {}
    for payload in payloads:
        role = str(payload.get("role"))
        rows = payload.get("send_device_receive_ns", ())
        own = STREAMS_OF_PAGE if role == PAGE_ROLE else (STREAM_OF_ROLE.get(role, role),)
        for stream in own:
            exchanges.setdefault(stream, []).extend(rows)
    return exchanges
