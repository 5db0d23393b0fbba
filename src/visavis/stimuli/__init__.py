"""Stimuli as pure functions of time: scenes, people's places, movements and gaze."""
