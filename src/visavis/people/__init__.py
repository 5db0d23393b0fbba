"""Simulated people: how they look around, how their bodies move, and what they answer.

This package holds the observer with attention, eyes and head, the body with a hand that points, and
the person who performs a study made with the kit. They see only the display and hear the questions,
as people do. Elsewhere: the seated skeleton's motion (`visavis.stimuli.motion`), devices that
measure these bodies (`visavis.devices`), and the people of a single study, which are kept with that
study.
"""
