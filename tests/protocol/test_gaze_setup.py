"""Calibrating within a session: frames go on while the tracker works out its verdict."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from tests.faults.sessions import lab, perform
from visavis.lab.geometry import Pose, direction_from_yaw_pitch_deg
from visavis.lab.screen import FlatScreen
from visavis.protocol.session.gaze_setup import ON_SCREEN_01, TARGETS, targets_on


@dataclass(frozen=True)
class Shown:
    """A display that is a flat screen."""

    screen: FlatScreen
    place: Pose = field(default_factory=lambda: Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])))


def screen(width_m: float, height_m: float, *, right_m: float = 0.0, up_m: float = 0.0) -> Shown:
    """Return a screen 0.6 m away whose middle is so far to the right and up."""
    return Shown(FlatScreen(width_m, height_m, 1920, 1080, 0.6, right_m, up_m))


WIDE = screen(0.30, 0.20)
"""Its edges are seen 0.25 to the sides and 1/6 up and down, as tangents."""
TALL = screen(0.18, 0.40)
SHIFTED = screen(0.30, 0.40, right_m=0.10)
RAISED = screen(0.60, 0.30, up_m=0.06)


def test_targets_are_7_and_a_half_and_15_degrees_from_the_centre() -> None:
    _, yaw_deg, pitch_deg = zip(*TARGETS, strict=True)
    ahead = -direction_from_yaw_pitch_deg(yaw_deg, pitch_deg)[:, 2]
    away_deg = np.degrees(np.arccos(ahead))
    assert [0.0, *[7.5] * 4, *[15.0] * 4] == pytest.approx(away_deg.tolist(), abs=0.05)


def test_targets_in_a_headset_are_as_they_are() -> None:
    assert TARGETS == targets_on(None)


def test_a_screen_that_shows_every_target_changes_none() -> None:
    # The highest are seen at tan 10.65° / cos 10.65° = 0.1913 up; this edge is at 0.3 · 0.9.
    assert TARGETS == targets_on(screen(0.36, 0.36))


@pytest.mark.parametrize(
    ("share", "shown"),
    [
        # The upper corners are seen at tan 10.65° / cos 10.65° = 0.19134 up, and the edge is at
        # 0.1 / 0.6 = 0.16667, of which nine tenths are 0.15: 0.15 / 0.19134.
        (0.783927, WIDE),
        # They are tan 10.65° = 0.18805 to the side; the edge is at 0.09 / 0.6: 0.135 / 0.18805.
        (0.717901, TALL),
        # The left edge is at 0.05 / 0.6 = 0.08333, the right one far away: 0.075 / 0.18805.
        (0.398834, SHIFTED),
        # The lower edge is at 0.09 / 0.6 = 0.15, the upper one at 0.35: 0.135 / 0.19134.
        (0.705535, RAISED),
    ],
    ids=["low", "narrow", "shifted to the right", "raised"],
)
def test_targets_are_drawn_together_as_far_as_the_nearest_edge_needs(
    share: float, shown: Shown
) -> None:
    for (name, yaw_deg, pitch_deg), target in zip(targets_on(shown), TARGETS, strict=True):
        assert target[0] == name
        expected_deg = [share * target[1], share * target[2]]
        assert expected_deg == pytest.approx([yaw_deg, pitch_deg], abs=1e-5)


@pytest.mark.parametrize("shown", [WIDE, TALL, SHIFTED, RAISED])
def test_every_target_lies_on_the_screen_away_from_its_edges(shown: Shown) -> None:
    _, yaw_deg, pitch_deg = zip(*targets_on(shown), strict=True)
    directions = direction_from_yaw_pitch_deg(yaw_deg, pitch_deg)
    met_m = shown.screen.meets_m(np.zeros((len(directions), 3)), directions)
    assert shown.screen.is_on(met_m).all()
    left_m, right_m, bottom_m, top_m = shown.screen.edges_m()
    assert met_m[:, 0].min() >= ON_SCREEN_01 * left_m
    assert met_m[:, 0].max() <= ON_SCREEN_01 * right_m
    assert met_m[:, 1].min() >= ON_SCREEN_01 * bottom_m
    assert met_m[:, 1].max() <= ON_SCREEN_01 * top_m


def test_targets_stay_straight_ahead_where_a_screen_is_not() -> None:
    beside = screen(0.30, 0.20, right_m=0.40)
    assert {(0.0, 0.0)} == {(yaw_deg, pitch_deg) for _, yaw_deg, pitch_deg in targets_on(beside)}


def test_no_frame_is_missed_while_a_calibration_is_worked_out(tmp_path: Path) -> None:
    recording = perform(lab(tmp_path))

    assert "calibration" in set(recording.events()["name"])
    assert 0 == recording.stream_arrays("frames")["dropped"].sum()
