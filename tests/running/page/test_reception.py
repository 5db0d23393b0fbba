"""Many people come to one study: everybody gets a session, the same one again, and may leave it."""

import asyncio
import contextlib
import json
from functools import partial
from pathlib import Path
from typing import Any

import aiohttp
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.running.page.pages import experiment, study
from tests.running.page.served_places import Place, post, serve, serve_file, void
from visavis.cli.commands.serving import people_wanted
from visavis.experiments.interpolation.study import study as interpolation
from visavis.lab.errors import DataError, UsageError
from visavis.protocol.people.key_file import KeyFile
from visavis.recording.reader import Recording
from visavis.running.page.arrivals import arrival_of, check_completion, completion_of, least_filled
from visavis.running.page.client import arrive, visit
from visavis.running.page.perform import about_of
from visavis.running.page.reception import ARRIVED_IDLE_NS, IDLE_NS, Reception, Rules
from visavis.running.page.server import KEY, PageServer
from visavis.running.page.steps import PageError, PageStep
from visavis.study.experiment import StudyExperiment
from visavis.study.returning import Returning


@pytest.fixture
def place(tmp_path: Path) -> Place:
    return Place(tmp_path, Rules())


def test_three_at_once_have_a_whole_session_each(place: Place) -> None:
    async def act(base: str, _: Reception) -> list[str]:
        async def one() -> str:
            return await visit(await arrive(base, {}), place.visitor(), place.clock)

        return list(await asyncio.gather(one(), one(), one()))

    assert ["done"] * 3 == serve(place, act)
    assert ["complete"] * 3 == [Recording(p).status for p in place.sessions()]
    assert [0, 1, 2] == [entry.index for entry in place.ledger.list()]


def test_who_comes_again_gets_the_session_they_had_also_of_a_new_server(place: Place) -> None:
    parameters = {"PROLIFIC_PID": "5f3a99c07b21d4", "STUDY_ID": "77", "other": "x"}

    async def first(base: str, _: Reception) -> str:
        address = await arrive(base, parameters)
        await visit(
            address, place.visitor(), place.clock, ends=lambda s: s.content.get("trial") == 2
        )
        return address.partition("#")[2]

    async def again(base: str, _: Reception) -> tuple[str, str]:
        address = await arrive(base, parameters)
        return address.partition("#")[2], await visit(address, place.visitor(), place.clock)

    key = serve(place, first)
    (session,) = place.sessions()
    assert "aborted" == Recording(session).status
    assert (key, "done") == serve(place, again)
    assert [session] == place.sessions()
    recording = Recording(session)
    assert 2 == len(recording.manifest.parts)
    trials = recording.trials()
    assert not trials["trial_id"].duplicated().any()
    assert "server restarted" in ";".join(trials["flags"].dropna())


def test_who_somebody_is_to_a_panel_never_lies_with_the_data(place: Place) -> None:
    async def act(base: str, _: Reception) -> None:
        await visit(await arrive(base, {"PROLIFIC_PID": "5f3a99c"}), place.visitor(), place.clock)

    serve(place, act)
    (label,) = place.who
    assert {"panel": "Prolific", "identifier": "5f3a99c"} == dict(place.who[label])
    for path in place.lab.data_root.rglob("*"):
        if path.is_file():
            content = path.read_bytes()
            assert b"5f3a99c" not in content
            assert b"127.0.0.1" not in content


def test_of_whoever_declines_neither_identifier_nor_page_is_kept(place: Place) -> None:
    async def act(base: str, _: Reception) -> str:
        key = await arrive(base, {"PROLIFIC_PID": "5f3a99c"})
        return await visit(key, place.visitor("decline"), place.clock)

    assert "declined" == serve(place, act)
    assert {} == place.who
    (session,) = place.sessions()
    events = Recording(session).events()
    (reply,) = events.loc[events["name"] == "page_event", "payload"]
    assert {"kind": "reply", "n": 1, "step": 1, "reply": {"agreed": False}} == dict(reply)


