"""Blinks in the pupil signal: as many as were made, with the lid's edges, at any unit and rate."""

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.analysis.gaze.streams import stamps
from visavis.analysis.gaze.pupil_blinks import PUPIL_BLINKS, pupil_blinks
from visavis.lab.errors import UsageError

Array = npt.NDArray[np.float64]


def blinking(
    rate_hz: float, onsets_ms: list[float], losses_ms: list[float], *, unit: float = 1.0
) -> tuple[npt.NDArray[np.int64], Array]:
    """A pupil that drifts slowly; the lid takes 40 ms to close and 60 ms to open."""
    rng = np.random.default_rng(1)
    t_ns = stamps(round(20 * rate_hz), rate_hz)
    t_ms = t_ns / 1e6
    size = 3.5 + 0.2 * np.sin(t_ms / 3000) + rng.normal(0, 0.002, len(t_ms))
    for onset, loss in zip(onsets_ms, losses_ms, strict=True):
        closing = (t_ms >= onset) & (t_ms < onset + 40)
        opening = (t_ms >= onset + 40 + loss) & (t_ms < onset + 100 + loss)
        size[closing] *= 1 - 0.6 * (t_ms[closing] - onset) / 40
        size[opening] *= 0.4 + 0.6 * (t_ms[opening] - onset - 40 - loss) / 60
        size[(t_ms >= onset + 40) & (t_ms < onset + 40 + loss)] = np.nan
    return t_ns, size * unit


@settings(max_examples=40, deadline=None)
@given(
    rate_hz=st.sampled_from([60.0, 120.0, 250.0, 500.0, 1000.0]),
    losses_ms=st.lists(st.floats(40, 450), min_size=1, max_size=8),
    unit=st.sampled_from([1.0, 1000.0, 250.0]),
    zero=st.booleans(),
)
def test_as_many_blinks_as_were_made_with_their_edges(
    rate_hz: float, losses_ms: list[float], unit: float, zero: bool
) -> None:
    onsets_ms = [1500.0 + 2100 * k for k in range(len(losses_ms))]
    t_ns, size = blinking(rate_hz, onsets_ms, losses_ms, unit=unit)
    blinks = pupil_blinks(t_ns, np.nan_to_num(size) if zero else size)
    assert (len(losses_ms), 0) == (len(blinks), blinks.losses)
    step_ms = 1000 / rate_hz
    # Half the window of smoothing, and the samples' noise that goes on in the lid's direction by
    # chance: three samples in a row in one of 24 edges, five in one of 720.
    off_ms = 15 + 5 * step_ms
    np.testing.assert_allclose(blinks.onset_ns / 1e6, onsets_ms, atol=off_ms)
    ends_ms = [on + 100 + loss for on, loss in zip(onsets_ms, losses_ms, strict=True)]
    np.testing.assert_allclose(blinks.offset_ns / 1e6, ends_ms, atol=off_ms)
    np.testing.assert_allclose(blinks.loss_ms, losses_ms, atol=1.01 * step_ms)


def test_a_pupil_that_widens_beside_a_blink_is_no_part_of_it() -> None:
    """Drift and noise went on in the lid's direction for 83 ms."""
    for rate_hz in (60.0, 120.0, 250.0):
        onsets_ms = [1500.0 + 700 * k for k in range(20)]
        t_ns, size = blinking(rate_hz, onsets_ms, [100.0] * 20)
        blinks = pupil_blinks(t_ns, size)
        off_ms = 15 + 3 * 1000 / rate_hz
        np.testing.assert_allclose(blinks.onset_ns / 1e6, onsets_ms, atol=off_ms)
        np.testing.assert_allclose(blinks.offset_ns / 1e6, np.add(onsets_ms, 200), atol=off_ms)


def test_a_flicker_and_a_tracker_that_lost_the_eye_are_no_blinks() -> None:
    t_ns, size = blinking(250, [2000.0, 6000.0], [200.0, 1500.0])
    size[3000:3002] = np.nan
    blinks = pupil_blinks(t_ns, size)
    assert (1, 1) == (len(blinks), blinks.losses)


def test_two_losses_within_a_tenth_of_a_second_are_one_blink() -> None:
    t_ns, size = blinking(500, [3000.0], [80.0])
    at = np.searchsorted(t_ns, 3_060_000_000)
    size[at : at + 8] = 1.6  # the lid lets the pupil through for 16 ms
    assert 1 == len(pupil_blinks(t_ns, size))


def test_rows_that_a_tracker_leaves_out_are_a_loss_too() -> None:
    t_ns, size = blinking(120, [3000.0, 9000.0], [150.0, 200.0])
    is_there = np.isfinite(size)
    there = pupil_blinks(t_ns[is_there], size[is_there])
    assert pupil_blinks(t_ns, size).onset_ns.tolist() == there.onset_ns.tolist()


def test_an_eye_that_never_blinks_or_was_never_seen_has_no_blink() -> None:
    t_ns, size = blinking(120, [], [])
    assert 0 == len(pupil_blinks(t_ns, size))
    assert (0, 0) == (len(b := pupil_blinks(t_ns, np.full(len(size), np.nan))), b.losses)
    assert 0 == len(pupil_blinks(t_ns[:0], size[:0]))
    with pytest.raises(UsageError, match="does not fit"):
        pupil_blinks(t_ns, size[:-1])
    with pytest.raises(UsageError, match="repeat or go back"):
        pupil_blinks(t_ns[::-1], size, PUPIL_BLINKS)
