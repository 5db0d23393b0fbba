"""A session keeps the version of the consent that its participant gave."""

from dataclasses import replace
from pathlib import Path

import pytest

from tests.faults.sessions import lab
from tests.sessions import opened
from visavis.recording.manifest import read_manifest
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import simulated_request


@pytest.mark.parametrize(("version", "own"), [("of last spring", "of last spring"), ("of now", "")])
def test_the_version_that_a_person_agreed_to_comes_before_the_labs_own(
    version: str, own: str, tmp_path: Path
) -> None:
    config = lab(tmp_path)
    privacy = config.privacy.model_copy(update={"consent_version": "of now"})
    study = opened("duel")
    request = simulated_request(
        study,
        study.experiment({"repetitions": 1}),
        config.model_copy(update={"privacy": privacy}),
        label="S01",
        index=0,
        seed=1,
    )
    person = replace(request.person, consent_version=own)
    assert version == read_manifest(perform_new(replace(request, person=person))).consent_version
