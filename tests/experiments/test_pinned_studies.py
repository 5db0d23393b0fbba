"""What sessions record and tables hold stays the same for the same seed."""

import pytest

from tests.experiments.fingerprint import first_difference, in_layout, read_fingerprint
from tests.experiments.small_studies import NAMES, PINNED, fingerprint


@pytest.mark.timeout(900)
@pytest.mark.parametrize("name", NAMES)
def test_a_study_records_and_computes_what_it_did_before(name, tmp_path):
    pinned = read_fingerprint(PINNED / f"{name}.json")

    found = in_layout(pinned, fingerprint(name, tmp_path))

    assert "" == first_difference(pinned, found)
