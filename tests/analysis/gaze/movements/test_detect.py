import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.analysis.gaze.streams import looks, shaken, stamps
from visavis.analysis.gaze.movements.detect import DETECTOR_NAMES, detect_movements
from visavis.analysis.gaze.movements.kinds import Movement, fixations_of
from visavis.analysis.gaze.movements.parameters import AUTO, MovementParameters
from visavis.lab.errors import DataError, UsageError
from visavis.lab.geometry import (
    direction_from_yaw_pitch_deg,
    quat_conjugate,
    quat_from_yaw_pitch_deg,
    rotate,
)

RATE_HZ = 250.0
PLACES_DEG = [(0, 0), (10, 0), (10, 8), (-4, 3), (2, -6), (8, 1)]
RESTS_MS = [500, 300, 800, 250, 400, 600]
DETECTORS = [MovementParameters(detector=name) for name in DETECTOR_NAMES]


def scene(rate_hz=RATE_HZ, noise_deg=0.03, seed=1):
    """Six rests with saccades of 32 ms between them, and white noise."""
    rows = [round(ms * rate_hz / 1000) for ms in RESTS_MS]
    gaze = looks(PLACES_DEG, rows, saccade_rows=max(1, round(0.032 * rate_hz)))
    return stamps(len(gaze), rate_hz), shaken(gaze, noise_deg, np.random.default_rng(seed))


def kinds_of(movements):
    return [Movement(k).name for k in movements.kind]


def still(seconds, rng_seed=3, rate_hz=RATE_HZ):
    n = round(seconds * rate_hz)
    return shaken(
        direction_from_yaw_pitch_deg(np.zeros(n), np.zeros(n)),
        0.03,
        np.random.default_rng(rng_seed),
    )


def gliding(speeds_deg_s, rate_hz=RATE_HZ, seed=4):
    """Gaze that moves right at these speeds, one a sample."""
    yaw = -np.cumsum(np.asarray(speeds_deg_s) / rate_hz)
    return shaken(
        direction_from_yaw_pitch_deg(yaw, np.zeros(len(yaw))), 0.03, np.random.default_rng(seed)
    )


@pytest.mark.parametrize(
    ("name", "rate_hz"),
    [
        ("engbert_kliegl", 120.0),
        ("engbert_kliegl", 250.0),
        ("engbert_kliegl", 500.0),
        ("nystrom_holmqvist", 1000.0),  # made for high rates
        ("nystrom_holmqvist", 500.0),
        ("i2mc", 60.0),
        ("i2mc", 120.0),
        ("i2mc", 500.0),
    ],
)
def test_six_rests_and_the_saccades_between_are_found_within_their_windows(name, rate_hz):
    t, gaze = scene(rate_hz)
    movements = detect_movements(t, gaze, MovementParameters(detector=name))
    rests = fixations_of(movements)
    assert 6 == len(rests)
    near_ms = 30 + 4 * 1000 / rate_hz  # of both ends: half a window more, and two samples each
    assert [pytest.approx(ms, abs=near_ms) for ms in RESTS_MS] == (rests.duration_ns / 1e6).tolist()
    assert 5 == (movements.kind == Movement.SACCADE).sum()
    assert 0 == (movements.kind == Movement.PURSUIT).sum()


@pytest.mark.parametrize("noise_deg", [0.0, 0.1, 0.3])
def test_thresholds_follow_the_noise(noise_deg):
    t, gaze = scene(noise_deg=noise_deg)
    assert 6 == len(fixations_of(detect_movements(t, gaze)))


def test_the_choice_is_told_with_what_was_measured():
    t, gaze = scene()
    fast = detect_movements(t, gaze)
    slow = detect_movements(*scene(30.0))
    assert "engbert_kliegl" == fast.detector
    assert "250 Hz" in fast.why
    assert "i2mc" == slow.detector
    assert "30 Hz" in slow.why
    assert "asked for" == detect_movements(t, gaze, DETECTORS[1]).why


