"""What sessions record and tables hold stays the same for the same seed."""

from collections.abc import Mapping

import pytest

from tests.experiments.fingerprint import first_difference, in_layout, read_fingerprint
from tests.experiments.small_studies import NAMES, PINNED, fingerprint

MOVED: Mapping[str, Mapping[str, str]] = {
    "stare": {
        "sensitivity.csv: dwell_p": "dwell_ms_p",
        "participants.csv: anxiety_total": "social_anxiety_total",
        "participants.csv: anxiety_fear": "social_anxiety_fear",
        "participants.csv: anxiety_avoidance": "social_anxiety_avoidance",
        "participants.csv: anxiety_performance": "social_anxiety_performance",
        "participants.csv: anxiety_interaction": "social_anxiety_interaction",
        "participants.csv: anxiety_fear_performance": "social_anxiety_fear_performance",
        "participants.csv: anxiety_fear_interaction": "social_anxiety_fear_interaction",
        "participants.csv: anxiety_avoidance_performance": "social_anxiety_avoidance_performance",
        "participants.csv: anxiety_avoidance_interaction": "social_anxiety_avoidance_interaction",
    },
    "quick_stare": {"answers.csv: anxiety_total": "social_anxiety_total"},
}
"""By study: where a pinned table or column stands now."""
RENAMED: Mapping[str, str] = {"anxiety_total": "social_anxiety_total"}
"""What a pinned text in a cell is called now."""


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("name", NAMES)
def test_a_study_records_and_computes_what_it_did_before(name, tmp_path):
    pinned = read_fingerprint(PINNED / f"{name}.json")

    found = in_layout(pinned, fingerprint(name, tmp_path), MOVED.get(name, {}), RENAMED)

    assert "" == first_difference(pinned, found)
