"""Eye contact and its avoidance: shares and durations are those asked for."""

from itertools import pairwise

import numpy as np
import pytest

from visavis.stimuli.gaze.contact import avoiding_looks, contact_looks
from visavis.stimuli.gaze.gaze_plan import LookAt
from visavis.stimuli.motion.errors import MotionError

OBSERVER = LookAt(2.0, "observer")
LONG_S = 20_000.0


def shares(looks: tuple[LookAt, ...]) -> tuple[float, np.ndarray]:
    ends = np.array([look.start_s for look in looks[1:]])
    starts = np.array([look.start_s for look in looks[:-1]])
    met = np.array([look.target == "observer" for look in looks[:-1]])
    lasting = ends - starts
    return float(lasting[met].sum() / lasting.sum()), lasting[met]


@pytest.mark.parametrize("share", [0.2, 0.4, 0.75])
def test_eyes_meet_for_the_share_of_time_asked_for(share: float) -> None:
    looks = contact_looks(np.random.default_rng(1), LONG_S, OBSERVER, looking_01=share)
    got, glances = shares(looks)
    assert got == pytest.approx(share, abs=0.02)
    assert glances.mean() == pytest.approx(3.0, abs=0.1)
    assert glances.min() >= 0.35


def test_who_avoids_contact_glances_shortly_and_seldom() -> None:
    got, glances = shares(avoiding_looks(np.random.default_rng(2), LONG_S, OBSERVER))
    assert got < 0.08
    assert glances.mean() == pytest.approx(0.5, abs=0.03)


def test_looks_begin_where_they_should_and_alternate() -> None:
    looks = contact_looks(np.random.default_rng(3), 60.0, OBSERVER)
    assert looks[0].start_s == 2.0
    assert all(a.target != b.target for a, b in pairwise(looks))
    assert contact_looks(np.random.default_rng(3), 60.0, OBSERVER) == looks


def test_impossible_shares_are_refused() -> None:
    with pytest.raises(MotionError, match="between 0 and 1"):
        contact_looks(np.random.default_rng(3), 60.0, OBSERVER, looking_01=1.0)
