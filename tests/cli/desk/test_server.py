"""The desk's server answers this computer's page alone, with the key in its address."""

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import aiohttp
import pytest

from tests.cli.test_operator_screen import STATUS
from tests.faults.sessions import lab
from visavis.cli.desk import server as desk_server
from visavis.cli.desk.link import About, SessionLink
from visavis.cli.desk.server import DeskServer
from visavis.protocol.session.operator import Action, Command, UnattendedOperator
from visavis.running.page.server import KEY

PATIENCE_S = 30.0
FOUND = {"made_wall_iso": "2026-01-01T00:00:00+00:00", "count": {}, "findings": []}


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(desk_server, "_run_doctor", lambda lab: FOUND)


Post = Callable[..., Awaitable[tuple[int, Any]]]


def served(data_root: Path, act: Callable[[DeskServer, str, Post], Awaitable[None]]) -> None:
    """Serve a lab's desk while something is asked of it."""

    async def all_of_it() -> None:
        desk = DeskServer(lab(data_root))
        address = await desk.start()
        running = asyncio.create_task(desk.run())
        async with aiohttp.ClientSession() as client:

            async def post(path: str, content: Any, **headers: str) -> tuple[int, Any]:
                sent = {KEY: desk.key, **headers}
                where = address.partition("#")[0].rstrip("/") + path
                async with client.post(where, json=content, headers=sent) as answer:
                    return answer.status, await answer.json()

            await asyncio.wait_for(act(desk, address, post), PATIENCE_S)
        running.cancel()
        await asyncio.wait([running])

    asyncio.run(all_of_it())


@pytest.mark.parametrize("path", ["/api/live", "/api/today", "/api/doctor", "/api/command"])
def test_nothing_is_told_without_the_key_or_under_another_name(path: str, tmp_path: Path) -> None:
    async def act(desk: DeskServer, address: str, post: Post) -> None:
        status, said = await post(path, {}, **{KEY: "guess"})
        assert (400, True) == (status, "another desk" in said["refused"])
        status, said = await post(path, {}, Host="evil.example")
        assert (403, "this address is not served") == (status, said["refused"])

    served(tmp_path, act)


def test_the_page_takes_nothing_from_elsewhere(tmp_path: Path) -> None:
    async def act(desk: DeskServer, address: str, post: Post) -> None:
        assert address.startswith("http://127.0.0.1:")
        assert address.endswith(f"/#{desk.key}")
        async with aiohttp.ClientSession() as client, client.get(address) as page:
            assert "default-src 'none'" in page.headers["Content-Security-Policy"]
            assert desk.key not in await page.text()

    served(tmp_path, act)


def test_a_command_goes_to_the_session_and_without_one_is_refused(tmp_path: Path) -> None:
    async def act(desk: DeskServer, address: str, post: Post) -> None:
        command = {"action": "note", "text": "sneezed"}
        assert (409, {"refused": "no session goes on"}) == await post("/api/command", command)
        about = About("stare", "S01B", 1, str(tmp_path), is_simulated=True, is_blind=False)
        with SessionLink(UnattendedOperator(), about, tmp_path) as link:
            link.show(STATUS)
            number, status = -1, None
            while status is None:
                _, told = await post("/api/live", {"after": number})
                number, status = told["number"], told["status"]
            assert "T05" == status["trial_id"]
            assert (200, {}) == await post("/api/command", command)
            commands: list[Command] = []
            while not commands:
                await asyncio.sleep(0)
                commands = list(link.poll())
            assert [Command(Action.NOTE, "sneezed")] == commands
        told = {"session": "not yet"}
        while told["session"]:
            _, told = await post("/api/live", {"after": number})
            number = told["number"]
        assert str(tmp_path) == told["ended"]

    served(tmp_path, act)


@pytest.mark.parametrize(
    "wrong",
    [
        {"action": "dance"},
        {"action": 7},
        {"action": "note", "text": 7},
        {"action": "note", "text": "x" * 501},
        [],
        "pause",
    ],
)
def test_what_is_no_command_is_refused(wrong: Any, tmp_path: Path) -> None:
    async def act(desk: DeskServer, address: str, post: Post) -> None:
        status, _ = await post("/api/command", wrong)
        assert 400 == status

    served(tmp_path, act)


