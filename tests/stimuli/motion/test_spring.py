"""The spring against its differential equation, its published figures and other step sizes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.spring import Spring


@settings(max_examples=20, deadline=None)
@given(
    st.floats(0.5, 20),
    st.sampled_from([0.0, 0.3, 0.99, 1.0, 1.01, 3.0]),
    st.floats(-2, 2),
    st.floats(-5, 5),
)
def test_spring_solves_its_equation(omega: float, zeta: float, x0: float, v0: float) -> None:
    t = np.linspace(0, 2, 9)
    solved = solve_ivp(
        lambda _, y: [y[1], -2 * zeta * omega * y[1] - omega**2 * y[0]],
        (0, 2), [x0, v0], t_eval=t, rtol=1e-10, atol=1e-12,
    )  # fmt: skip

    x, v = Spring(omega, zeta, 1.0).at(t, x0, v0)

    assert np.abs(solved.y[0] - x).max() < 1e-6
    assert np.abs(solved.y[1] - v).max() < 1e-5


def test_published_spring_overshoots_by_4_60_percent_at_0_628_s() -> None:
    t = np.linspace(0, 3, 300001)

    x, _ = Spring().at(t)

    assert pytest.approx(1.0460, abs=5e-5) == (1 - x).max()
    assert pytest.approx(0.628, abs=5e-4) == t[np.argmin(x)]
    assert 1.0 == x[0]


@pytest.mark.parametrize("zeta", [0.2, 0.7, 1.0, 2.0])
def test_steps_at_30_60_and_90_hz_end_at_the_same_place(zeta: float) -> None:
    spring = Spring(zeta=zeta)
    ends = []
    for rate_hz in (30, 60, 90):
        x, v = np.array(1.0), np.array(0.5)
        for _ in range(2 * rate_hz):
            x, v = spring.at(1 / rate_hz, x, v)
        ends.append(x)

    assert pytest.approx(float(ends[0]), abs=1e-12) == float(ends[1])
    assert pytest.approx(float(ends[0]), abs=1e-12) == float(ends[2])


def test_stiff_overdamped_spring_comes_to_rest_without_overflow() -> None:
    x, v = Spring(1e4, 50.0, 1.0).at([1e3, 1e6])

    assert [0.0, 0.0] == x.tolist()
    assert [0.0, 0.0] == v.tolist()


@pytest.mark.parametrize("bad", [{"omega_rad_s": 0.0}, {"zeta": -0.1}, {"time_scale": np.nan}])
def test_spring_that_does_not_pull_is_refused(bad: dict[str, float]) -> None:
    with pytest.raises(MotionError, match="omega"):
        Spring(**bad)
