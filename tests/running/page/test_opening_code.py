"""Six digits open a session where they are asked for; who guesses is shut out, and told of."""

from pathlib import Path
from typing import Any

import aiohttp
import pytest

from tests.running.page.served_places import Place, serve
from visavis.lab.clock import NS_PER_S
from visavis.running.page.opening_code import (
    DIGITS,
    MAX_WRONG,
    MAX_WRONG_FROM_ONE,
    MISSING,
    TOO_MANY,
    WRONG,
    OpeningCode,
    new_code,
)
from visavis.running.page.reception import Reception, Rules

CODE = "435895"
HERE = "192.168.1.7"


def guess(code: OpeningCode, address: str = HERE, n: float = MAX_WRONG_FROM_ONE) -> list[str]:
    """Return how so many wrong codes of one address are refused, all at once."""
    return [code.refusal(f"{i:06d}", address, 0) for i in range(int(n))]


def test_a_code_has_six_digits_and_is_another_each_time() -> None:
    codes = {new_code() for _ in range(20)}
    assert {DIGITS} == {len(code) for code in codes}
    assert all(code.isdigit() for code in codes)
    assert len(codes) > 1


@pytest.mark.parametrize(
    ("typed", "refusal"), [(CODE, ""), ("", MISSING), ("435896", WRONG), ("é", WRONG)]
)
def test_the_right_code_opens_and_others_are_refused_by_name(typed: str, refusal: str) -> None:
    assert refusal == OpeningCode(CODE).refusal(typed, HERE, 0)


def test_who_guesses_from_one_address_is_shut_out_there_and_comes_back_after_a_minute() -> None:
    code = OpeningCode(CODE)
    assert [WRONG] * int(MAX_WRONG_FROM_ONE) == guess(code)
    assert TOO_MANY == code.refusal(CODE, HERE, 59 * NS_PER_S)  # or guessing would go on
    assert "" == code.refusal(CODE, "192.168.1.8", 59 * NS_PER_S)
    assert "" == code.refusal(CODE, HERE, 60 * NS_PER_S)


def test_who_guesses_from_many_addresses_is_shut_out_with_everybody_for_half_a_minute() -> None:
    code = OpeningCode(CODE)
    addresses = [f"192.168.1.{n}" for n in range(int(MAX_WRONG))]
    assert {WRONG} == {code.refusal("000000", address, 0) for address in addresses}
    assert TOO_MANY == code.refusal(CODE, "192.168.2.1", 29 * NS_PER_S)
    assert "" == code.refusal(CODE, "192.168.2.1", 30 * NS_PER_S)


def test_codes_that_are_right_count_for_nothing() -> None:
    code = OpeningCode(CODE)
    assert {""} == {code.refusal(CODE, HERE, 0) for _ in range(200)}


def test_whoever_serves_is_told_of_each_lockout_once_and_of_nobodys_address() -> None:
    warnings: list[str] = []
    code = OpeningCode(CODE, warnings.append)
    assert WRONG in guess(code, n=50)
    assert 1 == len(warnings)
    assert "5 wrong codes" in warnings[0]
    assert HERE not in warnings[0]
    for n in range(int(MAX_WRONG)):
        code.refusal("000000", f"192.168.2.{n}", 0)
    assert ["20 wrong codes" in text for text in warnings] == [False, True]


def arrive(place: Place, *bodies: dict[str, Any]) -> list[dict[str, Any]]:
    """Return what a server answers to arrivals, one after another; "KEY" is the first one's."""

    async def act(base: str, _: Reception) -> list[dict[str, Any]]:
        answers: list[dict[str, Any]] = []
        async with aiohttp.ClientSession(base) as http:
            for body in bodies:
                if body.get("before") == "KEY":
                    body = {**body, "before": answers[0]["key"]}
                async with http.post("/api/arrive", json={"parameters": {}, **body}) as answer:
                    answers.append(await answer.json())
        return answers

    replies: list[dict[str, Any]] = serve(place, act)
    return replies


def test_without_the_code_nobody_gets_a_session_and_the_page_says_what_to_do(
    tmp_path: Path,
) -> None:
    place = Place(tmp_path, Rules(), OpeningCode(CODE))
    asked, wrong, other = arrive(place, {}, {"code": "111111"}, {"before": "of-another-study"})
    assert ["code"] * 3 == [answer["refused"] for answer in (asked, wrong, other)]
    assert "six digits" in asked["text"]
    assert "not the code" in wrong["text"]
    assert [] == place.sessions()


def test_with_the_code_a_session_begins_and_the_same_browser_needs_it_no_more(
    tmp_path: Path,
) -> None:
    place = Place(tmp_path, Rules(), OpeningCode(CODE))
    panel = {"parameters": {"PROLIFIC_PID": "5f3c0f0e6d1b2a0001a1b2c3"}}
    first, again, elsewhere = arrive(
        place, {**panel, "code": CODE}, {**panel, "before": "KEY"}, panel
    )
    assert first["key"] == again["key"]
    assert "key" not in elsewhere
    assert 1 == len(place.sessions())


def test_a_study_that_asks_for_no_code_takes_whoever_comes(tmp_path: Path) -> None:
    (answer,) = arrive(Place(tmp_path, Rules()), {"code": "111111"})
    assert "key" in answer
