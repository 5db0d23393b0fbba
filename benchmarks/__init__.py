"""Figures a reader can print again: run as python -m benchmarks.NAME [--json]."""
