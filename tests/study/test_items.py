"""Items: which row of a table every trial shows, and what is wrong with a table, by line."""

from collections import Counter
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as Files
from scipy.io import wavfile

from visavis.lab.errors import DesignError
from visavis.protocol.plan.design import Factor
from visavis.results.opened_study import find_study
from visavis.study.experiment import StudyExperiment
from visavis.study.items import Items, is_slip, read_items

FACTORS = (Factor("mood", ["glad", "sad"]),)
STUDY = """
from visavis import Factor, Items, Rating, Study, Text

study = Study("rated", factors=[{factors}], items=Items("things.csv", {options}),
              repetitions={repetitions}, practice={practice}, on="browser", uses=(),
              calibrate=False, sessions={sessions})


@study.trial
def trial(t):
    yield t.show(Text(f"{{t.item}} {{t.colour}}"), seconds=0.2)
    yield t.ask(Rating("liked", 1, 7))
"""
MOOD = 'Factor("mood", ["glad", "sad"])'
ONE = 'Factor("task", ["rate"])'


def things(count: int, *more: str) -> str:
    """Return a table of things with two moods in turn and three colours, the same for all."""
    lines = ["item,mood,colour,list,chance"]
    for k in range(count):
        mood, colour = ("glad", "sad")[k % 2], ("red", "green", "blue")[k % 3]
        lines.append(f"thing{k},{mood},{colour},{'ab'[k // 2 % 2]},{int(k < 8)}")
    return "\n".join([*lines, *more]) + "\n"


def experiment(
    folder: Path,
    table: str,
    options: str = "",
    *,
    factors: str = MOOD,
    repetitions: int = 6,
    practice: int = 0,
    sessions: tuple[str, ...] = (),
) -> StudyExperiment:
    (folder / "things.csv").write_text(table, "utf-8")
    text = STUDY.format(
        factors=factors,
        options=options,
        repetitions=repetitions,
        practice=practice,
        sessions=sessions,
    )
    (folder / "rated.py").write_text(text, "utf-8")
    study_experiment = find_study(str(folder / "rated.py")).experiment({})
    assert isinstance(study_experiment, StudyExperiment)
    return study_experiment


def shown(study_experiment: StudyExperiment, index: int = 0) -> list[dict[str, Any]]:
    return [dict(t.factors) for t in study_experiment.plan(index, 7).trials if not t.is_practice]


def test_every_item_is_drawn_once_at_the_level_of_its_column(tmp_path: Path) -> None:
    study_experiment = experiment(tmp_path, things(12))
    trials = shown(study_experiment)
    assert 12 == len({t["item"] for t in trials})
    assert all(t["mood"] == ("glad", "sad")[int(t["item"][5:]) % 2] for t in trials)
    assert {"red", "green", "blue"} == {t["colour"] for t in trials}
    assert trials == shown(study_experiment)
    assert trials != shown(study_experiment, 1)


def test_practice_shows_what_the_session_leaves_over(tmp_path: Path) -> None:
    study_experiment = experiment(tmp_path, things(16), practice=4)
    trials = study_experiment.plan(0, 7).trials
    practice = {t.factors["item"] for t in trials if t.is_practice}
    assert 4 == len(practice)
    assert not practice & {t.factors["item"] for t in trials if not t.is_practice}


def test_practice_takes_items_of_the_session_where_the_table_is_used_up(tmp_path: Path) -> None:
    study_experiment = experiment(tmp_path, things(12), practice=4)
    trials = study_experiment.plan(0, 7).trials
    practice = {t.factors["item"] for t in trials if t.is_practice}
    assert 4 == len(practice)
    assert practice <= {t.factors["item"] for t in trials if not t.is_practice}


def test_all_sessions_of_somebody_show_the_same_choice_in_another_order(tmp_path: Path) -> None:
    sessions = ("learn", "test", "retest")
    table = "item,colour\n" + "".join(f"thing{k},{k}\n" for k in range(24))
    first = experiment(tmp_path, table, factors=ONE, practice=2, sessions=sessions)
    choices = []
    for index in range(4):
        orders = [tuple(t["item"] for t in shown(first.of_session(k), index)) for k in range(1, 4)]
        assert len(orders[0]) < 24
        assert 1 == len({frozenset(order) for order in orders})
        assert 3 == len(set(orders))
        choices.append(frozenset(orders[0]))
    assert 1 < len(set(choices))


