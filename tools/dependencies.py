"""Look through what Visavis needs to run, and write its bill of materials.

`python -m tools.dependencies` names packages that are missing or older than asked for, licences
that do not fit ours, and, where pip-audit is installed, versions with known weaknesses; it ends
with 1 where it found anything. `--licences` lists every package with its licence. `--bom FILE`
writes the bill of materials of a release (CycloneDX 1.5).
"""

import argparse
import importlib.util
import json
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement

ROOT = "visavis"
CONSTRAINTS = Path(__file__).resolve().parent.parent / "constraints.txt"
NOT_FITTING = re.compile(r"\b(?:A?GPL|GNU (?:Affero )?General Public)", re.IGNORECASE)
LESSER = re.compile(r"LGPL|Lesser", re.IGNORECASE)
CHOICE = re.compile(r"\bOR\b", re.IGNORECASE)


@dataclass(frozen=True)
class Package:
    """One installed package, with what it needs itself; `licence` is empty where it says none."""

    name: str
    version: str
    licence: str
    needs: tuple[str, ...]


def packages_of(root: str = ROOT) -> tuple[tuple[Package, ...], tuple[str, ...]]:
    """Return every package that is needed to run, by name, and what is wrong with them."""
    found: dict[str, Package] = {}
    problems: list[str] = []
    waiting = [root]
    while waiting:
        name = waiting.pop()
        if _plain(name) in found:
            continue
        distribution = metadata.distribution(name)
        needed = list(_needs(distribution))
        found[_plain(name)] = Package(
            name,
            distribution.version,
            licence_of(distribution.metadata),
            tuple(sorted(_plain(r.name) for r in needed)),
        )
        for requirement in needed:
            problem = _problem(name, requirement)
            problems += [problem] if problem else []
            if problem is None:
                waiting.append(requirement.name)
    packages = tuple(found[name] for name in sorted(found))
    problems += [
        f"{p.name} {p.version} has the licence {p.licence!r}, which does not fit ours"
        for p in packages
        if is_unfit(p.licence)
    ]
    return packages, tuple(problems)


def is_unfit(licence: str) -> bool:
    """Tell a licence that would bind what is built on it; a choice of licences binds nobody."""
    if LESSER.search(licence) or CHOICE.search(licence):
        return False
    return NOT_FITTING.search(licence) is not None


def licence_of(said: Any) -> str:
    """Return a package's licence as its metadata names it, in one line."""
    expression = said.get("License-Expression")
    if expression:
        return str(expression)
    classes = [
        c.rpartition("::")[2].strip()
        for c in said.get_all("Classifier") or ()
        if c.startswith("License ::")
    ]
    text = str(said.get("License") or "").strip().partition("\n")[0]
    return ", ".join(classes) or text


def bill_of_materials(packages: Sequence[Package]) -> dict[str, Any]:
    """Return a CycloneDX bill of what Visavis is made of; the same packages give the same bill."""
    refs = {_plain(p.name): f"pkg:pypi/{_plain(p.name)}@{p.version}" for p in packages}
    own = next(p for p in packages if _plain(p.name) == ROOT)
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {"component": _component(own, refs, "application")},
        "components": [_component(p, refs, "library") for p in packages if p is not own],
        "dependencies": [
            {"ref": refs[_plain(p.name)], "dependsOn": [refs[n] for n in p.needs if n in refs]}
            for p in packages
        ],
    }


def _component(package: Package, refs: Mapping[str, str], kind: str) -> dict[str, Any]:
    ref = refs[_plain(package.name)]
    component: dict[str, Any] = {
        "type": kind,
        "bom-ref": ref,
        "name": package.name,
        "version": package.version,
        "purl": ref,
    }
    if package.licence:
        component["licenses"] = [{"license": {"name": package.licence}}]
    return component


def _needs(distribution: metadata.Distribution) -> Iterator[Requirement]:
    for text in distribution.requires or ():
        requirement = Requirement(text)
        if requirement.marker is None or requirement.marker.evaluate({"extra": ""}):
            yield requirement


def _problem(by: str, requirement: Requirement) -> str | None:
    try:
        version = metadata.version(requirement.name)
    except metadata.PackageNotFoundError:
        return f"{requirement.name} is missing; {by} needs it"
    if not requirement.specifier.contains(version, prereleases=True):
        return f"{requirement.name} is {version}; {by} asks for {requirement.specifier}"
    return None


def _plain(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def known_weaknesses() -> tuple[str, ...] | None:
    """Return what pip-audit says of the tested versions; None where it is not installed."""
    if importlib.util.find_spec("pip_audit") is None:
        return None
    asked = ["-m", "pip_audit", "--no-deps", "--disable-pip", "-r", str(CONSTRAINTS), "-f", "json"]
    done = subprocess.run(  # noqa: S603 - fixed arguments
        [sys.executable, *asked], capture_output=True, text=True, check=False
    )
    if not done.stdout.strip():
        return (f"pip-audit could not ask its database: {done.stderr.strip()[-300:]}",)
    return tuple(
        f"{entry['name']} {entry['version']}: {v['id']}, mended in {', '.join(v['fix_versions'])}"
        for entry in json.loads(done.stdout)["dependencies"]
        for v in entry.get("vulns", ())
    )


def _say(text: str) -> None:
    sys.stdout.write(f"{text}\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Audit, or write the bill; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bom", type=Path, help="write the bill of materials to this file")
    parser.add_argument("--licences", action="store_true", help="list packages and licences")
    chosen = parser.parse_args(arguments)
    packages, problems = packages_of()
    if chosen.licences:
        for package in packages:
            _say(f"{package.name:28}{package.version:14}{package.licence or 'none stated'}")
        return 0
    if chosen.bom is not None:
        text = json.dumps(bill_of_materials(packages), indent=1, ensure_ascii=False)
        chosen.bom.write_text(text + "\n", encoding="utf-8")
        _say(f"{len(packages)} packages in {chosen.bom}")
        return 0
    weaknesses = known_weaknesses()
    for line in (*problems, *(weaknesses or ())):
        _say(line)
    if weaknesses is None:
        _say("known weaknesses were not looked for: pip install pip-audit")
    _say(f"{len(packages)} packages are needed to run; {len(problems)} problems")
    return 1 if problems or weaknesses else 0


if __name__ == "__main__":
    sys.exit(main())
