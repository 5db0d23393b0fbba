"""Eye trackers in Vive Pro Eye headsets, through the vendor's SRanipal library."""
