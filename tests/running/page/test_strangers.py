"""No page of another site gets anything done: every endpoint, method, content type and origin."""

import asyncio
import json
from pathlib import Path
from typing import Any

import aiohttp
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.running.page.pages import begin_session
from tests.running.page.served_places import Place, serve
from visavis.running.page.client import arrive
from visavis.running.page.reception import Reception, Rules
from visavis.running.page.server import HEADERS, KEY, PageServer, PageSession

METHODS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE")
CONTENT_TYPES = (
    "text/plain",
    "application/x-www-form-urlencoded",
    "multipart/form-data; boundary=x",
    "application/json",
    "application/json; charset=utf-16",
    "",
)
ORIGINS = ("https://evil.example", "null", "http://127.0.0.1.evil.example", "http://localhost:1")
SITES = ("cross-site", "same-site", None)


def test_nothing_that_another_site_sends_changes_anything(tmp_path: Path) -> None:
    place = Place(tmp_path, Rules(quota=40))

    async def act(base: str, reception: Reception) -> tuple[int, list[str]]:
        key = (await arrive(base, {})).partition("#")[2]
        body = json.dumps({"tab": "t", "key": key, "parameters": {}, "events": []}).encode()
        server_paths = [f"/api/{name}" for name in ("arrive", "hello", "events", "leave", "board")]
        tried, done = 0, []
        async with aiohttp.ClientSession(base) as http:
            for path in server_paths:
                for method in METHODS:
                    for content_type in CONTENT_TYPES:
                        for origin in ORIGINS:
                            for site in SITES:
                                headers = {"Origin": origin, "Content-Type": content_type}
                                headers |= {} if site is None else {"Sec-Fetch-Site": site}
                                tried += 1
                                async with http.request(
                                    method, path, data=body, headers=headers
                                ) as response:
                                    assert set(HEADERS.items()) <= set(response.headers.items())
                                    if response.status < 400:
                                        done.append(f"{method} {path} {headers}")
        return tried, done

    tried, done = serve(place, act)
    assert (len(METHODS) * len(CONTENT_TYPES) * len(ORIGINS) * len(SITES) * 5, []) == (tried, done)
    assert 1 == len(place.sessions())


JSON = st.recursive(
    st.none() | st.booleans() | st.floats(allow_nan=False) | st.integers() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner),
    max_leaves=8,
)
EVENTS = st.fixed_dictionaries(
    {"n": st.integers(-1, 3) | JSON},
    optional={
        "kind": st.sampled_from(["reply", "moved", "about", "resize", "problem"]) | JSON,
        "at_ms": st.floats() | JSON,
        "step": st.integers(0, 3) | JSON,
        "reply": st.dictionaries(st.sampled_from(["agreed", "stop", "answers", "films"]), JSON),
        "names": JSON,
        "sliders": JSON,
        "camera": JSON,
        "about": JSON,
    },
)
BODIES = st.fixed_dictionaries(
    {},
    optional={
        "tab": st.sampled_from(["one", "two"]) | JSON,
        "key": st.just("key") | JSON,
        "events": st.lists(EVENTS, max_size=3) | JSON,
        "parameters": JSON,
        "before": JSON,
        "at_ms": JSON,
        "sent_ms": JSON,
        "wall_ms": JSON,
        "about": JSON,
        "takes_over": JSON,
    },
)
PATHS = ("hello", "events", "leave")


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    bodies=st.lists(st.tuples(st.sampled_from(["hello", "events", "leave"]), BODIES), max_size=6)
)
def test_whatever_is_posted_gets_an_answer_and_the_session_goes_on(
    bodies: list[tuple[str, dict[str, Any]]], tmp_path_factory: Any
) -> None:
    async def ask() -> list[int]:
        with begin_session(tmp_path_factory.mktemp("posted")) as (page, _):
            server = PageServer()
            session = PageSession(page.desk, {"words": {}})
            await server.start()
            server.add(session)
            statuses = []
            try:
                headers = {KEY: "key", "Content-Type": "application/json"}
                async with aiohttp.ClientSession(f"http://127.0.0.1:{server.port}") as http:
                    for path, body in [*bodies, ("hello", {"tab": "one", "takes_over": True})]:
                        data = json.dumps(body).encode("utf-8", "surrogatepass")
                        async with http.post(f"/api/{path}", data=data, headers=headers) as answer:
                            statuses.append(answer.status)
                            assert isinstance(await answer.json(), dict)
            finally:
                await server.stop()
            assert [] == session.failures
            return statuses

    statuses = asyncio.run(ask())
    assert 200 == statuses[-1]
    assert {*statuses} <= {200, 400, 409}
