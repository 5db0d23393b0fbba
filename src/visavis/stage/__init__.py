"""Draws a scene, or passes its geometry to viewers; independent of studies."""
