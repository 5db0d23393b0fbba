"""Eye trackers of USB HID usage page 0x12."""
