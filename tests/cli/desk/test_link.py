"""Between session and desk: what is told, what may be asked for, and who may ask."""

import asyncio
import base64
import errno
import gc
import io
import json
import math
import os
import socket
import stat
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from tests.cli.test_operator_screen import STATUS
from visavis.cli.desk.link import (
    ACTIONS,
    MAX_TEXT,
    About,
    SessionLink,
    _write_meeting,
    command_of,
    line_of,
    meeting_folder,
    meeting_name,
    status_message,
)
from visavis.cli.desk.scene_view import GAZE_KEPT, LastGaze
from visavis.cli.desk.watch import SessionWatch
from visavis.lab.clock import NS_PER_MS, NS_PER_S, StopWatch
from visavis.lab.geometry import Pose
from visavis.protocol.plan.steps import FrameView, GazeView
from visavis.protocol.session.operator import (
    KEYS,
    Action,
    BodyContact,
    Command,
    SessionStatus,
    UnattendedOperator,
)
from visavis.stage.contracts import Glance
from visavis.stimuli.picture import Camera
from visavis.stimuli.scene import Agent, Scene, SceneFrame
from visavis.stimuli.scenes.station_crowd import CrowdFrame, CrowdScene, station_crowd

PATIENCE_S = 20.0


class AtTheTerminal(UnattendedOperator):
    """An operator who looks four times a second and has typed one thing."""

    status_period_ns = NS_PER_S // 4

    def __init__(self) -> None:
        self.typed = [Command(Action.FLAG)]
        self.seen: list[SessionStatus] = []

    def poll(self) -> Sequence[Command]:
        typed, self.typed = self.typed, []
        return typed

    def show(self, status: SessionStatus) -> None:
        self.seen.append(status)

    def waits_for_advance(self, prompt: str) -> bool:
        return prompt == "wait"


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def link(cache: Path, tmp_path: Path) -> Iterator[SessionLink]:
    about = About("stare", "S07H", 1, str(tmp_path), is_simulated=True, is_blind=False)
    with SessionLink(AtTheTerminal(), about, tmp_path) as made:
        yield made


def with_desk(data_root: Path, act: Callable[[SessionWatch], Any]) -> Any:
    """Let a desk follow the session of a data root while something is done."""

    async def both() -> Any:
        watch = SessionWatch(data_root)
        running = asyncio.create_task(watch.run())
        try:
            return await asyncio.wait_for(act(watch), PATIENCE_S)
        finally:
            running.cancel()
            await asyncio.wait([running])

    return asyncio.run(both())


async def until(watch: SessionWatch, holds: Callable[[], bool]) -> None:
    while not holds():
        await watch.wait(watch.number, PATIENCE_S)


def polled(link: SessionLink) -> list[Command]:
    """Return what is asked for next, from wherever."""
    watch = StopWatch()
    while watch.elapsed_s() < PATIENCE_S:
        line = list(link.poll())
        if line:
            return line
    raise AssertionError("nothing was asked for")


def test_a_desk_hears_the_status_and_its_commands_reach_the_session(
    link: SessionLink, tmp_path: Path
) -> None:
    assert [Command(Action.FLAG)] == polled(link)  # typed at the terminal
    link.show(STATUS)

    async def act(watch: SessionWatch) -> Any:
        await until(watch, lambda: watch.status is not None)
        assert await watch.tell(Command(Action.NOTE, "sneezed"))
        return dict(watch.about or {}), dict(watch.status or {})

    about, status = with_desk(tmp_path, act)
    assert ("stare", "S07H", 1) == (about["study"], about["participant"], about["session"])
    assert ("trial", "T05", 5) == (status["state"], status["trial_id"], status["trials_done"])
    assert [Command(Action.NOTE, "sneezed")] == polled(link)


def test_a_session_goes_on_while_desks_come_and_go(link: SessionLink, tmp_path: Path) -> None:
    async def here(watch: SessionWatch) -> bool:
        await until(watch, lambda: watch.status is not None)
        return True

    for _ in range(2):
        link.show(STATUS)
        assert with_desk(tmp_path, here)
    link.show(STATUS)
    assert [Command(Action.FLAG)] == list(link.poll())


