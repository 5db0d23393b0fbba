"""The operator's window, on a virtual screen."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from visavis.devices.contracts import GAZE
from visavis.lab.frame import EyeView
from visavis.stage.mirror import gaze_in_picture, gaze_on_eye

SHOW = """
import numpy as np
from visavis.cli.doctor.machine import monitors
from visavis.stage.mirror import Mirror
from visavis.stage.renderer import Renderer
from visavis.stage.card.targets import EyeTarget
from visavis.stage.window import Window
from tests.stage import figures

window = Window("test", (320, 240))
print("screens", len(monitors()) > 0)  # asked at every session's start: the window stays usable
renderer = Renderer(window.context)
target = EyeTarget(window.context, (160, 120), renderer.quality.samples)
mirror = Mirror(window)
renderer.draw(figures.picture(2), [figures.camera()], [target])
before = target.read()

def shown():
    window.context.screen.use()
    raw = window.context.screen.read(components=3, alignment=1)
    return np.frombuffer(raw, np.uint8).reshape(240, 320, 3)[::-1].astype(int)

present, window.present = window.present, lambda: None
mirror.show(window.context, target.texture)
plain = shown()
mirror.gaze_01 = (0.5, -0.5)
mirror.show(window.context, target.texture)
marked = shown()
present()
changed = np.argwhere(np.abs(marked - plain).max(axis=2) > 20)
print("middle", *changed.mean(axis=0).round(0), "count", len(changed))
print("mirror", np.abs(plain[::2, ::2] - before.astype(int)).mean() < 6)
print("participant", (target.read() == before).all())
renderer.close()
mirror.close()
"""


@pytest.mark.skipif(
    shutil.which("xvfb-run") is None, reason="needs a virtual screen: apt install xvfb"
)
def test_gaze_point_is_in_the_mirror_and_never_in_the_eye_image() -> None:
    root = Path(__file__).parents[2]
    done = subprocess.run(
        ["xvfb-run", "-a", "-s", "-screen 0 640x480x24", sys.executable, "-c", SHOW],  # noqa: S607 - found above
        capture_output=True,
        text=True,
        timeout=60,
        cwd=root,
        env={**os.environ, "PYTHONPATH": str(root)},
        check=False,
    )
    if "needs" in done.stderr or "no window" in done.stderr:
        pytest.skip(done.stderr.strip().splitlines()[-1])
    assert done.returncode == 0, done.stderr
    assert "screens True" in done.stdout
    words = done.stdout.split()[2:]
    assert (float(words[1]), float(words[2])) == pytest.approx((180.0, 240.0), abs=3)
    assert 10 < int(words[4]) < 200
    assert "mirror True" in done.stdout
    assert "participant True" in done.stdout


def test_gaze_falls_where_the_frustum_says() -> None:
    tangents = (-1.0, 0.5, -0.8, 1.2)
    assert gaze_in_picture(np.array([0.5, 1.2, -1.0]), tangents) == pytest.approx((1.0, 1.0))
    assert gaze_in_picture(np.array([-1.0, -0.8, -1.0]), tangents) == pytest.approx((-1.0, -1.0))
    assert gaze_in_picture(np.array([0.0, 0.0, 1.0]), tangents) is None
    assert gaze_in_picture(np.full(3, np.nan), tangents) is None


def test_gaze_ring_follows_the_eye_of_the_picture_and_goes_with_the_gaze() -> None:
    eye = EyeView((-0.03, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), -1.0, 1.0, -1.0, 1.0)
    sample = np.zeros(1, GAZE.dtype)[0]
    sample["direction_head"] = (0.5, 0.0, -1.0)
    sample["left_direction_head"] = (0.0, 0.25, -1.0)
    assert gaze_on_eye(sample, eye) is None
    sample["valid"] = True
    assert gaze_on_eye(sample, eye) == pytest.approx((0.5, 0.0))
    sample["left_valid"] = True
    assert gaze_on_eye(sample, eye) == pytest.approx((0.0, 0.25))


def test_pictures_without_a_window_load_no_library_of_windows() -> None:
    code = "import sys, visavis.stage.drawn_stage; print('glfw' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "False" == done.stdout.strip()
