"""Gesture scripts: what is written is read; everything that is wrong is named by line."""

from pathlib import Path

import pytest

from visavis.lab.yaml_lines import ProblemsError
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.speaking.gesture_script import (
    GesturePhrase,
    GestureScript,
    format_script,
    read_script,
)

ONE = GesturePhrase(0.4, 0.9, 1.3, 1.6, 2.1, "R", "cup", 2)
LISTENS = GesturePhrase(2.2, 2.2, 2.4, 2.4, 2.4, "none", "")
TWO = GesturePhrase(2.5, 3.0, 3.4, 3.4, 3.9, "both", "frame")


def written(tmp_path: Path, name: str, text: str) -> Path:
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def test_a_script_that_is_written_is_read_again(tmp_path: Path) -> None:
    script = GestureScript((ONE, LISTENS, TWO), 5.0)
    assert read_script(written(tmp_path, "a.yaml", format_script(script))) == script


def test_a_table_reads_as_the_same_script(tmp_path: Path) -> None:
    text = (
        "start_s,stroke_s,stroke_end_s,hold_end_s,end_s,hand,lexeme,strokes\n"
        "0.4,0.9,1.3,1.6,2.1,R,cup,2\n2.5,3.0,3.4,,3.9,both,frame,\n"
    )
    assert read_script(written(tmp_path, "a.csv", text)) == GestureScript((ONE, TWO), 3.9)


def test_everything_wrong_is_named_with_its_line(tmp_path: Path) -> None:
    text = (
        "phrases:\n"
        "- {start_s: 0, stroke_s: 0.5, stroke_end_s: 0.4, end_s: 1, hand: X, lexeme: cub}\n"
        "- {start_s: 0.5, stroke_s: 1.5, stroke_end_s: 2, end_s: 3, hand: L, lexeme: cup}\n"
        "- {start_s: 4, stroke_end_s: 5, end_s: 6, hand: L, lexeme: cup, colour: red}\n"
    )
    with pytest.raises(ProblemsError) as raised:
        read_script(written(tmp_path, "a.yaml", text))
    found = {(p.line, p.key, p.message.split(";")[0]) for p in raised.value.problems}
    assert found == {
        (2, "phrase 1", "stroke_end_s (0.4 s) comes before stroke_s (0.5 s)"),
        (2, "phrase 1", "hand is 'X'"),
        (2, "phrase 1", "lexeme 'cub' is unknown"),
        (4, "phrase 3", "stroke_s is missing"),
        (4, "phrase 3", "colour is unknown"),
    }


def test_a_gesture_without_a_hand_and_a_hand_without_a_gesture_are_named(tmp_path: Path) -> None:
    times = "start_s: 0, stroke_s: 0.5, stroke_end_s: 1, end_s: 2"
    for entries, message in (
        ("hand: none, lexeme: cup", "lexeme is 'cup', and hand none"),
        ("hand: R", "lexeme is missing"),
        ("hand: R, lexeme: ''", "lexeme is missing"),
    ):
        path = written(tmp_path, "a.yaml", f"phrases:\n- {{{times}, {entries}}}\n")
        with pytest.raises(ProblemsError, match=message):
            read_script(path)


def test_phrases_over_each_other_are_refused(tmp_path: Path) -> None:
    one = "{start_s: 0, stroke_s: 0.5, stroke_end_s: 1, end_s: 2, hand: L, lexeme: cup}"
    other = one.replace("start_s: 0,", "start_s: 0.4,")
    with pytest.raises(ProblemsError, match="before the one above ends"):
        read_script(written(tmp_path, "a.yaml", f"phrases:\n- {one}\n- {other}\n"))


def test_a_corpus_may_name_gestures_that_we_do_not_draw(tmp_path: Path) -> None:
    row = "{start_s: 0, stroke_s: 0.5, stroke_end_s: 1, end_s: 2, hand: L, lexeme: kiss}"
    path = written(tmp_path, "a.yaml", f"phrases:\n- {row}\n")
    assert read_script(path, any_lexeme=True).phrases[0].lexeme == "kiss"


def test_another_kind_of_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MotionError, match=r"give \.yaml or \.csv"):
        read_script(written(tmp_path, "a.txt", "x"))
