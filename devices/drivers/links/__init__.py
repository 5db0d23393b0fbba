"""Wires that carry bytes, for any device at their other end."""