def test_events_are_exactly_the_runs_of_the_samples_kinds():
    t, gaze = scene()
    movements = detect_movements(t, gaze)
    kinds = np.zeros(len(t), np.int8)
    for kind, first, last in zip(
        movements.kind, movements.first_row, movements.last_row, strict=True
    ):
        assert not kinds[first : last + 1].any()
        kinds[first : last + 1] = kind
    assert movements.movement.tolist() == kinds.tolist()
    assert (movements.onset_ns == t[movements.first_row]).all()
    assert (np.diff(movements.onset_ns) >= movements.duration_ns[:-1]).all()


def test_amplitude_and_peak_speed_of_a_saccade_are_those_of_gaze():
    t, gaze = scene()
    movements = detect_movements(t, gaze)
    first = np.flatnonzero(movements.kind == Movement.SACCADE)[0]
    assert 10 == pytest.approx(movements.amplitude_deg[first], abs=1.5)
    assert 10 / 0.036 == pytest.approx(movements.peak_deg_s[first], rel=0.15)


def test_pursuit_is_told_from_fixation_and_can_be_left_out():
    speeds = np.concatenate([np.zeros(200), np.full(250, 12.0), np.zeros(200)])
    gaze = gliding(speeds)
    t = stamps(len(gaze), RATE_HZ)
    movements = detect_movements(t, gaze)
    share = (movements.movement[200:450] == Movement.PURSUIT).mean()
    assert share > 0.85
    assert (movements.movement[:150] == Movement.FIXATION).all()
    assert (movements.movement[-150:] == Movement.FIXATION).all()
    as_published = detect_movements(t, gaze, MovementParameters(pursuit=False))
    assert 0 == (as_published.movement == Movement.PURSUIT).sum()


def test_a_loss_is_bridged_a_blink_or_unknown_by_its_length():
    gaze = still(4.0)
    t = stamps(len(gaze), RATE_HZ)
    for lost_ms, expected in ((40, Movement.FIXATION), (200, Movement.BLINK), (800, 0)):
        hidden = gaze.copy()
        rows = slice(400, 400 + round(lost_ms * RATE_HZ / 1000))
        hidden[rows] = np.nan
        movements = detect_movements(t, hidden)
        assert {int(expected)} == set(movements.movement[rows].tolist())


def test_what_seems_a_saccade_beside_a_blink_is_part_of_it():
    gaze = looks([(0, 0), (0, -6), (0, 0)], [200, 3, 200], saccade_rows=8)
    gaze = shaken(gaze, 0.03, np.random.default_rng(1))
    gaze[205:250] = np.nan
    movements = detect_movements(stamps(len(gaze), RATE_HZ), gaze)
    assert "SACCADE" not in kinds_of(movements)
    assert ["FIXATION", "BLINK", "FIXATION"] == kinds_of(movements)


def test_the_swing_back_after_a_saccade_is_an_oscillation():
    rate = 500.0
    yaw = np.concatenate(
        [np.zeros(300), np.linspace(0, 8.0, 16), np.linspace(7.8, 6.8, 8), np.full(300, 6.8)]
    )
    gaze = shaken(
        direction_from_yaw_pitch_deg(yaw, np.zeros(len(yaw))), 0.01, np.random.default_rng(1)
    )
    movements = detect_movements(stamps(len(gaze), rate), gaze)
    assert ["FIXATION", "SACCADE", "OSCILLATION", "FIXATION"] == kinds_of(movements)


def test_counter_rotation_of_the_eyes_under_a_turning_head_is_fixation():
    n = round(3 * RATE_HZ)
    t = stamps(n, RATE_HZ)
    head_deg = 25 * np.sin(2 * np.pi * 0.8 * t / 1e9)
    world = still(3.0)
    heads = np.array([quat_from_yaw_pitch_deg(deg) for deg in head_deg])
    in_head = rotate(quat_conjugate(heads), world)
    speed = np.abs(np.gradient(head_deg, t / 1e9))
    movements = detect_movements(t, world, in_head=in_head, head_deg_s=speed)
    assert ["FIXATION"] == kinds_of(movements)
    assert movements.head_deg_s[0] == pytest.approx(movements.eye_deg_s[0], rel=0.1)
    assert movements.head_deg_s[0] > 60


