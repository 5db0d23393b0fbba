"""Pupil Labs Core."""
