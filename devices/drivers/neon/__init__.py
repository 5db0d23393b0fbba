"""Pupil Labs Neon."""
