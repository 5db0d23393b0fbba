"""Derive a study from another: only the differences are stated.

For example `study = derive("stare", "my_stare", repetitions=2, parameters={"trial_s": 8})`.
"""

import dataclasses
import inspect
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from visavis.lab.errors import DesignError
from visavis.lab.yaml_lines import did_you_mean
from visavis.study.arguments import new_name
from visavis.study.catalogue import declared_study, is_file
from visavis.study.declaration import PART_OF, Study
from visavis.study.exclusions import Exclusion
from visavis.study.parameters import parameters_in_force

OWN: Final = frozenset({"folder", "path", "plan_folder"})
"""Fields that a derived study does not inherit, and that `derive` does not accept."""


def derive(base: str | Path | Study, name: str, **differs: Any) -> Study:
    """Return a copy of a study with the differences given by name.

    `base` is a study found by its name, by its file (a relative path starts from the file that
    derives), or a `Study`. Everything that a `Study` takes can be given. `parameters` replace
    those of the base by name, levels of its factors among them; `exclusions` may be limits by
    name, such as {"max_trial_lost_01": 0.3}; `texts` names a folder whose texts lie over the
    base's. A trial, an answer or a scene of its own is added as to any study.

    Raises:
        UsageError: there is no such base.
        DesignError: the base cannot be derived from, or has no such keyword.
        ConfigError: a parameter does not exist, or has a wrong value.
    """
    frame = inspect.currentframe()
    caller = None if frame is None else frame.f_back
    file = None if caller is None else caller.f_globals.get("__file__")
    source = base if isinstance(base, Study) else _find_base(base, Path(file or ".").parent)
    possible = ["title", "question", "version", *(name for name in PART_OF if name not in OWN)]
    for keyword in differs:
        if keyword not in possible:
            near = new_name(keyword, possible) or did_you_mean(keyword, possible)
            raise DesignError(f"a study has no {keyword!r} to differ in{near}")
    changes = {
        "texts": None,
        **differs,
    }
    changes |= _parameters(source, changes)
    if isinstance(changes.get("exclusions"), Mapping):
        changes["exclusions"] = _limits(source, changes["exclusions"])
    files = source.files
    return source.with_changes(
        name=name,
        base=source,
        folder=Path(),
        path=None,
        plan_folder=None if "plan_of" in differs else files.plan_folder or files.folder,
        **changes,
    )


def _find_base(base: str | Path, here: Path) -> Study:
    reference = str(base)
    if is_file(reference):
        reference = str(here / reference)
    return declared_study(reference)


def _parameters(source: Study, changed: Mapping[str, Any]) -> dict[str, Any]:
    """Return fields of a study for its parameters, levels of factors and what every study has."""
    overrides = {
        k: list(v) if isinstance(v, tuple) else v for k, v in changed.get("parameters", {}).items()
    }
    if not overrides:
        return {"parameters": dict(source.design.parameters)}
    in_force = parameters_in_force(source, overrides)
    factors = tuple(
        dataclasses.replace(f, levels=tuple(in_force[f.name])) if f.name in in_force else f
        for f in changed.get("factors", source.design.factors)
    )
    return {
        "parameters": {k: in_force[k] for k in source.design.parameters},
        "factors": factors,
        **{
            k: v
            for k, v in in_force.items()
            if k in PART_OF and k not in source.design.parameters and k not in changed
        },
    }


def _limits(source: Study, limits: Mapping[str, float | None]) -> tuple[Exclusion, ...]:
    rules = {rule.name: rule for rule in source.analysis.exclusions}
    for name in limits:
        if name not in rules:
            raise DesignError(f"{source.name} has no rule {name!r}{did_you_mean(name, rules)}")
    return tuple(
        dataclasses.replace(rule, limit=limits[rule.name]) if rule.name in limits else rule
        for rule in source.analysis.exclusions
    )
