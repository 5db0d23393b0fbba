"""Speech: its times, strokes tied to words, lips that follow, and a synthesiser."""

from pathlib import Path

import numpy as np
import pytest

from visavis.lab.errors import DataError
from visavis.lab.yaml_lines import ProblemsError
from visavis.stimuli.motion.speaking.gesture_script import read_script
from visavis.stimuli.motion.speaking.mouth import mouth_of
from visavis.stimuli.motion.speaking.speech import (
    Speech,
    Utterance,
    read_speech,
    words_path,
    write_speech,
)
from visavis.stimuli.motion.speaking.synthesiser import (
    Clause,
    SynthesisVoice,
    library_path,
    read_text,
    synthesised,
)
from visavis.stimuli.sound import Waveform, part_of

RATE_HZ = 16_000


def spoken(*bursts: tuple[str, float, float], seconds: float = 3.0) -> Speech:
    """Return words as loud bursts."""
    samples = np.zeros((round(seconds * RATE_HZ), 1), np.float32)
    for _, start_s, end_s in bursts:
        samples[round(start_s * RATE_HZ) : round(end_s * RATE_HZ)] = 0.5
    words = tuple(Utterance(*burst) for burst in bursts)
    return Speech(Waveform("speech", samples, RATE_HZ), words)


def test_times_stand_beside_a_recording_and_are_read_again(tmp_path: Path) -> None:
    speech = spoken(("Friends,", 0.2, 0.6), ("Romans", 1.0, 1.5))
    write_speech(tmp_path / "a.wav", speech)
    again = read_speech(tmp_path / "a.wav")
    assert again.words == speech.words
    assert np.abs(again.sound.samples - speech.sound.samples).max() < 1e-4


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("word,ears,1.0,9.0", "line 2: from 1.0 to 9.0 s is no time within"),
        ("word,ears,x,1.0", "line 2: from x to 1.0 s is no time"),
        ("syllable,ears,0.1,0.2", "line 2: kind is 'syllable'"),
    ],
)
def test_wrong_times_are_refused_with_their_line(tmp_path: Path, row: str, message: str) -> None:
    write_speech(tmp_path / "a.wav", spoken())
    words_path(tmp_path / "a.wav").write_text(f"kind,text,start_s,end_s\n{row}\n", encoding="utf-8")
    with pytest.raises(DataError, match=message):
        read_speech(tmp_path / "a.wav")


def test_a_word_is_found_whatever_its_case_and_its_second_time_by_number() -> None:
    speech = spoken(("Caesar,", 0.2, 0.6), ("to", 0.7, 0.8), ("Caesar", 1.0, 1.5))
    assert speech.word("caesar").start_s == 0.2
    assert speech.word("Caesar#2").start_s == 1.0
    with pytest.raises(DataError, match="says 'Caesar' 2 times"):
        speech.word("Caesar#3")


SCRIPT = """
speech: a.wav
duration_s: 3
phrases:
- {word: ears, start_s: -0.6, stroke_s: 0, stroke_end_s: 0.4, end_s: 1.0, hand: R, lexeme: cup}
"""


def test_a_stroke_tied_to_a_word_begins_with_it(tmp_path: Path) -> None:
    write_speech(tmp_path / "a.wav", spoken(("ears", 1.1, 1.4)))
    (tmp_path / "a.yaml").write_text(SCRIPT, encoding="utf-8")
    script = read_script(tmp_path / "a.yaml")
    phrase = script.phrases[0]
    assert (phrase.start_s, phrase.stroke_s, phrase.end_s) == pytest.approx((0.5, 1.1, 2.1))
    assert script.speech == tmp_path / "a.wav"


def test_a_word_that_is_not_said_is_named_with_its_line(tmp_path: Path) -> None:
    write_speech(tmp_path / "a.wav", spoken(("eyes", 1.1, 1.4)))
    (tmp_path / "a.yaml").write_text(SCRIPT, encoding="utf-8")
    with pytest.raises(ProblemsError, match=r"5: phrase 1: .*says 'ears' never"):
        read_script(tmp_path / "a.yaml")
    (tmp_path / "b.yaml").write_text(SCRIPT.replace("speech: a.wav", ""), encoding="utf-8")
    with pytest.raises(ProblemsError, match="has a word, but no recording"):
        read_script(tmp_path / "b.yaml")


def test_a_part_of_a_recording_is_padded_with_silence() -> None:
    part = part_of(spoken(("a", 2.0, 3.0)).sound, 2.5, 1.0)
    assert part.duration_s == 1.0
    assert (part.samples[: RATE_HZ // 2] > 0).all()
    assert (part.samples[RATE_HZ // 2 :] == 0).all()


def test_lips_follow_loudness_where_no_phones_are_known() -> None:
    mouth = mouth_of(spoken(("a", 0.5, 1.0), ("b", 2.0, 2.5)))
    assert mouth.at(0.75)[0] > 0.4
    assert mouth.at(1.5)[0] == 0.0
    assert mouth.at(2.25)[0] > 0.4
    assert mouth.at(-1.0) == mouth.at(9.0) == (0.0, 0.0)


def test_lips_are_shut_in_p_b_and_m_and_wide_open_in_a() -> None:
    phones = (Utterance("m", 0.5, 0.6), Utterance("ɑː", 0.6, 0.8), Utterance("p", 0.8, 0.9))
    mouth = mouth_of(Speech(spoken().sound, (), phones))
    assert mouth.at(0.55)[0] == mouth.at(0.85)[0] == 0.0
    assert mouth.at(0.7)[0] == pytest.approx(0.55)


def test_a_text_has_a_clause_a_line_and_may_say_when(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("# a note\n2.6: lend me your ears;\n5 noble: The noble\nwent on: so\n")
    assert read_text(path) == (
        Clause("lend me your ears;", 2.6),
        Clause("The noble", 5.0, "noble"),
        Clause("went on: so"),
    )


def has_espeak() -> bool:
    try:
        library_path()
    except DataError:
        return False
    return True


@pytest.mark.skipif(not has_espeak(), reason="espeak-ng is not installed")
def test_words_are_spoken_when_the_text_says() -> None:
    clauses = (Clause("Friends, Romans,", 0.9, "Romans"), Clause("lend me your ears", 2.5))
    speech = synthesised("speech", clauses, SynthesisVoice(), 4.0)
    assert speech.sound.duration_s == 4.0
    assert speech.word("Romans").start_s == pytest.approx(0.9, abs=0.002)
    assert speech.word("lend").start_s == pytest.approx(2.5, abs=0.03)
    # What is said to be silent is, and words are heard.
    loud = np.abs(speech.sound.samples[:, 0]) > 0.02
    heard = np.flatnonzero(loud) / speech.sound.rate_hz
    for word in speech.words:
        assert ((heard >= word.start_s) & (heard <= word.end_s)).any()
    assert not ((heard > 2.0) & (heard < 2.45)).any()
    mouth = mouth_of(speech)
    assert mouth.at(2.2)[0] == 0.0


@pytest.mark.skipif(not has_espeak(), reason="espeak-ng is not installed")
def test_a_voice_that_there_is_not_is_refused() -> None:
    with pytest.raises(DataError, match="no voice 'nobody'"):
        synthesised("speech", (Clause("so"),), SynthesisVoice("nobody"))
