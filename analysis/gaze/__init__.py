"""Gaze: areas of interest, looks, fixations, data quality, import of other labs' recordings.

Times are int64 nanoseconds on one clock and are compared as integers; directions are unit
vectors and compared by great-circle angle, so nothing changes at ±180° or near the zenith.
"""
