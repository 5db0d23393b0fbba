"""Perform, simulate and analyse whole sessions and studies: what commands and scripts both do."""
