"""The half of the wire that takes streams, between a page and a server that knows none.

It puts the step `enter` after the consent, keeps streams and happenings of a headset, and hands on
what is left under the numbers that the server expects.
"""

from dataclasses import dataclass, field
from typing import Any

ENTER_STEP = 99_999
ENTER = {
    "kind": "enter",
    "xr": "optional",
    "needs": [],
    "lines": ["Clear the floor."],
    "version": "x",
}


@dataclass
class StandIn:
    """What a page in a headset sent beside its replies; `is_away` cuts the connection."""

    headset: list[dict[str, Any]] = field(default_factory=list)
    replies: list[dict[str, Any]] = field(default_factory=list)
    numbers: dict[int, bool] = field(default_factory=dict)
    entered: bool = False
    is_away: bool = False
    posts: list[dict[str, Any]] = field(default_factory=list)

    def install(self, page: Any) -> None:
        page.route("**/api/hello", self._hello)
        page.route("**/api/events", self._events)

    def rows(self, stream: str) -> list[dict[str, Any]]:
        """Return the batches of a stream."""
        return [e for e in self.headset if e.get("stream") == stream]

    def happenings(self) -> list[str]:
        """Return what happened around the headset."""
        return [e["what"] for e in self.headset if e["kind"] == "xr"]

    def _hello(self, route: Any) -> None:
        answer = route.fetch()
        state = answer.json()
        state["xr"] = "optional"
        state["streams"] = {}
        for e in self.headset:
            if e["kind"] == "stream":
                state["streams"][e["stream"]] = e["seq0"] + e["rows"]
        state["ack"] = max(self.numbers, default=0) if self.numbers else state["ack"]
        route.fulfill(response=answer, json=self._with_enter(state))

    def _with_enter(self, state: dict[str, Any]) -> dict[str, Any]:
        kind = state.get("step", {}).get("kind")
        if not self.entered and kind not in (None, "consent", "end"):
            return state | {"number": ENTER_STEP, "step": ENTER}
        return state

    def _events(self, route: Any) -> None:
        if self.is_away:
            route.abort()
            return
        body = route.request.post_data_json
        self.posts.append({k: v for k, v in body.items() if k != "events"})
        rest = []
        for e in body["events"]:
            is_own = e["kind"] in ("stream", "xr") or e.get("step") == ENTER_STEP
            is_new = e["n"] not in self.numbers
            self.numbers[e["n"]] = is_own
            if is_own and is_new:
                self.headset.append(e)
                self.entered = self.entered or e["kind"] == "reply"
            if not is_own:
                if e["kind"] == "reply" and is_new:
                    self.replies.append(e)
                real = e["n"] - sum(own for n, own in self.numbers.items() if n < e["n"])
                rest.append(e | {"n": real})
        answer = route.fetch(post_data=body | {"events": rest})
        state = answer.json()
        if answer.status == 200:
            ack, real = 0, 0
            for n in sorted(self.numbers):
                real += not self.numbers[n]
                if real > state["ack"]:
                    break
                ack = n
            state = self._with_enter(state | {"ack": ack})
        route.fulfill(response=answer, json=state)
