"""On a lab's network a real browser gets the page by https, and a session by the code."""

import re
from typing import Any

import pytest

from tests.running.page.test_browser import ASKING, PATIENCE_S, Server, until
from tests.running.page.test_browser import server as server
from visavis.recording.reader import Recording
from visavis.running.page.lan import addresses_here

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]  # a browser


def code_of(server: Server) -> str:
    """Return the code that the server shows."""
    assert server.process is not None
    assert server.process.stdout is not None
    for line in server.process.stdout:
        if found := re.fullmatch(r"(\d{3}) (\d{3})", line.strip()):
            return found[1] + found[2]
    raise AssertionError("no code was shown")


def test_a_browser_on_the_network_arrives_with_the_code_and_reaches_the_thanks(
    server: Server, browser: Any
) -> None:
    (server.root / "asked.py").write_text(ASKING, "utf-8")
    host = next(iter(addresses_here()), "localhost")
    address = server.start("serve", "asked.py", "--lan", "--host", host, "--port", "0")
    code = code_of(server)
    # Whoever compared the fingerprint goes on past the browser's warning.
    page = browser.new_context(ignore_https_errors=True).new_page()
    page.goto(f"{address}/?participant=nobody")
    field = page.locator("#code")
    field.wait_for(timeout=PATIENCE_S * 1000)
    assert page.evaluate("[isSecureContext, Boolean(crypto.subtle)]") == [True, True]
    go = page.locator("#main button")
    assert go.is_disabled()
    field.fill("12345")
    assert go.is_disabled()
    field.fill(f"{(int(code) + 1) % 10**6:06d}")
    go.click()
    page.get_by_text("This is not the code.").wait_for(timeout=PATIENCE_S * 1000)
    page.locator("#code").fill(f"{code[:3]} {code[3:]}")  # as it stands on the screen
    page.keyboard.press("Enter")
    page.locator("#code").wait_for(state="detached", timeout=PATIENCE_S * 1000)
    page.locator("#main button").first.wait_for(timeout=PATIENCE_S * 1000)
    page.reload()  # who has a session needs no code
    until(page, "Thank you")
    (path,) = (server.root / "data/simulated/asked").glob("sub-*/ses-001")
    while not (recording := Recording(path)).trials().shape[0] == 2:
        page.wait_for_timeout(50)
    events = recording.events()
    pages = events.loc[events["name"] == "page_event", "payload"]
    assert {True} == {p["about"]["checks_files"] for p in pages if p["kind"] == "about"}
