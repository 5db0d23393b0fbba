"""Every study's export passes the official validator: nothing wrong, nothing we could add."""

from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

from tests.experiments.crowd.sessions import session as crowd_session
from tests.experiments.small_studies import SESSIONS, simulated
from tests.faults.sessions import lab, perform
from tests.recording.test_export import ABOUT, issues_of
from tests.running.test_every_study import SMALL
from visavis.cli.sharing import shared_recording
from visavis.devices.registry import OPTION_MODELS
from visavis.lab.config import load_config
from visavis.lab.config_files import EXAMPLE, SCREEN_EXAMPLE
from visavis.recording.bids import export_bids
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import simulated_request
from visavis.running.sessions.study_folder import sessions_of


def recording_of(study: str, root: Path) -> Recording:
    if study == "stare":
        return perform(lab(root), trial_s=1.0)
    if study == "crowd":
        return crowd_session(root)
    if study in SESSIONS:
        return Recording(sessions_of(simulated(study, root))[0])
    name, _, screen = study.partition(" ")
    found = find_study(name)
    config = load_config(SCREEN_EXAMPLE if screen else EXAMPLE, OPTION_MODELS)
    request = simulated_request(
        found,
        found.experiment(SMALL.get(name, {})),
        config.model_copy(update={"data_root": root}),
        label="S01",
        index=0,
        seed=1,
    )
    on = "browser" if name in ("interpolation", "hybrid") else request.on
    return Recording(perform_new(replace(request, on=on)))


def withheld_from(recording: Recording) -> list[str]:
    """Return what of a recording is withheld from others though nobody typed it."""
    config = load_config(EXAMPLE, OPTION_MODELS)
    shown = shared_recording(recording.path, config, tier="shared", keep_label=True)
    assert len(shown.events())
    assert len(shown.trials())
    return [name for name in shown.withheld if not name.endswith("_typed")]


@pytest.mark.parametrize("study", ["interpolation", "hybrid", "stare before a screen"])
def test_a_study_on_a_page_or_a_screen_passes_the_official_validator(
    study: str, tmp_path: Path
) -> None:
    recording = recording_of(study, tmp_path / "data")
    assert [] == withheld_from(recording)
    task = study.partition(" ")[0]
    written = export_bids(
        [recording], tmp_path / "bids", task=task, dataset_name=study, about=ABOUT
    )
    assert [] == issues_of(tmp_path / "bids")
    assert any(p.name.endswith("_events.tsv") for p in written)
    assert study.endswith("screen") == any(p.name.endswith("_physio.tsv.gz") for p in written)


@pytest.mark.parametrize("study", ["stare", "crowd", "waving"])
def test_a_studys_data_set_passes_the_official_validator(study: str, tmp_path: Path) -> None:
    recording = recording_of(study, tmp_path / "data")
    assert [] == withheld_from(recording)
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
