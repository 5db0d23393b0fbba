"""What a study file or a script imports.

A study file declares a `Study`; see docs/write-a-study.md. Names are imported when they are first
used, so that a command starts without what it does not need.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from protocol.design import Factor
    from protocol.orders import never_next_to, no_more_than
    from visavis.compare import Compare, Published
    from visavis.deriving import derive
    from visavis.exclusions import STANDARD_RULES, Exclusion
    from visavis.measures import (
        Measure,
        TrialRecord,
        column,
        dwell_on,
        first_fixation_on,
        fixations_on,
    )
    from visavis.person import Seen, unopinionated
    from visavis.responses import Choice, Keys, Number, Pointing, Rating, SideBySide, Text
    from visavis.scenes import Scene, Staging
    from visavis.study import Source, Study

_HOMES = {
    "Factor": "protocol.design",
    "never_next_to": "protocol.orders",
    "no_more_than": "protocol.orders",
    "Compare": "visavis.compare",
    "Published": "visavis.compare",
    "derive": "visavis.deriving",
    "STANDARD_RULES": "visavis.exclusions",
    "Exclusion": "visavis.exclusions",
    "Measure": "visavis.measures",
    "TrialRecord": "visavis.measures",
    "column": "visavis.measures",
    "dwell_on": "visavis.measures",
    "first_fixation_on": "visavis.measures",
    "fixations_on": "visavis.measures",
    "Seen": "visavis.person",
    "unopinionated": "visavis.person",
    "Choice": "visavis.responses",
    "Keys": "visavis.responses",
    "Number": "visavis.responses",
    "Pointing": "visavis.responses",
    "Rating": "visavis.responses",
    "SideBySide": "visavis.responses",
    "Text": "visavis.responses",
    "Scene": "visavis.scenes",
    "Staging": "visavis.scenes",
    "Source": "visavis.study",
    "Study": "visavis.study",
}

__all__ = [
    "STANDARD_RULES",
    "Choice",
    "Compare",
    "Exclusion",
    "Factor",
    "Keys",
    "Measure",
    "Number",
    "Pointing",
    "Published",
    "Rating",
    "Scene",
    "Seen",
    "SideBySide",
    "Source",
    "Staging",
    "Study",
    "Text",
    "TrialRecord",
    "column",
    "derive",
    "dwell_on",
    "first_fixation_on",
    "fixations_on",
    "never_next_to",
    "no_more_than",
    "unopinionated",
]


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used."""
    if name not in _HOMES:
        raise AttributeError(f"visavis has no {name!r}; it has {', '.join(__all__)}")
    found = getattr(importlib.import_module(_HOMES[name]), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    """Return the public names."""
    return sorted(__all__)
