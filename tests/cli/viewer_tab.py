"""A page of the viewer in a real browser."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")


def page_array(arrays: bytes, ref: dict[str, Any]) -> npt.NDArray[Any]:
    """Return an array of a page; on it columns stand one after the other."""
    rows, *shape = ref["s"]
    flat = np.frombuffer(arrays, "<" + ref["d"], int(np.prod(ref["s"])), ref["o"])
    return flat.reshape(-1, rows).T.reshape(rows, *shape)


@contextmanager
def viewer_tab(page: Path, width_px: int, height_px: int) -> Iterator[tuple[Any, list[str]]]:
    """Open a page; yield its tab when the page is ready, and the errors of its scripts."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if CHROMIUM is None:
        pytest.skip("there is no chromium; apt install chromium")
    with playwright.sync_playwright() as driver:
        flags = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=flags)
        tab = browser.new_page(viewport={"width": width_px, "height": height_px})
        problems: list[str] = []
        tab.on("pageerror", lambda error: problems.append(str(error)))
        tab.goto(page.as_uri())
        tab.wait_for_selector("body[data-ready]", timeout=60_000)
        yield tab, problems
        browser.close()