def test_a_desk_hears_that_a_session_has_ended_and_which(cache: Path, tmp_path: Path) -> None:
    about = About("stare", "S07H", 1, str(tmp_path), is_simulated=True, is_blind=False)
    made = SessionLink(UnattendedOperator(), about, tmp_path)

    async def act(watch: SessionWatch) -> Any:
        with made:
            await until(watch, lambda: watch.about is not None)
        await until(watch, lambda: watch.about is None)
        return (watch.last_ended or {})["path"], await watch.tell(Command(Action.FLAG))

    assert (str(tmp_path), False) == with_desk(tmp_path, act)


def test_sessions_of_another_data_root_are_nobodys_business_here(
    link: SessionLink, tmp_path: Path
) -> None:
    async def act(watch: SessionWatch) -> bool:
        await asyncio.sleep(0)  # the first look
        await watch.wait(0, 0.2)
        return watch.about is None

    assert with_desk(tmp_path / "another", act)


@pytest.mark.skipif(os.name == "nt", reason="modes are those of POSIX")
def test_how_a_session_is_reached_is_its_owners_secret_and_gone_with_it(
    cache: Path, tmp_path: Path
) -> None:
    about = About("stare", "S07H", 1, str(tmp_path), is_simulated=True, is_blind=False)
    with SessionLink(UnattendedOperator(), about, tmp_path):
        (meeting,) = meeting_folder().glob("*.json")
        assert 0o600 == stat.S_IMODE(meeting.stat().st_mode)
        assert cache in meeting.parents
    assert [] == list(meeting_folder().glob("*.json"))


def test_a_desk_that_looks_while_a_session_begins_never_finds_half_of_its_file(
    cache: Path, tmp_path: Path
) -> None:
    looks: list[Any] = []

    def look(*_: Any) -> Any:
        sys.settrace(None)
        looks.extend(json.loads(file.read_text()) for file in meeting_folder().glob("*.json"))
        sys.settrace(look)
        return look

    earlier = sys.gettrace()
    sys.settrace(look)  # at every line that is run
    try:
        _write_meeting("lab", {"port": 1, "token": "x"})
    finally:
        sys.settrace(earlier)
    assert {"port": 1, "token": "x"} == looks[0] == looks[-1]


