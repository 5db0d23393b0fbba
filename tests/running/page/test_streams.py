"""What a page in a headset sends is what the wire is written down as."""

import re

from visavis.recording.page_clock import MAX_POSTS
from visavis.running.page.server import SITE
from visavis.running.page.streams import COLUMNS, HAPPENINGS, MAX_ROWS, POST_BYTES


def script(name: str) -> str:
    return (SITE / name).read_text("utf-8")


def test_page_and_server_have_the_same_limits() -> None:
    assert f"const MAX_ROWS = {MAX_ROWS};" in script("streams.js")
    assert f"const MAX_BYTES = {POST_BYTES // 1024} * 1024;" in script("page.js")
    assert f"const MAX_HEARD = {MAX_POSTS};" in script("page.js")


def test_a_page_sends_no_stream_and_no_happening_that_the_wire_does_not_name() -> None:
    text = script("headset.js")
    streams = re.findall(r'streams\.(?:row|skip|start)\("(\w+)"', text)
    assert {"head", "frame_timing", "pointer", "responses", "hands"} == set(streams)
    assert set(streams) <= set(COLUMNS)
    happenings = re.findall(r'\btell\("(\w+)"', text)
    assert {"reset", "ended", "off", "on", "context_lost"} <= set(happenings)
    assert set(happenings) <= set(HAPPENINGS)
