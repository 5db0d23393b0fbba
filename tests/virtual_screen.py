"""A child process before a screen of its own, which no monitor shows."""

import os
import shutil
import subprocess
import sys

import pytest

from tests.product_files import ROOT

MAX_S = 120


def run_before_a_screen(*words: str, size_px: tuple[int, int], keys: str | None = None) -> str:
    """Run a module of the tests on an X server of its own; return what it printed.

    `keys` is what is typed. The test is skipped where there is no such server, or no window of it
    can be drawn in.
    """
    if shutil.which("xvfb-run") is None:
        pytest.skip("needs a virtual screen: apt install xvfb xvfb-run")
    width, height = size_px
    screen = ["xvfb-run", "-a", "-s", f"-screen 0 {width}x{height}x24"]
    done = subprocess.run(
        [*screen, sys.executable, "-m", *words],
        input=keys,
        capture_output=True,
        text=True,
        timeout=MAX_S,
        cwd=ROOT,
        check=False,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    if "OpenGL 3.3" in done.stderr or "no window" in done.stderr:
        pytest.skip(done.stderr.strip().splitlines()[-1])
    assert 0 == done.returncode, done.stderr
    return done.stdout
