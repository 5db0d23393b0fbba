"""What a study file or a script imports.

A study file declares a `Study` (docs/write-a-study.md); a script opens, simulates and analyses
studies (docs/scripts.md). Names are imported when they are first used, so that a command starts
without what it does not need.
"""

import importlib
import importlib.util
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from analysis import collisions as collisions
    from analysis import gaze as gaze
    from analysis import statistics as statistics
    from analysis.statistics_report import Question as Question
    from analysis.statistics_report import answer as answer
    from protocol.design import Factor as Factor
    from protocol.orders import never_next_to as never_next_to
    from protocol.orders import no_more_than as no_more_than
    from protocol.parameters import Within as Within
    from stimuli.sound import Sound as Sound
    from visavis.analysis import Conclusion as Conclusion
    from visavis.careless import Careless as Careless
    from visavis.compare import Compare as Compare
    from visavis.confusion import Confusion as Confusion
    from visavis.deriving import derive as derive
    from visavis.exclusions import COMPLETENESS_RULES as COMPLETENESS_RULES
    from visavis.exclusions import STANDARD_RULES as STANDARD_RULES
    from visavis.exclusions import Exclusion as Exclusion
    from visavis.films import Directed as Directed
    from visavis.films import Film as Film
    from visavis.films import Following as Following
    from visavis.films import Lens as Lens
    from visavis.films import Pair as Pair
    from visavis.looks import LooksOn as LooksOn
    from visavis.measures import Measure as Measure
    from visavis.measures import TrialRecord as TrialRecord
    from visavis.measures import column as column
    from visavis.measures import dwell_on as dwell_on
    from visavis.measures import first_fixation_on as first_fixation_on
    from visavis.measures import fixations_on as fixations_on
    from visavis.pairs import Correlate as Correlate
    from visavis.pairs import Pairs as Pairs
    from visavis.pairs import Printed as Printed
    from visavis.person import Seen as Seen
    from visavis.person import unopinionated as unopinionated
    from visavis.pieces import MeasuredTrial as MeasuredTrial
    from visavis.pieces import Pieces as Pieces
    from visavis.responses import Choice as Choice
    from visavis.responses import Keys as Keys
    from visavis.responses import Number as Number
    from visavis.responses import Pointing as Pointing
    from visavis.responses import Rating as Rating
    from visavis.responses import SideBySide as SideBySide
    from visavis.responses import Text as Text
    from visavis.scenes import Scene as Scene
    from visavis.scenes import Staging as Staging
    from visavis.scripts import Session as Session
    from visavis.scripts import StudyData as StudyData
    from visavis.scripts import analyse as analyse
    from visavis.scripts import open_study as open_study
    from visavis.scripts import simulate as simulate
    from visavis.scripts import tables as tables
    from visavis.study import Source as Source
    from visavis.study import Study as Study

_NAMES = {
    "analysis.statistics_report": ("Question", "answer"),
    "protocol.design": ("Factor",),
    "protocol.orders": ("never_next_to", "no_more_than"),
    "protocol.parameters": ("Within",),
    "stimuli.sound": ("Sound",),
    "visavis.analysis": ("Conclusion",),
    "visavis.careless": ("Careless",),
    "visavis.compare": ("Compare",),
    "visavis.confusion": ("Confusion",),
    "visavis.deriving": ("derive",),
    "visavis.exclusions": ("COMPLETENESS_RULES", "STANDARD_RULES", "Exclusion"),
    "visavis.films": ("Directed", "Film", "Following", "Lens", "Pair", "Placed"),
    "visavis.looks": ("LooksOn",),
    "visavis.measures": (
        "Measure", "TrialRecord", "column", "dwell_on", "first_fixation_on", "fixations_on",
    ),
    "visavis.pairs": ("Correlate", "Pairs", "Printed"),
    "visavis.pieces": ("MeasuredTrial", "Pieces"),
    "visavis.person": ("Seen", "unopinionated"),
    "visavis.responses": (
        "Choice", "Keys", "Number", "Pointing", "Rating", "SideBySide", "Text",
    ),
    "visavis.scenes": ("Scene", "Staging"),
    "visavis.scripts": ("Session", "StudyData", "analyse", "open_study", "simulate", "tables"),
    "visavis.study": ("Source", "Study"),
}  # fmt: skip
_MODULES = {name: f"analysis.{name}" for name in ("collisions", "gaze", "statistics")}
_HOMES = {name: module for module, names in _NAMES.items() for name in names}
_PACKAGES = ("analysis", "devices", "lab", "protocol", "recording", "stage", "stimuli")


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used."""
    if name in _MODULES:
        found = importlib.import_module(_MODULES[name])
    elif name in _HOMES:
        found = getattr(importlib.import_module(_HOMES[name]), name)
    else:
        raise AttributeError(f"visavis has no {name!r}; it has {', '.join(__dir__())}")
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    """Return the public names."""
    return sorted((*_HOMES, *_MODULES))


def _refuse_hidden_packages() -> None:
    """Say which folder hides a package of ours, instead of failing somewhere inside.

    Raises:
        ImportError: a folder or module of that name comes first on the path.
    """
    home = Path(__file__).resolve().parent.parent
    for name in _PACKAGES:
        spec = importlib.util.find_spec(name)
        found = list((spec and spec.submodule_search_locations) or ())
        for place in [Path(f).resolve() for f in found] or [Path((spec and spec.origin) or home)]:
            if place not in (home / name, home):
                raise ImportError(
                    f"{place} hides the package {name!r} of Visavis; rename that folder or file "
                    "of yours, or run from another folder (python -P leaves the current one out)"
                )


_refuse_hidden_packages()
