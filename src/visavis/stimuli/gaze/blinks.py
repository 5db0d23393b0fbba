"""Draw the blinks of agents in advance, so that openness is a function of time."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from visavis.lab.clock import NS_PER_S

CLOSING_01 = 0.3
"""Share of a blink spent closing; lids fall faster than they rise."""
CLOSED_01 = 0.15
"""Share of a blink spent closed."""


@dataclass(frozen=True)
class BlinkParameters:
    """How often and how long: intervals from one blink's end to the next are
    `shortest_interval_s` plus a gamma variable of shape 2, `mean_interval_s` on average; durations
    are log-normal around their median. The defaults give about 16 blinks a minute.
    """

    mean_interval_s: float = 3.5
    shortest_interval_s: float = 0.8
    median_duration_ms: float = 230.0
    duration_log_sd: float = 0.2


DEFAULT_BLINK_PARAMETERS = BlinkParameters()


@dataclass(frozen=True)
class Blinks:
    """Blinks of several agents, in order of their start: `agent`, `start_ns`, `end_ns`, each (k,).

    Times count from the same zero as those the behaviour is asked for. Blinks of one agent do
    not overlap.
    """

    agent: npt.NDArray[np.int64]
    start_ns: npt.NDArray[np.int64]
    end_ns: npt.NDArray[np.int64]


def draw_blinks(
    rng: np.random.Generator,
    agent_count: int,
    duration_s: float,
    *,
    params: BlinkParameters = DEFAULT_BLINK_PARAMETERS,
) -> Blinks:
    """Draw the blinks of `agent_count` agents from time 0 on; the last may end after the duration.

    Every agent is already in the middle of an interval at time 0, so nobody starts with a blink
    more often than at any other time.
    """
    spread_s = params.mean_interval_s - params.shortest_interval_s
    count = 2 + int(2 * duration_s / params.mean_interval_s) + 8
    interval_s = params.shortest_interval_s + rng.gamma(2.0, spread_s / 2, (agent_count, count))
    length_s = (
        np.exp(rng.normal(0.0, params.duration_log_sd, (agent_count, count)))
        * params.median_duration_ms
        / 1000
    )
    passed_s = rng.uniform(0.0, 4 * params.mean_interval_s, agent_count)
    start_s = np.cumsum(interval_s, axis=1) + np.cumsum(length_s, axis=1) - length_s
    start_s -= passed_s[:, None]
    is_within = (start_s + length_s > 0) & (start_s < duration_s)
    agent = np.broadcast_to(np.arange(agent_count)[:, None], is_within.shape)[is_within]
    start_ns = np.round(start_s[is_within] * NS_PER_S).astype(np.int64)
    end_ns = start_ns + np.round(length_s[is_within] * NS_PER_S).astype(np.int64)
    order = np.argsort(start_ns, kind="stable")
    return Blinks(agent[order], start_ns[order], end_ns[order])
