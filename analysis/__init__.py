"""Pure functions on arrays and frames: gaze, quality, statistics, plots, report."""
