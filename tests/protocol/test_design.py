from collections import Counter
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from visavis.lab.errors import DesignError
from visavis.protocol.plan.design import (
    Design,
    Factor,
    combinations_of,
    group_of,
    make_plan,
    trial_seed,
)
from visavis.protocol.plan.orders import never_next_to, no_more_than

GAZE = Factor("gaze", ("A", "D", "AD", "DA"))
PLACE = Factor("place", tuple(f"place{i}" for i in range(9)))


def stare(**changes):
    settings_ = {
        "factors": (GAZE, PLACE),
        "repetitions": 2,
        "blocks": 3,
        "order": "balanced_blocks",
        "balanced": ("gaze",),
        **changes,
    }
    return Design("stare", "1", **settings_)


def conditions(block):
    return [tuple(t.factors.values()) for t in block.trials]


seeds = st.integers(0, 2**31)
indices = st.integers(0, 500)


@given(seeds, indices)
@settings(max_examples=40, deadline=None)
def test_stare_blocks_are_as_balanced_as_arithmetic_allows(seed, index):
    plan = make_plan(stare(), seed=seed, participant_index=index)
    assert [24, 24, 24] == [len(b.trials) for b in plan.blocks]
    for block in plan.blocks:
        gaze = Counter(t.factors["gaze"] for t in block.trials)
        place = Counter(t.factors["place"] for t in block.trials)
        assert dict.fromkeys(GAZE.levels, 6) == gaze
        assert Counter({3: 6, 2: 3}) == Counter(place.values())
        assert max(Counter(conditions(block)).values()) == 1
    assert dict.fromkeys(((g, p) for g in GAZE.levels for p in PLACE.levels), 2) == Counter(
        c for b in plan.blocks for c in conditions(b)
    )


@given(
    st.lists(st.integers(1, 4), min_size=1, max_size=3),
    st.integers(1, 4),
    st.integers(1, 5),
    st.sampled_from(["fixed", "random", "latin_square", "williams"]),
    seeds,
    indices,
)
@settings(max_examples=60, deadline=None)
def test_every_order_is_a_permutation_of_the_factorial(sizes, reps, blocks, order, seed, index):
    factors = tuple(Factor(f"f{i}", tuple(range(n))) for i, n in enumerate(sizes))
    expected = Counter(tuple(c.values()) for c in combinations_of(factors) * reps)
    blocks = min(blocks, expected.total())
    design = Design("s", "1", factors, repetitions=reps, blocks=blocks, order=order)
    plan = make_plan(design, seed=seed, participant_index=index)
    assert expected == Counter(tuple(t.factors.values()) for t in plan.trials)
    assert blocks == len(plan.blocks)
    assert max(len(b.trials) for b in plan.blocks) - min(len(b.trials) for b in plan.blocks) <= 1
    assert list(range(1, expected.total() + 1)) == [t.number for t in plan.trials]


@given(st.integers(2, 4), st.integers(2, 4), st.integers(1, 4), st.integers(1, 3), seeds)
@settings(max_examples=40, deadline=None)
def test_balanced_factors_are_equal_in_every_block(n_a, n_b, blocks, times, seed):
    design = Design(
        "s",
        "1",
        (Factor("a", tuple(range(n_a))), Factor("b", tuple(range(n_b)))),
        repetitions=blocks * times,
        blocks=blocks,
        order="balanced_blocks",
        balanced=("a", "b"),
    )
    for block in make_plan(design, seed=seed, participant_index=0).blocks:
        for name in ("a", "b"):
            assert len(set(Counter(t.factors[name] for t in block.trials).values())) == 1


def test_equal_seed_and_index_give_an_equal_plan():
    first = make_plan(stare(practice=4), seed=3, participant_index=7)
    assert first == make_plan(stare(practice=4), seed=3, participant_index=7)


def test_participants_and_seeds_differ_in_order_and_trial_seeds():
    plans = [
        make_plan(stare(), seed=seed, participant_index=index)
        for seed in range(3)
        for index in range(3)
    ]
    assert 9 == len({tuple(c for b in p.blocks for c in conditions(b)) for p in plans})
    assert 9 * 72 == len({t.seed for p in plans for t in p.trials})


