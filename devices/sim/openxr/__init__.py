"""An OpenXR runtime without a headset."""
