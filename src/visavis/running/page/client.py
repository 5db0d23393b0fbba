"""The browser of a simulated participant: speaks the page's protocol over HTTP."""

from collections.abc import Callable, Mapping
from typing import Any, Final

import aiohttp

from visavis.lab.clock import NS_PER_MS, Clock
from visavis.lab.errors import DataError
from visavis.running.page.server import KEY
from visavis.running.page.steps import PageStep
from visavis.running.page.visitor import Visitor

TAB: Final = "simulated"


async def arrive(base: str, parameters: Mapping[str, str]) -> str:
    """Arrive at a served study; return the address of the new session.

    Raises:
        DataError: the server gave no session; says why.
    """
    async with aiohttp.ClientSession(base) as http:
        async with http.post("/api/arrive", json={"parameters": dict(parameters)}) as response:
            answer: dict[str, Any] = await response.json()
    if "key" not in answer:
        raise DataError(f"no session for a simulated page: {answer}")
    return f"{base}/#{answer['key']}"


async def visit(
    address: str,
    visitor: Visitor,
    clock: Clock,
    *,
    ends: Callable[[PageStep], bool] = lambda step: False,
) -> str:
    """Answer every step of the page at an address (http://…/#KEY); return the outcome.

    `ends` tells whether the page closes before a step, as if its battery had run out.

    Raises:
        DataError: the server refused what was sent.
    """
    base, _, key = address.partition("/#")
    begun_ns = clock.now_ns() - round(visitor.now_ms * NS_PER_MS)
    async with aiohttp.ClientSession(base, headers={KEY: key}) as http:

        async def post(path: str, body: Mapping[str, Any]) -> dict[str, Any]:
            async with http.post(path, json=body) as response:
                message: dict[str, Any] = await response.json()
                if response.status != 200 or "failed" in message:
                    raise DataError(f"the server refused a simulated page: {message}")
                return message

        message = await post(
            "/api/hello",
            {
                "tab": TAB,
                "takes_over": True,
                "at_ms": visitor.now_ms,
            },
        )
        has_described = False
        while message["step"]["kind"] != "end":
            content = dict(message["step"])
            step = PageStep(content.pop("kind"), content)
            if ends(step):
                return ""
            if not has_described and step.kind != "consent":
                has_described = True
                answers = {
                    "n": message["ack"] + 1,
                    "kind": "about",
                    "at_ms": visitor.now_ms,
                    "about": {"user_agent": TAB},
                }
                message = await post("/api/events", {"tab": TAB, "events": [answers]})
            reply = visitor.reply(step)
            clock.sleep_until_ns(begun_ns + round(visitor.now_ms * NS_PER_MS))
            for moves in visitor.moves:
                movements = {
                    "n": message["ack"] + 1,
                    "kind": "moved",
                    "at_ms": visitor.now_ms,
                    "step": message["number"],
                    **moves,
                }
                message = await post("/api/events", {"tab": TAB, "events": [movements]})
            visitor.moves.clear()
            for batch in visitor.batches:
                samples = {**batch, "n": message["ack"] + 1}
                message = await post("/api/events", {"tab": TAB, "events": [samples]})
            visitor.batches.clear()
            event = {
                "n": message["ack"] + 1,
                "kind": "reply",
                "at_ms": visitor.now_ms,
                "step": message["number"],
                "reply": reply,
            }
            message = await post("/api/events", {"tab": TAB, "events": [event]})
    return str(message["step"]["outcome"])
