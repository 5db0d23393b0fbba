"""What sessions record and tables hold stays the same for the same seed."""

from collections.abc import Mapping

import pytest

from tests.experiments.fingerprint import first_difference, in_layout, read_fingerprint
from tests.experiments.small_studies import NAMES, PINNED, fingerprint

MOVED: Mapping[str, Mapping[str, str]] = {
    "stare": {"sensitivity.csv: dwell_p": "dwell_ms_p"},
}
"""By study: where a pinned table or column stands now."""
RENAMED: Mapping[str, str] = {}
"""What a pinned text in a cell is called now."""


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("name", NAMES)
def test_a_study_records_and_computes_what_it_did_before(name, tmp_path):
    pinned = read_fingerprint(PINNED / f"{name}.json")

    found = in_layout(pinned, fingerprint(name, tmp_path), MOVED.get(name, {}), RENAMED)

    assert "" == first_difference(pinned, found)
