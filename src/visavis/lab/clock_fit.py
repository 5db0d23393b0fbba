"""Map a device's clock to the host's from time exchanges or from one-way arrivals.

Raw stamps and all exchanges are stored as they are; the fits are stored in addition.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DataError

LOWEST_ROUND_TRIPS = 0.30
"""Share of exchanges that a fit uses: those with the shortest waits in queues."""

SAME_CLOCK_NS = 20_000_000
QUICK_WITHIN_NS = 20_000
QUICK_KEPT = 3


class TimeExchange(Protocol):
    """Host clock before and after, device clock in between, all ns."""

    @property
    def host_send_ns(self) -> int:
        """When the request left."""
        ...

    @property
    def device_ns(self) -> int:
        """What the device's clock showed."""
        ...

    @property
    def host_receive_ns(self) -> int:
        """When the answer came."""
        ...


@dataclass(frozen=True)
class ClockFit:
    """A straight line from device time to host-minus-device offset.

    `offset_ns` holds at `reference_device_ns`; `drift_ppm` is how much faster the host's clock
    runs than the device's; `residual_ms` is the weighted standard deviation about the line,
    NaN below three exchanges; `round_trip_ms` is the median round trip of the `n_used`
    exchanges. An asymmetric link biases the offset by at most half the round trip.
    """

    offset_ns: int
    drift_ppm: float
    reference_device_ns: int
    residual_ms: float
    n: int
    n_used: int
    round_trip_ms: float

    def to_host_ns(self, t_device_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """Map device times (n,) to the host's clock."""
        elapsed_ns = t_device_ns - self.reference_device_ns
        t_host_ns: npt.NDArray[np.int64] = (
            t_device_ns
            + self.offset_ns
            + np.rint(elapsed_ns * (self.drift_ppm * 1e-6)).astype("i8")
        )
        return t_host_ns


def fit_clock(pairs: Sequence[TimeExchange], *, share: float = LOWEST_ROUND_TRIPS) -> ClockFit:
    """Fit offset and drift by least squares on the exchanges with the lowest round trips.

    An exchange is wrong by at most half of what its round trip exceeds the lowest one by, so
    it weighs by the inverse square of that bound. One exchange gives an offset with drift
    zero. Raises DataError for none, or for one received before it was sent.
    """
    send, device, receive = _columns(pairs)
    round_trip = receive - send
    keep = max(min(3, send.size), int(np.ceil(share * send.size)))
    best = np.sort(np.argsort(round_trip, kind="stable")[:keep])
    reference = int(device[best[0]])
    elapsed_s = (device[best] - reference) / NS_PER_S
    offsets = send[best] + round_trip[best] // 2 - device[best]
    base = int(offsets[0])
    relative = (offsets - base).astype(np.float64)
    weights = _weights(round_trip[best] - round_trip.min())
    mean_s, mean_ns = float(weights @ elapsed_s), float(weights @ relative)
    centred_s = elapsed_s - mean_s
    spread_s2 = float(weights @ centred_s**2)
    drift_ns_per_s = float(weights @ (centred_s * relative)) / spread_s2 if spread_s2 > 0 else 0.0
    intercept = mean_ns - drift_ns_per_s * mean_s
    residuals = relative - intercept - drift_ns_per_s * elapsed_s
    spread = float(np.sqrt(weights @ residuals**2)) if keep > 2 else float("nan")
    return ClockFit(
        offset_ns=base + round(intercept),
        drift_ppm=drift_ns_per_s / 1e3,
        reference_device_ns=reference,
        residual_ms=spread / 1e6,
        n=int(send.size),
        n_used=keep,
        round_trip_ms=float(np.median(round_trip[best])) / 1e6,
    )


def offset_ns(pairs: Sequence[TimeExchange]) -> int:
    """Return one host-minus-device offset: the median of the exchanges with the least round trip.

    Exchanges within 1 % of the lowest round trip count, so a link whose best case is exact
    gives an exact integer. Use it over stretches short enough that drift does not matter.
    """
    send, device, receive = _columns(pairs)
    round_trip = receive - send
    best = round_trip <= round_trip.min() + round_trip.min() // 100
    offsets = np.sort(send[best] + round_trip[best] // 2 - device[best])
    return int(offsets[(offsets.size - 1) // 2])


def fit_one_way(t_device_ns: npt.NDArray[np.int64], t_host_ns: npt.NDArray[np.int64]) -> ClockFit:
    """Fit a stream without exchanges by the lower convex envelope of arrival minus device time.

    The line is the envelope's edge over the middle of the stream: no arrival lies below it. Its
    offset still contains the link's least delay. `n_used` counts the envelope's corners and
    `round_trip_ms` is NaN. Raises DataError below two distinct device times.
    """
    if t_device_ns.shape != t_host_ns.shape or np.unique(t_device_ns).size < 2:
        raise DataError("a one-way clock fit needs two samples at different device times")
    order = np.lexsort((t_host_ns, t_device_ns))
    device, host = t_device_ns[order], t_host_ns[order]
    reference = int(device[0])
    base = int(host[0] - device[0])
    x = (device - reference) / NS_PER_S
    y = (host - device - base).astype(np.float64)
    corners = _lower_envelope(x, y)
    middle = x[-1] / 2
    edge = max(i for i in range(len(corners) - 1) if x[corners[i]] <= middle)
    left, right = corners[edge], corners[edge + 1]
    drift_ns_per_s = (y[right] - y[left]) / (x[right] - x[left])
    intercept = y[left] - drift_ns_per_s * x[left]
    above = y - intercept - drift_ns_per_s * x
    return ClockFit(
        offset_ns=base + round(intercept),
        drift_ppm=float(drift_ns_per_s) / 1e3,
        reference_device_ns=reference,
        residual_ms=float(np.std(above)) / 1e6,
        n=int(x.size),
        n_used=len(corners),
        round_trip_ms=float("nan"),
    )


def _weights(excess_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
    """Return weights that sum to one; a fifth of the median excess keeps the best finite."""
    bound = excess_ns.astype(np.float64)
    floor = max(0.2 * float(np.median(bound)), 1.0)
    raw = 1.0 / (bound**2 + floor**2)
    weights: npt.NDArray[np.float64] = raw / raw.sum()
    return weights


def _lower_envelope(x: npt.NDArray[np.float64], y: npt.NDArray[np.float64]) -> list[int]:
    """Return indices of the lower convex hull's corners, by Andrew's monotone chain."""
    corners: list[int] = []
    for i in range(x.size):
        if corners and x[i] == x[corners[-1]]:
            continue  # sorted by y within equal x: the first is the lowest
        while len(corners) > 1:
            a, b = corners[-2], corners[-1]
            turn = (x[b] - x[a]) * (y[i] - y[a]) - (y[b] - y[a]) * (x[i] - x[a])
            if turn > 0:
                break
            corners.pop()
        corners.append(i)
    return corners


def _columns(
    pairs: Sequence[TimeExchange],
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    if not pairs:
        raise DataError("a clock fit needs at least one time exchange; there is none")
    table = np.array([(p.host_send_ns, p.device_ns, p.host_receive_ns) for p in pairs], "i8")
    send, device, receive = table.T
    wrong = np.flatnonzero(receive < send)
    if wrong.size:
        raise DataError(f"time exchange {int(wrong[0])} was received before it was sent")
    return send, device, receive


def latest_quick(pairs: Sequence[TimeExchange]) -> list[TimeExchange]:
    """Return the last three exchanges that were hardly slower than the quickest.

    "Hardly" is 20 µs of round trip. Exchanges from before a jump of the device's clock (more
    than 20 ms away from the last exchange's offset) are left out. With recent exchanges only, a
    drifting clock displaces the offset less than it would over all of them.
    """
    if not pairs:
        return []
    send, device, receive = _columns(pairs)
    round_trip = receive - send
    offsets = send + round_trip // 2 - device
    same = np.abs(offsets - offsets[-1]) <= SAME_CLOCK_NS + round_trip
    quick = same & (round_trip <= round_trip[same].min() + QUICK_WITHIN_NS)
    return [pairs[int(i)] for i in np.flatnonzero(quick)[-QUICK_KEPT:]]