def test_stop_and_delete_leaves_a_tombstone_and_stop_and_keep_the_answers(place: Place) -> None:
    async def act(base: str, _: Reception) -> list[str]:
        return [
            await visit(await arrive(base, {}), place.visitor(stop), place.clock)
            for stop in ("delete", "keep")
        ]

    assert ["withdrawn", "stopped"] == serve(place, act)
    gone, stays = place.ledger.list()
    assert ("withdrawn", "active") == (gone.status, stays.status)
    assert [place.folder / f"sub-{stays.label}" / "ses-001"] == place.sessions()


def test_when_enough_are_at_it_others_are_told_and_who_leaves_makes_room(tmp_path: Path) -> None:
    place = Place(tmp_path, Rules(quota=1, completion="https://panel.example/?cc=1&id={id}"))

    async def act(base: str, reception: Reception) -> list[Any]:
        await visit(await arrive(base, {}), place.visitor(), place.clock, ends=is_behind_consent)
        with pytest.raises(DataError, match="enough participants"):
            await arrive(base, {})
        place.clock.sleep_until_ns(place.clock.now_ns() + IDLE_NS + 1)
        await reception._leave_idle()
        address = await arrive(base, {"survey_code": "a-1"})
        async with aiohttp.ClientSession(base) as http:
            headers = {KEY: address.partition("#")[2]}
            async with http.post("/api/hello", json={"tab": "t"}, headers=headers) as response:
                state = await response.json()
        return [state["completion"], (await reception.board())["counts"]]

    completion, counts = serve(place, act)
    assert "https://panel.example/?cc=1&id=a-1" == completion
    assert {"left": 1, "arrived": 1} == counts


def test_a_place_is_taken_with_the_consent_and_whoever_consents_too_late_is_told(
    tmp_path: Path,
) -> None:
    place = Place(tmp_path, Rules(quota=1))
    panel = {"PROLIFIC_PID": "5f3a9c8d2b1e4a7f6c0d9e8b"}

    async def act(base: str, reception: Reception) -> list[Any]:
        first, second = await arrive(base, {}), await arrive(base, panel)
        outcomes = [await visit(at, place.visitor(), place.clock) for at in (first, second)]
        with pytest.raises(DataError, match="enough participants"):
            await arrive(base, panel)
        return [*outcomes, (await reception.board())["counts"]]

    assert ["done", "full", {"complete": 1, "full": 1}] == serve(place, act)
    late = Recording(place.sessions()[1])
    payloads = list(late.events().loc[late.events()["name"] == "page_event", "payload"])
    assert [{"agreed": True, "is_full": True}] == [payload["reply"] for payload in payloads]
    assert {} == place.who


WITHOUT_CONSENT = """
from visavis import Factor, Film, Rating, Scene, Study

study = Study(
    "at_once", factors=[Factor("motion", ["idle"])], on="browser", uses=(), calibrate=False,
)


@study.trial
def trial(t):
    shown = Film(Scene("person", motion=t.motion), 0.5, size_px=(160, 160), rate_hz=30)
    yield t.watch(shown, Rating("lively", 1, 5))
"""