@pytest.mark.parametrize(
    ("column", "factor", "expected"),
    [
        ("moood", "mood", True),
        ("Mood", "mood", True),
        ("seen_befor", "seen_before", True),
        ("seenbefore", "seen_before", True),
        ("target_valence", "prime_valence", False),
        ("target_side", "cue_side", False),
        ("voice_gender", "face_gender", False),
        ("target_1", "target_2", False),
    ],
)
def test_a_column_like_a_factor_is_a_slip_only_where_every_word_is_alike(
    column: str, factor: str, expected: bool
) -> None:
    assert expected == is_slip(column, factor)


def test_each_participant_sees_a_list_of_their_own(tmp_path: Path) -> None:
    study_experiment = experiment(tmp_path, things(16), 'lists="list"', repetitions=4)
    lists = [{t["list"] for t in shown(study_experiment, index)} for index in range(3)]
    assert [{"a"}, {"b"}, {"a"}] == lists


def test_a_latin_square_shows_every_item_at_every_level_over_participants(
    tmp_path: Path,
) -> None:
    factors = f'{MOOD}, Factor("frame", ["none", "gold"])'
    study_experiment = experiment(
        tmp_path, things(16), 'lists="list", over="frame"', factors=factors, repetitions=4
    )
    people = [{t["item"]: t["frame"] for t in shown(study_experiment, index)} for index in range(2)]
    assert [16, 16] == [len(person) for person in people]
    assert all(people[0][item] != people[1][item] for item in people[0])
    of_list = {(t["list"], t["frame"]) for t in shown(study_experiment)}
    assert {("a", "none"), ("b", "gold")} == of_list


def test_weights_are_chances_and_limits_hold(tmp_path: Path) -> None:
    study_experiment = experiment(
        tmp_path,
        things(12),
        'weight="chance", alike={"colour": 1}, apart=2, again=True',
        factors=ONE,
        repetitions=60,
    )
    trials = shown(study_experiment)
    counts = Counter(t["item"] for t in trials)
    assert {f"thing{k}" for k in range(8)} == set(counts)
    assert all(a["colour"] != b["colour"] for a, b in pairwise(trials))
    items = [t["item"] for t in trials]
    assert all(item not in items[max(0, k - 2) : k] for k, item in enumerate(items))


def test_shown_anew_means_all_before_any_again(tmp_path: Path) -> None:
    study_experiment = experiment(tmp_path, things(4), "again=True", factors=ONE, repetitions=12)
    assert {3} == set(Counter(t["item"] for t in shown(study_experiment)).values())


def test_a_limit_on_a_factor_holds_in_the_order_of_trials(tmp_path: Path) -> None:
    study_experiment = experiment(tmp_path, things(12), 'alike={"mood": 1}')
    assert all(a["mood"] != b["mood"] for a, b in pairwise(shown(study_experiment)))


@pytest.mark.parametrize(
    ("options", "repetitions", "says"),
    [
        (
            "",
            7,
            "6 items for mood (glad|sad), of whose trials a session has 7; lower",
        ),
        ('alike={"colour": 1}, apart=11, again=True', 12, "none keeps .*alike.*apart=11"),
    ],
)
def test_too_few_items_and_limits_that_cannot_hold_are_told(
    options: str, repetitions: int, says: str, tmp_path: Path
) -> None:
    study_experiment = experiment(tmp_path, things(12), options, repetitions=repetitions)
    with pytest.raises(DesignError, match=says):
        study_experiment.plan(0, 1)


@pytest.mark.parametrize(
    ("table", "options", "says"),
    [
        ("", {}, "things.csv is empty; its first line names the columns"),
        ("item,mood\n", {}, "a header and no rows"),
        ("item,mood\na,glad\na,sad\n", {}, "line 3: 'a' is in line 2 already"),
        ("item,mood\n,glad\nb,sad\n", {}, "line 2: item is empty"),
        ("item,mood\na,glad\nb,sadd\nc,sad\n", {}, "line 3: mood is 'sadd', no level.*sad"),
        ("item,mood\na,glad\n", {}, "no row has mood 'sad'"),
        ("item,mood\na,glad,x\nb,sad\n", {}, "line 2: 3 cells below 2 columns"),
        ("item,item\na,b\n", {}, "has the column 'item' twice"),
        ("item,participant\na,b\n", {}, "'participant' is a column of every trial"),
        ("item,session\na,b\n", {}, "a column of its own, .*let the trial choose by t.session"),
        (
            "item,moood\na,glad\nb,sad\n",
            {},
            "line 1: the column 'moood' holds levels of the factor 'mood' .*call it 'mood'",
        ),
        ("item,two words\na,b\n", {}, "the column 'two words' is no name"),
        ("item,mood,w\na,glad,1\nb,sad,-1\n", {"weight": "w"}, "line 3: w is -1; a weight"),
        ("item,mood\na,glad\nb,sad\n", {"lists": "lst"}, "lists names 'lst', which is no col"),
        ("item,mood\na,glad\nb,sad\n", {"over": "mood"}, "over names 'mood'"),
    ],
)
def test_a_mistake_in_a_table_is_told_by_its_line(
    table: str, options: dict[str, Any], says: str, tmp_path: Path
) -> None:
    (tmp_path / "things.csv").write_text(table, "utf-8")
    with pytest.raises(DesignError, match=says):
        read_items(Items("things.csv", **options), tmp_path, FACTORS)


