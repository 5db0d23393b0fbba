"""What is acknowledged is on the disk, and a session that broke off goes on at the same step."""

import base64
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.running.page.pages import TAB, begin_session, go_on_with, study
from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DesignError
from visavis.recording.reader import Recording
from visavis.running.page.desk import LEASE_NS, RELOAD_FLAG, SLEEP_FLAG, Post
from visavis.running.page.earlier_parts import RESTART_FLAG
from visavis.running.page.server import FILES, SITE
from visavis.running.page.spoken_digits import HOW_MANY, hear_digits, say_digits, spoken_digits
from visavis.running.page.steps import OpenElsewhereError, PageError
from visavis.study.careless_answers import NOT_HEARD, Careless


def screen_for(monkeypatch: pytest.MonkeyPatch, screening: str) -> None:
    """Have the study screen its visitors by one check."""
    declared = study().study
    monkeypatch.setattr(declared, "procedure", replace(declared.procedure, screening=(screening,)))


def answers_in(path: Path) -> list[tuple[str, Any]]:
    """Return everything answered in the trials of a session, as its journal tells it."""
    events = Recording(path).events()
    state = events.loc[events["name"] == "answered", "payload"]
    return [(p["trial_id"] + " " + p["question"], p["answer"]) for p in state]


def test_every_acknowledged_answer_is_on_the_disk_before_the_next_step_is_told(
    tmp_path: Path,
) -> None:
    with begin_session(tmp_path) as (page, path):
        while not page.desk.is_over:
            sent = page.event()
            page.desk.take(TAB, [sent])
            page.desk.recorder.checkpoint()
            events = Recording(path).events()
            numbers = [
                p["n"] for p in events.loc[events["name"] == "page_event", "payload"] if "n" in p
            ]
            assert list(range(1, page.desk.state()["ack"] + 1)) == numbers
            assert sent["n"] == page.desk.state()["ack"]


def test_whoever_is_cut_off_at_any_step_goes_on_there_and_loses_nothing(tmp_path: Path) -> None:
    with begin_session(tmp_path, "S99") as (page, whole):
        steps = []
        while not page.desk.is_over:
            steps.append(page.desk.state())
            page.answer()
        page.desk.recorder.close("complete")
    rows = Recording(whole).trials().set_index("trial_id")
    for cut in range(1, len(steps)):
        with begin_session(tmp_path, f"S{cut:02d}") as (page, path):
            for _ in range(cut):
                page.answer()
        with go_on_with(path) as page:
            assert steps[cut] == page.desk.state()
            page.answer_all()
            page.desk.recorder.close("complete")
        again = Recording(path).trials()
        assert list(rows.index) == list(again["trial_id"])
        again = again.set_index("trial_id")
        for name in ("motion", "lively", "livelier", "effort", "status", "attempt"):
            assert rows[name].equals(again[name]), (cut, name)
        assert answers_in(whole) == answers_in(path)
        flagged = list(again.index[again["flags"].str.contains(RESTART_FLAG)])
        in_trial = steps[cut]["step"].get("trial")
        assert (1 if in_trial else 0) == len(flagged)


def test_a_page_that_is_reloaded_gets_the_same_step_and_its_trial_is_flagged(
    tmp_path: Path,
) -> None:
    with begin_session(tmp_path) as (page, path):
        while page.desk.state()["step"]["kind"] != "watch":
            page.answer()
        before = page.desk.state()
        page.desk.leave(TAB)
        page.desk.hello("two")
        page.desk.hello(TAB, before="two")
        assert before == page.desk.state()
        page.answer_all()
        page.desk.recorder.close("complete")
    flags = Recording(path).trials()["flags"]
    assert [RELOAD_FLAG, "", ""] == list(flags)


