"""The OpenXR headset on a genuine runtime, where one is installed."""

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.genuine.monado import Service, missing, screen

REPOSITORY = Path(__file__).resolve().parents[2]

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(missing()), reason=f"no genuine OpenXR runtime: {missing()}"),
]


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    made = Service(tmp_path)
    with screen(made.environment):
        made.start()
        yield made
        made.kill()


def performed(service: Service, scenario: str) -> Any:
    with subprocess.Popen(
        [sys.executable, "-X", "faulthandler", "-m", "tests.genuine.monado_child", scenario],
        cwd=REPOSITORY,
        env=service.environment,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as child:
        assert child.stdin is not None
        assert child.stdout is not None
        result = None
        for line in child.stdout:
            if line.startswith("{"):
                result = json.loads(line)
            elif line.strip() in ("kill", "start"):
                (service.kill if line.strip() == "kill" else service.start)()
                child.stdin.write("done\n")
                child.stdin.flush()
    assert 0 == child.returncode
    return result


@pytest.mark.parametrize("scenario", ["headless", "pictures"])
def test_poses_are_where_the_head_was_put(service: Service, scenario: str) -> None:
    result = performed(service, scenario)
    assert ("streaming", []) == (result["state"], result["faults"])
    assert "Monado" in result["runtime"]
    assert result["apart_m"] < 1e-4
    assert result["apart"] < 1e-6
    assert 1 < result["ahead_ms"] < 100
    # by the runtime's own stamps each head is foreseen for the light that it promises
    age = result["pose_age"]
    assert age["frames"] > 150
    assert 0 == pytest.approx(age["at_least_ms"], abs=0.01)
    assert result["ahead_ms"] == pytest.approx(age["at_most_ms"], abs=0.5)


def test_eyes_that_are_moved_apart_are_drawn_for(service: Service) -> None:
    result = performed(service, "knob")
    assert (58.0, 70.0) == pytest.approx((result["first"], result["then"]), abs=0.01)
    assert any("58.0 to 70.0 mm" in fault for fault in result["faults"])


def test_a_service_that_was_killed_is_found_again(service: Service) -> None:
    result = performed(service, "killed")
    assert ["streaming", "fault", "streaming"] == result["states"]
    assert result["valid"]


@pytest.mark.timeout(300)
@pytest.mark.parametrize("ending", ["abort", "sigterm", "ctrl-c"])
def test_a_session_with_pictures_ends_in_any_way_with_its_recording_sealed(
    service: Service, ending: str
) -> None:
    result = performed(service, ending)
    assert [] == result["problems"]
    assert result["shown"] > 0
    assert "aborted" == result["status"]


LATE = ("of the expected samples", "no data for", "picture_stalled", "eye_tracker_warning")
"""What is said where the computer is too busy to be in time with frames and samples."""


def in_time(findings: list[str]) -> list[str]:
    return [finding for finding in findings if not any(late in finding for late in LATE)]


@pytest.mark.timeout(600)
@pytest.mark.parametrize("study", ["stare", "crowd", "waving", "own"])
def test_whole_session_of_every_kind_of_study_is_checked_green(
    service: Service, study: str
) -> None:
    result = performed(service, study)
    assert "complete" == result["status"]
    others = in_time(result["findings"])
    assert [] == [finding for finding in others if not finding.startswith("GREEN")]
    assert "GREEN" == result["level"] or len(others) < len(result["findings"])
    assert result["trials"] == result["attempts"] > 1
    assert 1.0 == result["tracked"]
    assert result["moved_m"] > 0.01


@pytest.mark.timeout(1500)
def test_whole_session_is_shown_and_follows_the_knob_of_the_eyes(service: Service) -> None:
    result = performed(service, "own-shown")
    assert "complete" == result["status"]
    assert result["shown"] > 100
    assert result["apart_mm"][-1] == pytest.approx(70.0, abs=0.01)
    assert 1 < len(result["apart_mm"]) < 10  # a row when the knob was turned, none for rounding


@pytest.mark.timeout(600)
def test_session_whose_runtime_is_killed_and_started_again_is_complete(service: Service) -> None:
    result = performed(service, "own-killed")
    assert "complete" == result["status"]
    assert any("lost the OpenXR session" in finding for finding in result["findings"])
    # a trial that went on is flagged, one that was interrupted came again
    is_flagged = any("headset_lost" in finding for finding in result["findings"])
    assert is_flagged or result["attempts"] > result["trials"]
    reds = [f for f in in_time(result["findings"]) if f.startswith("RED")]
    assert [] == reds
