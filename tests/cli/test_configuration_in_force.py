"""Which configuration a command takes: that of its folder or above, never the program's own."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner, Result

from visavis.cli.app import load_lab
from visavis.cli.main import app
from visavis.lab.config_files import EXAMPLE, find_config
from visavis.lab.errors import ConfigError, UsageError

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def visavis(*arguments: str) -> Result:
    result = CliRunner().invoke(app, arguments)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


def test_the_nearest_configuration_above_is_taken(here: Path) -> None:
    inner = here / "pilot" / "notes"
    inner.mkdir(parents=True)
    assert find_config(inner) is None
    (here / "lab_config.yaml").touch()
    assert here / "lab_config.yaml" == find_config(inner)
    (here / "pilot" / "lab_config.yaml").touch()
    assert here / "pilot" / "lab_config.yaml" == find_config(inner)


def test_no_package_of_visavis_looks_like_a_lab() -> None:
    assert [] == [p for p in ROOT.glob("*/**/lab_config.yaml") if ".venv" not in p.parts]


NEED_A_LAB = (
    ("run", "stare", "--participant", "1", "--fast"),
    ("resume",),
    ("devices", "list"),
    ("devices", "test"),
    ("devices", "identify", "armband_left_forearm"),
    ("devices", "capture", "eye_tracker", "-o", "eyes.wire"),
    ("devices", "luminance"),
    ("participant", "add", "stare"),
    ("participant", "list", "stare"),
    ("participant", "rename", "stare", "1", "17", "--reason", "mistyped"),
    ("participant", "withdraw", "stare", "1"),
    ("character", "import", "someone.glb"),
    ("plan", "stare", "--participant", "1", "--devices", "real"),
)


@pytest.mark.parametrize("command", NEED_A_LAB, ids=" ".join)
def test_without_a_configuration_devices_and_data_are_left_alone(
    command: tuple[str, ...], here: Path
) -> None:
    with pytest.raises(ConfigError, match=r"no lab_config\.yaml in .* or above.*visavis init"):
        visavis(*command)
    assert [] == list(here.iterdir())


def test_what_only_simulates_takes_the_example_and_says_so(here: Path) -> None:
    result = visavis("plan", "stare", "--participant", "1")
    first = result.stderr.splitlines()[0]
    assert "example of Visavis, simulated; no lab_config.yaml" in first
    assert 80 >= len(first)  # as wide as a usual terminal
    assert "visavis init" in result.stderr
    assert [] == list(here.iterdir())


def test_data_of_the_example_go_to_the_current_folder(here: Path) -> None:
    lab = load_lab(None, "sim", only_simulates=True)
    assert (here / "data", here / "keys") == (lab.data_root, lab.key_root)
    assert all(device.simulated for device in lab.devices.values())


SAYS_IT = {
    "doctor": "",
    "devices list": "",
    "devices test": "nobody",
    "devices identify": "nobody",
    "devices setup": "nobody",
    "devices capture": "nobody",
    "devices luminance": "",
    "devices rules": "",
    "sync-test": "",
    "participant add": "nothing",
    "participant list": "nothing",
    "participant rename": "nothing 1 2 --reason mistyped",
    "participant withdraw": "nothing 1",
    "plan": "nothing",
    "fidelity": "nothing",
    "lock": "nothing --participants 3",
    "prepare": "nothing",
    "run": "nothing --participant 1",
    "resume": "nothing",
    "serve": "nothing",
    "board": "nothing",
    "export-web": "nothing --output web",
    "import-web": "nothing results.txt",
    "desk": "",
    "check": "nothing",
    "quality": "nothing",
    "note": "nothing 1 text",
    "exclude": "nothing 1 --reason why",
    "preview": "nothing --png a.png",
    "redraw": "nothing --frame 1 --png a.png",
    "simulate": "nothing",
    "demo": "",
    "view": "nothing",
    "film": "nothing --trial T01 -o a.avi",
    "gaze-map": "nothing --by a",
    "replay": "nothing --verify",
    "analyse": "nothing",
    "report": "nothing",
    "power": "nothing",
    "import annotations": "nothing a.csv",
    "export session": "nothing",
    "export character": "nobody -o a.glb",
    "export motion": "walk --character nobody -o a.glb",
    "character list": "",
    "character sheet": "a.png",
    "character import": "nobody.glb",
    "character fetch": "valid nobody.zip",
}
"""With what each verb ends soon after it has read the configuration."""
NEEDS_NONE = {"new", "devices replay", "participant information"}
"""Files and texts are written from a study alone, a wire that was captured is its own device."""


def verbs(command: Any, name: str = "") -> Iterator[str]:
    """Yield every verb that takes a configuration."""
    context = command.context_class(command)
    if hasattr(command, "list_commands"):
        for below in command.list_commands(context):
            yield from verbs(command.get_command(context, below), f"{name} {below}".strip())
    elif any("--config" in option.opts for option in command.params):
        yield name


def test_every_verb_with_a_configuration_is_listed_here() -> None:
    assert {*SAYS_IT, *NEEDS_NONE} == set(verbs(typer.main.get_command(app)))


@pytest.mark.parametrize("verb", SAYS_IT)
def test_the_configuration_in_force_is_said_in_the_first_line(
    verb: str, here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def ended(*_: object, **__: object) -> None:
        raise UsageError("enough")

    monkeypatch.setattr("visavis.cli.commands.study.simulate_study", ended)
    monkeypatch.setattr("visavis.cli.commands.desk._desk_server", ended)
    CliRunner().invoke(app, ["init"])
    said = CliRunner().invoke(app, [*verb.split(), *SAYS_IT[verb].split()]).stderr.splitlines()
    assert f"configuration: {here / 'lab_config.yaml'} (Example laboratory)" == said[0]


def test_json_stands_alone(here: Path) -> None:
    visavis("init")
    result = visavis("plan", "stare", "--participant", "1", "--json")
    assert "" == result.stderr
    assert "stare" == json.loads(result.stdout)["study"]


def test_init_writes_the_example_and_never_over_a_file(here: Path) -> None:
    visavis("init", "my_lab")
    assert EXAMPLE.read_bytes() == (here / "my_lab" / "lab_config.yaml").read_bytes()
    (here / "my_lab" / "lab_config.yaml").write_text("lab: mine")
    with pytest.raises(UsageError, match="left as it is"):
        visavis("init", "my_lab")
    assert "lab: mine" == (here / "my_lab" / "lab_config.yaml").read_text()