def test_a_head_that_turns_fast_with_resting_eyes_is_no_saccade():
    speeds = np.concatenate([np.zeros(300), np.full(40, 90.0), np.zeros(300)])
    world = gliding(speeds)
    n = len(world)
    t = stamps(n, RATE_HZ)
    resting = still(n / RATE_HZ)
    alone = detect_movements(t, world)
    together = detect_movements(t, world, in_head=resting, head_deg_s=speeds)
    assert "SACCADE" in kinds_of(alone)
    assert "SACCADE" not in kinds_of(together)


@given(st.floats(-180, 180), st.integers(0, 2))
@settings(max_examples=15, deadline=None)
def test_turning_the_whole_recording_about_the_vertical_changes_no_event(yaw_deg, which):
    t, gaze = scene()
    turned = rotate(quat_from_yaw_pitch_deg(yaw_deg), gaze)
    a, b = (detect_movements(t, v, DETECTORS[which]) for v in (gaze, turned))
    assert (a.movement != b.movement).mean() < 0.01
    assert len(a) == len(b)


@given(st.integers(0, 10**15))
@settings(max_examples=10, deadline=None)
def test_when_a_recording_began_changes_nothing(start_ns):
    t, gaze = scene()
    assert (
        detect_movements(t, gaze).movement.tolist()
        == detect_movements(t + start_ns, gaze).movement.tolist()
    )


@pytest.mark.parametrize("params", [AUTO, *DETECTORS], ids=lambda p: p.detector)
@pytest.mark.parametrize("n", [0, 1, 2, 300])
def test_nothing_seen_is_no_event_but_a_blink_at_most(params, n):
    movements = detect_movements(stamps(n, RATE_HZ), np.full((n, 3), np.nan), params)
    assert set(kinds_of(movements)) <= {"BLINK"}
    assert n == len(movements.movement)
    assert 0 == len(fixations_of(movements))


@pytest.mark.parametrize("params", [AUTO, *DETECTORS], ids=lambda p: p.detector)
def test_gaze_that_never_moves_is_one_fixation(params):
    gaze = np.tile([0.0, 0.0, -1.0], (500, 1))
    assert ["FIXATION"] == kinds_of(detect_movements(stamps(500, RATE_HZ), gaze, params))


def test_wrong_input_is_refused_with_its_reason():
    t, gaze = scene()
    with pytest.raises(UsageError, match="there are auto, engbert_kliegl"):
        detect_movements(t, gaze, MovementParameters(detector="eyeballing"))  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="do not fit"):
        detect_movements(t, gaze[:-1])
    with pytest.raises(UsageError, match="do not fit"):
        detect_movements(t, gaze, in_head=gaze[:-1])
    with pytest.raises(UsageError, match="head speeds"):
        detect_movements(t, gaze, head_deg_s=np.zeros(3))
    with pytest.raises(DataError, match="row 5"):
        detect_movements(np.where(np.arange(len(t)) == 5, 0, t), gaze)


def test_parameters_list_every_threshold_by_name_without_the_parts():
    params = MovementParameters("i2mc", min_fixation_ms=80.0, nominal_rate_hz=250.0)
    names = list(params.by_name())

    assert ["detector", "windows_ms"] == names[:2]
    assert ["max_saccade_ms", "nominal_rate_hz"] == names[-2:]
    assert 33 == len(names) == len(set(names))
    assert ("i2mc", 80.0, 250.0) == (
        params.by_name()["detector"],
        params.fixations.min_fixation_ms,
        params.nominal_rate_hz,
    )
