"""Headsets that tests put before the page: one after the standard, and Meta's emulator."""
