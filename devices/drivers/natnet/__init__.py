"""OptiTrack Motive."""
