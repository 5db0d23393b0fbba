"""Under a head that turns, gaze that rests is told from gaze that follows a target."""

from functools import cache

import numpy as np
import pytest

from benchmarks.gaze_detectors.agreement import agreement
from benchmarks.gaze_detectors.worn import Wearing, WornRecording, worn_set
from visavis.analysis.gaze.movements.detect import DETECTOR_NAMES, detect_movements
from visavis.analysis.gaze.movements.head_motion import STILL, without_head
from visavis.analysis.gaze.movements.kinds import Movement, Movements
from visavis.analysis.gaze.movements.parameters import MovementParameters

PEOPLE = 3


@cache
def recordings(wearing: Wearing) -> list[WornRecording]:
    return worn_set(wearing, PEOPLE)


def found(wearing: Wearing, **parameters: str) -> list[Movements]:
    params = MovementParameters(**parameters)  # type: ignore[arg-type]  # a detector's name
    return [
        detect_movements(r.t_ns, r.in_world, params, in_head=r.in_head) for r in recordings(wearing)
    ]


def share_01(wearing: Wearing, events: list[Movements], truth: Movement, called: Movement) -> float:
    """Return the share of samples of a kind that were called another."""
    true = np.concatenate([r.truth.movement for r in recordings(wearing)])
    seen = np.concatenate([e.movement for e in events])
    return float((seen[true == truth] == called).mean())


def counted(wearing: Wearing, events: list[Movements]) -> tuple[float, float]:
    """Return event F1 of fixations, and how many are found for each that there is."""
    of = agreement(
        [r.truth.movement == Movement.FIXATION for r in recordings(wearing)],
        [e.movement == Movement.FIXATION for e in events],
    )
    return of.f1, of.count_ratio


@pytest.mark.parametrize("late_ms", [0.0, 12.0, 30.0])
@pytest.mark.parametrize("noise_deg", [0.1, 0.3, 0.5])
@pytest.mark.parametrize("pursuit_01", [0.0, 0.4])
def test_a_head_that_turns_at_200_deg_s_makes_no_pursuit_of_gaze_that_rests(
    late_ms: float, noise_deg: float, pursuit_01: float
) -> None:
    wearing = Wearing(200.0, noise_deg, late_ms, pursuit_01=pursuit_01)
    events = found(wearing)

    assert share_01(wearing, events, Movement.FIXATION, Movement.PURSUIT) <= 0.05
    f1, ratio = counted(wearing, events)
    assert f1 > 0.95
    assert 0.85 <= ratio <= 1.15
    if pursuit_01:
        assert share_01(wearing, events, Movement.PURSUIT, Movement.PURSUIT) > 0.9


@pytest.mark.parametrize("name", DETECTOR_NAMES)
def test_every_detector_is_told_what_the_head_does(name: str) -> None:
    wearing = Wearing(200.0, 0.1, 30.0, rate_hz=250.0, pursuit_01=0.4)
    events = found(wearing, detector=name)

    assert share_01(wearing, events, Movement.FIXATION, Movement.PURSUIT) <= 0.05


@pytest.mark.parametrize("late_ms", [-20.0, 12.0, 30.0])
def test_how_late_the_eyes_are_is_measured_and_told(late_ms: float) -> None:
    events = found(Wearing(100.0, 0.3, late_ms))

    assert [late_ms] * PEOPLE == pytest.approx([e.eye_late_ms for e in events], abs=2.0)
    assert [0.0] * PEOPLE == pytest.approx([e.slip_01 for e in events], abs=0.02)


def test_eyes_that_are_not_late_are_left_as_they_are() -> None:
    for r in recordings(Wearing(100.0, 0.3)):
        gaze, motion = without_head(r.t_ns, r.in_world, r.in_head)
        assert motion == STILL
        assert gaze is r.in_world


def test_a_still_head_says_nothing_about_late_eyes() -> None:
    assert [0.0] * PEOPLE == [e.eye_late_ms for e in found(Wearing(0.0, 0.3, 30.0))]


def test_eyes_that_compensate_nine_tenths_of_a_turn_rest() -> None:
    wearing = Wearing(150.0, 0.2, vor_gain=0.9)
    events = found(wearing)

    assert [0.1] * PEOPLE == pytest.approx([e.slip_01 for e in events], abs=0.02)
    assert share_01(wearing, events, Movement.FIXATION, Movement.PURSUIT) <= 0.05


def test_gaze_that_follows_with_the_head_is_no_incomplete_compensation() -> None:
    events = found(Wearing(100.0, 0.2, vor_gain=0.5))

    assert [0.0] * PEOPLE == [e.slip_01 for e in events]
    assert np.mean([e.share_01(Movement.PURSUIT) for e in events]) > 0.5


def test_losses_leave_the_rest_as_it_was() -> None:
    wearing = Wearing(200.0, 0.3, 30.0)
    r = recordings(wearing)[0]
    lost = np.random.default_rng(1).uniform(size=len(r.t_ns)) < 0.02
    lost[500:600] = True
    world = np.where(lost[:, None], np.nan, r.in_world)
    zeros = np.where(lost[:, None], 0.0, r.in_head)

    gaze, motion = without_head(r.t_ns, world, zeros)

    assert motion.late_ms == pytest.approx(30.0, abs=2.0)
    assert np.array_equal(np.isnan(gaze).all(axis=1), lost)
