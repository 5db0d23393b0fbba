"""Numbers as a journal prints them; missing values print as a dash."""

import math

MISSING = "–"
_MINUS = "\N{MINUS SIGN}"


def is_known(value: float | None) -> bool:
    """Tell whether there is a finite number to print."""
    return value is not None and math.isfinite(value)


def decimal(value: float | None, digits: int = 2) -> str:
    """Return a number with a true minus sign; never a negative zero."""
    if value is None or not math.isfinite(value):
        return MISSING
    text = f"{value:.{digits}f}"
    if float(text) == 0:
        text = text.removeprefix("-")
    return text.replace("-", _MINUS)


def signed(value: float | None, digits: int = 2) -> str:
    """Return a number with its sign, plus or minus; zero has none."""
    text = decimal(value, digits)
    has_sign = text.startswith(_MINUS) or text == MISSING or not text.strip("0.")
    return text if has_sign else f"+{text}"


def fraction(value: float | None, digits: int = 2) -> str:
    """Return a number that cannot exceed 1 (p, r, η²) without its leading zero."""
    text = decimal(value, digits)
    return text.replace("0.", ".", 1) if text.lstrip(_MINUS).startswith("0.") else text


def probability(p: float | None) -> str:
    """Return a p value for a table: '.023', '< .001', never '.000' or '1.000'."""
    if p is None or not math.isfinite(p):
        return MISSING
    if p < 0.001:
        return "< .001"
    return "> .999" if p > 0.999 else fraction(p, 3)


def threshold(value: float) -> str:
    """Return a significance threshold with three significant digits: '.00167', '.05'."""
    digits = max(2, 2 - math.floor(math.log10(value)))
    return fraction(float(f"{value:.3g}"), digits).rstrip("0")


def milliseconds(value: float | None) -> str:
    """Return a time in whole milliseconds."""
    return decimal(value, 0)


def percentage(share_01: float | None, digits: int = 1) -> str:
    """Return a share from 0 to 1 as percent."""
    return MISSING if not is_known(share_01) else f"{decimal(100 * (share_01 or 0.0), digits)} %"


def mean_sd(mean: float | None, sd: float | None, digits: int = 2) -> str:
    """Return 'mean (SD)'; the mean alone when there is no spread to give."""
    if not is_known(mean):
        return MISSING
    return (
        f"{decimal(mean, digits)} ({decimal(sd, digits)})"
        if is_known(sd)
        else (decimal(mean, digits))
    )


def interval(low: float | None, high: float | None, digits: int = 2) -> str:
    """Return '[low, high]'."""
    if not (is_known(low) and is_known(high)):
        return MISSING
    return f"[{decimal(low, digits)}, {decimal(high, digits)}]"


def count_of(n: int, one: str, many: str | None = None) -> str:
    """Return '1 trial', '2 trials'."""
    return f"{n} {one if n == 1 else many or one + 's'}"
