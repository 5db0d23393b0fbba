"""Simulated people: how they look around, how their bodies move, and what they answer.

Here are the observer with attention, eyes and head, the body with a hand that points, and the
person who performs a study made with the kit. They see what a display shows and hear what is asked,
as people do. Not here: the seated skeleton's motion itself (`visavis.stimuli.motion`), devices that
measure these bodies (`visavis.devices`), and people of one study alone, who stand with that study.
"""
