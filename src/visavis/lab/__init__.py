"""The vocabulary every other package speaks.

Clock, stream schemas with units, poses, errors, configuration. Imports nothing of ours.
"""
