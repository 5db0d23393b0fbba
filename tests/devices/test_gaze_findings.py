"""Eyes that are seen too seldom are found in what came with the last polls alone."""

from visavis.devices.drivers.streaming.gaze_findings import SeenEyes


def test_samples_are_counted_over_as_many_polls_as_were_asked_for_and_no_more() -> None:
    seen = SeenEyes(polls=3)
    counts = []
    for samples, left, right in ((5, 5, 0), (7, 1, 7), (2, 2, 1), (4, 0, 0)):
        seen.add(samples, left, right)
        counts.append((seen.samples, seen.left, seen.right))
    assert [(5, 5, 0), (12, 6, 7), (14, 8, 8), (13, 3, 8)] == counts
