"""A locked plan as a page of Markdown, in the order in which registries ask for it."""

from collections.abc import Mapping
from typing import Any

NONE_TEXT = "None."


def markdown(content: Mapping[str, Any], sha256: str) -> str:
    """Return the plan as a readable page, with the sections of a preregistration on OSF."""
    plan, sample = content["plan"], content["sample"]
    comparisons = plan["comparisons"]
    # Exploratory comparisons have a section of their own and no hypothesis.
    confirmatory = {n: c for n, c in comparisons.items() if not c["exploratory"]}
    besides = {n: c for n, c in comparisons.items() if c["exploratory"]}
    before = sample["sessions_before"]
    # Sections come in the order of OSF's form, so that they can be copied one by one.
    parts = [
        f"# {plan['title']}: locked plan",
        f"Study `{plan['study']}`, version {plan['study_version']}. "
        f"Locked {content['locked_at']}. SHA-256 of the plan: `{sha256}`.",
        "## Study information",
        "### Research question",
        plan["question"] or "None stated.",
        "### Hypotheses",
        _list(_hypothesis(n, c) for n, c in confirmatory.items()),
        *_primary(plan),
        "## Design plan",
        "### Blinding",
        "Nobody looks at results before the sample is complete; looking all the same is recorded."
        if content["is_blinded"]
        else "Results are not hidden while the study runs.",
        "### Factors",
        _list(
            f"`{name}` ({'between' if f['between'] else 'within'} participants): "
            f"{', '.join(map(str, f['levels']))}"
            for name, f in plan["factors"].items()
        ),
        "### Parameters",
        _list(f"`{name}`: {value}" for name, value in plan["parameters"].items()),
        "## Sampling plan",
        "### Existing data",
        "No session was recorded before this plan was locked."
        if not before
        else f"{before} sessions were recorded before this plan was locked.",
        "### Sample size and stopping rule",
        f"{sample['participants']} participants. {sample['rule']}".strip(),
        "## Variables",
        "### Measured",
        _list(
            f"`{column}`{_unit(m['unit'])}: {m['words']} ({m['aggregate']} over the trials of a "
            "cell)"
            for column, m in plan["measures"].items()
        ),
        "### Questionnaires",
        _list(f"`{name}`" for name in plan["questionnaires"]),
        "## Analysis plan",
        "### Statistical models",
        _list(
            (
                *(_test(n, c) for n, c in confirmatory.items()),
                *(f"family {n}: {_fields(f)}" for n, f in plan["families"].items()),
                *([f"of all families: {_fields(plan['tests'])}"] if plan["tests"] else []),
            )
        ),
        "### Data exclusion",
        _list(
            f"`{name}`: {r['level']}s whose `{r['column']}` is "
            + ("missing" if r["leaves_out"] == "missing" else f"{r['leaves_out']} {r['limit']}")
            for name, r in plan["exclusions"].items()
            if r["limit"] is not None
        ),
        "### Exploratory analyses",
        _list(_test(n, c) for n, c in besides.items()),
        *_files(plan),
        "## Software",
        _list(f"{name} {value or 'unknown'}" for name, value in plan["versions"].items()),
        f"Seed of the study: {plan['seed']}.",
    ]
    return "\n\n".join(parts) + "\n"


def _files(plan: Mapping[str, Any]) -> list[str]:
    """Return the files that the study shows or asks from; of older plans none."""
    files = plan.get("files")
    if not files:
        return []
    return ["## Files", _list(f"`{name}`: SHA-256 `{digest}`" for name, digest in files.items())]


def _primary(plan: Mapping[str, Any]) -> list[str]:
    """Return the primary claims, apart from which everything is secondary; of older plans none."""
    claims = plan.get("primary")
    if not claims:
        return []
    items = _list(f"{claim} (`{name}`)" for name, claim in claims.items())
    return ["### Primary", f"{items}\n\nEverything else is secondary, and exploratory."]


def _hypothesis(name: str, compare: Mapping[str, Any]) -> str:
    expects = compare.get("expects", "")  # plans of earlier versions have none
    direction = f", expected: {expects}" if expects else ""
    about = f"{compare['claim']} (`{name}`)" if compare["claim"] else f"`{name}` differs"
    return f"{about}{direction}"


def _test(name: str, compare: Mapping[str, Any]) -> str:
    alone = compare["correction"] == "none"
    family = "uncorrected" if alone else f"{compare['correction']} over family {compare['family']}"
    family += ", one-sided" if compare.get("one_sided") else ""
    options = "".join(f", {k} {v}" for k, v in compare["options"].items())
    return f"`{name}`: test {compare['test']}, α = {compare['alpha']:g}, {family}{options}"


def _fields(about: Mapping[str, Any]) -> str:
    return "; ".join(f"{name} {_plain(value)}" for name, value in about.items() if value)


def _plain(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(
            " and ".join(map(str, v)) if isinstance(v, list) else str(v) for v in value
        )
    return str(value)


def _unit(unit: str) -> str:
    return "" if unit in ("", "1") else f" ({unit})"


def _list(lines: Any) -> str:
    return "\n".join(f"- {line}" for line in lines) or NONE_TEXT
