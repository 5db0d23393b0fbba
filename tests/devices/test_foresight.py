"""Simulated headsets foresee the head as runtimes do, with the error that foreseeing makes."""

import numpy as np
import pytest

from tests.devices.bodies import FixatingBody
from visavis.devices.sim.body.headset import SimulatedHeadset
from visavis.devices.sim.foresight import Foresight
from visavis.lab.clock import NS_PER_MS, SimClock
from visavis.lab.geometry import angle_deg, quat_from_yaw_pitch_deg, rotate

AHEAD = np.array([0.0, 0.0, -1.0])
FRAME_NS = 11 * NS_PER_MS


class Turning(FixatingBody):
    """A head whose yaw in degrees is a function of seconds; asked for no time before the last."""

    def __init__(self, yaw_deg):
        super().__init__()
        self._yaw_deg = yaw_deg
        self._asked_ns = 0

    def head(self, t_ns):
        assert t_ns >= self._asked_ns, "the body is asked for a time before the last one"
        self._asked_ns = t_ns
        return np.array([0.0, 1.2, 0.0]), quat_from_yaw_pitch_deg(self._yaw_deg(t_ns * 1e-9))


def error_deg(yaw_deg, look_ahead_ms, frames=20):
    """Return by how much the last of some frames is foreseen wrongly."""
    foresight = Foresight(Turning(yaw_deg))
    for k in range(frames):
        now_ns = k * FRAME_NS
        light_ns = now_ns + look_ahead_ms * NS_PER_MS
        _, turn = foresight.at(now_ns, light_ns)
    truth = quat_from_yaw_pitch_deg(yaw_deg(light_ns * 1e-9))
    return float(angle_deg(rotate(turn, AHEAD), rotate(truth, AHEAD)))


@pytest.mark.parametrize("look_ahead_ms", [0, 11, 22, 60])
def test_a_head_that_turns_steadily_is_foreseen_exactly(look_ahead_ms):
    assert error_deg(lambda s: 150 * s, look_ahead_ms) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("look_ahead_ms", [11, 22, 60])
def test_acceleration_is_not_foreseen(look_ahead_ms):
    a_deg_s2, ahead_s, between_s = 200.0, look_ahead_ms * 1e-3, FRAME_NS * 1e-9
    expected = a_deg_s2 * (ahead_s**2 + ahead_s * between_s) / 2
    assert error_deg(lambda s: a_deg_s2 * s * s / 2, look_ahead_ms) == pytest.approx(expected)


def test_a_head_that_was_put_elsewhere_did_not_move_there():
    assert error_deg(lambda s: 90.0 * (s > 0.2), 60, frames=20) == pytest.approx(0.0, abs=1e-6)


def test_the_past_is_interpolated_between_measurements():
    foresight = Foresight(Turning(lambda s: 100 * s))
    for k in range(3):
        foresight.at(k * FRAME_NS, k * FRAME_NS)
    _, turn = foresight.at(2 * FRAME_NS, FRAME_NS + FRAME_NS // 2)
    expected = quat_from_yaw_pitch_deg(100 * 1.5 * FRAME_NS * 1e-9)
    assert turn == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(("look_ahead_ms", "expected_ms"), [(None, 1000 / 90), (60.0, 60.0)])
def test_the_poses_of_a_simulated_headset_have_the_times_they_describe(look_ahead_ms, expected_ms):
    got = []
    body = Turning(lambda s: 120 * s)
    headset = SimulatedHeadset("headset", body, SimClock(), look_ahead_ms=look_ahead_ms)
    headset.open(1.0)
    headset.start(got.append)
    frames = [headset.wait_frame() for _ in range(10)]
    headset.poll(0.0)
    (foreseen,) = (b for b in got if b.schema.name == "head")
    (measured,) = (b for b in got if b.schema.name == "head_measured")
    assert [f.predicted_display_ns for f in frames] == foreseen.t_device_ns.tolist()
    assert [f.t_ns for f in frames] == foreseen.t_host_ns.tolist()
    assert [f.t_ns for f in frames] == measured.t_device_ns.tolist()
    ahead_ms = (foreseen.t_device_ns - foreseen.t_host_ns) / NS_PER_MS
    assert ahead_ms == pytest.approx(expected_ms, abs=1e-3)
    for batch in (foreseen, measured):
        turns = np.array([quat_from_yaw_pitch_deg(120e-9 * t) for t in batch.t_device_ns])
        assert batch.values["orientation_wxyz"][1:] == pytest.approx(turns[1:], abs=1e-6)


def test_both_poses_of_a_frame_are_those_asked_for_one_by_one():
    single, both = (Foresight(Turning(lambda s: 100 * s + 40 * s * s)) for _ in range(2))
    for k in range(30):
        now_ns = k * FRAME_NS
        times_ns = (now_ns, now_ns + (k % 4) * FRAME_NS)
        one_by_one = [np.concatenate(single.at(now_ns, t_ns)) for t_ns in times_ns]
        assert np.array(one_by_one, np.float32).tobytes() == both.at_once(*times_ns).tobytes()
