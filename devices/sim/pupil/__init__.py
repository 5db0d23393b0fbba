"""Pupil Capture."""
