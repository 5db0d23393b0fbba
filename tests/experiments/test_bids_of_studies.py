"""Every study's export passes the official validator: nothing wrong, nothing we could add."""

from pathlib import Path

import pandas as pd
import pytest

from devices.registry import OPTION_MODELS
from lab.config import load_config
from lab.config_files import EXAMPLE
from recording.bids import export_bids
from recording.reader import Recording
from tests.experiments.crowd.sessions import session as crowd_session
from tests.experiments.small_studies import SESSIONS
from tests.faults.sessions import lab, perform
from tests.recording.test_export import ABOUT, issues_of
from visavis.catalogue import find_study
from visavis.sessions.perform import perform_new, simulated_request


def recording_of(study: str, root: Path) -> Recording:
    if study == "stare":
        return perform(lab(root), trial_s=1.0)
    if study == "crowd":
        return crowd_session(root)
    found = find_study(study)
    whole = load_config(EXAMPLE, OPTION_MODELS).model_copy(update={"data_root": root})
    request = simulated_request(
        found, found.experiment(SESSIONS["waving"].parameters), whole, label="S01", index=0, seed=1
    )
    return Recording(perform_new(request))


@pytest.mark.slow
@pytest.mark.parametrize("study", ["stare", "crowd", "waving"])
def test_a_studys_data_set_passes_the_official_validator(study: str, tmp_path: Path) -> None:
    recording = recording_of(study, tmp_path / "data")
    written = export_bids(
        [recording], tmp_path / "bids", task=study, dataset_name=study, about=ABOUT
    )
    assert [] == issues_of(tmp_path / "bids")
    names = [p.name for p in written]
    assert any("tracksys-HMD" in n for n in names)
    assert (study != "stare") == any("tracksys-body" in n for n in names)
    if study == "crowd":
        channels = next(p for p in written if p.name.endswith("body_run-1_channels.tsv"))
        assert "left_lower_arm" in set(pd.read_csv(channels, sep="\t")["tracked_point"])
