"""A plan locked before the data are looked at: what it freezes, and deviations from it."""
