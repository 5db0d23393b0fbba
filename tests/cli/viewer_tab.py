"""A page of the viewer: what it says of a session, and in a real browser."""

import base64
import json
import shutil
import zlib
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


def page_parts(payload: str) -> tuple[dict[str, Any], bytes]:
    """Return header and arrays of the text of a bundle."""
    raw = zlib.decompress(base64.b64decode(payload))
    begin = 8 + int.from_bytes(raw[:8], "little")
    return json.loads(raw[8:begin]), raw[begin:]


def header_of(page: Path) -> dict[str, Any]:
    """Return what a page says of its session; arrays apart."""
    text = page.read_text(encoding="utf-8")
    return page_parts(text.partition('id="data">')[2].partition("<")[0])[0]


@contextmanager
def viewer_tab(
    playwright: Any, page: Path, width_px: int, height_px: int
) -> Iterator[tuple[Any, list[str]]]:
    """Open a page in a browser that the module's driver (`playwright`) begins; yield its tab when
    the page is ready, and the errors of its scripts.
    """
    if CHROMIUM is None:
        pytest.skip("there is no chromium; apt install chromium")
    flags = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]
    browser = playwright.chromium.launch(executable_path=CHROMIUM, args=flags)
    tab = browser.new_page(viewport={"width": width_px, "height": height_px})
    problems: list[str] = []
    tab.on("pageerror", lambda error: problems.append(str(error)))
    tab.goto(page.as_uri())
    tab.wait_for_selector("body[data-ready]", timeout=60_000)
    yield tab, problems
    browser.close()