def test_a_session_is_found_once_the_computer_has_files_to_spare_again(
    link: SessionLink, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    connect, failures = asyncio.open_connection, [errno.EMFILE, errno.ENOBUFS]

    async def connect_or_fail(*place: Any, **options: Any) -> Any:
        if failures:
            raise OSError(failures.pop(), "short of it")
        return await connect(*place, **options)

    monkeypatch.setattr(asyncio, "open_connection", connect_or_fail)
    monkeypatch.setattr("visavis.cli.desk.watch.LOOK_AGAIN_S", 0.01)
    with_desk(tmp_path, lambda watch: until(watch, lambda: watch.about is not None))
    assert [] == failures


def test_a_session_without_a_file_to_be_found_by_goes_on_says_why_and_leaves_no_socket(
    cache: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cache.mkdir()
    (cache / "visavis").write_text("a file in the place of the folder")
    about = About("stare", "S07H", 1, str(tmp_path), is_simulated=True, is_blind=False)
    with warnings.catch_warnings(record=True) as all_warnings:
        warnings.simplefilter("always")
        with SessionLink(UnattendedOperator(), about, tmp_path) as link:
            link.show(STATUS)
        del link
        gc.collect()
    output = " ".join(capsys.readouterr().out.split())
    assert "no desk can find this session" in output
    assert "it goes on at this terminal" in output
    assert [] == [warning for warning in all_warnings if warning.category is ResourceWarning]


def test_nobody_without_the_secret_is_told_or_heard(link: SessionLink) -> None:
    link.poll()
    link.show(STATUS)
    (meeting,) = meeting_folder().glob("*.json")
    port = json.loads(meeting.read_text("utf-8"))["port"]
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S) as stranger:
        stranger.sendall(b"guess\n" + line_of({"action": "abort"}))
        assert b"" == _all_of(stranger)
    assert [] == list(link.poll())


def _all_of(stranger: socket.socket) -> bytes:
    try:
        return stranger.recv(1024)
    except ConnectionResetError:
        return b""


def test_what_killed_sessions_left_is_cleared_after_a_week(cache: Path, tmp_path: Path) -> None:
    meeting_folder().mkdir(parents=True)
    old, new = (meeting_folder() / f"{name}-1.json" for name in ("old", "new"))
    for left, age_s in ((old, 8 * 86400), (new, 0)):
        left.write_text("{}", "utf-8")
        changed_s = left.stat().st_mtime - age_s
        os.utime(left, (changed_s, changed_s))
    about = About("stare", "S07H", 1, str(tmp_path), is_simulated=True, is_blind=False)
    with SessionLink(UnattendedOperator(), about, tmp_path):
        assert (False, True) == (old.exists(), new.exists())


def test_a_killed_sessions_way_is_forgotten(cache: Path, tmp_path: Path) -> None:
    folder = meeting_folder()
    folder.mkdir(parents=True)
    left = folder / f"{meeting_name(tmp_path)}-1.json"
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        left.write_text(json.dumps({"port": free.getsockname()[1], "token": "x"}), "utf-8")

    async def act(watch: SessionWatch) -> None:
        while left.exists():
            await asyncio.sleep(0.01)

    with_desk(tmp_path, act)


@pytest.mark.parametrize("says", [b"", b"220 no session of ours\r\n"], ids=["nothing", "no JSON"])
def test_a_stranger_at_a_killed_sessions_port_hides_no_session(
    says: bytes, link: SessionLink, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # who says something is waited for, however busy the computer
    monkeypatch.setattr("visavis.cli.desk.watch.HELLO_S", PATIENCE_S if says else 0.05)
    left = meeting_folder() / f"{meeting_name(tmp_path)}-0.json"  # comes before the session's
    link.show(STATUS)

    async def act(watch: SessionWatch) -> Any:
        await until(watch, lambda: watch.status is not None and bool(says) != left.exists())
        return watch.status

    with socket.create_server(("127.0.0.1", 0)) as stranger:

        def speak() -> None:
            visitor, _ = stranger.accept()
            with visitor:
                visitor.sendall(says)
                visitor.recv(1 << 10)
                visitor.recv(1 << 10)  # until the desk goes away

        left.write_text(json.dumps({"port": stranger.getsockname()[1], "token": "x"}), "utf-8")
        speaking = threading.Thread(target=speak)
        speaking.start()
        status = with_desk(tmp_path, act)
        speaking.join()
    assert "trial" == status["state"]
    assert bool(says) != left.exists()  # a silent one may be a session that is busy


def test_a_desk_can_ask_for_what_the_keys_do_and_for_no_answer_of_a_participant() -> None:
    assert set(KEYS.values()) == set(ACTIONS)
    assert Command(Action.PAUSE) == command_of(b'{"action": "pause"}', ACTIONS)
    assert None is command_of(b'{"action": "answer", "text": "5"}', ACTIONS)
    assert None is command_of(b'{"action": "pause"}', ())
    for line in (
        b"",
        b"[]",
        b"{}",
        b"\xff",
        b'{"action": "dance"}',
        b'{"action": "note", "text": 1}',
    ):
        assert None is command_of(line, ACTIONS)


def test_a_reason_is_one_of_the_labs() -> None:
    own = {"noise": "noise outside"}
    line = b'{"action": "skip", "text": "drill", "code": "noise"}'
    assert Command(Action.SKIP, "drill", "noise") == command_of(line, ACTIONS, own)
    assert None is command_of(line, ACTIONS)
    for code in (b'"weather"', b"7", b'["noise"]'):
        assert None is command_of(b'{"action": "skip", "code": ' + code + b"}", ACTIONS, own)


def test_two_sessions_at_once_are_heard_and_commanded_apart(cache: Path, tmp_path: Path) -> None:
    def link_of(label: str) -> SessionLink:
        about = About("stare", label, 1, str(tmp_path), is_simulated=True, is_blind=False)
        return SessionLink(UnattendedOperator(), about, tmp_path)

    with link_of("S01") as one, link_of("S02") as other:
        one.show(replace(STATUS, trial_id="T01"))
        other.show(replace(STATUS, trial_id="T02"))

        async def act(watch: SessionWatch) -> Any:
            await until(
                watch, lambda: 2 == len([live for live in watch.live.values() if live.status])
            )
            names = {live.about["participant"]: name for name, live in watch.live.items()}
            trials = {
                live.about["participant"]: (live.status or {})["trial_id"]
                for live in watch.live.values()
            }
            assert await watch.tell(Command(Action.PAUSE), names["S02"])
            assert not await watch.tell(Command(Action.PAUSE), "one that has ended")
            return trials

        assert {"S01": "T01", "S02": "T02"} == with_desk(tmp_path, act)
        assert [Command(Action.PAUSE)] == polled(other)
        assert [] == list(one.poll())


def test_a_note_is_one_line_of_text() -> None:
    line = line_of({"action": "note", "text": "  a\x1b[2J\nb" + "x" * MAX_TEXT})
    note = command_of(line, ACTIONS)
    assert note is not None
    assert note.text.startswith("a[2Jbxxx")
    assert len(note.text) <= MAX_TEXT


def test_the_terminal_is_drawn_no_more_often_than_without_a_desk(link: SessionLink) -> None:
    shown = NS_PER_S // link.status_period_ns
    for _ in range(shown):
        link.show(STATUS)
    terminal: Any = link._operator
    assert NS_PER_S // terminal.status_period_ns == len(terminal.seen)


def test_who_waits_at_the_terminal_is_waited_for(link: SessionLink) -> None:
    assert link.waits_for_advance("wait")
    assert not link.waits_for_advance("go")


def test_what_is_not_known_is_nothing_never_a_number() -> None:
    unknown = replace(
        STATUS,
        trial_left_s=math.nan,
        calibration=replace(STATUS.calibration, accuracy_deg=None),
    )
    line = json.loads(line_of(status_message(1, unknown, LastGaze())))
    assert (None, None) == (line["trial_left_s"], line["accuracy_deg"])
    assert None is line["above"]


def seen(valid: bool, *, brightness_01: float = 1.0) -> SessionStatus:
    """Return a status of a frame in which somebody 2 m ahead, 1 m to the right, was looked at.

    Their head is 3° wide to each side, and half the gap to the next 0.5°.
    """
    head = Pose(np.array([0.0, 1.2, 0.5]), np.array([1.0, 0.0, 0.0, 0.0]))
    at = np.array([1.0, 1.3, -2.0])
    gaze = GazeView(
        np.array([5 * NS_PER_MS]),
        np.array([valid]),
        np.array([[0.6, 0.0, -0.8]]),
        np.array([[0.0, 1.2, 0.5]]),
        np.zeros((1, 1)),
        np.full((1, 1), 3.0 if valid else np.nan),
        np.full((1, 1), 0.5 if valid else np.nan),
        np.array([0 if valid else -2], np.int16),
    )
    agent = Agent("a1", "anna", "right_close", at, 0.11, np.array([0.0, 0.0, 1.0]), at)
    scene = Scene("rows", (agent,), brightness_01=brightness_01)
    shown = SceneFrame(scene, 0, np.array([[0.0, 0.0, 1.0]]), np.ones(1))
    return replace(STATUS, frame=FrameView(0, 0, head, True, gaze), scene_frame=shown)


def above_of(link: SessionLink, status: SessionStatus) -> Any:
    link.show(status)
    latest = link._latest
    assert latest is not None
    return status_message(*latest)["above"]


def test_from_above_people_head_and_gaze_are_where_they_are(link: SessionLink) -> None:
    above = above_of(link, seen(True))
    assert [["right_close", 1.0, -2.0, 0.12]] == above["people"]
    assert ([0.0, 0.5], [0.0, -1.0]) == (above["head"], above["ahead"])
    assert ([0.0, 0.5, 0.6, -0.8], 0) == (above["gaze"], above["hit"])


def test_a_blink_keeps_the_gaze_and_a_loss_does_not(link: SessionLink) -> None:
    above_of(link, seen(True))
    kept = [above_of(link, seen(False))["gaze"] for _ in range(GAZE_KEPT + 1)]
    assert [True] * GAZE_KEPT + [False] == [gaze is not None for gaze in kept]


def test_in_the_dark_nobody_is_drawn_or_looked_at(link: SessionLink) -> None:
    above = above_of(link, seen(True, brightness_01=0.0))
    assert ([], -1) == (above["people"], above["hit"])


def test_areas_of_interest_are_as_wide_as_looks_are_counted(link: SessionLink) -> None:
    away_m = math.dist((0.0, 1.2, 0.5), (1.0, 1.3, -2.0))
    areas = above_of(link, seen(True))["areas"]
    assert [pytest.approx(away_m * math.sin(math.radians(3.5)), abs=1e-4)] == areas


def test_areas_stay_while_gaze_is_lost_and_go_with_their_scene(link: SessionLink) -> None:
    status = seen(True)
    link.show(status)
    lost_status = replace(seen(False), scene_frame=status.scene_frame)
    assert 1 == len([above_of(link, lost_status) for _ in range(2 * GAZE_KEPT)][-1]["areas"])
    assert [] == above_of(link, seen(False))["areas"]


def view_of(link: SessionLink, status: SessionStatus) -> Any:
    link.show(status)
    assert link._latest is not None
    return status_message(*link._latest)["from_head"]


def test_before_the_participant_heads_gaze_and_areas_are_where_they_are(link: SessionLink) -> None:
    view = view_of(link, seen(True))
    ((name, x, y, radius),) = view["heads"]
    assert ("right_close", 1.0 / 2.5, 0.1 / 2.5) == (name, x, y)
    assert pytest.approx(0.12 / 2.5, abs=1e-4) == radius
    assert ((0.75, 0.0), 0) == (view["gaze"], view["hit"])
    assert [[0.4, 0.04, pytest.approx(math.tan(math.radians(3.5)), abs=1e-4)]] == view["areas"]
    assert None is view["jpeg"]


def test_what_is_behind_the_participant_is_not_before_them(link: SessionLink) -> None:
    status = seen(True)
    assert status.frame is not None
    turned = Pose(status.frame.head.position_m, np.array([0.0, 0.0, 1.0, 0.0]))
    view = view_of(link, replace(status, frame=status.frame._replace(head=turned)))
    assert ([], [], None) == (view["heads"], view["areas"], view["gaze"])


def test_a_crowd_is_seen_and_who_is_touched_is_told(link: SessionLink) -> None:
    crowd = station_crowd(1)
    scene = CrowdScene("crowd_1", (), crowd=crowd)
    shown = CrowdFrame(scene, 0, np.empty((0, 3)), np.empty(0))
    contact = BodyContact("armband_left_forearm", "left_hand", 7, vibrates=True)
    status = replace(seen(True), scene_frame=shown, contacts=(contact,), contacts_begun=3)
    above = above_of(link, status)
    places = [[x, z] for _, x, z, _ in above["people"]]
    assert crowd.position_m.tolist() == places
    assert ([7], []) == (above["touched"], above["areas"])
    message = status_message(1, status, LastGaze())
    assert ("left_hand", 3) == (message["contacts"][0]["segment"], message["contacts_begun"])
    assert 0 < len(view_of(link, status)["heads"]) < len(crowd)


class Glancing:
    """What the participant saw, as often as it is asked for."""

    def __init__(self) -> None:
        self.asked = 0

    def __call__(self) -> Glance:
        self.asked += 1
        camera = Camera(Pose(np.array([0.0, 1.2, 0.5]), np.array([1.0, 0, 0, 0])), -1, 1, -1, 1)
        return Glance(np.full((9, 8, 3), 200, np.uint8), camera)


def test_a_desk_sees_what_the_participant_sees(link: SessionLink, tmp_path: Path) -> None:
    glancing = Glancing()

    async def act(watch: SessionWatch) -> Any:
        while not (line := watch.of()) or line.last_view is None:
            link.show(replace(seen(True), glance=glancing))
            await watch.wait(watch.number, 0.1)
        return line.last_view

    view = with_desk(tmp_path, act)
    image = Image.open(io.BytesIO(base64.b64decode(view["jpeg"])))
    assert ("JPEG", (8, 9)) == (image.format, image.size)
    assert ([-1, 1, -1, 1], 1) == (view["tangents"], len(view["areas"]))


def test_nobody_asks_for_a_picture_while_no_desk_is_there(link: SessionLink) -> None:
    glancing = Glancing()
    link.show(replace(seen(True), glance=glancing))
    assert 0 == glancing.asked


def test_an_operator_who_is_blinded_gets_no_picture(cache: Path, tmp_path: Path) -> None:
    glancing = Glancing()
    about = About("stare", "S07H", 1, str(tmp_path), is_simulated=True, is_blind=True)

    async def act(watch: SessionWatch) -> None:
        await until(watch, lambda: watch.about is not None)
        link.show(replace(seen(True), glance=glancing))
        await until(watch, lambda: watch.status is not None)

    with SessionLink(UnattendedOperator(), about, tmp_path) as link:
        with_desk(tmp_path, act)
    assert 0 == glancing.asked
