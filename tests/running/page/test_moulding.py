"""Live figures through the desk: what sliders did is recorded, given back, and cannot be forged."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from tests.running.page.pages import SEED, TAB, config
from visavis.lab.clock import SimClock
from visavis.lab.errors import DesignError
from visavis.recording.folder import create_session, open_session
from visavis.recording.manifest import Manifest
from visavis.recording.provenance import provenance
from visavis.recording.reader import Recording
from visavis.recording.writer import VIRTUAL_TIME_BATCH_NS, Recorder
from visavis.results.moves import moves_of
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.running.film_store import film_store
from visavis.running.live_store import LiveStore, page_files, until_on_page
from visavis.running.page.course import Notes, Visit, course
from visavis.running.page.desk import PageDesk
from visavis.running.page.earlier_parts import EarlierParts, past_of
from visavis.running.page.steps import PageError, PageStep
from visavis.running.page.visitor import visitor_of
from visavis.stimuli.motion.synthesis.pose_distance import Likeness, compared_joints
from visavis.study.information import facts_in_event
from visavis.study.live import Live, Moulding, Near, Slider, walks

STUDY = Path(__file__).parents[2] / "studies" / "moulding.py"


@cache
def study() -> OpenedStudy:
    found = find_study(str(STUDY))
    assert isinstance(found, OpenedStudy)
    return found


class Page:
    """A simulated page before a desk of the study, which records into a new part of a session."""

    def __init__(
        self, path: Path | None, root: Path, past: EarlierParts | None = None, tab: str = TAB
    ) -> None:
        self.tab = tab
        made, self.clock, notes = study().experiment({}), SimClock(), Notes()
        plan = made.plan(0, SEED)
        if path is None:
            manifest = Manifest(
                "moulding", "S01", 1, True, plan, SEED, {"on": "browser"}, (), "", "", provenance()
            )
            self.folder = create_session(root, manifest)
        else:
            self.folder, _ = open_session(path)
        part = self.folder.begin_part(self.clock)
        recorder = Recorder(
            part, self.clock, threaded=False, max_batch_ns=VIRTUAL_TIME_BATCH_NS, is_simulated=True
        )
        store = film_store(made)
        visit = Visit(
            made,
            plan,
            "S01",
            1,
            self.folder.manifest.parts[-1].number,
            study().questionnaires(config(root)),
            page_files(store, LiveStore(made.lives), is_simulated=True),
            self.clock.now_ns,
            notes,
        )
        self.desk = PageDesk(course(visit), recorder, self.clock, notes, past, key="key")
        person = study().participant(0, SEED, effect=True, experiment=made)
        self.visitor = visitor_of(person, made, store)
        self.desk.hello(tab, takes_over=past is not None)

    def send(self, **event: Any) -> None:
        """Send one event, its number the next."""
        self.desk.take(
            self.tab,
            [{"n": self.desk.last_event_number + 1, "at_ms": self.visitor.now_ms, **event}],
        )

    def move(self, sliders: list[Any], **more: Any) -> None:
        """Tell that a slider of the step that is shown was moved."""
        event = {"names": ["activeness"], "sliders": sliders, "camera": [], **more}
        self.send(kind="moved", step=self.desk.step_number, **event)

    def answer(self) -> None:
        """Answer the step that is shown, its movements before."""
        step, number = self.desk.step, self.desk.step_number
        reply = self.visitor.reply(PageStep(step.kind, step.content))
        for moves in self.visitor.moves:
            self.send(kind="moved", step=number, **moves)
        self.visitor.moves.clear()
        self.send(kind="reply", step=number, reply=reply)

    def until(self, kind: str) -> None:
        """Answer until a step of a kind is shown."""
        while self.desk.step.kind != kind:
            self.answer()

    def end(self) -> Recording:
        """Answer to the end; return the closed recording."""
        while not self.desk.is_over:
            self.answer()
        return self.close()

    def close(self) -> Recording:
        """Close the recording and return it."""
        self.desk.recorder.close("complete")
        self.folder.close()
        return Recording(self.folder.path)


def test_movements_are_recorded_given_back_and_covered_by_what_people_were_told(
    tmp_path: Path,
) -> None:
    page = Page(None, tmp_path)
    recording = page.end()
    rows, moves = recording.trials(), moves_of(recording)
    assert list(rows["status"]) == ["complete"] * 3
    assert list(rows["tries"]) == list(rows["mould_moves"])  # the trial counted what it got back
    for row in rows.to_dict("records"):
        own = moves[moves["trial_id"] == row["trial_id"]]
        assert len(own) == row["mould_moves"]
        assert own["value"].iloc[-1] == row["activeness"]
        assert row["mould_on_ns"] <= own["t_ns"].min()
        assert own["t_ns"].max() <= row["mould_off_ns"]
        last_ms = (own["t_ns"].iloc[-1] - row["mould_on_ns"]) / 1e6
        assert row["activeness_ms"] == pytest.approx(last_ms)
    events = recording.events()
    covered = [facts_in_event(*e) for e in zip(events["name"], events["payload"], strict=True)]
    assert "moulding" in frozenset().union(*covered)


def test_movements_before_a_page_was_reloaded_are_recorded_but_are_not_of_the_answer(
    tmp_path: Path,
) -> None:
    page = Page(None, tmp_path)
    page.until("mould")
    page.move([[page.visitor.now_ms + 100, 0, 0.9]])
    page.desk.hello("two", before=TAB)
    page.desk.hello(TAB, before="two")
    page.answer()
    recording = page.end()
    first = recording.trials().iloc[0]
    moves = moves_of(recording)
    assert len(moves[moves["trial_id"] == first["trial_id"]]) == first["mould_moves"] + 1


def test_movements_that_waited_in_the_store_of_an_earlier_page_are_not_of_the_answer(
    tmp_path: Path,
) -> None:
    page = Page(None, tmp_path)
    page.until("mould")
    page.desk.hello("two", before=TAB)
    page.tab = "two"
    page.move([[900_000.0, 0, 0.9]], tab=TAB, at_ms=900_000.0)
    page.answer()
    recording = page.end()
    first = recording.trials().iloc[0]
    moves = moves_of(recording)
    assert len(moves[moves["trial_id"] == first["trial_id"]]) == first["mould_moves"] + 1


def test_a_target_is_reached_or_the_time_is_over_and_a_guess_ends_by_its_button(
    tmp_path: Path,
) -> None:
    near, beyond = Near({"march": 1.0}), Near({"march": 1.0, "slouch": 1.0}, within_m=1e-6)
    seen = replace(live_of_study(), beside="female_01")
    for live, until, is_blind, ended in (
        (seen, near, False, "near"),
        (seen, beyond, False, "limit"),
        (seen, near, True, "button"),
        (live_of_study(), beyond, False, "limit"),
    ):
        page = Page(None, tmp_path / f"{ended}{is_blind}{bool(live.beside)}")
        page.until("mould")
        goal = {"until": until_on_page(live, until), "is_blind": is_blind}
        page.visitor.lives = (live,)
        reply = page.visitor.reply(PageStep("mould", {**page.desk.step.content, **goal}))
        page.close()
        assert reply["ended_by"] == ended
        last = float(reply["answers"]["activeness"]["option"])
        target, joints = until.shares(live.examples), compared_joints(live.examples.skeleton)
        likeness = Likeness(live.examples, target, until.poses, joints)
        assert reply["distance_m"] == likeness.exact_m(live.shares([last]))
        if not is_blind:
            assert (reply["distance_m"] < until.within_m) == (ended == "near")


def live_of_study() -> Live:
    """Return the figure of the study."""
    return study().experiment({}).lives[0]


def test_who_does_not_see_a_figure_must_see_its_target() -> None:
    live, near = live_of_study(), Near({"march": 1.0})
    with pytest.raises(DesignError, match="must see its target"):
        Moulding(live, (Slider("a"),), near, is_blind=True)
    with pytest.raises(DesignError, match="must see its target"):
        Moulding(replace(live, beside="female_01"), (Slider("a"),), is_blind=True)


def test_a_session_that_broke_off_in_the_middle_of_a_figure_gives_the_same_rows(
    tmp_path: Path,
) -> None:
    whole = Page(None, tmp_path / "whole").end().trials()
    page = Page(None, tmp_path / "broken")
    page.until("mould")
    page.answer()
    page.until("mould")
    page.move([[page.visitor.now_ms + 100, 0, 0.9]])
    path = page.folder.path
    page.close()
    again = Page(path, tmp_path / "broken", past_of(Recording(path)), "another")
    recording = again.end()
    rows = recording.trials()
    assert list(rows["trial_id"]) == list(whole["trial_id"])
    assert list(rows["activeness"]) == list(whole["activeness"])
    assert list(rows["mould_moves"]) == list(whole["mould_moves"])
    assert len(moves_of(recording)) == whole["mould_moves"].sum() + 1


@pytest.mark.parametrize(
    ("sliders", "more", "refusal"),
    [
        ([[1.0, 1, 0.5]], {}, "no slider 1"),
        ([[1.0, 0]], {}, "has 3 numbers"),
        ([[1.0, 0, float("nan")]], {}, "sliders"),
        ([[1.0, 0, 0.5]] * 3000, {}, "at most 2000"),
        ([], {"camera": [[1.0, 0.0, 0.0]]}, "has 4 numbers"),
        ([], {"names": ["speed"]}, "not those of the step"),
        ([], {"names": 3}, "names are"),
    ],
)
def test_forged_movements_are_refused(
    sliders: list[Any], more: dict[str, Any], refusal: str, tmp_path: Path
) -> None:
    page = Page(None, tmp_path)
    page.until("mould")
    with pytest.raises(PageError, match=refusal):
        page.move(sliders, **more)
    page.close()


@pytest.mark.parametrize(
    ("change", "refusal"),
    [
        ({"ended_by": "boredom"}, "ended by"),
        ({"frames": -1}, "frames"),
        ({"renderer": "x" * 300}, "renderer"),
        ({"distance_m": "far"}, "distance_m"),
        ({"answers": {}}, "the answer to activeness"),
        (
            {"answers": {"activeness": {"option": "7", "at_ms": 1.0, "by": "mouse"}}},
            "out of bounds",
        ),
        (
            {"answers": {"activeness": {"option": "x", "at_ms": 1.0, "by": "mouse"}}},
            "not a number",
        ),
    ],
)
def test_forged_replies_to_a_figure_are_refused(
    change: dict[str, Any], refusal: str, tmp_path: Path
) -> None:
    page = Page(None, tmp_path)
    page.until("mould")
    reply = page.visitor.reply(PageStep("mould", page.desk.step.content))
    with pytest.raises(PageError, match=refusal):
        page.send(kind="reply", step=page.desk.step_number, reply={**reply, **change})
    page.close()


def test_sliders_and_figures_that_cannot_be_are_refused_by_name() -> None:
    three = walks("set_a", "plain", "march", "slouch")
    at = {"plain": [0.5], "march": [1.0], "slouch": [0.0]}
    live = Live(three, at=at)
    with pytest.raises(DesignError, match="starts at 2"):
        Slider("speed", start=2.0)
    with pytest.raises(DesignError, match="look at slouch"):
        Live(three, at={k: v for k, v in at.items() if k != "slouch"})
    with pytest.raises(DesignError, match="2 sliders for a figure that takes 1"):
        Moulding(live, (Slider("a"), Slider("b")))
    with pytest.raises(DesignError, match="takes 3"):
        Moulding(Live(three), (Slider("a"),))
    with pytest.raises(DesignError, match="limit_s is 0"):
        Moulding(live, (Slider("a"),), limit_s=0.0)
    with pytest.raises(DesignError, match="names hop"):
        Moulding(live, (Slider("a"),), Near({"hop": 1.0}))
    with pytest.raises(DesignError, match="has no hop"):
        walks("set_a", "hop")
    other = replace(live, character="male_01")
    with pytest.raises(DesignError, match="not for the body"):
        LiveStore((other,)).describe(other)
    with pytest.raises(DesignError, match="made anew"):
        LiveStore(()).describe(live)
