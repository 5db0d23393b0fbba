"""FOVE 0."""
