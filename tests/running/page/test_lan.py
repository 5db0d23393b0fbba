"""On a lab's network: https by its own certificate or the lab's, and the options that fit."""

import hashlib
import http.client
import json
import os
import re
import signal
import ssl
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime, timedelta
from ipaddress import ip_address
from pathlib import Path

import pytest

from tests.commands import COMMANDS, RunningCommand
from tests.running.page.test_serving import COMMAND, STUDY
from visavis.cli.commands.serving import Way
from visavis.lab.clock import SystemClock
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import UsageError
from visavis.running.page.lan import addresses_here, certificate_of
from visavis.running.page.own_certificate import NAME, own_certificate

NOW = datetime.fromisoformat(SystemClock().wall_iso())
NAMES = ("192.168.1.5", "127.0.0.1", "localhost")


def test_other_computers_are_told_no_address_that_means_themselves() -> None:
    assert not any(ip_address(text).is_loopback for text in addresses_here())


def test_a_certificate_of_its_own_stays_the_same_and_nobody_else_reads_its_key(
    tmp_path: Path,
) -> None:
    first = own_certificate(tmp_path / "keys", NAMES, NOW)
    again = own_certificate(tmp_path / "keys", NAMES[1:], NOW)
    assert first.fingerprint == again.fingerprint
    assert re.fullmatch("([0-9A-F]{2}:){31}[0-9A-F]{2}", first.fingerprint)
    if os.name != "nt":
        assert 0o600 == (tmp_path / "keys" / NAME).stat().st_mode & 0o777


@pytest.mark.parametrize("change", ["address", "age", "damage"])
def test_a_certificate_that_browsers_would_refuse_is_made_anew(tmp_path: Path, change: str) -> None:
    old = NOW - timedelta(days=400) if change == "age" else NOW
    if change == "age":
        with pytest.raises(UsageError, match="expired"):
            own_certificate(tmp_path, NAMES, old)
    else:
        own_certificate(tmp_path, NAMES, old)
    before = (tmp_path / NAME).read_text("ascii")
    if change == "damage":
        (tmp_path / NAME).write_text(before[:300], "ascii")
    names = ("192.168.1.6", *NAMES) if change == "address" else NAMES
    certificate = own_certificate(tmp_path, names, NOW)
    assert certificate.fingerprint
    assert before != (tmp_path / NAME).read_text("ascii")


def test_a_lab_s_certificate_is_for_the_name_that_people_type(tmp_path: Path) -> None:
    own_certificate(tmp_path, ("study.lab.example",), NOW)
    path = tmp_path / NAME
    assert certificate_of(path, path, ["study.lab.example"]).fingerprint
    with pytest.raises(UsageError, match=r"does not hold for other\.lab\.example: .*mismatch"):
        certificate_of(path, path, ["other.lab.example"])


def test_a_key_of_another_certificate_is_refused_and_so_is_what_is_none(tmp_path: Path) -> None:
    for name in ("a", "b"):
        own_certificate(tmp_path / name, NAMES, NOW)
    (tmp_path / "text.pem").write_text("none", "ascii")
    for certificate, key in (("a/" + NAME, "b/" + NAME), ("text.pem", "text.pem"), ("no", "no")):
        with pytest.raises(UsageError, match="no certificate and its key"):
            certificate_of(tmp_path / certificate, tmp_path / key, [])


@pytest.mark.parametrize(
    ("way", "refusal"),
    [
        (Way("http://192.168.1.5", "127.0.0.1", 80, is_lan=True), "speaks https"),
        (Way("", "127.0.0.1", 80, is_lan=True, certificate=Path("a")), "go together"),
        (Way("", "127.0.0.1", 80, is_lan=True, key=Path("a")), "go together"),
        (Way("", "127.0.0.1", 80, certificate=Path("a"), key=Path("b")), "are for --lan"),
        (
            Way("", "127.0.0.1", 80, is_lan=True, certificate=Path("a"), key=Path("b")),
            "--public https://study",
        ),
        (Way("", "0.0.0.0", 80), "or use --lan"),  # noqa: S104  # refused
    ],
)
def test_options_that_do_not_fit_together_are_refused_with_the_way_out(
    way: Way, refusal: str
) -> None:
    with pytest.raises(UsageError, match=re.escape(refusal)):
        way.check()


@pytest.mark.parametrize(
    ("public", "pattern"),
    [
        ("https://study.example.org", "port 443, .* --public https://study.example.org:8080"),
        ("https://study.example.org:80", "port 80, and this listens at 8080"),
        ("https://study.example.org:8080", "^$"),
        ("", "^$"),
    ],
)
def test_a_name_that_leads_to_another_port_is_told(public: str, pattern: str) -> None:
    way = Way(public, "127.0.0.1", 0, is_lan=True)
    assert re.search(pattern, way.other_port(8080))
    assert "" == Way(public, "127.0.0.1", 0).other_port(8080)


