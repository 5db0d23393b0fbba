import ast
from pathlib import Path

import pytest

from benchmarks.import_graph import (
    SourceFile,
    circles,
    deferred_statements,
    imports_within,
    read_package,
)
from benchmarks.source_lines import (
    bindings,
    count,
    count_comment_lines,
    dataclass_fields,
    functions_of_many_parameters,
    is_bare_participle,
    rows,
)


def tree(folder: Path, files: dict[str, str]) -> Path:
    """Write a package `kit` and return its folder."""
    for name, text in files.items():
        path = folder / "kit" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return folder / "kit"


def imports_of(folder: Path, files: dict[str, str]) -> list[tuple[str, str, bool]]:
    imports = imports_within(read_package(tree(folder, files)))
    return sorted((each.source, each.target, each.is_deferred) for each in imports)


def module(text: str) -> dict[str, SourceFile]:
    return {"kit.one": SourceFile("kit.one", Path("kit/one.py"), text, ast.parse(text))}


def test_imports_are_seen_under_type_checking_and_in_functions_too(tmp_path):
    expected = [
        ("kit.a", "kit.b", False),
        ("kit.b", "kit.c", False),
        ("kit.c", "kit.room.inner", True),
        ("kit.room.inner", "kit.a", False),
        ("kit.room.inner", "kit.room", False),
    ]
    files = {
        "a.py": "from kit.b import name\nimport os\n",
        "b.py": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from kit import c\n",
        "c.py": "class A:\n    def f(self):\n        import kit.room.inner\n",
        "room/__init__.py": "door = 1\n",
        "room/inner.py": "from .. import a\nfrom . import door\nfrom elsewhere import kit\n",
    }
    assert imports_of(tmp_path, files) == expected


def test_an_import_by_a_written_name_counts(tmp_path):
    files = {
        "a.py": "def f(part):\n    import_module('kit.b')\n    importlib.import_module(part)\n",
        "b.py": "say('kit.a')\n",
    }
    assert imports_of(tmp_path, files) == [("kit.a", "kit.b", True)]


def test_a_folder_that_two_links_lead_to_is_read_once(tmp_path):
    room = tmp_path / "room"
    room.mkdir()
    (room / "one.py").write_text("")
    package = tree(tmp_path, {"two.py": ""})
    for name in ("room", "twin"):
        (package / name).symlink_to(room, target_is_directory=True)
    (room / "around").symlink_to(room, target_is_directory=True)
    assert list(read_package(package)) == ["kit.room.one", "kit.two"]


def test_a_circle_is_every_module_that_leads_back_to_itself(tmp_path):
    files = {
        "a.py": "import kit.b",
        "b.py": "def f():\n    import kit.c",
        "c.py": "import kit.a, kit.d",  # d is reached, but leads nowhere
        "d.py": "",
        "e.py": "import kit.f, kit.a",
        "f.py": "import kit.e",
    }
    imports = imports_within(read_package(tree(tmp_path, files)))
    assert circles(imports) == [["kit.a", "kit.b", "kit.c"], ["kit.e", "kit.f"]]


def test_a_deferred_statement_of_two_names_counts_once(tmp_path):
    files = {
        "a.py": "def f():\n    from kit import b, c\n    def g():\n        import kit.b\n",
        "b.py": "import kit.c",
        "c.py": "",
    }
    assert deferred_statements(imports_within(read_package(tree(tmp_path, files)))) == 2


def test_every_place_that_binds_a_name_counts():
    text = (
        "a = 1\nb: int = 2\nc += 1\nfor d in e: pass\nwith open(f) as g: pass\n"
        "def h(i, *j, k=1, **m): self.n = [o for o in p]\n"
        "class Q:\n    r: int\ntry: pass\nexcept E as s: pass\nimport t\n(u := 1)\n"
    )
    names = sorted(binding.name for binding in bindings(module(text)["kit.one"]))
    assert names == list("Qabcdghijkmnorsu")


@pytest.mark.parametrize("name", ["told", "_known", "asked", "GIVEN", "Shown", "_wanted"])
def test_a_participle_alone_is_bare(name):
    assert is_bare_participle(name)


@pytest.mark.parametrize(
    "name", ["told_lines", "seed", "speed", "sorted", "calibrated", "SessionAborted", "left", "_"]
)
def test_nouns_terms_and_compounds_are_no_bare_participles(name):
    assert not is_bare_participle(name)


def test_fields_are_counted_with_those_of_the_dataclasses_that_one_extends(tmp_path):
    files = {
        "a.py": "@dataclass(frozen=True)\nclass Base:\n    x: int\n    y: ClassVar[int] = 1\n",
        "b.py": (
            "from kit.a import Base\n"
            "@dataclass\nclass Part(Base):\n    x: float\n    z: int = 0\n"
            "class Plain:\n    w: int\n"
        ),
    }
    expected = {"kit.a.Base": 1, "kit.b.Part": 2}
    assert dataclass_fields(read_package(tree(tmp_path, files))) == expected


PARTS = (
    "@dataclass\nclass Walls:\n    height_m: int\n    colour: str\n"
    "@dataclass\nclass _Keywords(Walls):\n    name: str\n"
    "class House:\n    @takes_keywords_of(_Keywords)\n    def __init__(self, name): ...\n"
)


def test_a_signature_has_no_fields_of_its_own(tmp_path):
    files = {"a.py": PARTS}
    assert dataclass_fields(read_package(tree(tmp_path, files))) == {"kit.a.Walls": 2}


@pytest.mark.parametrize(
    "files",
    [
        {"a.py": PARTS + "given = _Keywords(2, 'red', 'barn')\n"},
        {"a.py": PARTS, "b.py": "from kit.a import _Keywords\n"},
        {"a.py": PARTS + "def build(keywords: _Keywords): ...\n"},
        {"a.py": PARTS.replace("    @takes_keywords_of(_Keywords)\n", "")},
    ],
    ids=["made", "imported", "passed on", "no signature"],
)
def test_a_signature_that_serves_for_more_is_counted(tmp_path, files):
    expected = {"kit.a.Walls": 2, "kit.a._Keywords": 3}
    assert dataclass_fields(read_package(tree(tmp_path, files))) == expected


def test_self_is_no_parameter_of_twelve():
    eleven = ", ".join(f"a{i}" for i in range(11))
    text = f"class A:\n    def few(self, {eleven}): pass\n    def many(self, {eleven}, *b): pass\n"
    assert functions_of_many_parameters(module(text)) == {"kit.one.many": 12}


def test_comment_lines_stand_alone_and_are_no_directives():
    text = '# why\nx = 1  # beside code\n\n# fmt: skip\n"""\n# in a text\n"""\n    # indented\n'
    assert count_comment_lines(text) == 2


def test_the_table_says_what_is_missed(tmp_path):
    package = tree(tmp_path, {"a.py": "import kit.b\ntold = 1\n", "room/b.py": "", "b.py": ""})
    (package / "b.py").write_text("def f():\n    import kit.a\n")
    table = {row.name: (row.value, row.is_missed) for row in rows(count(package))}
    assert table["product"] == (4, False)
    assert table["modules in circles"] == (2, True)
    assert table["deferred imports of the product"] == (1, False)
    assert table["bare participles"] == (500, True)