@pytest.mark.parametrize(
    ("flags", "late_s", "wall_s"),
    [(SLEEP_FLAG, 60, 60), ("", 60, 0), ("", 0, 3600), ("", 0, -3600)],
    ids=["asleep", "slow network", "clock set forward", "clock set back"],
)
def test_a_computer_that_slept_is_told_and_its_page_dated_anew(
    flags: str, late_s: int, wall_s: int, tmp_path: Path
) -> None:
    with begin_session(tmp_path) as (page, path):
        while page.desk.state()["step"]["kind"] != "watch":
            page.answer()
        at_ms = page.visitor.now_ms
        page.desk.take(TAB, [], Post(at_ms, 1.7e12))
        page.clock.sleep_until_ns(page.clock.now_ns() + late_s * NS_PER_S)
        page.desk.take(TAB, [], Post(at_ms, 1.7e12 + 1000 * wall_s))
        behind_ns = page.clock.now_ns() - round(at_ms * 1e6)
        while not page.desk.is_over:
            reply = page.event()
            page.clock.sleep_until_ns(round(page.visitor.now_ms * 1e6) + behind_ns)
            page.desk.take(TAB, [reply])
        page.desk.recorder.close("complete")
    first = Recording(path).trials().iloc[0]
    assert flags == first["flags"]
    slept_ns = behind_ns if flags else 0
    assert 0 <= first["film_on_ns"] - at_ms * 1e6 - slept_ns < 5 * NS_PER_S


def test_that_a_computer_slept_outlives_its_server(tmp_path: Path) -> None:
    with begin_session(tmp_path) as (page, path):
        while page.desk.state()["step"]["kind"] != "watch":
            page.answer()
        for late_s in (0, 60):
            page.clock.sleep_until_ns(page.clock.now_ns() + late_s * NS_PER_S)
            page.desk.take(TAB, [], Post(page.visitor.now_ms, 1.7e12 + 1000 * late_s))
        page.desk.recorder.checkpoint()
    with go_on_with(path) as page:
        page.answer_all()
        page.desk.recorder.close("complete")
    assert {SLEEP_FLAG, RESTART_FLAG} == set(Recording(path).trials().iloc[0]["flags"].split(";"))


def test_a_second_tab_is_refused_until_the_first_has_gone(tmp_path: Path) -> None:
    with begin_session(tmp_path) as (page, _):
        with pytest.raises(OpenElsewhereError):
            page.desk.hello("two")
        page.clock.sleep_until_ns(page.clock.now_ns() + LEASE_NS + NS_PER_S)
        page.desk.hello("two")
        with pytest.raises(OpenElsewhereError):
            page.desk.take(TAB, [])


def test_what_is_sent_again_is_taken_once_and_a_gap_is_refused(tmp_path: Path) -> None:
    with begin_session(tmp_path) as (page, _):
        sent = page.event()
        page.desk.take(TAB, [sent])
        state = page.desk.state()
        page.desk.take(TAB, [sent])
        assert state == page.desk.state()
        with pytest.raises(PageError, match="one is missing"):
            page.desk.take(TAB, [{**page.event(), "n": sent["n"] + 2}])


@pytest.mark.parametrize(
    ("kind", "wrong"),
    [
        ("consent", {"agreed": "yes"}),
        ("watch", {"answers": {}}),
        ("watch", {"shown_ms": "now"}),
        ("watch", {"films": {"film": {"first_ms": float("inf")}}}),
        ("watch", {"answers": {"lively": {"option": "9", "at_ms": 1.0, "by": "keys"}}}),
        ("watch", {"answers": {"lively": {"option": "3", "at_ms": 1.0, "by": "magic"}}}),
        ("watch", {"hidden_ms": True}),
        ("questions", {"answers": {"age": "7e9"}}),
        ("questions", {"answers": {"gender": "12"}}),
        ("text", {"stop": "now"}),
    ],
)
def test_a_reply_that_no_page_of_ours_sends_is_refused_and_the_session_goes_on(
    kind: str, wrong: dict[str, Any], tmp_path: Path
) -> None:
    with begin_session(tmp_path) as (page, path):
        while page.desk.state()["step"]["kind"] != kind:
            page.answer()
        sent = page.event()
        before = page.desk.state()
        with pytest.raises(PageError):
            page.desk.take(TAB, [{**sent, "reply": {**sent["reply"], **wrong}}])
        assert before == page.desk.state()
        page.desk.take(TAB, [sent])
        page.answer_all()
        page.desk.recorder.close("complete")
    assert ["complete"] * 3 == list(Recording(path).trials()["status"])


