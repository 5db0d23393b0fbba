"""What a study file or a script imports.

A study file declares a `Study` (docs/write-a-study.md); a script opens, simulates and analyses
studies (docs/scripts.md). The names stand in `__init__.pyi`, where type checkers find them. Each is
imported when it is first used, so that a command starts without what it does not need.
"""

from typing import Any

from visavis.public_names import HOMES, STUDY_ROOMS, public_object

__all__ = [name for name, (home, _) in HOMES.items() if home.startswith(STUDY_ROOMS)]


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used."""
    if name not in HOMES:
        raise AttributeError(f"visavis has no {name!r}; it has {', '.join(__dir__())}")
    globals()[name] = public_object(name)
    return globals()[name]


def __dir__() -> list[str]:
    """Return the public names."""
    return sorted(HOMES)
