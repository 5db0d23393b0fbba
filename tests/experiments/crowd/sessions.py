"""Simulate one short crowd session in process, with faults where a test wants them."""

from pathlib import Path
from typing import Any

from tests.store import STORE
from visavis.devices.registry import OPTION_MODELS
from visavis.lab.config import LabConfig, load_config
from visavis.lab.config_files import EXAMPLE
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import Request, simulated_request


def session(folder: Path, **wanted: Any) -> Recording:
    """Return the recording of one walk per block; `wanted` as for `request`."""
    if wanted:
        return Recording(perform_new(request(folder, **wanted)))
    return Recording(STORE.copy("one crowd session", lambda at: perform_new(request(at)), folder))


def request(
    folder: Path,
    *,
    faults: dict[str, list[dict[str, Any]]] | None = None,
    drivers: dict[str, dict[str, Any]] | None = None,
    effect: bool = True,
    index: int = 0,
    group: str = "",
    config: LabConfig | None = None,
    **parameters: Any,
) -> Request:
    """Return what to perform; `faults` and `drivers` by device role.

    Drivers replace those of the lab, with the options they need.
    """
    if config is None:
        config = load_config(EXAMPLE, OPTION_MODELS)
    devices = dict(config.devices)
    for role, entry in (drivers or {}).items():
        options = {name: value for name, value in entry.items() if name != "driver"}
        given = {"driver": entry["driver"], "options": options}
        devices[role] = devices[role].model_copy(update=given)
    for role, listed in (faults or {}).items():
        options = {**devices[role].options, "faults": listed}
        devices[role] = devices[role].model_copy(update={"options": options})
    config = config.model_copy(update={"data_root": folder, "devices": devices})
    study = find_study("crowd")
    experiment = study.experiment({"configurations": 1, "intertrial_s": 0.5, **parameters})
    return simulated_request(
        study, experiment, config, label="S01B", index=index, seed=3, effect=effect, group=group
    )
