"""Maps of gaze that `visavis gaze-map` wrote, for a report to show."""

from typing import Final

MAP_NAME: Final = "gaze_map_by"
"""How the names of their files begin."""
