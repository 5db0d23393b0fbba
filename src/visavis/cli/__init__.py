"""The composition root: the visavis command, and the only importer of drivers and simulators."""
