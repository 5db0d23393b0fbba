"""Scenes of the studies, as geometry."""
