"""A monitor in the place of a headset."""
