"""What the drivers of eye and body trackers share: life, clocks, rows of gaze."""
