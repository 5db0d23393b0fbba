"""What a headset measures is checked at the door, and lands once in the streams of a recording."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.running.page.headsets.batches import FRAME_MS, POSE, batch, head_rows
from tests.running.page.pages import TAB, Page, begin_session, go_on_with
from tests.running.page.test_page_clock import Network, at_a_film, beats
from visavis.analysis.session_check import check_session
from visavis.analysis.session_verdict import Level
from visavis.devices.streams import HEAD, NO_DEVICE_TIME
from visavis.lab.clock import NS_PER_MS, NS_PER_S, SystemClock
from visavis.lab.schema import SampleBatch
from visavis.recording.page_clock import PAGE_ROLE
from visavis.recording.reader import Recording
from visavis.recording.session_times import session_times
from visavis.recording.writer import REAL_TIME_BATCH_NS, Recorder
from visavis.running.page.desk import LOST_FLAG, Post
from visavis.running.page.steps import BadEventError, PageError
from visavis.running.page.stream_batches import PageStreams, read_batch
from visavis.running.page.streams import COLUMNS, MAX_ROWS

NAN = float("nan")
HEAD_ROW = (0.0, *POSE, 1.0)


def in_headset(page: Page) -> Page:
    """Return a page at a film that may send what a headset measures."""
    page.desk.headset_streams = tuple(COLUMNS)
    at_a_film(page)
    return page


def send(page: Page, *events: dict[str, Any]) -> None:
    """Let a page send events under the next numbers."""
    first = page.desk.last_event_number + 1
    page.desk.take(TAB, [{**e, "n": first + i} for i, e in enumerate(events)])


@pytest.mark.parametrize(
    ("why", "event"),
    [
        ("there is no stream", batch([HEAD_ROW], "gaze")),
        ("0 rows", batch([])),
        ("rows; a batch has", batch(head_rows(MAX_ROWS + 1, 0.1))),
        ("are not", batch(head_rows(3)) | {"rows": 2}),
        ("not base64", batch([HEAD_ROW], data="%%%")),
        ("not base64", batch([HEAD_ROW], data="é")),
        ("rows counts nothing", batch([HEAD_ROW]) | {"rows": True}),
        ("seq0 counts nothing", batch([HEAD_ROW], seq0=-1)),
        ("t0_ms is not a number", batch([HEAD_ROW]) | {"t0_ms": "now"}),
        ("follow one another", batch([(1.0, *POSE, 1.0), (0.5, *POSE, 1.0)])),
        ("follow one another", batch([(NAN, *POSE, 1.0)], at_ms=5001.0)),
        ("follow one another", batch([(-1.0, *POSE, 1.0)])),
        ("follow one another", batch(head_rows(90), at_ms=5010.0)),
        ("within 100 m", batch([(0.0, 101.0, *POSE[1:], 1.0)])),
        ("within 100 m", batch([(0.0, NAN, *POSE[1:], 0.0)])),
        ("unit quaternion", batch([(0.0, *POSE[:3], 0.0, 0.0, 0.0, 0.0, 1.0)])),
        ("valid is 1", batch([(0.0, *POSE, 0.5)])),
        ("valid is 1", batch([(0.0, *[NAN] * 7, 1.0)])),
        ("a hand is", batch([(0.0, 2.0, *POSE, 1.0)], "pointer")),
        ("a control is", batch([(0.0, 14.0, 1.0)], "responses")),
        ("a control has", batch([(0.0, 7.0, 1.5)], "responses")),
        ("a control has", batch([(0.0, 7.0, NAN)], "responses")),
        ("a time is none", batch([(0.0, 0.0, 18.0, -1.0, 0.0, 1.0)], "frame_timing")),
        ("a time is none", batch([(0.0, 0.0, 18.0, 1e30, 0.0, 1.0)], "frame_timing")),
        ("a time is none", batch([(0.0, 0.0, np.inf, 1.0, 0.0, 1.0)], "frame_timing")),
        ("skipped counts", batch([(0.0, 0.0, 18.0, 1.0, 0.5, 1.0)], "frame_timing")),
        ("drawn is", batch([(0.0, 0.0, 18.0, 1.0, 0.0, 2.0)], "frame_timing")),
        ("xr0_ms", batch([(0.0, 0.0, 18.0, 1.0, 0.0, 1.0)], "frame_timing", xr0_ms=None)),
        ("no headset's rate", batch([HEAD_ROW], rate_hz=-5.0)),
        ("unit quaternion", batch([(0.0, *([0.0] * 400))], "hands")),
    ],
)
def test_what_no_headset_measures_is_refused_and_says_why(why: str, event: dict[str, Any]) -> None:
    with pytest.raises(PageError, match=why):
        read_batch(event)


def test_a_batch_that_is_set_aside_leaves_the_others_their_way(tmp_path: Path) -> None:
    with begin_session(tmp_path) as (page, path):
        in_headset(page)
        wrong = batch([(0.0, *POSE, 0.5)], seq0=10)
        with pytest.raises(BadEventError, match="valid is 1") as caught:
            send(page, batch(head_rows(10)), wrong)
        assert page.desk.last_event_number + 1 == caught.value.n
        send(page, batch(head_rows(10), seq0=10, t0_ms=5200.0))
        page.desk.recorder.checkpoint()
        assert list(range(20)) == list(Recording(path).stream("head")["seq"])


def test_nothing_of_a_headset_is_taken_where_none_can_be_entered(tmp_path: Path) -> None:
    with begin_session(tmp_path) as (page, path):
        page.desk.headset_streams = ("head",)
        with pytest.raises(BadEventError, match="nobody entered"):
            send(page, batch(head_rows(1)))  # before consent
        page.desk.headset_streams = ()
        at_a_film(page)
        for event in (batch(head_rows(1)), {"kind": "xr", "at_ms": 1.0, "what": "off"}):
            with pytest.raises(BadEventError, match="nobody entered"):
                send(page, event)
        page.desk.recorder.checkpoint()
        assert () == Recording(path).stream_names


def test_every_stream_lands_as_the_lab_s_with_what_is_unknown_named(tmp_path: Path) -> None:
    hand = [v for _ in range(50) for v in (*POSE, 1.0)]
    with begin_session(tmp_path) as (page, path):
        in_headset(page)
        send(
            page,
            batch([HEAD_ROW, (10.0, *[NAN] * 7, 0.0)]),
            batch(
                [(0.0, 0.0, 18.0, 2.5, 0.0, 1.0), (14.0, NAN, NAN, NAN, 0.0, 0.0)], "frame_timing"
            ),
            batch([(0.0, 1.0, *POSE, 1.0)], "pointer"),
            batch([(0.0, 7.0, 1.0), (80.0, 7.0, 0.0)], "responses"),
            batch([(0.0, *hand)], "hands"),
        )
        page.desk.recorder.close("complete")
    recording = Recording(path)
    assert set(COLUMNS) == set(recording.stream_names)
    head = recording.stream_arrays("head")
    assert [True, False] == list(head["valid"])
    assert np.allclose(POSE[:3], head["position_m"][0])
    assert np.allclose(POSE[3:], head["orientation_wxyz"][0])
    assert np.isnan(head["position_m"][1]).all()
    schema = recording.stream_schema("head")
    assert schema is not None
    assert (HEAD.fields, 72.0) == (schema.fields, schema.nominal_rate_hz)
    timing = recording.stream_arrays("frame_timing")
    assert [0, 1] == list(timing["pose_seq"])
    assert [NO_DEVICE_TIME] * 2 == list(timing["predicted_display_ns"])
    assert [918 * NS_PER_MS, NO_DEVICE_TIME] == list(timing["predicted_xr_ns"])
    shown_ns = timing["t_submitted_ns"] - timing["t_host_ns"]
    assert (round(2.5 * NS_PER_MS), -1) == (shown_ns[0], timing["t_submitted_ns"][1])
    assert not timing["timing_known"].any()
    assert [1] == list(recording.stream_arrays("pointer")["hand"])
    assert [1.0, 0.0] == list(recording.stream_arrays("responses")["value_01"])
    assert (1, 50, 3) == recording.stream_arrays("hands")["position_m"].shape


def test_rows_are_dated_by_the_page_s_clock_and_not_by_their_arrival(tmp_path: Path) -> None:
    network = Network(20.0)
    with begin_session(tmp_path) as (page, path):
        in_headset(page)
        beats(page, network, 1800.0)
        seen_s = page.clock.now_ns() / NS_PER_S
        page.clock.sleep_until_ns(round((seen_s + 45) * NS_PER_S))  # the network was away
        send(page, batch(head_rows(720), t0_ms=network.page_ms(seen_s)))
        page.answer_all()
        page.desk.recorder.close("complete")
    recording = Recording(path)
    host_ns = recording.stream_arrays("head")["t_host_ns"]
    want_ns = round(seen_s * NS_PER_S) + np.rint(np.arange(720) * FRAME_MS * NS_PER_MS)
    assert 2 * NS_PER_MS > np.abs(host_ns - want_ns).max()
    events = recording.events()
    assert PAGE_ROLE in [p.get("role") for p in events["payload"]]
    dated = session_times(recording, "head", 1)
    assert 2 * NS_PER_MS > np.abs(dated.t_ns - want_ns).max()
    assert 19 < -dated.drift_ppm < 21


def test_what_waited_in_the_store_is_dated_by_the_clock_of_its_own_page(tmp_path: Path) -> None:
    with begin_session(tmp_path) as (page, path):
        in_headset(page)
        sent = {"n": page.desk.last_event_number + 1, "kind": "visibility", "is_visible": True}
        page.desk.take(TAB, [{**sent, "at_ms": 60_000.0}])
        begun_ns = page.clock.now_ns() - 60_000 * NS_PER_MS
        page.clock.sleep_until_ns(page.clock.now_ns() + 20 * NS_PER_S)
        page.desk.leave(TAB)
        page.desk.hello("two", before=TAB, at_ms=300.0)
        rows = batch(head_rows(10), t0_ms=65_000.0, tab=TAB)
        page.desk.take("two", [{**rows, "n": page.desk.last_event_number + 1}])
        page.desk.recorder.checkpoint()
        host_ns = Recording(path).stream_arrays("head")["t_host_ns"]
    assert begun_ns + 65_000 * NS_PER_MS == host_ns[0]


def test_a_hole_in_the_numbers_flags_the_trial_and_numbers_never_go_back(tmp_path: Path) -> None:
    with begin_session(tmp_path) as (page, path):
        in_headset(page)
        send(page, batch(head_rows(10), seq0=7), batch(head_rows(5), seq0=30, t0_ms=5300.0))
        with pytest.raises(BadEventError, match="row 20 came after 34"):
            send(page, batch(head_rows(5), seq0=20, t0_ms=5400.0))
        page.answer_all()
        page.desk.recorder.close("complete")
    recording = Recording(path)
    assert [LOST_FLAG, "", ""] == list(recording.trials()["flags"])
    assert [*range(7, 17), *range(30, 35)] == list(recording.stream("head")["seq"])
    (stream,) = check_session(recording).streams
    assert (15, 28, Level.RED) == (stream.rows, stream.expected, stream.level)


def test_what_happens_around_a_headset_flags_the_trial(tmp_path: Path) -> None:
    with begin_session(tmp_path) as (page, path):
        in_headset(page)
        for what in ("off", "on", "reset"):
            send(page, {"kind": "xr", "at_ms": 1.0, "what": what, "detail": ""})
        for wrong in ({"what": "asleep"}, {"what": "off", "detail": 5}):
            with pytest.raises(BadEventError, match=r"headset|detail"):
                send(page, {"kind": "xr", "at_ms": 1.0, **wrong})
        page.answer_all()
        page.desk.recorder.close("complete")
    assert "headset off;reference space reset" == Recording(path).trials().iloc[0]["flags"]


def test_a_trial_whose_headset_was_left_and_entered_again_was_seen_in_both(tmp_path: Path) -> None:
    with begin_session(tmp_path) as (page, path):
        in_headset(page)
        page.desk.notes.place = "headset"
        page.desk.notes.begin()
        for what in ("ended", "entered"):
            send(page, {"kind": "xr", "at_ms": 1.0, "what": what})
        page.answer_all()
        page.desk.recorder.close("complete")
    assert ["both", "headset", "headset"] == list(Recording(path).trials()["seen_in"])


def write_rows_unknown_to_the_journal(page: Page) -> None:
    """Send ten rows, and write ten more whose acknowledgement never left."""
    in_headset(page)
    send(page, batch(head_rows(10)))
    page.desk.recorder.checkpoint()
    unknown = read_batch(batch(head_rows(10), seq0=10, t0_ms=5200.0))
    page.desk._streams.write(unknown, lambda ms: round(ms * NS_PER_MS), page.clock.now_ns())
    page.desk.recorder.checkpoint()


def test_a_killed_server_loses_and_doubles_no_row(tmp_path: Path) -> None:
    with begin_session(tmp_path) as (page, path):
        write_rows_unknown_to_the_journal(page)
    with go_on_with(path) as page:
        page.desk.headset_streams = ("head",)
        assert {"head": 20} == page.desk.next_rows
        send(page, batch(head_rows(15), seq0=10, t0_ms=5200.0))
        page.answer_all()
        page.desk.recorder.close("complete")
    assert list(range(25)) == list(Recording(path).stream("head")["seq"])


@pytest.mark.parametrize("says_hello", [True, False])
def test_what_waited_while_a_server_began_anew_has_the_times_at_which_it_was_measured(
    tmp_path: Path, says_hello: bool
) -> None:
    with begin_session(tmp_path) as (page, path):
        in_headset(page)
    away_s = 5.0
    with go_on_with(path, says_hello=False) as page:
        page.desk.headset_streams = ("head", "frame_timing")
        page.clock.sleep_until_ns(2 * NS_PER_S)
        now_ms = 60_000.0  # of the page, when its post leaves
        if says_hello:
            page.desk.hello(TAB, at_ms=now_ms - 10)
        first = page.desk.last_event_number + 1
        waiting = [
            batch(head_rows(36), seq0=seq0, t0_ms=now_ms - 1000 * away_s + seq0 * FRAME_MS)
            for seq0 in range(0, round(72 * away_s), 36)
        ]
        post = Post(now_ms, 1.7e12, 1, 2 * NS_PER_S)
        page.desk.take(TAB, [{**e, "n": first + i} for i, e in enumerate(waiting)], post)
        page.answer_all()
        page.desk.recorder.close("complete")
    found = Recording(path).stream_arrays("head", part=2)["t_host_ns"]
    want_ns = (2 - away_s) * NS_PER_S + np.arange(len(found)) * FRAME_MS * NS_PER_MS
    assert 360 == len(found)
    assert 20 * NS_PER_MS > np.abs(found - want_ns).max()  # three seconds before the part began


def test_whoever_goes_on_behind_rows_that_are_on_the_disk_has_lost_none(tmp_path: Path) -> None:
    with begin_session(tmp_path) as (page, path):
        write_rows_unknown_to_the_journal(page)
    with go_on_with(path) as page:  # by a page without a store, which numbers as it is told
        page.desk.headset_streams = ("head",)
        send(page, batch(head_rows(5), seq0=page.desk.next_rows["head"], t0_ms=5400.0))
        assert LOST_FLAG not in page.desk.notes.all
        page.desk.recorder.close("complete")
    assert list(range(25)) == list(Recording(path).stream("head")["seq"])


def test_ten_minutes_of_backlog_in_one_post_wait_for_the_disk_and_do_not_blame_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    total = 54_000
    batches = [
        batch(head_rows(min(MAX_ROWS, total - seq0), 11.0), seq0=seq0, t0_ms=11.0 * seq0)
        for seq0 in range(0, total, MAX_ROWS)
    ]
    waiting: list[int] = []
    with begin_session(tmp_path) as (page, path):
        in_headset(page)
        recorder = page.desk.recorder
        write, checkpoint = recorder.append, recorder.checkpoint

        def append(rows: SampleBatch) -> None:
            waiting.append(len(rows))
            write(rows)

        def wait() -> None:
            waiting.append(0)
            checkpoint()

        monkeypatch.setattr(recorder, "append", append)
        monkeypatch.setattr(recorder, "checkpoint", wait)
        send(page, *batches)
        monkeypatch.undo()
        recorder.close("complete")
    assert total == len(Recording(path).stream_arrays("head")["seq"])
    ends = [-1, *(i for i, n in enumerate(waiting) if n == 0), len(waiting)]
    at_once = max(sum(waiting[a + 1 : b]) for a, b in pairwise(ends))
    folder = tmp_path / "part"
    folder.mkdir()
    with Recorder(
        folder, SystemClock(), threaded=True, max_batch_ns=REAL_TIME_BATCH_NS, is_simulated=True
    ) as recorder:
        streams = PageStreams(recorder)
        for seq0 in range(0, at_once, MAX_ROWS):
            rows = read_batch(batch(head_rows(MAX_ROWS, 11.0), seq0=seq0, t0_ms=11.0 * seq0))
            streams.write(rows, lambda ms: round(ms * NS_PER_MS), 10**15)
        assert 0 == recorder.stats()["head"].dropped
