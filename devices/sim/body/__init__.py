"""Simulated bodies, and trackers that measure them."""
