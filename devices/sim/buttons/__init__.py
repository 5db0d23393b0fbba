"""Keyboards, button boxes and gamepads whose buttons a simulated body presses."""
