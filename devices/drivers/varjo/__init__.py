"""Eye trackers in Varjo headsets, through the vendor's native library."""
