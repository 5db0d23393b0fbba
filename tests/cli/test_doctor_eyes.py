"""Doctor says when the active OpenXR runtime hides an eye tracker, and which one tells of it."""

import json
import subprocess
from pathlib import Path

import pytest

from visavis.cli.doctor import wires
from visavis.devices.drivers.openxr.offer import ask
from visavis.devices.registry import OPTION_MODELS
from visavis.devices.sim.native_build import find_compiler
from visavis.lab.config import parse_config
from visavis.lab.config_files import EXAMPLE

SOURCE = Path(__file__).parents[1] / "devices" / "native" / "openxr_offer.c"


@pytest.fixture
def runtimes(tmp_path, monkeypatch):
    """What makes a runtime that the genuine loader loads, in a folder where packages put them."""
    pytest.importorskip("xr", reason="pip install pyopenxr")
    compiler = find_compiler()
    if compiler is None:
        pytest.skip("needs a C compiler: apt-get install gcc")
    monkeypatch.setattr(wires, "XR_FOLDERS", (str(tmp_path),))

    def make(name, *, gaze, extension="", headset=True):
        library = tmp_path / f"{name}.so"
        said = (
            f'-DNAME="{name}"',
            f"-DGAZE={int(gaze)}",
            f'-DEXTENSION="{extension}"',
            f"-DHEADSET={int(headset)}",
        )
        command = [compiler, "-shared", "-fPIC", *said, "-o", str(library), str(SOURCE)]
        subprocess.run(command, check=True)
        manifest = tmp_path / f"openxr_{name}.json"
        runtime = {"library_path": str(library)}
        manifest.write_text(json.dumps({"file_format_version": "1.0.0", "runtime": runtime}))
        return manifest

    return make


def eyes(monkeypatch, active, driver="openxr_gaze"):
    monkeypatch.setenv("XR_RUNTIME_JSON", str(active))
    text = EXAMPLE.read_text("utf-8")
    device = f"devices:\n  eye_tracker: {{driver: {driver}}}\n"
    head, _, _ = text.partition("devices:")
    lab = parse_config(
        f"{head}{device}  headset: {{driver: openxr_headset}}\n", Path("l.yaml"), OPTION_MODELS
    )
    return [f for f in wires.runtimes(lab) if f.subject == wires.EYES]


def test_a_runtime_that_hides_the_tracker_is_named_with_the_one_to_choose(runtimes, monkeypatch):
    hiding = runtimes("SteamVR", gaze=False)
    telling = runtimes("Varjo", gaze=True)
    runtimes("Other", gaze=False)
    (verdict,) = eyes(monkeypatch, hiding)
    assert verdict.level == "missing"
    assert verdict.found == "SteamVR hides the eye tracker, whose gaze Varjo tells"
    assert "make Varjo the active OpenXR runtime" in verdict.remedy
    assert str(telling) in verdict.remedy


@pytest.mark.parametrize(
    ("extension", "how"),
    [
        ("", "one ray of both eyes"),
        ("XR_HTC_eye_tracker", "each eye by XR_HTC_eye_tracker"),
        ("XR_FB_eye_tracking_social", "each eye by XR_FB_eye_tracking_social"),
    ],
)
def test_what_the_active_runtime_tells_of_eyes_is_said(runtimes, monkeypatch, extension, how):
    (verdict,) = eyes(monkeypatch, runtimes("Vendor", gaze=True, extension=extension))
    assert (verdict.level, verdict.found) == ("ok", f"Vendor tells {how}")


def test_a_runtime_without_a_headset_cannot_say(runtimes, monkeypatch):
    (verdict,) = eyes(monkeypatch, runtimes("Alone", gaze=True, headset=False))
    assert verdict.level == "warning"
    assert "finds no headset" in verdict.found
    assert "switch on the headset" in verdict.remedy


def test_no_tracker_anywhere_is_missing_with_what_to_allow(runtimes, monkeypatch):
    (verdict,) = eyes(monkeypatch, runtimes("Plain", gaze=False))
    assert (verdict.level, verdict.found) == ("missing", "Plain tells no gaze")
    assert "eye tracking" in verdict.remedy


def test_a_runtime_that_cannot_be_loaded_is_no_answer_and_no_end(runtimes, monkeypatch, tmp_path):
    broken = tmp_path / "openxr_broken.json"
    broken.write_text(
        '{"file_format_version": "1.0.0", "runtime": {"library_path": "/no/such.so"}}'
    )
    assert ask(broken) is None
    telling = runtimes("Whole", gaze=True)
    (verdict,) = eyes(monkeypatch, broken)
    assert "cannot be asked for gaze, which Whole tells" in verdict.found
    assert str(telling) in verdict.remedy


def test_runtimes_are_asked_only_where_gaze_is_to_come_from_them(runtimes, monkeypatch):
    assert eyes(monkeypatch, runtimes("SteamVR", gaze=False), driver="fove") == []
