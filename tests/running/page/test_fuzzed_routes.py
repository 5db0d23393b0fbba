"""Every GET is answered with what is served, or refused, whatever is asked (`benchmarks.fuzz`)."""

from pathlib import Path
from typing import cast

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


def test_what_is_served_to_nobody_and_folders_of_this_computer_are_wrong(tmp_path: Path) -> None:
    is_sound = is_served((b"page",), tmp_path)
    assert is_sound((Answer(200, b"", b"page"), Answer(206, b"", b"ag"), Answer(404, b"", b"no")))
    assert not is_sound((Answer(200, b"", b"secret"),))
    assert not is_sound((Answer(500, b"", b"it failed"),))
    assert not is_sound((Answer(404, b"", f"no {tmp_path}/x".encode()),))


def test_answers_on_one_connection_are_told_apart() -> None:
    said = b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nabHTTP/1.1 404 Not Found\r\n\r\n"
    assert [(200, b"ab"), (404, b"")] == [(a.status, a.body) for a in answers_in(said)]
