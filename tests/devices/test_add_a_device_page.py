"""What docs/add-a-device.md tells a newcomer to write passes the suite, as it stands there."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "add-a-device.md"
BLOCK = re.compile(r"^```python\n# ((?:pedal|belt)/\w+\.py)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
TESTS_ON_THE_PAGE = {"pedal": 9, "belt": 3}
MAX_LINES_OF_THE_BELT = 80
TOML = re.compile(r"^```toml\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    folder = tmp_path_factory.mktemp("page")
    blocks = BLOCK.findall(PAGE.read_text("utf-8"))
    for name in TESTS_ON_THE_PAGE:
        (folder / name).mkdir()
        (folder / name / "__init__.py").touch()
    for name, text in blocks:
        (folder / name).write_text(text, "utf-8")
    for number, block in enumerate(TOML.findall(PAGE.read_text("utf-8"))):
        installed = folder / f"page{number}-1.dist-info"
        installed.mkdir()
        about = f"Metadata-Version: 2.1\nName: page{number}\nVersion: 1\n"
        (installed / "METADATA").write_text(about)
        points = re.sub(r'\[project\.entry-points\."([\w.]+)"\]', r"[\1]", block)
        lines = [line.replace('"', "") for line in points.splitlines() if line[:1] != "#"]
        (installed / "entry_points.txt").write_text("\n".join(lines))
    return folder


def run(package, *arguments):
    path = os.pathsep.join((str(package), str(ROOT / "src")))
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=package,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=110,
    )


@pytest.mark.parametrize(("name", "passed"), TESTS_ON_THE_PAGE.items())
def test_what_the_page_says_passes_the_suite(package, name, passed):
    done = run(package, "-m", "pytest", "-q", "-W", "error", "-p", "no:cacheprovider", name)
    assert f"{passed} passed" in done.stdout, done.stdout + done.stderr


def test_the_belt_takes_at_most_80_lines():
    parts = [text for name, text in BLOCK.findall(PAGE.read_text("utf-8")) if "belt/" in name]
    written = [text for text in parts if "def test_" not in text]
    assert len(written) == 4
    assert sum(len(text.splitlines()) + 1 for text in written) <= MAX_LINES_OF_THE_BELT


def test_suite_names_the_promise_that_a_newcomer_breaks(package, tmp_path):
    broken = tmp_path / "pedal"
    broken.mkdir()
    for file in (package / "pedal").glob("*.py"):
        text = file.read_text("utf-8")
        (broken / file.name).write_text(
            text.replace("        self._seq += len(rows)\n", ""), "utf-8"
        )
    done = run(tmp_path, "-m", "pytest", "-q", "-p", "no:cacheprovider", "pedal")
    assert "broken promise: seq rises across batches" in done.stdout


def test_driver_of_another_package_stands_in_the_configuration(package):
    (package / "lab_config.yaml").write_text(
        "lab: L\ndata_root: data\nkey_root: keys\nprivacy: {consent_version: '1'}\n"
        "devices:\n  responses: {driver: pedal, port: nowhere}\n"
    )
    listed = run(package, "-m", "visavis.cli.main", "devices", "list")
    assert re.search(r"responses\s+pedal\s+ready", listed.stdout), listed.stdout + listed.stderr
    tested = run(package, "-m", "visavis.cli.main", "devices", "test", "--seconds", "0.5")
    assert tested.returncode == 4
    assert "cannot open nowhere" in tested.stdout


def test_simulator_of_another_package_is_captured_and_played_back(package):
    (package / "simulated.yaml").write_text(
        "lab: L\ndata_root: data\nkey_root: keys\nprivacy: {consent_version: '1'}\n"
        "devices:\n  responses: {driver: pedal, simulated: true}\n"
    )
    capture = ("devices", "capture", "responses", "-o", "pedal.wire", "--seconds", "1.2")
    captured = run(package, "-m", "visavis.cli.main", *capture, "--config", "simulated.yaml")
    assert "Example foot pedal" in captured.stdout, captured.stdout + captured.stderr
    played = run(package, "-m", "visavis.cli.main", "devices", "replay", "pedal.wire")
    assert re.search(r"responses +\d+ rows", played.stdout), played.stdout + played.stderr


def test_wrong_option_of_another_package_is_refused_with_its_line(package):
    (package / "wrong.yaml").write_text(
        "lab: L\ndata_root: data\nkey_root: keys\nprivacy: {consent_version: '1'}\n"
        "devices:\n  responses: {driver: pedal, porrt: COM7}\n"
    )
    refused = run(package, "-m", "visavis.cli.main", "devices", "list", "--config", "wrong.yaml")
    assert refused.returncode == 2
    assert "did you mean 'port'" in refused.stderr
