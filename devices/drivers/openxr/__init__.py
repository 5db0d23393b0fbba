"""Devices of an OpenXR runtime."""
