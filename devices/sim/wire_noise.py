"""Random delays and damage of a simulated wire."""

from collections.abc import Sequence

import numpy as np

from visavis.devices.contracts import Body

LEG_FLOOR_NS = 100_000
LEG_UNDISTURBED_01 = 0.7
LEG_WAIT_NS = 150_000

_LEG_STREAM = 0x1E
_SEED_RANGE = 2**64


class NetworkLegs:
    """One-way travel times in a local network."""

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng([seed, _LEG_STREAM])

    def draw_ns(self) -> int:
        """Draw a travel time: often the floor, otherwise the floor and a wait."""
        if self._rng.random() < LEG_UNDISTURBED_01:
            return LEG_FLOOR_NS
        return LEG_FLOOR_NS + round(self._rng.exponential(LEG_WAIT_NS))


class WireNoise:
    """The generator of one wire: from (seed, `body.stretch()`), without a body from the seed.

    A stretch then has the same messages whether or not the session was interrupted and resumed
    before it (decision 0004).
    """

    def __init__(self, seed: int | Sequence[int], body: Body | None) -> None:
        self._seed = [seed] if isinstance(seed, int) else list(seed)
        self._body = body
        self._stretch = 0 if body is None else body.stretch()
        self._rng = self._new_generator()

    def rng(self) -> np.random.Generator:
        """Return the generator of the present stretch."""
        stretch = 0 if self._body is None else self._body.stretch()
        if stretch != self._stretch:
            self._stretch = stretch
            self._rng = self._new_generator()
        return self._rng

    def _new_generator(self) -> np.random.Generator:
        return np.random.default_rng([*self._seed, self._stretch % _SEED_RANGE])
