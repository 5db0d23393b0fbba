"""Run the library of espeak-ng on one clause; a program of its own, started by `synthesiser`.

Reads JSON from standard input (library, voice, rate_wpm, pitch, text) and writes JSON: rate_hz,
samples (16 bits, base64), and words and phones with their times. It imports nothing of Visavis:
espeak-ng is under the GPL, so its library is loaded only in this process.
"""

import base64
import ctypes
import json
import sys
from typing import Any, ClassVar

RETRIEVAL, PHONE_EVENTS, IPA_EVENTS, NO_EXIT = 1, 0x1, 0x2, 0x8000
RATE, PITCH = 1, 3
BY_CHARACTER, UTF8 = 1, 1
WORD, END, PHONE = 1, 5, 7


class _Name(ctypes.Union):
    _fields_: ClassVar = [
        ("number", ctypes.c_int),
        ("name", ctypes.c_char_p),
        ("string", ctypes.c_char * 8),
    ]


class _Event(ctypes.Structure):
    _fields_: ClassVar = [
        ("type", ctypes.c_int),
        ("unique_identifier", ctypes.c_uint),
        ("text_position", ctypes.c_int),
        ("length", ctypes.c_int),
        ("audio_position", ctypes.c_int),
        ("sample", ctypes.c_int),
        ("user_data", ctypes.c_void_p),
        ("id", _Name),
    ]


class _Voice(ctypes.Structure):
    _fields_: ClassVar = [
        ("name", ctypes.c_char_p),
        ("languages", ctypes.c_char_p),
        ("identifier", ctypes.c_char_p),
        ("gender", ctypes.c_ubyte),
        ("age", ctypes.c_ubyte),
        ("variant", ctypes.c_ubyte),
        ("reserved", ctypes.c_ubyte),
        ("score", ctypes.c_int),
        ("spare", ctypes.c_void_p),
    ]


CALLBACK = ctypes.CFUNCTYPE(
    ctypes.c_int, ctypes.POINTER(ctypes.c_short), ctypes.c_int, ctypes.POINTER(_Event)
)


def speak(order: dict[str, Any]) -> dict[str, Any]:
    """Return samples and events of a text."""
    library = ctypes.CDLL(order["library"])
    rate_hz = library.espeak_Initialize(RETRIEVAL, 0, None, PHONE_EVENTS | IPA_EVENTS | NO_EXIT)
    if rate_hz <= 0:
        return {"problem": "espeak-ng found none of its data"}
    samples, words, phones = bytearray(), [], []

    def take(wav: Any, count: int, events: Any) -> int:
        if wav and count > 0:
            samples.extend(ctypes.string_at(wav, 2 * count))
        k = 0
        while events[k].type:
            event, k = events[k], k + 1
            if event.type == WORD:
                words.append((event.text_position, event.length, event.audio_position / 1000))
            elif event.type == PHONE:
                name = bytes(event.id.string).split(b"\0")[0].decode("utf-8", "ignore")
                phones.append((name, event.audio_position / 1000))
        return 0

    callback = CALLBACK(take)
    library.espeak_SetSynthCallback(callback)
    voice = order["voice"].encode()
    by_language = _Voice(languages=voice)
    if library.espeak_SetVoiceByName(voice) and library.espeak_SetVoiceByProperties(
        ctypes.byref(by_language)
    ):
        return {"problem": f"espeak-ng has no voice {order['voice']!r}"}
    library.espeak_SetParameter(RATE, int(order["rate_wpm"]), 0)
    library.espeak_SetParameter(PITCH, int(order["pitch"]), 0)
    text = order["text"].encode()
    library.espeak_Synth(text, len(text) + 1, 0, BY_CHARACTER, 0, UTF8, None, None)
    library.espeak_Synchronize()
    return {
        "rate_hz": rate_hz,
        "samples": base64.b64encode(bytes(samples)).decode(),
        "words": words,
        "phones": phones,
    }


if __name__ == "__main__":
    json.dump(speak(json.load(sys.stdin)), sys.stdout)
