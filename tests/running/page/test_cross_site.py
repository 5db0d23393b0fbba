"""Nothing that a page of another site sends with a real browser is let in, or read there."""

from pathlib import Path

import pytest

from benchmarks.cross_site import BROWSERS, is_there, measure

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]  # browsers


@pytest.mark.parametrize("browser", BROWSERS)
def test_pages_of_other_sites_get_nothing_done_in(browser: str, tmp_path: Path) -> None:
    pytest.importorskip("playwright" if browser == "chromium" else "websockets")
    if not is_there(browser):
        pytest.skip(f"there is no {browser}")
    outcome = measure(browser, tmp_path)
    assert [] == outcome.where
    assert outcome.sent > 1700
    assert outcome.is_clean
