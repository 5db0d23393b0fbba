"""Figures of a study: every comparison, families of tests, data quality, who was left out."""
