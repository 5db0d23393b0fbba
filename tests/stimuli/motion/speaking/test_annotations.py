"""Annotations of ANVIL and ELAN become the same script; what they lack is named by line."""

import shutil
from pathlib import Path

import pytest

from tests.stimuli.motion.speaking.test_gesture_script import ONE, TWO
from visavis.lab.errors import UsageError
from visavis.lab.yaml_lines import ProblemsError
from visavis.stimuli.motion.bvh import write_bvh
from visavis.stimuli.motion.bvh_clip import bvh_of_clip
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.speaking.annotations import Tiers, read_any_script
from visavis.stimuli.motion.speaking.corpus import read_corpus
from visavis.stimuli.motion.speaking.gesture_script import (
    GestureScript,
    format_script,
)
from visavis.stimuli.motion.speaking.synthetic_speaker import synthetic_take

ELAN = Path(__file__).with_name("take.eaf")
"""Our own two gestures, written by pympi-ling 1.71."""
WHOLE = GestureScript((ONE, TWO), 3.9)
ANVIL = """<?xml version="1.0" encoding="ISO-8859-1"?>
<annotation>
  <head><specification src="gesture.xml"/></head>
  <body>
    <track name="gesture.phase" type="primary">
      <el index="0" start="0.4" end="0.9"><attribute name="type">prep</attribute></el>
      <el index="1" start="0.9" end="1.1"><attribute name="type">stroke</attribute></el>
      <el index="2" start="1.1" end="1.3"><attribute name="type">stroke</attribute></el>
      <el index="3" start="1.3" end="1.6"><attribute name="type">hold</attribute></el>
      <el index="4" start="1.6" end="2.1"><attribute name="type">retract</attribute></el>
      <el index="5" start="2.5" end="3.0"><attribute name="type">prep</attribute></el>
      <el index="6" start="3.0" end="3.4"><attribute name="type">stroke</attribute></el>
      <el index="7" start="3.4" end="3.9"><attribute name="type">retract</attribute></el>
    </track>
    <track name="gesture.phrase" type="span" ref="gesture.phase">
      <el index="0" start="0" end="4">
        <attribute name="lexeme">Cup</attribute><attribute name="handedness">RH</attribute>
      </el>
      <el index="1" start="5" end="7">
        <attribute name="lexeme">frame</attribute><attribute name="handedness">2H</attribute>
      </el>
    </track>
  </body>
</annotation>
"""


def anvil(tmp_path: Path, text: str = ANVIL) -> Path:
    path = tmp_path / "take.anvil"
    path.write_text(text, encoding="latin-1")
    return path


def test_annotations_of_anvil_are_read(tmp_path: Path) -> None:
    assert read_any_script(anvil(tmp_path)) == WHOLE


def test_annotations_of_elan_written_by_another_program_are_read() -> None:
    assert read_any_script(ELAN) == WHOLE


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('name="lexeme">Cup', 'name="meaning">Cup', (16, "phrase 1", "lexeme is missing")),
        (">2H<", ">3H<", (19, "phrase 2", "hand is '3H'; give LH, RH, 2H or none")),
        (
            'start="5" end="7"',
            'start="5" end="9"',
            (19, "gesture.phrase", "end is '9', not an element from 0 to 7"),
        ),
        (
            'start="3.0" end="3.4"',
            'start="3.0" end="?"',
            (12, "gesture.phase", "end is '?', not a time in seconds"),
        ),
        (
            'start="3.0" end="3.4"><attribute name="type">stroke',
            'start="3.0" end="3.4"><attribute name="type">beat',
            (19, "phrase 2", "no stroke on tier 'phase' from 2.5 to 3.9 s"),
        ),
    ],
)
def test_what_is_missing_is_named_with_its_line(
    tmp_path: Path, old: str, new: str, problem: tuple[int, str, str]
) -> None:
    assert old in ANVIL
    with pytest.raises(ProblemsError) as raised:
        read_any_script(anvil(tmp_path, ANVIL.replace(old, new)))
    assert problem in [(p.line, p.key, p.message) for p in raised.value.problems]


def test_a_listener_makes_no_gesture(tmp_path: Path) -> None:
    text = ANVIL.replace(">2H<", ">none<").replace(">frame<", "><")
    assert text.count("><") > ANVIL.count("><")
    last = read_any_script(anvil(tmp_path, text)).phrases[-1]
    assert ("none", "") == (last.hand, last.lexeme)


def test_a_missing_tier_is_named_with_what_there_is(tmp_path: Path) -> None:
    with pytest.raises(ProblemsError, match="Hande: there is no such tier; did you mean 'hand'"):
        read_any_script(ELAN, Tiers(hand="Hande"))
    with pytest.raises(ProblemsError, match="there is no such track"):
        read_any_script(anvil(tmp_path), Tiers(phase="parts"))


def test_an_annotation_without_time_is_named(tmp_path: Path) -> None:
    path = tmp_path / "take.eaf"
    text = ELAN.read_text(encoding="utf-8")
    path.write_text(text.replace(' TIME_VALUE="2100"', "", 1), encoding="utf-8")
    with pytest.raises(ProblemsError, match="TIME_SLOT_REF2 has no time; align it in ELAN"):
        read_any_script(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (ANVIL[:900], r"line 1\d: it is not complete XML"),
        ("<html><body/></html>", "is an XML file with <html>"),
        ('<!DOCTYPE a [<!ENTITY x "y">]><annotation/>', "declares entities"),
    ],
)
def test_other_files_are_refused(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(MotionError, match=message):
        read_any_script(anvil(tmp_path, text))


def test_a_folder_of_takes_teaches_what_the_motion_does(tmp_path: Path) -> None:
    clip, script, planted = synthetic_take(5, 0.5)
    write_bvh(tmp_path / "one.bvh", bvh_of_clip(clip), decimals=5)
    (tmp_path / "one.yaml").write_text(format_script(script), encoding="utf-8")
    assert read_corpus(tmp_path).postures == planted.postures


def test_takes_without_a_partner_are_named(tmp_path: Path) -> None:
    shutil.copy(ELAN, tmp_path / "a.eaf")
    with pytest.raises(MotionError, match=r"nothing belongs to a\.eaf; give each take the same"):
        read_corpus(tmp_path)
    with pytest.raises(UsageError, match="is no folder"):
        read_corpus(tmp_path / "nowhere")
