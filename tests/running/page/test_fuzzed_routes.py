"""Every GET is answered with what is served, or refused, whatever is asked (`benchmarks.fuzz`)."""

from pathlib import Path
from typing import cast

import pytest

from benchmarks.fuzz.__main__ import fuzz, read_whole
from benchmarks.fuzz.routes import Answer, answers_in, is_served, request_of, routes
from benchmarks.fuzz.target import Target


def test_every_route_answers_damaged_requests(tmp_path: Path) -> None:
    with routes(tmp_path) as targets:
        for target in targets:
            read_whole(target)
            outcome = fuzz(target, 300, float("inf"), 7)
            assert (0, 0, {}) == (outcome.wrong, outcome.hangs, outcome.where), target.name
        assert 2 == len(targets)


def answer_of(target: Target, request: bytes) -> Answer:
    (answer,) = cast("tuple[Answer, ...]", target.read(request))
    return answer


def test_a_whole_request_is_answered_with_what_is_served(tmp_path: Path) -> None:
    with routes(tmp_path) as (pages, desk):
        page = answer_of(pages, pages.samples[0])
        assert (200, True) == (page.status, page.body.startswith(b"<!"))
        part = answer_of(pages, pages.samples[2])
        assert (206, 898) == (part.status, len(part.body))
        sessions = answer_of(desk, desk.samples[2])
        assert (200, b'{"sessions": []}') == (sessions.status, sessions.body)
        assert 404 == answer_of(pages, request_of("/../server.py")).status


@pytest.mark.parametrize(
    "request_bytes",
    [
        b"CONNECT  \r\nHost: 127.0.0.1\r\n\r\n",
        request_of("/").replace(b"Accept: */*", b"Expect: \xff"),
        *(
            request_of("/page.js", f"{name}: Thu, 01 Jan 2026 00:00:018446744073709551616 GMT")
            for name in ("If-Modified-Since", "If-Unmodified-Since", "If-Range")
        ),
    ],
    ids=["no URL", "expectation", "modified since", "unmodified since", "range"],
)
def test_what_cannot_be_read_is_refused_and_the_operator_is_not_alarmed(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, request_bytes: bytes
) -> None:
    with routes(tmp_path) as (pages, _):
        assert 400 == answer_of(pages, request_bytes).status
    assert "" == caplog.text


def test_what_is_served_to_nobody_and_folders_of_this_computer_are_wrong(tmp_path: Path) -> None:
    is_sound = is_served((b"page",), tmp_path)
    assert is_sound((Answer(200, b"", b"page"), Answer(206, b"", b"ag"), Answer(404, b"", b"no")))
    assert not is_sound((Answer(200, b"", b"secret"),))
    assert not is_sound((Answer(500, b"", b"it failed"),))
    assert not is_sound((Answer(404, b"", f"no {tmp_path}/x".encode()),))


def test_answers_on_one_connection_are_told_apart() -> None:
    chunked = b"HTTP/1.1 416 No\r\nTransfer-Encoding: chunked\r\n\r\n2\r\ncd\r\n1\r\ne\r\n0\r\n\r\n"
    of_head = b"HTTP/1.1 200 OK\r\nContent-Length: 9\r\n\r\n"
    whole = b"HTTP/0.9 200 OK\r\nContent-Length: 2\r\n\r\nab"
    stream = chunked + of_head + whole + b"HTTP/1.1 404 Not Found\r\n\r\n"
    expected = [(416, b"cde"), (200, b""), (200, b"ab"), (404, b"")]
    assert expected == [(answer.status, answer.body) for answer in answers_in(stream)]
    with pytest.raises(ValueError, match="no answer"):
        answers_in(b"hello")
    with pytest.raises(ValueError, match="no chunk"):
        answers_in(chunked.replace(b"2\r\n", b"x\r\n"))
