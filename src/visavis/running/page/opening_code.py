"""The six digits that open a session on a study's page, for people who cannot type its address."""

import hmac
import secrets
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from visavis.running.page.rate_limit import ArrivalLimits, RateLimit

DIGITS: Final = 6
MISSING: Final = "code_text"
WRONG: Final = "code_wrong"
TOO_MANY: Final = "code_wait"
MAX_WRONG: Final = 20.0
"""So many wrong codes are read at once, then one in half a minute: 1,000 of a million in 8 h."""
MAX_WRONG_FROM_ONE: Final = 5.0
"""The same of one address, which then has one a minute."""


def new_code() -> str:
    """Return six digits that nobody can foresee."""
    return f"{secrets.randbelow(10**DIGITS):0{DIGITS}}"


@dataclass
class OpeningCode:
    """Tells who knows the code from who guesses it.

    A code that is right costs nothing; once too many were wrong none is read, also not the right
    one, or guessing would go on. `say` tells whoever serves of every lockout, without the address.
    """

    digits: str = field(default_factory=new_code, repr=False)
    say: Callable[[str], None] = lambda text: None
    limits: ArrivalLimits = field(
        default_factory=lambda: ArrivalLimits(
            RateLimit(MAX_WRONG, 1 / 30, MAX_WRONG), MAX_WRONG_FROM_ONE, 1 / 60
        )
    )
    _is_locked: bool = False

    def refusal(self, digits: str, address: str, now_ns: int) -> str:
        """Return the name of the words that a page shows; "" where the code is right.

        `address` is where it came from, "" where nobody knows; `now_ns` is session time.
        """
        if not digits:
            return MISSING
        if not self.limits.lets_pass(address, now_ns):
            if not self._is_locked:
                self.say(self._lockout())
            self._is_locked = True
            return TOO_MANY
        self._is_locked = False
        if not hmac.compare_digest(digits.encode(errors="replace"), self.digits.encode()):
            return WRONG
        self.limits.give_back(address)
        return ""

    def _lockout(self) -> str:
        if self.limits.of_all.left < 1:
            return (
                f"{MAX_WRONG:.0f} wrong codes were typed: no code is read now but one in half a "
                "minute. If nobody mistyped it so often, somebody guesses: end the server, and "
                "begin it anew where only your headsets are"
            )
        return (
            f"somebody typed {MAX_WRONG_FROM_ONE:.0f} wrong codes; from there only one a minute "
            "is read now, also the right one"
        )
