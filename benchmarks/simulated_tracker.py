"""The tracker of the quick path, by the name benchmarks and tests know it."""

from visavis.cli.quick_tracker import QuickTracker, tracker_of

__all__ = ["QuickTracker", "tracker_of"]
