"""Stare in the crowd (after Raimbaud et al. 2022)."""
