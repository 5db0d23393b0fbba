"""A study that is served to several people in one process, for the tests of its reception."""

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from pathlib import Path
from typing import Any

import aiohttp
import pytest

from tests.running.page.pages import SEED, config, experiment, study
from visavis.lab.clock import SimClock
from visavis.protocol.people.ledger import Ledger
from visavis.protocol.session.operator import UnattendedOperator
from visavis.results.opened_study import find_study
from visavis.running.film_store import film_store
from visavis.running.page.opening_code import OpeningCode
from visavis.running.page.reception import Reception, Rules
from visavis.running.page.server import KEY, PageServer
from visavis.running.page.steps import PageStep
from visavis.running.page.visitor import Visitor, visitor_of
from visavis.running.sessions.session_request import Request, SessionPerson


class Somebody(Visitor):
    """A visitor who may stop at the first page of text."""

    stop = ""

    def reply(self, step: PageStep) -> dict[str, Any]:
        if self.stop == "decline" and step.kind == "consent":
            return {"agreed": False}
        if self.stop and step.kind == "watch":
            return {"stop": self.stop, "hidden_ms": 0.0}
        return super().reply(step)


class Place:
    """A study that is served, with its ledger and the identities it keeps elsewhere."""

    def __init__(self, root: Path, rules: Rules, code: OpeningCode | None = None) -> None:
        self.code = code
        self.clock = SimClock()
        self.lab = config(root)
        self.folder = self.lab.data_root / "simulated" / study().name
        self.folder.mkdir(parents=True, exist_ok=True)
        self.ledger = Ledger(self.folder, self.clock, prefix="S")
        self.who: dict[str, Mapping[str, str]] = {}
        self.rules = rules

    def reception(self) -> Reception:
        base = Request(
            study=study(),
            experiment=experiment(),
            config=self.lab,
            person=SessionPerson("", 0),
            seed=SEED,
            clock=self.clock,
            operator=UnattendedOperator(),
            on="browser",
        )
        return Reception(
            base,
            film_store(experiment()),
            self.ledger,
            self.rules,
            identify=self.who.__setitem__,
            identity_of=self.who.get,
            forget=lambda label: self.who.pop(label, None),
            withdraw=lambda label: void(self.ledger.withdraw(label, [self.folder])),
            code=self.code,
        )

    def visitor(self, stop: str = "") -> Somebody:
        person = study().participant(0, SEED, effect=True, experiment=experiment())
        made = visitor_of(person, experiment(), film_store(experiment()))
        somebody = Somebody(
            made.person, made.films, made.responses, made.views, made.store, made.sound_of
        )
        somebody.stop = stop
        somebody.now_ms = self.clock.now_ns() / 1e6
        return somebody

    def sessions(self) -> list[Path]:
        return sorted(self.folder.glob("sub-*/ses-001"))


def void(_: object) -> None:
    """Return nothing of something."""


def serve(place: Place, act: Callable[[str, Reception], Awaitable[Any]]) -> Any:
    """Serve a study while somebody acts, then end the server."""

    async def whole() -> Any:
        reception = place.reception()
        server = PageServer(reception=reception)
        await server.start()
        until = asyncio.Event()
        serving = asyncio.create_task(reception.serve(server, until))
        try:
            return await act(f"http://127.0.0.1:{server.port}", reception)
        finally:
            until.set()
            await serving
            await server.stop()

    return asyncio.run(whole())


def serve_file(path: Path, text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make what places of this module serve the study that a file holds."""
    path.write_text(text, "utf-8")
    opened_study = find_study(str(path))
    parts = {"study": opened_study, "experiment": opened_study.experiment({})}
    for name, part in parts.items():
        monkeypatch.setattr(f"{__name__}.{name}", lambda part=part: part)


async def post(base: str, path: str, body: dict[str, Any], key: str = "") -> dict[str, Any]:
    async with aiohttp.ClientSession(base, headers={KEY: key}) as http:
        async with http.post(path, json=body) as response:
            answer: dict[str, Any] = await response.json()
            return answer
