"""Tobii Pro eye trackers on a screen, by the maker's SDK."""
