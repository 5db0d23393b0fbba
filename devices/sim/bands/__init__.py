"""Bands of other makers."""
