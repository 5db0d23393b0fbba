"""What Visavis needs to run: complete, with licences that fit, in a bill of materials."""

import json
from email.message import Message
from pathlib import Path

import pytest

from tools.dependencies import bill_of_materials, is_unfit, licence_of, main, packages_of


def test_everything_that_is_needed_is_there_and_fits() -> None:
    packages, problems = packages_of()
    assert () == problems
    assert {"visavis", "numpy", "pydantic", "pydantic_core"} <= {
        p.name.lower().replace("-", "_") for p in packages
    }
    assert "pytest" not in {p.name for p in packages}


@pytest.mark.parametrize(
    ("licence", "unfit"),
    [
        ("GPL-3.0-only", True),
        ("GNU Affero General Public License v3", True),
        ("GNU Lesser General Public License v3 (LGPLv3)", False),
        ("LGPL-2.1-or-later", False),
        ("MIT OR GPL-2.0", False),
        ("BSD-3-Clause", False),
    ],
)
def test_licences_that_would_bind_users_are_named(licence: str, unfit: bool) -> None:
    assert unfit == is_unfit(licence)


def test_a_licence_is_its_expression_else_its_class_else_the_first_line() -> None:
    said = Message()
    said["License"] = "Free to use\nand more"
    assert "Free to use" == licence_of(said)
    said["Classifier"] = "License :: OSI Approved :: MIT License"
    assert "MIT License" == licence_of(said)
    said["License-Expression"] = "MIT"
    assert "MIT" == licence_of(said)


def test_the_bill_names_every_package_and_what_it_needs(tmp_path: Path) -> None:
    path = tmp_path / "bom.json"
    assert 0 == main(["--bom", str(path)])
    bill = json.loads(path.read_text("utf-8"))
    packages, _ = packages_of()
    assert bill_of_materials(packages) == bill
    assert "visavis" == bill["metadata"]["component"]["name"]
    assert len(packages) - 1 == len(bill["components"])
    known = {c["bom-ref"] for c in (*bill["components"], bill["metadata"]["component"])}
    assert all(set(d["dependsOn"]) <= known for d in bill["dependencies"])
    assert any("numpy" in ref for d in bill["dependencies"] for ref in d["dependsOn"])


def test_licences_are_listed_a_package_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert 0 == main(["--licences"])
    lines = capsys.readouterr().out.splitlines()
    packages, _ = packages_of()
    assert [p.name for p in packages] == [line.split()[0] for line in lines]
    assert all(len(line.split()) >= 3 for line in lines)