@pytest.mark.parametrize(
    ("public", "is_insecure"),
    [
        ("", False),
        ("http://localhost:8080", False),
        ("https://study.example.org", False),
        ("http://192.168.1.5:8080", True),
    ],
)
def test_a_plain_address_of_a_network_is_no_safe_one(public: str, is_insecure: bool) -> None:
    assert is_insecure == Way(public, "0.0.0.0", 80).is_insecure  # noqa: S104  # not listened to


@contextmanager
def serving(root: Path, *options: str) -> Iterator[tuple[list[str], RunningCommand]]:
    """Serve a study; give what was printed until the board's address, and the server."""
    (root / "many.py").write_text(STUDY, encoding="utf-8")
    (root / "lab_config.yaml").write_text(EXAMPLE.read_text("utf-8"), "utf-8")
    server = COMMANDS.start(
        *[*COMMAND, "serve", "./many.py", "--port", "0", "--devices", "sim", *options],
        cwd=root,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    assert server.stdout is not None
    lines: list[str] = []
    try:
        for line in server.stdout:
            lines.append(line.strip())
            if "/board#" in line:
                break
        yield lines, server
    finally:
        server.send_signal(signal.SIGTERM)
        rest, _ = server.communicate(timeout=60)
        lines += rest.splitlines()


def post(port: int, tls: ssl.SSLContext, body: dict[str, object]) -> dict[str, object]:
    """Arrive at a served study by https; return the answer."""
    connection = http.client.HTTPSConnection("localhost", port, timeout=60, context=tls)
    try:
        headers = {"Content-Type": "application/json"}
        connection.request("POST", "/api/arrive", json.dumps(body), headers)
        answer: dict[str, object] = json.loads(connection.getresponse().read())
        return answer
    finally:
        connection.close()


@pytest.mark.slow
def test_a_lab_is_served_by_https_whose_fingerprint_and_code_stand_on_the_screen(
    tmp_path: Path,
) -> None:
    with serving(tmp_path, "--lan", "--host", "localhost") as (lines, _):
        text = "\n".join(lines)
        (port,) = re.findall(r"^https://localhost:(\d+)$", text, re.M)
        # Who trusts what the screen shows gets a session by the code, and by nothing else.
        shown = ssl.get_server_certificate(("localhost", int(port)))
        digest = hashlib.sha256(ssl.PEM_cert_to_DER_cert(shown)).hexdigest().upper()
        printed = "".join(re.findall(r"^((?:[0-9A-F]{2}:){15}[0-9A-F]{2})$", text, re.M))
        assert digest == printed.replace(":", "")
        (digits,) = re.findall(r"^(\d{3} \d{3})$", text, re.M)
        tls = ssl.create_default_context(cadata=shown)
        refused = post(int(port), tls, {"parameters": {}})
        assert "six digits" in str(refused["text"])
        wrong = [post(int(port), tls, {"parameters": {}, "code": f"x{n}"}) for n in range(25)]
        assert "Too many" in str(wrong[-1]["text"])
    assert "20 wrong codes" in "\n".join(lines)
    with serving(tmp_path, "--lan", "--host", "localhost") as (lines, _):
        text = "\n".join(lines)
        (port,) = re.findall(r"^https://localhost:(\d+)$", text, re.M)
        (digits,) = re.findall(r"^(\d{3} \d{3})$", text, re.M)
        code = digits.replace(" ", "")
        assert "key" in post(int(port), tls, {"parameters": {}, "code": code})  # the same one
        plain = http.client.HTTPConnection("localhost", int(port), timeout=60)
        plain.request("GET", "/")
        with pytest.raises((http.client.HTTPException, OSError)):
            plain.getresponse()


@pytest.mark.slow
def test_whoever_serves_at_a_plain_address_of_a_network_is_told_what_goes_unchecked(
    tmp_path: Path,
) -> None:
    with serving(tmp_path, "--public", "http://192.168.1.5:8080") as (lines, _):
        assert "not noticed" in "\n".join(lines)


@pytest.mark.slow
def test_where_no_certificate_can_be_made_the_ways_out_are_told(tmp_path: Path) -> None:
    (tmp_path / "many.py").write_text(STUDY, "utf-8")
    (tmp_path / "lab_config.yaml").write_text(EXAMPLE.read_text("utf-8"), "utf-8")
    without = "import sys; sys.modules['cryptography'] = None; from visavis.cli.main import main"
    arguments = ["serve", "./many.py", "--devices", "sim", "--lan", "--host", "localhost"]
    process = COMMANDS.run("-c", f"{without}; main()", *arguments, cwd=tmp_path, timeout=60)
    output = " ".join((process.stdout + process.stderr).split())
    assert 0 != process.returncode
    for way_out in ("visavis[lan]", "--certificate", "adb reverse"):
        assert way_out in output
