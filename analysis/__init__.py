"""Functions on arrays, tables and recordings: gaze, quality, statistics, plots, report."""