def test_without_consent_a_place_is_taken_with_the_first_answer_of_a_person(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    serve_file(tmp_path / "open.py", WITHOUT_CONSENT, monkeypatch)
    place = Place(tmp_path, Rules(quota=1))

    def has_loaded(step: PageStep) -> bool:  # which every page does by itself
        return step.kind != "preload"

    async def act(base: str, reception: Reception) -> list[Any]:
        first, second = await arrive(base, {}), await arrive(base, {"PROLIFIC_PID": "5f3a99c"})
        for address in (first, second):
            await visit(address, place.visitor(), place.clock, ends=has_loaded)
        counts = [(await reception.board())["counts"]]
        outcomes = [await visit(at, place.visitor(), place.clock) for at in (first, second)]
        with pytest.raises(DataError, match="enough participants"):
            await arrive(base, {})
        return [*counts, *outcomes, (await reception.board())["counts"]]

    replies = serve(place, act)
    assert [{"arrived": 2}, "done", "full", {"complete": 1, "full": 1}] == replies
    late = Recording(place.sessions()[1])
    payloads = late.events().loc[late.events()["name"] == "page_event", "payload"]
    assert {"is_full": True} == [p["reply"] for p in payloads if p["kind"] == "reply"][-1]
    assert 0 == len(late.trials())
    assert {} == place.who


def test_who_goes_on_without_consent_has_a_place_only_if_they_answered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    serve_file(tmp_path / "open.py", WITHOUT_CONSENT, monkeypatch)
    place = Place(tmp_path, Rules(quota=1))

    async def opens(base: str, reception: Reception) -> str:
        address = await arrive(base, {})
        await visit(address, place.visitor(), place.clock, ends=lambda step: True)
        return address.partition("#")[2]

    key = serve(place, opens)

    async def comes_back(base: str, reception: Reception) -> list[Any]:
        assert await reception.session_of(key) is not None
        counts = (await reception.board())["counts"]
        first = await visit(await arrive(base, {}), place.visitor(), place.clock)
        return [counts, first, await visit(f"{base}/#{key}", place.visitor(), place.clock)]

    assert [{"arrived": 1}, "done", "full"] == serve(place, comes_back)


def test_who_is_sent_back_to_the_start_without_consent_has_arrived_at_reception_and_on_board(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    serve_file(
        tmp_path / "open.py", WITHOUT_CONSENT.replace('["idle"]', '["idle", "wave"]'), monkeypatch
    )
    place = Place(tmp_path, Rules(quota=1))

    async def leaves_in_second_trial(base: str, reception: Reception) -> str:
        address = await arrive(base, {})
        await visit(
            address, place.visitor(), place.clock, ends=lambda s: s.content.get("trial") == 2
        )
        return address.partition("#")[2]

    key = serve(place, leaves_in_second_trial)

    async def comes_back(base: str, reception: Reception) -> list[Any]:
        reception._returning = Returning(resumes="start")
        await visit(f"{base}/#{key}", place.visitor(), place.clock, ends=lambda step: True)
        states = list(reception._states.values())
        counts = [(await reception.board())["counts"]]
        outcome = await visit(f"{base}/#{key}", place.visitor(), place.clock)
        return [states, *counts, outcome]

    assert [["arrived"], {"arrived": 1}, "done"] == serve(place, comes_back)
    rows = Recording(place.sessions()[0]).trials()
    assert [1, 1, 2] == sorted(rows["attempt"])


IN_GROUPS = """
from visavis import Factor, Rating, Study

study = Study(
    "grouped", factors=[Factor("load", ["low", "high"]), Factor("who", ["a", "b"], between=True)],
    on="browser", uses=(), calibrate=False,
)


@study.trial
def trial(t):
    yield t.ask(Rating("nice", 1, 5))
"""


def test_each_group_takes_as_many_as_are_wanted_of_it_and_who_leaves_makes_room_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    serve_file(tmp_path / "grouped.py", IN_GROUPS, monkeypatch)
    place = Place(tmp_path, Rules(group_quota=2))

    async def act(base: str, reception: Reception) -> list[str]:
        at = [await arrive(base, {}) for _ in range(4)]
        outcomes = [await visit(address, place.visitor(), place.clock) for address in at[:3]]
        await visit(at[3], place.visitor(), place.clock, ends=lambda s: s.content.get("trial") == 2)
        with pytest.raises(DataError, match="enough participants"):
            await arrive(base, {})
        place.clock.sleep_until_ns(place.clock.now_ns() + IDLE_NS + 1)  # the fourth leaves
        await reception._leave_idle()
        outcomes.append(await visit(await arrive(base, {}), place.visitor(), place.clock))
        with pytest.raises(DataError, match="enough participants"):
            await arrive(base, {})
        return outcomes

    assert ["done"] * 4 == serve(place, act)
    groups = [entry.group for entry in place.ledger.list()]
    assert ["a", "b", "a", "b", "b"] == groups  # the fifth takes over from the fourth


@pytest.mark.parametrize(
    ("text", "wanted"), [("", (None, None)), ("40", (40, None)), ("20/group", (None, 20))]
)
def test_people_wanted_are_said_in_all_or_of_each_group(
    text: str, wanted: tuple[int | None, int | None]
) -> None:
    assert wanted == people_wanted(text)
    with pytest.raises(UsageError, match="takes a number such as 40, or 20/group"):
        people_wanted("0/group")


def test_visitors_who_never_consent_take_no_place_and_are_soon_taken_for_gone(
    tmp_path: Path,
) -> None:
    place = Place(tmp_path, Rules(quota=1))

    async def act(base: str, reception: Reception) -> list[Any]:
        for _ in range(5):
            await arrive(base, {})
        place.clock.sleep_until_ns(place.clock.now_ns() + ARRIVED_IDLE_NS + 1)
        await reception._leave_idle()
        outcome = await visit(await arrive(base, {}), place.visitor(), place.clock)
        return [outcome, (await reception.board())["counts"]]

    assert ["done", {"left": 5, "complete": 1}] == serve(place, act)


def test_where_too_many_pages_are_open_people_wait_and_are_not_sent_away(
    place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("visavis.running.page.reception.MAX_OPEN", 1)

    async def act(base: str, reception: Reception) -> Any:
        await arrive(base, {})
        return await post(base, "/api/arrive", {"parameters": {}})

    assert "busy" == serve(place, act)["refused"]


def test_a_page_cannot_say_that_there_is_no_place(place: Place) -> None:
    async def act(base: str, reception: Reception) -> tuple[int, str]:
        key = (await arrive(base, {})).partition("#")[2]
        reply = {"agreed": True, "is_full": True}
        event = {"n": 1, "kind": "reply", "at_ms": 1.0, "step": 1, "reply": reply}
        async with aiohttp.ClientSession(base, headers={KEY: key}) as http:
            await (await http.post("/api/hello", json={"tab": "t"})).json()
            body = {"tab": "t", "events": [event]}
            async with http.post("/api/events", json=body) as response:
                return response.status, (await response.json())["refused"]

    assert (400, "whether there is a place is not for a page to say") == serve(place, act)


def is_behind_consent(step: PageStep) -> bool:
    """Tell whether a step comes after the consent."""
    return step.kind != "consent"


def test_the_board_has_the_same_address_whenever_a_study_is_served(place: Place) -> None:
    key = place.reception().board_key
    assert key == place.reception().board_key
    assert len(key) == 64
    key_file = KeyFile(place.lab.key_root, "films", [])
    assert not key.startswith(key_file.pseudonym("board"))


def test_the_board_tells_who_is_where_to_its_key_alone(place: Place) -> None:
    async def act(base: str, reception: Reception) -> tuple[int, dict[str, Any]]:
        await visit(await arrive(base, {}), place.visitor(), place.clock)
        await visit(await arrive(base, {}), place.visitor("keep"), place.clock)
        async with aiohttp.ClientSession(base) as http:
            async with http.post("/api/board", json={}, headers={KEY: "x"}) as response:
                status = response.status
            headers = {KEY: reception.board_key}
            async with http.post("/api/board", json={}, headers=headers) as response:
                return status, await response.json()

    status, board = serve(place, act)
    assert 400 == status
    assert board["is_simulated"]
    assert {"complete": 1, "stopped": 1} == board["counts"]
    done, stopped = board["places"]
    assert (2, 2) == (done["trials_done"], done["trials_planned"])
    assert 0 == stopped["trials_done"]
    assert board["median_minutes"] == done["minutes"] > 0
    json.dumps(board)


def test_a_page_that_is_heard_as_the_server_ends_opens_no_session_again(
    place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def act(base: str, reception: Reception) -> None:
        key, close = (await arrive(base, {})).partition("#")[2], reception._close

        async def close_and_hear(opened: Any, status: Any, reason: str) -> None:
            await close(opened, status, reason)
            with contextlib.suppress(aiohttp.ClientError):
                async with aiohttp.ClientSession(base, headers={KEY: key}) as http:
                    await http.post("/api/hello", json={"tab": "t"})

        monkeypatch.setattr(reception, "_close", close_and_hear)

    serve(place, act)
    assert ["aborted"] == [p.status for p in Recording(place.sessions()[0]).manifest.parts]


def test_who_wanted_deletion_as_the_server_was_killed_is_deleted_by_the_next(
    place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def stops(base: str, reception: Reception) -> None:
        monkeypatch.setattr(reception, "_withdraw", void)  # the kill comes before the deletion
        await visit(await arrive(base, {}), place.visitor("delete"), place.clock)

    async def nothing(base: str, _: Reception) -> None:
        return None

    serve(place, stops)
    assert 1 == len(place.sessions())
    serve(place, nothing)
    assert [] == place.sessions()
    assert ["withdrawn"] == [entry.status for entry in place.ledger.list()]


def test_a_session_that_cannot_be_gone_on_with_is_refused_in_words(
    place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def leaves(base: str, _: Reception) -> str:
        address = await arrive(base, {})
        await visit(address, place.visitor(), place.clock, ends=lambda s: s.kind == "watch")
        return address.partition("#")[2]

    key = serve(place, leaves)
    messages: list[str] = []

    async def again(base: str, reception: Reception) -> tuple[int, str]:
        monkeypatch.setattr(reception, "_say", messages.append)
        path = place.sessions()[0] / "manifest.json"
        path.write_text(path.read_text("utf-8").replace('"seed"', '"sown"'), "utf-8")
        async with aiohttp.ClientSession(base, headers={KEY: key}) as http:
            async with http.post("/api/hello", json={"tab": "t"}) as response:
                return response.status, (await response.json())["refused"]

    status, refused = serve(place, again)
    # Not 400, as of a key that nobody knows: a browser forgets that.
    assert (500, "this session cannot go on; please tell the researchers") == (status, refused)
    assert 1 == len(messages)


@pytest.mark.parametrize("comes", ["for the first time", "again"])
def test_who_still_waits_to_be_let_in_keeps_no_server_from_ending(
    comes: str, place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What answers them waits for its turn after their page has gone: nobody would close that."""

    async def leaves(base: str, _: Reception) -> str:
        return (await arrive(base, {})).partition("#")[2]

    key = serve(place, leaves) if comes == "again" else ""

    async def ends() -> tuple[Any, Reception]:
        reception = place.reception()
        server = PageServer(reception=reception)
        await server.start()
        until, stop = asyncio.Event(), server.stop
        serving = asyncio.create_task(reception.serve(server, until))
        await reception._turn.acquire()
        asked = reception.session_of(key) if key else reception.arrive({})
        waiting = asyncio.create_task(asked)

        async def stop_and_let_in() -> None:
            await stop()
            reception._turn.release()
            await asyncio.wait([waiting])

        monkeypatch.setattr(server, "stop", stop_and_let_in)
        until.set()
        await serving
        return waiting.exception() or waiting.result(), reception

    reply, reception = asyncio.run(ends())
    assert {} == reception._open
    refused = reply if comes == "again" else reply["refused"]
    assert "this session cannot go on; please tell the researchers" == str(refused) or (
        "busy" == refused
    )


def test_one_damaged_session_leaves_the_board_of_all_others(place: Place) -> None:
    async def act(base: str, reception: Reception) -> dict[str, int]:
        for _ in range(2):
            await visit(await arrive(base, {}), place.visitor(), place.clock, ends=lambda s: True)
        (place.sessions()[0] / "manifest.json").write_text("{", "utf-8")
        return dict((await reception.board())["counts"])

    assert {"damaged": 1, "arrived": 1} == serve(place, act)
    place.reception()  # which begins with the damaged one, too


def test_a_key_that_no_header_can_hold_is_a_refusal(place: Place) -> None:
    async def act(base: str, reception: Reception) -> int:
        async with aiohttp.ClientSession(base) as http:
            async with http.post("/api/board", json={}, headers={KEY: "schlüssel"}) as response:
                return response.status

    assert 400 == serve(place, act)


@pytest.mark.parametrize(
    "event",
    [
        {"kind": "resize", "view_px": "\ud800"},
        {"kind": "resize", "view_px": float("nan")},
        {"kind": "visibility", "at_ms": 9e14},
    ],
)
def test_nothing_that_a_page_sends_ends_the_server(place: Place, event: dict[str, Any]) -> None:
    async def act(base: str, reception: Reception) -> list[str]:
        key = (await arrive(base, {})).partition("#")[2]
        async with aiohttp.ClientSession(base, headers={KEY: key}) as http:
            async with http.post("/api/hello", json={"tab": "t"}) as response:
                state = await response.json()
            sent = {"n": 1, "at_ms": 1.0, **event}
            body = json.dumps({"tab": "t", "events": [sent]})
            async with http.post("/api/events", data=body) as response:
                assert response.status in (200, 400)
            assert state["ack"] == 0
        await visit(f"{base}/#{key}", place.visitor(), place.clock)
        return [await visit(await arrive(base, {}), place.visitor(), place.clock)]

    assert ["done"] == serve(place, act)
    assert ["complete"] * 2 == [Recording(p).status for p in place.sessions()]


@given(st.lists(st.booleans(), max_size=40), st.integers(1, 8))
def test_orders_stay_even_over_those_who_complete(stays: list[bool], n_orders: int) -> None:
    taken: list[int] = []
    counting: list[int] = []
    for completes in stays:
        index = least_filled(taken, counting, lambda i: (i % n_orders,))
        assert index not in taken
        taken.append(index)
        counting += [index] if completes else []
        filled = [sum(i % n_orders == k for i in counting) for k in range(n_orders)]
        assert max(filled) - min(filled) <= 1


def test_only_what_can_be_an_identifier_is_taken() -> None:
    assert "" == arrival_of({}).identifier
    with pytest.raises(PageError, match="PROLIFIC_PID=<b> is not an identifier"):
        arrival_of({"PROLIFIC_PID": "<b>"})
    somebody = arrival_of({"survey_code": "12345"})
    assert "https://sona/x?survey_code=12345" == completion_of(
        "https://sona/x?survey_code={id}", somebody
    )
    with pytest.raises(UsageError, match="web address"):
        check_completion("javascript:alert(1)")


def test_the_secret_of_a_page_lies_with_no_data_and_is_the_same_of_another_server(
    place: Place,
) -> None:
    async def act(base: str, _: Reception) -> str:
        address = await arrive(base, {})
        await visit(address, place.visitor(), place.clock, ends=lambda s: s.kind == "watch")
        return address.partition("#")[2]

    key = serve(place, act)
    assert 64 == len(key)
    for path in place.lab.data_root.rglob("*"):
        assert not (path.is_file() and key.encode() in path.read_bytes()), path

    async def again(base: str, reception: Reception) -> bool:
        return await reception.session_of(key) is not None

    assert serve(place, again)


def test_who_is_withdrawn_beside_the_server_is_ended_deleted_and_forgotten(place: Place) -> None:
    parameters = {"PROLIFIC_PID": "5f3a"}

    async def act(base: str, reception: Reception) -> tuple[Any, ...]:
        key = (await arrive(base, parameters)).partition("#")[2]
        (entry,) = place.ledger.list()
        place.ledger.begin_withdrawal(entry.label, [place.folder])  # as its command does
        await reception._notice_withdrawals()
        was_deleted = [] == place.sessions()
        async with aiohttp.ClientSession(base, headers={KEY: key}) as http:
            async with http.post("/api/hello", json={"tab": "t"}) as response:
                refused = (await response.json())["refused"]
        again = (await arrive(base, parameters)).partition("#")[2]
        return was_deleted, refused, again != key, (await reception.board())["counts"]

    was_deleted, refused, is_another, counts = serve(place, act)
    assert was_deleted
    assert "this address leads to no session; ask for a new one" == refused
    assert is_another
    assert {"deleted": 1, "arrived": 1} == counts
    assert ["withdrawn", "active"] == [entry.status for entry in place.ledger.list()]


def test_who_left_and_is_withdrawn_beside_the_server_makes_room(tmp_path: Path) -> None:
    place = Place(tmp_path, Rules(quota=1))

    async def act(base: str, reception: Reception) -> str:
        await visit(await arrive(base, {}), place.visitor(), place.clock)
        with pytest.raises(DataError, match="enough participants"):
            await arrive(base, {})
        (entry,) = place.ledger.list()
        place.ledger.withdraw(entry.label, [place.folder])
        return await arrive(base, {})

    assert "#" in serve(place, act)
    assert 1 == len(place.sessions())


@pytest.mark.parametrize(("stop", "outcome"), [("", "done"), ("keep", "stopped")])
def test_who_comes_again_to_a_session_that_is_over_is_told_so_and_nothing_is_added(
    place: Place, stop: str, outcome: str
) -> None:
    async def whole(base: str, _: Reception) -> str:
        address = await arrive(base, {})
        await visit(address, place.visitor(stop), place.clock)
        return address.partition("#")[2]

    key = serve(place, whole)
    (session,) = place.sessions()
    before = {p: p.read_bytes() for p in session.rglob("*") if p.is_file()}

    async def again(base: str, _: Reception) -> list[Any]:
        hello = await post(base, "/api/hello", {"tab": "t"}, key)
        events = await post(base, "/api/events", {"tab": "t", "events": []}, key)
        return [hello["step"], hello["title"], events["step"]]

    end = {"kind": "end", "outcome": outcome}
    assert [end, experiment().study.title, end] == serve(place, again)
    assert before == {p: p.read_bytes() for p in session.rglob("*") if p.is_file()}


def test_a_page_has_a_title_of_its_own_and_names_whom_to_ask() -> None:
    gestures = StudyExperiment(interpolation, {"language": "fr"})

    assert ("Des gestes filmés", "Dr. Who, 42") == information_of(gestures, "Dr. Who, 42")
    assert (study().title, "") == information_of(experiment(), "")


def information_of(shown: StudyExperiment, contact: str) -> tuple[str, str]:
    about = about_of(shown, True, contact)
    return about["title"], about["contact"]


def test_an_identifier_that_others_could_guess_brings_back_in_the_same_browser_alone(
    place: Place,
) -> None:
    async def act(base: str, _: Reception) -> list[Any]:
        body = {"parameters": {"survey_code": "12345"}}
        key = (await post(base, "/api/arrive", body))["key"]
        other = await post(base, "/api/arrive", body)
        same = await post(base, "/api/arrive", {**body, "before": key})
        return [other["refused"], same["key"] == key]

    assert ["begun", True] == serve(place, act)
    assert 1 == len(place.sessions())


def test_a_link_to_somebody_of_the_ledger_gives_them_their_own_place(place: Place) -> None:
    first, second = place.ledger.add(), place.ledger.add()

    async def act(base: str, _: Reception) -> list[Any]:
        key = (await post(base, "/api/arrive", {"parameters": {"participant": "02"}}))["key"]
        again = {"parameters": {"participant": second.label}, "before": key}
        same = (await post(base, "/api/arrive", again))["key"]
        await post(base, "/api/arrive", {"parameters": {"participant": "77"}})
        return [key == same]

    assert [True] == serve(place, act)
    third = place.ledger.list()[2]
    assert [second.label, third.label] == [p.parent.name[4:] for p in place.sessions()]
    assert first.index == 0
    assert {"panel": "link", "identifier": second.label} == dict(place.who[second.label])


@pytest.mark.parametrize("key", ["parameters", "told"])  # a page loaded from 0.2 says `told`
def test_a_placeholder_that_no_panel_filled_is_refused_in_words(place: Place, key: str) -> None:
    async def act(base: str, reception: Reception) -> dict[str, Any]:
        return await post(base, "/api/arrive", {key: {"PROLIFIC_PID": "{{%PROLIFIC_PID%}}"}})

    assert "address" == serve(place, act)["refused"]
    assert [] == place.sessions()


def test_a_stranger_writes_no_line_of_their_own_to_whoever_serves(
    place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines: list[str] = []
    monkeypatch.setattr(
        "tests.running.page.served_places.Reception", partial(Reception, say=lines.append)
    )

    async def act(base: str, reception: Reception) -> dict[str, Any]:
        forged = {"PROLIFIC_PID": "a\r\n\x1b[1AFor you alone\x9b2K\u2028http://elsewhere"}
        return await post(base, "/api/arrive", {"parameters": forged})

    assert "address" == serve(place, act)["refused"]
    (line,) = lines
    assert line.isprintable()  # nor does the terminal take it for a command
