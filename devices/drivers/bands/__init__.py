"""Bands of other makers: they confirm nothing and are timed from this computer."""
