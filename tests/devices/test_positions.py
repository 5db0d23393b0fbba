"""No position that cannot be one reaches a recording: infinite, or beyond a kilometre."""

import numpy as np
import pytest

from tests.devices.body_rigs import BodyRig, WalkingBody
from tests.devices.test_pupil_codec import binocular, decoded
from visavis.devices.contracts import GAZE, HEAD
from visavis.devices.drivers.lsl.body import LslBody
from visavis.devices.drivers.natnet.driver import NatNet
from visavis.devices.drivers.openxr.spec import OPENXR_HEADSET
from visavis.devices.drivers.runtimes.controllers import ray_batch
from visavis.devices.drivers.runtimes.headset import RuntimeHeadset
from visavis.devices.drivers.streaming.gaze_rays import Eye, gaze_row, rows_to_values
from visavis.devices.drivers.xsens.driver import XsensMvn
from visavis.devices.plausible import are_places, is_place
from visavis.devices.sim.lsl.body import LslBodySimulator
from visavis.devices.sim.natnet import NatNetSimulator
from visavis.devices.sim.xsens import XsensSimulator
from visavis.lab.clock import NS_PER_S, SimClock

NOWHERE = [1000.5, -2e6, 3e38, np.inf, -np.inf, np.nan]
UPRIGHT = (1.0, 0.0, 0.0, 0.0)
WAND = {"Wand": "right_hand"}
TRACKERS = {
    "natnet": (
        lambda body, clock, **kw: NatNetSimulator(body, clock, bodies=WAND, **kw),
        lambda role, wire, clock: NatNet(role, wire, clock, bodies=WAND),
    ),
    "lsl_body": (
        lambda body, clock, **kw: LslBodySimulator(body, clock, bodies=WAND, **kw),
        lambda role, wire, clock: LslBody(role, wire, clock, objects=WAND),
    ),
    "xsens": (XsensSimulator, XsensMvn),
}


class LostBody(WalkingBody):
    """All of it is somewhere else from one second on."""

    far = np.inf

    def segments(self, names, t_ns):
        positions, turns = super().segments(names, t_ns)
        positions[t_ns >= NS_PER_S, :, 1] = self.far
        return positions, turns


def body_stream(tracker, far):
    simulate, drive = TRACKERS[tracker]

    def lost(body, clock, **options):
        body = LostBody()
        body.far = far
        return simulate(body, clock, **options)

    return BodyRig(lost, drive).start().run(1.6)


@pytest.mark.parametrize("far", [1e5, 1e7, np.inf])
@pytest.mark.parametrize("tracker", TRACKERS)
def test_body_tracker_has_no_segment_at_a_place_that_is_none(tracker, far):
    rig = body_stream(tracker, far)
    valid, position_m = rig.column("valid"), rig.column("position_m")
    assert valid[0].all()
    assert not valid[-1].any()
    assert np.isnan(position_m[-1]).all()
    assert np.isnan(rig.column("orientation_wxyz")[-1]).all()
    assert are_places(position_m[valid]).all()
    if far < np.inf:  # what is infinite may look like lost tracking already
        assert "positions that can be none" in rig.messages()


@pytest.mark.parametrize("x", NOWHERE)
def test_ray_of_a_controller_that_is_nowhere_is_not_valid(x):
    rows = ray_batch(0, 0, 0, [((0.0, 1.0, 0.0), UPRIGHT), ((0.0, x, 0.0), UPRIGHT)]).values
    assert rows["valid"].tolist() == [True, False]
    assert np.isnan(rows["position_m"][1]).all()
    assert np.isnan(rows["orientation_wxyz"][1]).all()


@pytest.mark.parametrize("x", NOWHERE)
def test_head_that_is_nowhere_is_not_valid(x):
    class Headset(RuntimeHeadset):
        def _connect(self, deadline_ns):
            pass

        _connect_again = _connect

    kept = []
    clock = SimClock()
    headset = Headset(
        "headset", Silent(), clock, OPENXR_HEADSET, display_rate_hz=90.0, render_size_px=(1, 1)
    )
    headset.open(1.0)
    headset.start(kept.append)
    headset._begin_frame(1, 2, 0, ((0.0, 0.0, x), UPRIGHT))
    headset.poll(0.0)
    (head,) = [batch for batch in kept if batch.schema.fields == HEAD.fields]
    assert not head.values["valid"][0]
    assert np.isnan(head.values["position_m"]).all()


class Silent:
    """A wire on which nothing ever comes."""

    kind, is_simulated = "none", True

    def open(self, deadline_s):
        pass

    def receive(self, timeout_s):
        return ()

    def close(self):
        pass


@pytest.mark.parametrize("x", [1000.5, -2e6, 3e38, np.inf, -np.inf])
def test_gaze_that_starts_nowhere_is_not_valid(x):
    eye = Eye((0.0, 0.0, -1.0), (0.0, x, 0.0), True)
    values = rows_to_values([gaze_row(eye, eye)])
    assert values.dtype == GAZE.dtype
    assert not values["valid"][0]
    assert np.isnan(values["origin_m"]).all()


@pytest.mark.parametrize("x_m", NOWHERE[:-1])
def test_gaze_of_capture_that_starts_nowhere_is_not_valid(x_m):
    centers = {"0": [x_m * 1e3, 0.0, 0.0], "1": [x_m * 1e3, 0.0, 0.0]}
    _, sample = decoded(binocular(eye_centers_3d=centers))
    assert not sample["valid"]
    assert np.isnan(sample["origin_m"]).all()


def test_gaze_may_start_at_a_place_nobody_told():
    eye = Eye((0.0, 0.0, -1.0), (np.nan, np.nan, np.nan), True)
    assert rows_to_values([gaze_row(eye, eye)])["valid"][0]


def test_a_kilometre_away_is_a_place():
    assert is_place(1000.0, -1000.0, 0.0)
    assert are_places(np.array([[1000.0, 0.0, -1000.0], [0.0, 1000.1, 0.0]])).tolist() == [
        True,
        False,
    ]
