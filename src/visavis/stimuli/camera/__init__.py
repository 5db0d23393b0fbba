"""A camera that films somebody in a place it knows: tracks, choice of shots, cuts, motion."""
