"""Triggers out: marks of the session as codes on lines that an amplifier records."""
