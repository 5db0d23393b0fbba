"""The examples for serving unattended name what is there: options of `serve`, units, directives."""

import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.product_files import ROOT
from visavis.cli.main import app

EXAMPLES = ROOT / "docs" / "unattended"
UNIT = EXAMPLES / "visavis-serve@.service"


def served(text: str) -> list[str]:
    """Return the options of `visavis serve` in a text."""
    line = next(one for one in text.splitlines() if re.search(r"\bserve \./", one))
    return [word for word in shlex.split(line) if word.startswith("--")]


@pytest.mark.parametrize("name", ["visavis-serve@.service", "Containerfile"])
def test_the_options_are_those_of_serve(name: str) -> None:
    text = (EXAMPLES / name).read_text("utf-8")
    known = CliRunner().invoke(app, ["serve", "--help"], env={"COLUMNS": "200"}).output
    options = [o for o in served(text.replace("\\\n#", "")) if o in ("--public", "--port")]
    assert options
    assert [] == [option for option in options if option not in known]


def test_systemd_takes_the_unit(tmp_path: Path) -> None:
    program = shutil.which("systemd-analyze")
    if program is None:
        pytest.skip("there is no systemd")
    unit = tmp_path / "visavis-serve@lively.service"
    unit.write_text(UNIT.read_text("utf-8").replace("/opt/visavis/bin/visavis", "/bin/true"))
    done = subprocess.run([program, "verify", str(unit)], capture_output=True, text=True)
    assert (0, "") == (done.returncode, done.stderr)


def test_nginx_takes_the_server(tmp_path: Path) -> None:
    program = shutil.which("nginx")
    if program is None:
        pytest.skip("there is no nginx; apt install nginx-light")
    server = (EXAMPLES / "nginx.conf").read_text("utf-8").replace("443 ssl", "127.0.0.1:0")
    server = "\n".join(line for line in server.splitlines() if "ssl_certificate" not in line)
    whole = f"pid {tmp_path}/pid; error_log stderr; events {{}} http {{ {server} }}"
    config = tmp_path / "nginx.conf"
    config.write_text(whole.replace("127.0.0.1:0", "127.0.0.1:18443"), "utf-8")
    command = [program, "-t", "-c", str(config), "-p", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert 0 == done.returncode, done.stderr