def test_trial_seed_depends_on_nothing_but_seed_participant_and_number():
    plan = make_plan(stare(practice=3), seed=11, participant_index=5)
    other = make_plan(stare(order="random", practice=0), seed=11, participant_index=5)
    expected = [trial_seed(11, 5, n) for n in range(1, 73)]
    assert expected == [t.seed for t in plan.trials if not t.is_practice]
    assert expected == [t.seed for t in other.trials]


@given(seeds, indices, st.integers(1, 1000))
def test_trial_seeds_fit_a_signed_64_bit_column(seed, index, number):
    assert 0 <= trial_seed(seed, index, number) < 2**63
    assert trial_seed(seed, index, number) != trial_seed(seed, index, number, practice=True)


def test_trial_seed_stays_what_recorded_studies_used():
    assert 4755582382628778216 == trial_seed(1, 0, 1)


def test_practice_comes_first_in_a_block_of_its_own():
    plan = make_plan(stare(practice=5), seed=1, participant_index=0)
    assert ["P1", "P2", "P3", "P4", "P5"] == [t.trial_id for t in plan.blocks[0].trials]
    assert all(t.is_practice for t in plan.blocks[0].trials)
    assert "T01" == plan.blocks[1].trials[0].trial_id
    assert [0, 1, 2, 3] == [b.index for b in plan.blocks]
    assert all(t.block == b.index for b in plan.blocks for t in b.trials)


def test_practice_can_be_given_trial_by_trial():
    cell = {"gaze": "D", "place": "place4"}
    plan = make_plan(stare(practice=(cell,)), seed=1, participant_index=0)
    assert [cell] == [t.factors for t in plan.blocks[0].trials]


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_rules_hold_within_every_block(seed):
    rules = (no_more_than(2, "gaze"), never_next_to("gaze", [("AD", "DA")]))
    for block in make_plan(stare(constraints=rules), seed=seed, participant_index=0).blocks:
        gaze = [t.factors["gaze"] for t in block.trials]
        assert all(len(set(gaze[i : i + 3])) > 1 for i in range(22))
        assert ("AD", "DA") not in set(pairwise(gaze))


def test_blocked_factor_changes_only_between_blocks_in_fixed_order():
    design = Design(
        "crowd",
        "1",
        (Factor("haptics", ("before", "on", "after")), Factor("crowd", tuple(range(8)))),
        blocked_by="haptics",
    )
    plan = make_plan(design, seed=1, participant_index=3)
    assert [{"before"}, {"on"}, {"after"}] == [
        {t.factors["haptics"] for t in b.trials} for b in plan.blocks
    ]
    assert all(set(range(8)) == {t.factors["crowd"] for t in b.trials} for b in plan.blocks)
    assert "Block 2: on" == plan.blocks[1].name


def test_williams_block_orders_balance_over_participants():
    design = Design(
        "s",
        "1",
        (Factor("mode", ("a", "b", "c", "d")), Factor("x", (1, 2))),
        blocked_by="mode",
        block_order="williams",
    )
    orders = [
        [b.trials[0].factors["mode"] for b in make_plan(design, seed=1, participant_index=i).blocks]
        for i in range(4)
    ]
    assert {1} == set(Counter(p for order in orders for p in pairwise(order)).values())


def test_phases_follow_one_another_and_keep_the_order_of_the_other_factors():
    design = Design(
        "s",
        "1",
        (Factor("phase", ("guess", "adjust")), Factor("means", ("a", "b", "c"))),
        order="latin_square",
        phased_by="phase",
    )
    for index in range(3):
        trials = make_plan(design, seed=1, participant_index=index).trials
        assert ["guess"] * 3 + ["adjust"] * 3 == [t.factors["phase"] for t in trials]
        means = [t.factors["means"] for t in trials]
        assert means[:3] == means[3:]
        assert "abc"[index] == means[0]