@pytest.mark.parametrize(
    ("reply", "outcome"),
    [
        ({"agreed": False}, "declined"),
        ({"stop": "delete"}, "withdrawn"),
        ({"stop": "keep"}, "stopped"),
    ],
)
def test_whoever_declines_or_stops_is_asked_nothing_more(
    reply: dict[str, Any], outcome: str, tmp_path: Path
) -> None:
    with begin_session(tmp_path) as (page, path):
        page.desk.take(TAB, [{**page.event(), "reply": reply}])
        assert {"kind": "end", "outcome": outcome} == page.desk.state()["step"]
        page.desk.recorder.close("aborted")
    assert Recording(path).trials().empty


def page_events(path: Path) -> list[dict[str, Any]]:
    """Return what is recorded of the page itself."""
    events = Recording(path).events()
    return [dict(p) for p in events.loc[events["name"] == "page_event", "payload"]]


def pages_before_consent(page: Any) -> None:
    """Have a page send what pages of earlier versions sent before anybody agreed."""
    page.desk.hello("two", before=TAB, about={"user_agent": "Firefox", "refresh_hz": 60.0})
    page.desk.hello(TAB, before="two", about={"user_agent": "Firefox"})
    page.desk.take(TAB, [{"n": 1, "kind": "visibility", "at_ms": 5.0, "is_visible": False}])


def test_a_refusal_keeps_the_refusal_and_nothing_else_of_the_page(tmp_path: Path) -> None:
    with begin_session(tmp_path) as (page, path):
        pages_before_consent(page)
        page.desk.recorder.checkpoint()
        assert [] == page_events(path)
        page.desk.take(TAB, [{**page.event(), "reply": {"agreed": False, "version": "x"}}])
        page.desk.recorder.close("aborted")
    assert [{"kind": "reply", "n": 2, "step": 1, "reply": {"agreed": False}}] == page_events(path)
    with go_on_with(path) as page:
        assert {"kind": "end", "outcome": "declined"} == page.desk.state()["step"]


def test_whoever_agrees_has_the_page_recorded_and_nothing_that_it_did_before(
    tmp_path: Path,
) -> None:
    with begin_session(tmp_path) as (page, path):
        pages_before_consent(page)
        page.answer()
    assert [("opened", TAB), ("reply", TAB)] == [(p["kind"], p["tab"]) for p in page_events(path)]


def test_a_fact_about_the_browser_that_nobody_is_told_of_is_not_recorded(tmp_path: Path) -> None:
    with begin_session(tmp_path) as (page, path):
        page.answer()
        about = {"user_agent": "Firefox", "plugins": ["x"]}
        sent = {"n": 2, "kind": "about", "at_ms": page.visitor.now_ms, "about": about}
        page.desk.take(TAB, [sent])
        page.desk.recorder.checkpoint()
    assert {"user_agent": "Firefox"} == page_events(path)[-1]["about"]


def test_a_film_that_fails_is_named_and_its_trial_counts_as_skipped(tmp_path: Path) -> None:
    with begin_session(tmp_path) as (page, path):
        while page.desk.state()["step"]["kind"] != "watch":
            page.answer()
        failed = {"film": "abc", "place": "film", "why": "error 4: no decoder"}
        sent = page.event()
        page.desk.take(TAB, [{**sent, "reply": {"shown_ms": 1.0, "failed": failed}}])
        page.answer_all()
        page.desk.recorder.close("complete")
    first = Recording(path).trials().iloc[0]
    assert ("skipped", "film abc: error 4: no decoder") == (first["status"], first["reason"])


def test_response_time_runs_from_the_first_picture_that_was_presented(tmp_path: Path) -> None:
    with begin_session(tmp_path) as (page, path):
        while page.desk.state()["step"]["kind"] != "watch":
            page.answer()
        sent = page.event()
        sent["reply"]["films"]["film"] |= {"first_ms": 5000.0, "first_at_ms": 260.0}
        sent["reply"]["answers"]["lively"]["at_ms"] = 6234.5
        sent["reply"]["shown_ms"], sent["reply"]["off_ms"] = 4900.0, 6500.0
        page.desk.take(TAB, [sent])
        page.answer_all()
        page.desk.recorder.close("complete")
    row = Recording(path).trials().iloc[0]
    assert pytest.approx(1234.5, abs=1e-6) == row["lively_ms"]
    assert pytest.approx(100.0, abs=1e-6) == row["film_wait_ms"]
    assert 260 == row["film_first_at_ms"]
    assert 1_500_000_000 == row["film_off_ns"] - row["film_on_ns"]


