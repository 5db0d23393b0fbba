"""People differ in what contact does to them as much as the source's tests imply, to both sides."""

import numpy as np
import pytest
from scipy import special, stats

from cli.quick_tracker import tracker_of
from experiments.stare.published import PARTICIPANTS, TESTS
from visavis.looks import DWELL_MS, FIXATION_COUNT
from visavis.observer.temperament import DEFAULT_POPULATION, draw_temperament
from visavis.power import KitPower


def printed_dz(measure: str) -> float:
    """Return the standardised difference of A and D that the printed t implies."""
    t = TESTS["A", "D", measure].statistic
    assert t is not None
    return float(abs(t) / np.sqrt(PARTICIPANTS))


def test_as_many_people_avert_their_eyes_as_normal_differences_imply() -> None:
    rng = np.random.default_rng(0)
    people = [draw_temperament(DEFAULT_POPULATION, rng).constants[0] for _ in range(3000)]
    implied = special.ndtr(-printed_dz(DWELL_MS))
    assert 0.109 == pytest.approx(implied, abs=0.001)
    assert implied == pytest.approx(np.mean([p["hold_s"] < 0 for p in people]), abs=0.03)
    assert implied < np.mean([p["return_gain"] < 1 for p in people]) < 0.25


@pytest.mark.slow
def test_differences_have_the_published_size_and_spread_and_both_signs() -> None:
    rows = KitPower("stare", tracker_of).simulate_people(range(20), effect=1.0, seed=5)
    for measure in (DWELL_MS, FIXATION_COUNT):
        wide = rows.pivot_table(index="participant", columns="condition", values=measure)
        off = (wide["D"] - wide["A"]).to_numpy()
        assert printed_dz(measure) == pytest.approx(off.mean() / off.std(ddof=1), abs=0.35)
        assert 0.02 <= (off < 0).mean() <= 0.3
        assert abs(stats.skew(np.sort(off)[:-1])) < 1.2  # was 2.5 with nobody reversed
