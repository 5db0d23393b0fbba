"""A report says when its data were made, and no command that would not make them again."""

from typing import Any

import pytest

from visavis.analysis.report.sources import on_virtual_clock, provenance_of_sessions
from visavis.lab.clock import SIMULATED_EPOCH_ISO
from visavis.recording.manifest import Manifest
from visavis.recording.provenance import Provenance


def session(began_iso: str, *, is_simulated: bool = True) -> Manifest:
    return Manifest(
        study="duel",
        participant="S01B",
        session=1,
        is_simulated=is_simulated,
        plan={"study_version": "1"},
        seed=1,
        configuration={},
        devices=(),
        consent_version="",
        created_wall_iso=began_iso,
        provenance=Provenance("3.11", {}, "abc"),
    )


@pytest.mark.parametrize(
    ("began", "told"),
    [
        ([SIMULATED_EPOCH_ISO], "virtual time"),
        (["2026-03-02T10:00:00+01:00"], "2026-03-02"),
        (["2026-03-19T10:00:00+01:00", "2026-03-02T10:00:00+01:00"], "2026-03-02 to 2026-03-19"),
        ([SIMULATED_EPOCH_ISO, "2026-03-02T10:00:00+01:00"], "2026-03-02, virtual time"),
    ],
)
def test_dates_of_a_clock_that_nobody_lived_by_are_not_told(began: list[str], told: str) -> None:
    made = provenance_of_sessions("duel", [session(iso) for iso in began], (), ())
    assert told == made.data_date


@pytest.mark.parametrize(
    ("settings", "is_virtual"),
    [({}, True), ({"is_simulated": False}, False), ({"began_iso": "2026-03-02T10:00:00Z"}, False)],
)
def test_only_a_simulated_session_is_on_the_virtual_clock(
    settings: dict[str, Any], is_virtual: bool
) -> None:
    assert is_virtual == on_virtual_clock(session(**{"began_iso": SIMULATED_EPOCH_ISO, **settings}))
