"""Errors of characters."""

from visavis.lab.errors import DataError


class CharacterError(DataError):
    """A character's file or figure is unusable; the message names file, bone and next step."""