def test_the_width_of_a_card_tells_how_large_a_screen_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    screen_for(monkeypatch, "card")
    with begin_session(tmp_path) as (page, path):
        while page.desk.state()["step"]["kind"] != "card":
            page.answer()
        assert (85.6, 53.98) == tuple(page.desk.state()["step"]["card_mm"])
        sent = page.event()
        for wrong in (0.0, 1e3, "large", float("nan")):
            with pytest.raises(PageError):
                page.desk.take(TAB, [{**sent, "reply": {"px_per_mm": wrong}}])
        page.answer_all()
        page.desk.recorder.close("complete")
    events = Recording(path).events()
    (measured,) = events.loc[events["name"] == "screen_measured", "payload"]
    assert pytest.approx(96 / 25.4) == measured["px_per_mm"]


@pytest.mark.parametrize("hears", [True, False])
def test_who_does_not_type_the_digits_that_were_said_is_flagged_and_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, hears: bool
) -> None:
    screen_for(monkeypatch, "sound")
    with begin_session(tmp_path) as (page, path):
        while page.desk.state()["step"]["kind"] != "sound":
            page.answer()
        sent = page.event()
        assert HOW_MANY == len(sent["reply"]["heard"])
        for wrong in ({"heard": "a", "played": 1}, {"heard": 123, "played": 1}, {"heard": None}):
            with pytest.raises(PageError):
                page.desk.take(TAB, [{**sent, "reply": wrong}])
        if not hears:
            page.desk.take(TAB, [{**sent, "reply": {"heard": None, "played": 0}}])
        else:
            page.desk.take(TAB, [sent])
        page.answer_all()
        page.desk.recorder.close("complete")
    recording = Recording(path)
    events = recording.events()
    (checked,) = events.loc[events["name"] == "sound_checked", "payload"]
    assert hears == checked["is_right"]
    flags = recording.trials()["flags"].fillna("")
    assert [("" if hears else NOT_HEARD)] * len(flags) == list(flags)
    facts = Careless("lively", max_sound_failed=0.0).facts(recording.trials())
    assert [float(not hears)] == list(facts["sound_failed"])


@given(digits=st.lists(st.integers(0, 9), min_size=1, max_size=5))
@pytest.mark.parametrize("language", ["en", "de", "fr"])
def test_what_is_said_is_what_somebody_hears_who_knows_the_voice(
    language: str, digits: list[int]
) -> None:
    files = spoken_digits(language, None)
    assert "".join(map(str, digits)) == hear_digits(say_digits(digits, files), files)


def test_a_page_with_three_spoken_digits_is_below_300_kilobytes() -> None:
    page = sum((SITE / name).stat().st_size for name in FILES.values())
    for language in ("en", "de", "fr"):
        files = spoken_digits(language, None)
        longest = max(range(10), key=lambda digit: len(files[digit]))
        sound = base64.b64encode(say_digits([longest] * HOW_MANY, files))
        assert 300_000 > page + len(sound)


def test_a_lab_s_own_voice_comes_first_and_a_language_without_one_is_told(tmp_path: Path) -> None:
    own = tmp_path / "digits" / "it"
    own.mkdir(parents=True)
    with pytest.raises(DesignError, match=r"digits/es beside the study"):
        spoken_digits("es", tmp_path)
    with pytest.raises(DesignError, match=r"0\.wav: no digit can be spoken"):
        spoken_digits("it", tmp_path)
    for k, content in enumerate(spoken_digits("fr", None)):
        (own / f"{k}.wav").write_bytes(content)
    assert spoken_digits("fr", None) == spoken_digits("it", tmp_path)
    (own / "9.wav").write_bytes(b"RIFF")
    spoken_digits.cache_clear()
    with pytest.raises(DesignError, match=r"9\.wav"):
        spoken_digits("it", tmp_path)


def test_a_study_says_what_is_measured_of_a_screen() -> None:
    other: Any = ("ruler",)
    with pytest.raises(DesignError, match=r"screening holds 'ruler'.*a list of 'card' or 'sound'"):
        study().study.with_changes(screening=other)
