"""The common part of the drivers of eye and body trackers: states, clocks, rows of gaze."""
