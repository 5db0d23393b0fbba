"""How many new people a served study lets in at a time: over all, and from one address."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from ipaddress import IPv6Address, ip_address
from typing import Final

from visavis.lab.clock import NS_PER_S

IPV6_SITE_BITS: Final = 64
"""One household or lab has this many leading bits of an IPv6 address in common."""
MAX_ADDRESSES: Final = 10_000


@dataclass
class RateLimit:
    """Lets so many pass at once, then so many a second."""

    at_once: float = 60.0
    a_second: float = 2.0
    left: float = 60.0
    _seen_ns: int | None = None

    def lets_pass(self, now_ns: int) -> bool:
        """Tell whether one more may come at a time."""
        self.refill(now_ns)
        if self.left < 1.0:
            return False
        self.left -= 1.0
        return True

    def refill(self, now_ns: int) -> None:
        """Add what has become free until a time."""
        passed_s = 0.0 if self._seen_ns is None else (now_ns - self._seen_ns) / NS_PER_S
        self._seen_ns = now_ns
        self.left = min(self.at_once, self.left + self.a_second * passed_s)


@dataclass
class ArrivalLimits:
    """Limits of the people who arrive: of all together, and of each address.

    A class at one school comes from one address: 30 at once, then one in ten seconds. Addresses
    are kept in memory alone, and only until they have their whole allowance again.
    """

    of_all: RateLimit = field(default_factory=RateLimit)
    at_once_from_one: float = 30.0
    a_second_from_one: float = 0.1
    _of_address: dict[str, RateLimit] = field(default_factory=dict, repr=False)

    def lets_pass(self, address: str, now_ns: int) -> bool:
        """Tell whether one more may come from an address; "" where nobody knows it."""
        if address:
            self._forget(now_ns)
            n = self.at_once_from_one
            limit = self._of_address.setdefault(address, RateLimit(n, self.a_second_from_one, n))
            if not limit.lets_pass(now_ns):
                return False
        return self.of_all.lets_pass(now_ns)

    def give_back(self, address: str) -> None:
        """Let one more pass in place of who came from an address and does not count."""
        for limit in filter(None, (self.of_all, self._of_address.get(address))):
            limit.left = min(limit.at_once, limit.left + 1.0)

    def _forget(self, now_ns: int) -> None:
        """Forget the addresses that have their whole allowance; the oldest where there are many."""
        for address, limit in list(self._of_address.items()):
            limit.refill(now_ns)
            if limit.left >= limit.at_once or len(self._of_address) >= MAX_ADDRESSES:
                del self._of_address[address]


def visitor_address(peer: str, headers: Mapping[str, str]) -> str:
    """Return the address that a request came from, "" where a proxy here does not say it.

    A proxy before the server runs on this computer and adds the visitor's address at the end of
    `X-Forwarded-For`; what others say there is not believed. Of an IPv6 address the first half
    stands for the site.
    """
    try:
        address = ip_address(peer)
    except ValueError:
        return ""
    if address.is_loopback:
        forwarded = headers.get("X-Forwarded-For", "").rpartition(",")[2].strip()
        if not forwarded:
            return ""
        try:
            address = ip_address(forwarded)
        except ValueError:  # one limit for all whom the proxy names badly
            return forwarded[:45]
    if isinstance(address, IPv6Address):
        if address.ipv4_mapped is not None:
            return str(address.ipv4_mapped)
        return f"{IPv6Address(int(address) >> IPV6_SITE_BITS << IPV6_SITE_BITS)}/64"
    return str(address)
