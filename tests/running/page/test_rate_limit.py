"""A flood of arrivals is held up, also from one address, which is that of the visitor."""

import pytest

from visavis.running.page.rate_limit import ArrivalLimits, RateLimit, visitor_address


def test_a_flood_of_arrivals_is_held_up_and_lets_people_in_again() -> None:
    brake = RateLimit(at_once=3, a_second=2, left=3)
    assert [True] * 3 + [False] == [brake.lets_pass(0) for _ in range(4)]
    assert [False, True] == [brake.lets_pass(ns) for ns in (400_000_000, 1_000_000_000)]
    assert [True] * 3 + [False] == [brake.lets_pass(10**12) for _ in range(4)]


def test_one_address_cannot_hold_everybody_else_up_and_is_forgotten() -> None:
    limits = ArrivalLimits(RateLimit(10, 1, 10), at_once_from_one=3, a_second_from_one=0.1)
    assert [True] * 3 + [False] * 2 == [limits.lets_pass("192.0.2.1", 0) for _ in range(5)]
    assert limits.lets_pass("192.0.2.2", 0)
    assert [False, True] == [limits.lets_pass("192.0.2.1", s * 10**9) for s in (9, 10)]
    assert all(limits.lets_pass("", 10**12) for _ in range(10))
    assert limits.lets_pass("192.0.2.3", 2 * 10**12)
    assert "192.0.2.1" not in str(vars(limits))


@pytest.mark.parametrize(
    ("peer", "forwarded", "address"),
    [
        ("192.0.2.77", None, "192.0.2.77"),
        ("8.8.8.8", "1.2.3.4", "8.8.8.8"),  # whoever comes directly cannot be somebody else
        ("127.0.0.1", None, ""),
        ("127.0.0.1", "9.9.9.9, 1.1.1.1", "1.1.1.1"),  # the last one is the proxy's word
        ("10.0.0.5", None, "10.0.0.5"),
        ("127.0.0.1", "nonsense", "nonsense"),  # one limit for all of them
        ("192.168.1.7", "8.8.8.8", "192.168.1.7"),  # of the lab's network, not a proxy's
        ("::ffff:1.2.3.4", None, "1.2.3.4"),
        ("2a02:8109:9c40:1::7", None, "2a02:8109:9c40:1::/64"),
        ("2a02:8109:9c40:1:9::8", None, "2a02:8109:9c40:1::/64"),
        ("", None, ""),
    ],
)
def test_an_address_is_that_of_the_visitor_and_not_of_a_proxy(
    peer: str, forwarded: str | None, address: str
) -> None:
    headers = {} if forwarded is None else {"X-Forwarded-For": forwarded}
    assert address == visitor_address(peer, headers)