def test_the_doctor_leaves_devices_of_a_session_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def act(desk: DeskServer, address: str, post: Post) -> None:
        assert (200, {"doctor": FOUND}) == await post("/api/doctor", {})

        def opened(lab: Any) -> Any:
            raise AssertionError("the devices are the session's")

        monkeypatch.setattr(desk_server, "_run_doctor", opened)
        about = About("stare", "S01B", 1, str(tmp_path), is_simulated=True, is_blind=False)
        with SessionLink(UnattendedOperator(), about, tmp_path):
            told: dict[str, Any] = {"session": None, "number": -1}
            while not told["session"]:
                _, told = await post("/api/live", {"after": told["number"]})
            assert (200, {"doctor": FOUND}) == await post("/api/doctor", {})  # nothing newer
            note = tmp_path / "part-01" / "doctor.json"
            note.parent.mkdir()
            finding = {"level": "warning", "subject": "disk", "found": "3 GB", "remedy": "free"}
            note.write_text(
                '{"made_wall_iso": "2026-01-02T00:00:00+00:00", "findings": ['
                + str(finding).replace("'", '"')
                + "]}",
                "utf-8",
            )
            _, told = await post("/api/doctor", {})
            assert {"missing": 0, "warning": 1, "ok": 0} == told["doctor"]["count"]

    served(tmp_path, act)


def test_another_program_reads_the_sessions_and_gives_reasons(tmp_path: Path) -> None:
    async def act(desk: DeskServer, address: str, post: Post) -> None:
        about = About("stare", "S01B", 1, str(tmp_path), is_simulated=True, is_blind=False)
        where = address.partition("/#")[0] + "/api/v1/sessions"

        async def sessions(**headers: str) -> Any:
            async with aiohttp.ClientSession() as client, client.get(where, headers=headers) as got:
                return await got.json()

        assert "refused" in await sessions()
        assert {"sessions": []} == await sessions(**{KEY: desk.key})
        with SessionLink(UnattendedOperator(), about, tmp_path) as link:
            link.show(STATUS)
            found: list[Any] = []
            while not found or not found[0]["status"]:
                found = (await sessions(**{KEY: desk.key}))["sessions"]
                await asyncio.sleep(0)
            (one,) = found
            assert ("S01B", "T05") == (one["about"]["participant"], one["status"]["trial_id"])
            asked = {"action": "skip", "text": "dizzy", "code": "unwell", "which": one["which"]}
            status, told = await post("/api/v1/command", {**asked, "code": "weather"})
            assert (400, True) == (status, "disturbance" in told["refused"])
            assert 409 == (await post("/api/v1/command", {**asked, "which": "ended"}))[0]
            assert (200, {}) == await post("/api/v1/command", asked)
            assert [Command(Action.SKIP, "dizzy", "unwell")] == await heard(link)

    served(tmp_path, act)


async def heard(link: SessionLink) -> list[Command]:
    """Return what reaches a session next."""
    commands: list[Command] = []
    while not commands:
        await asyncio.sleep(0)
        commands = list(link.poll())
    return commands


def test_a_program_that_starts_lab_recorder_starts_and_ends_a_session(tmp_path: Path) -> None:
    async def act(desk: DeskServer, address: str, post: Post) -> None:
        port = await desk.listen_as_lab_recorder(0)
        about = About("stare", "S01B", 1, str(tmp_path), is_simulated=True, is_blind=False)
        with SessionLink(UnattendedOperator(), about, tmp_path) as link:
            link.show(STATUS)
            told: dict[str, Any] = {"session": None, "number": -1}
            while not told["session"]:
                _, told = await post("/api/live", {"after": told["number"]})
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(b"select all\nfilename {participant:P1} {task:stare}\nstart\n")
            assert b"OKOKOK" == await reader.readexactly(6)
            assert [Command(Action.ADVANCE)] == await heard(link)
            writer.write(b"stop\n")
            assert [Command(Action.ABORT)] == await heard(link)
            writer.close()

    served(tmp_path, act)


def test_a_web_page_that_posts_to_the_port_of_remote_commands_is_not_obeyed(tmp_path: Path) -> None:
    async def act(desk: DeskServer, address: str, post: Post) -> None:
        commands: list[Command] = []
        desk._watch.tell = commands.append  # type: ignore[method-assign,assignment]  # records
        port = await desk.listen_as_lab_recorder(0)
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n\nstop\n")
        assert b"" == await reader.read()
        assert [] == commands
        writer.close()

    served(tmp_path, act)


def test_the_day_is_told_with_the_lab_and_its_mark(tmp_path: Path) -> None:
    async def act(desk: DeskServer, address: str, post: Post) -> None:
        status, told = await post("/api/today", {})
        assert (200, True, []) == (status, told["is_simulated"], told["studies"])
        assert "Example laboratory" == told["lab"]

    served(tmp_path, act)
