"""Gestures with and without the whole body: two studies on a page."""
