"""Wires that carry bytes, whatever device is at their other end."""
