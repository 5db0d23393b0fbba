"""Arrays that place things, for card and processor alike: cameras, joints, contact with floors."""
