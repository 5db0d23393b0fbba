"""What can go wrong between the server and a page."""

from visavis.lab.errors import LabError


class PageError(LabError):
    """A page sent what no page of ours sends; nothing of it was taken."""


class OpenElsewhereError(LabError):
    """The session is open in another tab or browser."""