def test_a_factor_of_phases_varies_within_people_and_not_between_blocks():
    factors = (Factor("phase", (1, 2)), Factor("x", (1, 2)))
    with pytest.raises(DesignError, match="phased_by names 'mood'"):
        Design("s", "1", factors, phased_by="mood")
    with pytest.raises(DesignError, match="phase makes blocks and phases"):
        Design("s", "1", factors, blocked_by="phase", phased_by="phase")


@given(st.integers(1, 6), st.integers(1, 12), seeds)
def test_group_sizes_differ_by_at_most_one(n_groups, n_participants, seed):
    design = Design(
        "s", "1", (Factor("x", (1, 2)), Factor("group", tuple(range(n_groups)), between=True))
    )
    sizes = Counter(group_of(design, seed=seed, participant_index=i) for i in range(n_participants))
    full = [sizes.get(g, 0) for g in design.groups]
    assert max(full) - min(full) <= 1


def test_group_in_the_ledger_overrides_the_assignment():
    design = Design("s", "1", (Factor("x", (1, 2)), Factor("haptics", ("on", "off"), between=True)))
    for group in design.groups:
        plan = make_plan(design, seed=1, participant_index=0, group=group)
        assert {group} == {t.factors["haptics"] for t in plan.trials}
        assert group == plan.group
    with pytest.raises(DesignError, match="no group 'sometimes'"):
        make_plan(design, seed=1, participant_index=0, group="sometimes")


def test_order_of_a_participant_does_not_depend_on_the_group():
    design = Design("s", "1", (PLACE, Factor("haptics", ("on", "off"), between=True)))
    on, off = (make_plan(design, seed=1, participant_index=4, group=g) for g in ("on", "off"))
    assert [t.factors["place"] for t in on.trials] == [t.factors["place"] for t in off.trials]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"factors": (GAZE, GAZE)}, "given twice"),
        ({"factors": (Factor("g", ()),), "balanced": ()}, "no levels"),
        ({"factors": (Factor("g", (1, 1)),), "balanced": ()}, "level 1 twice"),
        ({"balanced": ("gaz",)}, "balanced names 'gaz'"),
        ({"blocked_by": "colour"}, "blocked_by names 'colour'"),
        ({"blocks": 0}, "start at 1"),
        ({"practice": ({"gaze": "Q", "place": "place1"},)}, "not a combination"),
        ({"factors": (Factor("g", (1, 2), between=True),), "balanced": ()}, "varies within"),
        ({"blocks": 73}, "cannot fill"),
    ],
)
def test_an_impossible_design_says_why(changes, message):
    with pytest.raises(DesignError, match=message):
        stare(**changes)


def test_balance_that_does_not_divide_is_refused_with_the_way_out():
    with pytest.raises(DesignError, match="occurs 8 times, which does not divide over 3"):
        make_plan(stare(balanced=("place",)), seed=1, participant_index=0)
    with pytest.raises(DesignError, match="do not divide into 5 equal blocks"):
        make_plan(stare(blocks=5), seed=1, participant_index=0)


def test_a_fixed_order_that_breaks_a_rule_is_refused():
    design = stare(order="fixed", constraints=(no_more_than(3, "gaze"),))
    with pytest.raises(DesignError, match="fixed order breaks the rule"):
        make_plan(design, seed=1, participant_index=0)


def test_a_negative_seed_is_refused():
    with pytest.raises(DesignError, match="start at 0"):
        make_plan(stare(), seed=-1, participant_index=0)


def test_levels_of_practice_alone_are_met_in_practice_and_never_counted():
    crowds = Factor("crowd", (1, 2), practice_only=(0,))
    plan = make_plan(
        Design("walks", "1", (crowds,), practice=({"crowd": 0},)), seed=1, participant_index=0
    )
    assert [0] == [t.factors["crowd"] for t in plan.trials if t.is_practice]
    assert [1, 2] == sorted(t.factors["crowd"] for t in plan.trials if not t.is_practice)
    with pytest.raises(DesignError, match="not a combination"):
        Design("walks", "1", (Factor("crowd", (1, 2)),), practice=({"crowd": 0},))
