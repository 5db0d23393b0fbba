"""Real devices: codec, transport use and driver; vendor libraries are imported inside open."""
