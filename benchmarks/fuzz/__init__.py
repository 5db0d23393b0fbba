"""Damaged inputs for every reader of a file and every codec of a wire."""