def test_a_table_that_is_missing_or_not_utf_8_is_told(tmp_path: Path) -> None:
    (tmp_path / "things.csv").write_bytes("item\nä\n".encode("latin-1"))
    with pytest.raises(DesignError, match="not UTF-8"):
        read_items(Items("things.csv"), tmp_path, ())
    with pytest.raises(DesignError, match=r"there is no table .*thing.csv.*things.csv"):
        read_items(Items("thing.csv"), tmp_path, ())


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_a_byte_order_mark_and_a_spreadsheets_separator_are_read(
    delimiter: str, tmp_path: Path
) -> None:
    lines = ["item,mood,age", "ä b😀,glad,7", "c,sad,12"]
    text = "\r\n".join(lines).replace(",", delimiter)
    (tmp_path / "things.csv").write_text("\ufeff" + text, "utf-8")
    table = read_items(Items("things.csv"), tmp_path, FACTORS)
    assert ("item", "mood", "age") == table.columns
    assert {"item": "ä b😀", "mood": "glad", "age": 7} == table.rows[0]


def save(folder: Path, name: str, mode: str = "RGB", size: tuple[int, int] = (20, 30)) -> None:
    picture = Files.new(mode, size)
    orientation = Files.Exif()
    if name.startswith("turned"):
        orientation[0x0112] = 6
    picture.save(folder / name, exif=orientation)


def test_sounds_are_looked_at_row_by_row(tmp_path: Path) -> None:
    for name in ("word.wav", "Other.wav"):
        wavfile.write(tmp_path / name, 8000, np.full(800, 9, np.int16))
    (tmp_path / "cut.wav").write_bytes((tmp_path / "word.wav").read_bytes()[:500])
    (tmp_path / "text.wav").write_text("no sound", "utf-8")
    wavfile.write(tmp_path / "empty.wav", 8000, np.zeros(0, np.int16))
    names = ["word.wav", "other.wav", "gone.wav", "cut.wav", "text.wav", "empty.wav"]
    (tmp_path / "t.csv").write_text("\n".join(["sound", *names]), "utf-8")
    with pytest.raises(DesignError) as told:
        read_items(Items("t.csv"), tmp_path, ())
    for line, words in (
        (3, "'other.wav' is called 'Other.wav' there"),
        (4, "gone.wav: cannot be read"),
        (5, "cut.wav: cut short"),
        (6, "text.wav: no WAV file"),
        (7, "empty.wav: .*more than none"),
    ):
        assert told.match(f"line {line}: .*{words}"), told.value


def test_pictures_are_looked_at_row_by_row(tmp_path: Path) -> None:
    for name in ("ä b😀.png", "plain.png", "Other.png"):
        save(tmp_path, name)
    save(tmp_path, "turned.jpg", size=(30, 20))  # lies on its side, and is shown upright
    save(tmp_path, "clear.png", "RGBA")
    save(tmp_path, "print.jpg", "CMYK")
    save(tmp_path, "deep.png", "I;16")
    save(tmp_path, "large.png", size=(21, 30))
    (tmp_path / "text.png").write_text("no picture", "utf-8")
    right = ["ä b😀.png", "plain.png", "turned.jpg", "clear.png"]
    wrong = ["other.png", "gone.png", "print.jpg", "deep.png", "text.png", "large.png"]

    def read(names: list[str], **options: Any) -> None:
        (tmp_path / "t.csv").write_text("\n".join(["picture", *names]), "utf-8")
        read_items(Items("t.csv", **options), tmp_path, ())

    read(right)
    with pytest.raises(DesignError) as told:
        read([*right, *wrong])
    for line, words in (
        (6, "'other.png' is called 'Other.png' there"),
        (7, "there is no picture .*gone.png"),
        (8, "colours for print .CMYK."),
        (9, "more than 8 bits a channel"),
        (10, "is no picture that can be read"),
        (11, "its picture is 21 x 30 pixels, most are 20 x 30"),
    ):
        assert told.match(f"line {line}: .*{words}"), told.value
    read([*right, "large.png"], any_size=True)
