"""Read units as the Unified Code for Units of Measure (UCUM) writes them: `uV`, `m/s2`, `/min`.

Case counts (`S` is siemens, `s` second). What a unit counts may stand in braces: `{beats}/min`.
Source: UCUM 2.2, case-sensitive codes, https://ucum.org/ucum.
"""

import difflib
import re
from functools import cache

from visavis.lab.errors import DataError

PREFIXES = "Y Z E P T G M k h da d c m u n p f a z y Ki Mi Gi Ti".split()
METRIC = """
m s g rad K C cd mol sr Hz N Pa J W A V F Ohm S Wb Cel T H lm lx Bq Gy Sv l L ar t bar u eV pc [c]
[h] [k] [eps_0] [mu_0] [e] [m_e] [m_p] [G] [g] [ly] gf Ky Gal dyn erg P Bi St Mx G Oe Gb sb Lmb ph
Ci R RAD REM cal_[15] cal_[20] cal_m cal_IT cal_th cal tex m[H2O] m[Hg] eq osm g% kat U [iU] [IU]
Np B B[SPL] B[V] B[mV] B[uV] B[10.nV] B[W] B[kW] st mho bit By Bd
""".split()
"""Units that take a prefix."""
OTHER = """
10* 10^ [pi] % [ppth] [ppm] [ppb] [pptr] gon deg ' '' min h d a_t a_j a_g a wk mo_s mo_j mo_g mo AU
atm [lbf_av] [in_i] [ft_i] [yd_i] [mi_i] [fth_i] [nmi_i] [kn_i] [sin_i] [sft_i] [syd_i] [cin_i]
[cft_i] [cyd_i] [mil_i] [hd_i] [lb_av] [oz_av] [gr] [stone_av] [degF] [degR] [Cal] [Btu] [HP]
[in_i'H2O] [in_i'Hg] [diop] [p'diop] %[slope] [MET] [pH] [S] [arb'U] [CFU] Ao b att [psi] circ sph
[m/s2/Hz^(1/2)] [NTU] [FNU] bit_s
""".split()
"""Units without a prefix; customary units of trade and pharmacy are left out."""

WRITTEN = {
    "microvolt": "uV", "millivolt": "mV", "volt": "V", "microsiemens": "uS", "siemens": "S",
    "ohm": "Ohm", "kiloohm": "kOhm", "kohm": "kOhm", "second": "s", "sec": "s",
    "millisecond": "ms", "msec": "ms", "microsecond": "us", "nanosecond": "ns", "minute": "min",
    "hertz": "Hz", "meter": "m", "metre": "m", "millimeter": "mm", "millimetre": "mm",
    "centimeter": "cm", "centimetre": "cm", "degree": "deg", "radian": "rad", "celsius": "Cel",
    "degc": "Cel", "degreescelsius": "Cel", "°c": "Cel", "kelvin": "K", "percent": "%",
    "bpm": "/min", "beatsperminute": "/min", "breathsperminute": "/min", "newton": "N",
    "pascal": "Pa", "kilogram": "kg", "gram": "g", "gs": "[g]", "mmhg": "mm[Hg]", "tesla": "T",
    "microtesla": "uT", "lux": "lx", "decibel": "dB", "normalized": "1", "normalised": "1",
    "none": "1", "count": "1", "pixel": "{pixel}", "px": "{pixel}", "sample": "{sample}",
    "°": "deg",
}  # fmt: skip
"""Names that people and programs write, in small letters and the singular, and their code."""

_ASCII_OF_SIGN = {"µ": "u", "μ": "u", "Ω": "Ohm", "²": "2", "³": "3", "⁻": "-", "¹": "1"}
_ASCII_OF_SIGN |= {"**": "", "^": "", "·": ".", "×": ".", "*": ".", " ": ""}


def _longest_first(codes: list[str]) -> str:
    return "|".join(re.escape(code) for code in sorted(codes, key=len, reverse=True))


@cache
def _component() -> re.Pattern[str]:
    simple = (
        f"(?:{_longest_first(OTHER)}|(?:{_longest_first(PREFIXES)})?(?:{_longest_first(METRIC)})"
        "|[1-9][0-9]*)(?:[+-]?[1-9][0-9]*)?"
    )
    note = r"\{[!-z|~]*\}"
    return re.compile(rf"(?:{simple}(?:{note})?|{note}(?:{note})?)(?=[./)]|$)")


@cache
def is_ucum(unit: str) -> bool:
    """Return whether a text is a UCUM unit; the empty text is not."""
    return _end_of_term(unit, 0) == len(unit)


def require_ucum(unit: str, where: str) -> None:
    """Raise DataError, with the nearest unit, unless a text is a unit of UCUM."""
    if not is_ucum(unit):
        near = nearest(unit)
        hint = f"did you mean {near!r}?" if near else "uV, Cel, /min, m/s2 and % are some"
        raise DataError(
            f"{where} has unit {unit!r}, which is none of UCUM (https://ucum.org): {hint}"
        )


def nearest(unit: str) -> str:
    """Return the most likely unit; empty when none is similar."""
    if is_ucum(unit):
        return unit
    if exact := code_of(unit):
        return exact
    some = [*METRIC, *OTHER, *(p + m for p in ("k", "c", "m", "u", "n") for m in METRIC)]
    by_letters = {code.lower(): code for code in reversed(some)}
    matches = difflib.get_close_matches(_as_ascii(unit).lower(), by_letters, n=1, cutoff=0.6)
    return by_letters[matches[0]] if matches else ""


def code_of(unit: str) -> str:
    """Return the code of a unit as programs write it ("microvolts", "µV", "m/s^2"), or nothing."""
    text = unit.strip()
    plain = re.sub(r"[\s_-]", "", text.lower())
    for name in (plain, plain.removesuffix("s")):
        if name in WRITTEN:
            return WRITTEN[name]
    for code in (text, _as_ascii(text)):
        if is_ucum(code):
            return code
    return ""


def _as_ascii(text: str) -> str:
    for sign, plain in _ASCII_OF_SIGN.items():
        text = text.replace(sign, plain)
    return text


def _end_of_term(unit: str, at: int) -> int:
    """Return where the term that begins here ends; -1 when there is none."""
    if unit[at : at + 1] == "/":
        at += 1
    while True:
        at = _end_of_component(unit, at)
        if at < 0 or unit[at : at + 1] not in (".", "/"):
            return at
        at += 1


def _end_of_component(unit: str, at: int) -> int:
    if unit[at : at + 1] != "(":
        component = _component().match(unit, at)
        return component.end() if component else -1
    end = _end_of_term(unit, at + 1)
    if end < 0 or unit[end : end + 1] != ")":
        return -1
    note = re.compile(r"\{[!-z|~]*\}").match(unit, end + 1)
    return note.end() if note else end + 1
