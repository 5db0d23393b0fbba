"""Who came and left stops nobody's analysis: they are counted, named, and left out."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.running.page.served_places import Place, serve
from visavis.lab.errors import DataError
from visavis.running.page.client import arrive, visit
from visavis.running.page.reception import Reception, Rules
from visavis.running.page.steps import PageStep
from visavis.running.scripts import StudyData
from visavis.running.sessions.intake_list import intake_list, share_list

LEAVERS = ("opened", "declined", "broke off", "stopped")


def come_and_go(place: Place, who: tuple[str, ...]) -> None:
    async def act(base: str, _: Reception) -> None:
        for manner in who:
            stop = {"declined": "decline", "stopped": "keep"}.get(manner, "")
            at: dict[str, Callable[[PageStep], bool]] = {
                "opened": lambda step: True,
                "broke off": lambda step: step.kind == "watch",
            }
            await visit(
                await arrive(base, {}),
                place.visitor(stop),
                place.clock,
                ends=at.get(manner, lambda step: False),
            )

    serve(place, act)


@pytest.fixture
def place(tmp_path: Path) -> Place:
    return Place(tmp_path, Rules())


def test_who_came_and_left_is_named_and_left_out(place: Place) -> None:
    come_and_go(place, ("complete", *LEAVERS, "complete"))
    listed = intake_list(place.sessions())
    assert ["sub-S01B", "sub-S06G"] == [path.parent.name for path in listed.sessions]
    assert 4 == len(listed.lines())
    reasons = [reason for _, reason in listed.left_out]
    assert ["left", "declined", "left", "stopped, data kept"] == [
        reason.partition("(")[2].rstrip(")") for reason in reasons
    ]


def test_a_session_that_lost_its_rows_is_damaged_and_not_somebody_who_left(place: Place) -> None:
    come_and_go(place, ("complete", "broke off"))
    journals = [path / "part-01/events.jsonl" for path in place.sessions()]
    for journal in journals:
        journal.unlink()
    assert place.sessions() == list(intake_list(place.sessions()).sessions)


def test_a_script_measures_who_finished_among_who_left(place: Place) -> None:
    come_and_go(place, ("complete", *LEAVERS))
    data = StudyData(place.folder, place.reception()._base.study)
    assert ["S01B"] == [intake.manifest.participant for intake in data._intakes]


def test_nobody_who_began_a_trial_is_said_with_who_came(place: Place) -> None:
    come_and_go(place, ("declined", "opened"))
    with pytest.raises(DataError, match=r"nobody has .*S01B holds no trial"):
        intake_list(place.sessions())


def test_who_gave_nothing_is_counted_and_named_and_not_shared(place: Place) -> None:
    come_and_go(place, ("complete", "opened", "declined", "opened", "broke off"))
    shared = share_list(place.sessions(), keeps_empty=False)
    assert ["sub-S01B"] == [path.parent.name for path in shared.sessions]
    assert (
        "left out: 3 sessions; holds neither trial nor answer (left): sub-S02C/ses-001, "
        "sub-S04E/ses-001, sub-S05F/ses-001",
        "left out: 1 session; holds neither trial nor answer (declined): sub-S03D/ses-001",
    ) == shared.counts()
    assert 5 == len(share_list(place.sessions(), keeps_empty=True).sessions)


def test_a_study_of_which_nobody_gave_anything_is_not_shared(place: Place) -> None:
    come_and_go(place, ("declined", "opened"))
    with pytest.raises(DataError, match=r"nothing is there to share: .*declined.*--tier raw"):
        share_list(place.sessions(), keeps_empty=False)


def test_a_session_that_lost_its_answers_is_damaged_and_not_left_out_of_what_is_shared(
    place: Place,
) -> None:
    come_and_go(place, ("complete",))
    (place.sessions()[0] / "part-01/events.jsonl").unlink()
    assert place.sessions() == list(share_list(place.sessions(), keeps_empty=False).sessions)
