"""Eyes that are seen too seldom are found in the last samples alone."""

import pytest

from visavis.devices.drivers.streaming.gaze_findings import SeenEyes, eye_faults, recent_samples


def test_samples_are_counted_as_far_back_as_was_asked_for_and_no_farther() -> None:
    eyes = SeenEyes(9)
    counts = []
    for samples, left, right in ((5, 5, 0), (7, 1, 7), (2, 2, 1), (4, 0, 0)):
        eyes.add(samples, left, right)
        counts.append((eyes.samples, eyes.left, eyes.right))
    assert [(5, 5, 0), (12, 6, 7), (9, 3, 8), (13, 3, 8)] == counts


def test_what_comes_at_once_counts_as_what_comes_one_by_one() -> None:
    one_by_one, at_once = SeenEyes(20), SeenEyes(20)
    for _ in range(20):
        one_by_one.add(1, 1, 0)
    at_once.add(60, 60, 60)
    at_once.add(20, 20, 0)
    assert (20, 20, 0) == (one_by_one.samples, one_by_one.left, one_by_one.right)
    assert (20, 20, 0) == (at_once.samples, at_once.left, at_once.right)


@pytest.mark.parametrize("rate_hz", [0.0, 4.0])
def test_a_slow_tracker_or_one_of_no_known_rate_tells_of_a_lost_eye_too(rate_hz: float) -> None:
    eyes = SeenEyes(recent_samples(rate_hz))
    for _ in range(30):
        eyes.add(1, 1, 0)
    (fault,) = eye_faults("eye_tracker", eyes)
    assert "the right eye is not seen" == fault.message
