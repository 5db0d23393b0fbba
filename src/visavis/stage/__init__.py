"""Draws a scene, or hands its geometry to whoever watches; knows nothing of studies."""
