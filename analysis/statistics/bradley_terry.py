"""Bradley and Terry's model of choices between two, with Davidson's ties."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np
import numpy.typing as npt
from scipy import sparse, special

from visavis.analysis.statistics.answer_likelihood import (
    MAX_QUADRATURE,
    N_NODES,
    AnswerLikelihood,
    RowTerms,
)
from visavis.analysis.statistics.clmm import ClmmEffect
from visavis.analysis.statistics.contrasts import (
    ContrastAdjustment,
    Contrasts,
    LevelPairs,
    contrast_family,
    pair_labels,
    pair_matrix,
    pairs_text,
)
from visavis.analysis.statistics.design import Codes, Frame, Missing, column_of
from visavis.analysis.statistics.errors import (
    MissingValue,
    NotConverged,
    NotNumeric,
    SubjectInTwoGroups,
    TooFewLevels,
    TooFewSubjects,
    UnknownMethod,
    option_text,
)
from visavis.analysis.statistics.gee import hotelling
from visavis.analysis.statistics.inputs import numbers, rows_text
from visavis.analysis.statistics.marginal import estimate_effect
from visavis.analysis.statistics.results import (
    Array,
    Interval,
    Provenance,
    Result,
    Row,
    number,
    p_text,
)

MAX_LOG_ODDS = 25.0


@dataclass(frozen=True)
class Ability:
    """How an item fares: its log ability above the mean of all, with error and interval.

    `preferred`, `tied` and `refused` count the pairs it stood in.
    """

    item: str
    ability: float
    se: float
    interval: Interval
    preferred: int
    tied: int
    refused: int

    def row(self) -> Row:
        """Return it as one flat table row."""
        return {
            "item": self.item,
            "estimate": self.ability,
            "se": self.se,
            "ci_low": self.interval.low,
            "ci_high": self.interval.high,
            "preferred": self.preferred,
            "tied": self.tied,
            "refused": self.refused,
        }


@dataclass(frozen=True)
class PairFit:
    """Deviance of a model from the counts of every pair by itself, choices taken as independent.

    A small p says that one scale does not explain these choices (they go in circles, say).
    """

    chi2: float
    df: int
    p: float

    def sentence(self) -> str:
        """Say it in one line."""
        return (
            f"one scale against every pair by itself: G²({self.df}) = {number(self.chi2)}, "
            f"{p_text(self.p)}, as if choices were independent"
        )


@dataclass(frozen=True)
class PairModel:
    """Log odds as fitted: `beta` (p,) of every item but the first above the first, then of the
    first place, of groups (times the items) and of a tie, where there are these.

    `robust` (p, p) is their covariance from people's scores, times n/(n − groups), `likelihood`
    that of the information; `df` people − groups. `spread` (q, q) is the covariance of what people
    like beyond all, where it is random.
    """

    beta: Array
    robust: Array
    likelihood: Array
    log_likelihood: float
    df: int
    spread: Array = field(default_factory=lambda: np.zeros((0, 0)))
    is_singular: bool = False

    def test(self, L: Array) -> tuple[float, float]:
        """Return F and denominator df of Lβ = 0 (q, p), Hotelling's T² of people's scores."""
        return hotelling(L, self.beta, self.robust, self.df)


@dataclass(frozen=True)
class BradleyTerry(Result):
    """Tests, abilities and pairs of a Bradley–Terry(–Davidson) model.

    `effects` holds the test that all items are alike and, with groups, that groups judge them
    alike; `tie` and `first_place` are log odds (None where not fitted): of a tie between equals,
    and of the item in first place. `fit` is None with groups, places, or no pair to spare.
    """

    effects: tuple[ClmmEffect, ...]
    abilities: tuple[Ability, ...]
    tie: float | None
    first_place: float | None
    fit: PairFit | None
    model: PairModel
    provenance: Provenance

    @property
    def items(self) -> tuple[str, ...]:
        """The items compared, in their order."""
        return tuple(a.item for a in self.abilities)

    def contrasts(self, *, adjust: ContrastAdjustment = "holm") -> Contrasts:
        """Compare all items two by two; the effect is the odds of being preferred."""
        k = len(self.items)
        L = pair_matrix(k) @ _abilities_of(k, self.model.beta.size)
        return _odds(self, ("items",), pair_labels(self.items), L, k, adjust)

    def place(self) -> Contrasts | None:
        """Return the odds of what stands first; None where they were not fitted."""
        if self.first_place is None:
            return None
        L = np.eye(self.model.beta.size)[[len(self.items) - 1]]
        return _odds(self, ("place",), [(("first", "second"),)], L, 2, "none")

    def order(self) -> str:
        """Return the items from the most to the least preferred, in a sentence."""
        best_first = sorted(self.abilities, key=lambda a: -a.ability)
        lines = "; ".join(f"{a.item} {number(a.ability)}, {a.interval}" for a in best_first)
        return f"Log abilities, of which the mean is 0: {lines}."

    def sentence(self) -> str:
        """Return the tests and the order of the items."""
        lines = [f"{self.provenance.test}, n = {self.provenance.n}."]
        lines += [effect.sentence() + "." for effect in self.effects]
        lines.append(self.order())
        lines += [f"Note: {note}." for note in self.provenance.notes]
        return "\n".join(lines)

    def rows(self) -> tuple[Row, ...]:
        """Return one flat table row per test."""
        return tuple({**e.row(), **self.provenance.row()} for e in self.effects)

    def row(self) -> Row:
        """Return the first test's row; `rows` has them all."""
        return self.rows()[0]


@dataclass(frozen=True)
class DavidsonRows:
    """Choices at log odds η of the first above the second: `sign` 1, −1 or 0 for a tie.

    Their own parameter, where there are ties, is the log odds of one between equals, on the scale
    of half the odds (Davidson 1970).
    """

    sign: Array
    has_ties: bool

    @property
    def n_own(self) -> int:
        """One with ties, else none."""
        return int(self.has_ties)

    def start(self) -> Array:
        """Return equal odds."""
        return np.zeros(self.n_own)

    def in_order(self, order: Codes) -> "DavidsonRows":
        """Return the rows in another order."""
        return replace(self, sign=self.sign[order])

    def terms(self, own: Array, eta: Array, *, is_curved: bool) -> RowTerms:
        """Return log-likelihoods with derivatives."""
        sign = self.sign if eta.ndim == 1 else self.sign[:, None]
        half = eta / 2
        log_tie = np.full(half.shape, own[0] if self.has_ties else -np.inf)
        log_odds = np.stack([half, -half, log_tie])
        log_sum = special.logsumexp(log_odds, axis=0)
        first, second, tie = np.exp(log_odds - log_sum)
        log_p = np.where(sign > 0, half, np.where(sign < 0, -half, log_tie)) - log_sum
        lean, either = first - second, first + second
        bend, turn = (either - lean**2) / 4, lean * (tie / 2 - either + lean**2) / 4
        by_tie = ((sign == 0) - tie, lean * tie / 2, tie * (2 * lean**2 - either) / 4)
        return RowTerms(log_p, (sign - lean) / 2, bend, turn, (by_tie,) if self.has_ties else ())

    def by_parameter(self, own: Array, parts: tuple[Array, ...]) -> Array:
        """Return derivatives in the odds of a tie."""
        return np.stack(parts, axis=1) if parts else np.zeros((self.sign.size, 0))


@dataclass(frozen=True)
class _Votes:
    """Rows of choices, columns `X` (rows, p) of the odds, `Z` (rows, q) of what people like."""

    X: Array
    sign: Array
    subject: Codes
    has_ties: bool
    Z: Array
    is_alike: bool = False
    nodes: int = 0

    @property
    def rows(self) -> DavidsonRows:
        """The choices, without what they depend on."""
        return DavidsonRows(self.sign, self.has_ties)

    def likelihood(self) -> AnswerLikelihood:
        """Return the likelihood of the choices."""
        usual = N_NODES if self.Z.shape[1] == 1 else 1
        return AnswerLikelihood(
            self.rows,
            self.X,
            self.subject,
            self.Z,
            nodes=self.nodes or usual,
            is_alike=self.is_alike,
        )


_NO_PEAK = (
    "the Bradley–Terry model has no finite estimate: an item, a place or a group is preferred "
    "throughout, or too few pairs were judged"
)


def bradley_terry(
    frame: Frame,
    dv: str,
    *,
    first: str,
    second: str,
    subject: str,
    between: str = "",
    items: Sequence[str] = (),
    side: bool = False,
    missing: Missing = "error",
    random: str = "",
    nodes: int = 0,
) -> BradleyTerry:
    """Fit abilities of items to choices between two, one row per choice.

    `first` and `second` are columns of the items compared, `dv` is above 0 where the first was
    preferred, below where the second was, 0 for a tie. P(first) is proportional to π₁, P(second)
    to π₂ and P(tie) to ν√(π₁π₂) (Davidson 1970); without ties it is Bradley and Terry's (1952).
    `side` adds the odds of the item in first place (Davidson and Beaver 1977). Rows of two equal
    items carry no information on the items and are left out.

    People differ in what they like, so one person's choices are not independent: tests are
    Hotelling's T² of people's scores (robust errors); the likelihood ratio reported with them
    treats all choices as independent. With `between`, groups are compared in what they like.
    `random` gives every person log abilities of their own, normal around those of all: with one SD
    for all items ("alike"), or with an SD of each and all covariances ("maximal"), integrated by
    Laplace's approximation or by quadrature with so many `nodes`. Then odds are those of a person,
    and the likelihood ratio, too, lets people differ.

    Raises a `StatisticsError` naming the row, or `NotConverged` where an item, or a set of them,
    was never preferred to the others.
    """
    # 1. Rows that can be used: a vote, and two different items.
    firsts, seconds = (_labels(frame, name) for name in (first, second))
    people = _labels(frame, subject)
    vote = numbers(column_of(frame, dv), name=dv, allow_missing=missing != "error")
    groups = _labels(frame, between) if between else ["all"] * vote.size
    keep = ~np.isnan(vote)
    exclusions: tuple[str, ...] = ()
    if not keep.all():
        exclusions = (f"{int((~keep).sum())} rows without {dv}",)
    same = np.array([a == b for a, b in zip(firsts, seconds, strict=True)]) & keep
    if same.any():
        exclusions += (f"{int(same.sum())} rows of an item beside itself",)
    rows = np.flatnonzero(keep & ~same)
    if set(np.unique(vote[rows])) <= {0.0, 1.0}:
        raise NotNumeric(
            f"{dv} holds no number below 0: write 1 where {first} was preferred, {-1} where "
            f"{second} was, and 0 for a tie"
        )
    # 2. Items in their order; those that nobody compared have no ability.
    names = tuple(items) or tuple(dict.fromkeys(_in_natural_order({*firsts, *seconds})))
    compared_items = {firsts[i] for i in rows} | {seconds[i] for i in rows}
    absent = sorted(compared_items - set(names))
    if absent:
        raise UnknownMethod(f"{absent[0]!r} is compared but not among the items {', '.join(names)}")
    names = tuple(item for item in names if item in compared_items)
    if len(names) < 2:
        raise TooFewLevels(f"{first} and {second} name {len(names)} items; a comparison needs two")
    place = {item: i for i, item in enumerate(names)}
    a, b = (np.array([place[column[i]] for i in rows]) for column in (firsts, seconds))
    sign = np.sign(vote[rows])
    persons, person = np.unique([people[i] for i in rows], return_inverse=True)
    kinds, kind = np.unique([groups[i] for i in rows], return_inverse=True)
    _refuse_two_groups(person, kind, persons, subject, between)
    if persons.size <= kinds.size:
        raise TooFewSubjects(f"{persons.size} people; a group needs more than one")
    # 3. Without a way from every item to every other the likelihood has no peak (Ford 1957).
    for j, group in enumerate(kinds):
        _refuse_unbeaten(
            names,
            a[kind == j],
            b[kind == j],
            sign[kind == j],
            f" in {between} {group}" if between else "",
        )
    # 4. Log odds of a row: ability of the first minus that of the second item; the first item of
    # all is the reference. Places and groups (sum-coded) are further columns.
    k = len(names)
    D = np.zeros((rows.size, k))
    D[np.arange(rows.size), a] += 1
    D[np.arange(rows.size), b] -= 1
    columns = [D[:, 1:]]
    if side:
        columns.append(np.ones((rows.size, 1)))
    codes = np.vstack([np.eye(kinds.size - 1), -np.ones(kinds.size - 1)])[kind]
    columns += [D[:, 1:] * codes[:, [j]] for j in range(kinds.size - 1)]
    Z = _own_columns(D, random)
    if persons.size <= Z.shape[1] and random == "maximal":
        raise TooFewSubjects(
            f"{persons.size} people do not determine the covariances of {k} items; take "
            + option_text("random", "alike")
        )
    if nodes > 1 and Z.shape[1] > MAX_QUADRATURE:
        raise UnknownMethod(
            f"quadrature over {k} items takes too long ({MAX_QUADRATURE + 1} at most); leave nodes "
            "out (Laplace)"
        )
    # 5. Fit, and test the items, and the groups' difference in them, by Hotelling's T².
    has_ties = bool((sign == 0).any())
    votes = _Votes(np.hstack(columns), sign, person, has_ties, Z, random == "alike", nodes)
    model = _model(votes, persons.size, kinds.size)
    ends = np.cumsum([0, *(c.shape[1] for c in columns)])
    terms: dict[tuple[str, ...], range] = {(first, second): range(k - 1)}
    if between:
        terms[first, second, between] = range(int(ends[1 + side]), int(ends[-1]))
    groups_of_two = tuple(str(kind) for kind in kinds[:2])
    pairs = {(first, second): (names[:2],), (first, second, between): (names[:2], groups_of_two)}
    effects = tuple(
        _effect(term, list(at), votes, model, pairs[term]) for term, at in terms.items()
    )
    # 6. What a reader must know.
    notes = [f"{rows.size} choices of {persons.size} people between {k} items"]
    if votes.has_ties:
        share = float((sign == 0).mean())
        notes.append(f"{100 * share:.0f} % ties (Davidson)")
    notes += _people_like(names, model, random)
    fit = None if side or between or random else _fit(votes, model.beta, a, b)
    if fit is not None:
        notes.append(fit.sentence())
    if np.unique(np.abs(sign * vote[rows])).size > 2:
        notes.append(f"only the direction of {dv} counts here, not its strength")
    place_at = k - 1 if side else None
    own_abilities = f"random abilities per {subject}, " if random else ""
    provenance = Provenance(
        "Bradley–Terry–Davidson model" if votes.has_ties else "Bradley–Terry model",
        int(persons.size),
        error_term=f"{own_abilities}robust errors of people",
        dropped=exclusions,
        notes=tuple(notes),
    )
    return BradleyTerry(
        effects,
        _abilities(names, a, b, sign, model),
        float(model.beta[-1]) if votes.has_ties else None,
        None if place_at is None else float(model.beta[place_at]),
        fit,
        model,
        provenance,
    )


def _own_columns(D: Array, random: str) -> Array:
    """Return the columns of what people like beyond all: none, or one less than there are items."""
    if random not in ("", "alike", "maximal"):
        raise UnknownMethod(f"random is {random!r}; it is alike, maximal, or left out")
    if not random:
        return np.zeros((D.shape[0], 0))
    if random == "maximal":
        return D[:, 1:]
    k = D.shape[1]
    basis = np.linalg.svd(np.eye(k) - 1 / k)[0][:, : k - 1]
    return np.asarray(D @ basis, dtype=np.float64)


def _model(votes: _Votes, n: int, groups: int) -> PairModel:
    fit = votes.likelihood().fit(
        no_peak=_NO_PEAK,
        is_far=lambda own, beta: np.abs(np.append(own, beta)).max(initial=0) > MAX_LOG_ODDS,
    )
    own = votes.rows.n_own
    last = np.roll(np.arange(own + fit.beta.size), -own)
    robust = fit.influence.T @ fit.influence * n / (n - groups)
    at = np.ix_(last, last)
    beta = np.concatenate([fit.beta, fit.own])
    return PairModel(
        beta,
        robust[at],
        fit.covariance[at],
        fit.log_likelihood,
        n - groups,
        fit.spread,
        fit.is_singular,
    )


def _people_like(items: Sequence[str], model: PairModel, random: str) -> list[str]:
    """Say how far people differ in what they like."""
    if not random:
        return []
    if random == "alike":
        sd = number(float(np.sqrt(model.spread[0, 0])))
        return [f"SD between people of the log ability of an item {sd}"]
    k = len(items)
    C = _abilities_of(k, k - 1)
    sds = np.sqrt(np.einsum("ij,jk,ik->i", C, model.spread, C))
    each = "; ".join(f"{item} {number(float(sd))}" for item, sd in zip(items, sds, strict=True))
    lines = [f"SD between people of log abilities above their mean: {each}"]
    if model.is_singular:
        lines.append(
            "what people like is singular: the choices do not tell their abilities all apart; take "
            + option_text("random", "alike")
        )
    return lines


def _effect(
    term: tuple[str, ...],
    at: list[int],
    votes: _Votes,
    model: PairModel,
    pairs: Sequence[tuple[str, ...]],
) -> ClmmEffect:
    F, df = model.test(np.eye(model.beta.size)[at])
    without = replace(votes, X=np.delete(votes.X, at, axis=1))
    fewer = without.likelihood()
    chi2 = max(0.0, 2 * (model.log_likelihood + fewer.loss(fewer.peak())[0]))
    q = len(at)
    p, chi2_p = float(special.fdtrc(q, df, F)), float(special.chdtrc(q, chi2))
    effect, comparison = None, ""
    if q == 1:  # the coefficient is of the second item above the first, groups are sum-coded
        times = -(2 ** (len(pairs) - 1))
        se = abs(times) * float(np.sqrt(model.robust[at[0], at[0]]))
        ratio = "odds" if len(pairs) == 1 else "odds ratio"
        comparison = pairs_text([(a, b) for a, b in pairs])
        effect = estimate_effect(times * float(model.beta[at[0]]), se, df, ratio=ratio)
    return ClmmEffect(term, F, q, df, p, effect, comparison, chi2, chi2_p)


def _abilities_of(k: int, p: int) -> Array:
    """Return the matrix (k, p) from coefficients to log abilities above their mean."""
    C: Array = np.zeros((k, p))
    C[1:, : k - 1] = np.eye(k - 1)
    C -= C.mean(axis=0)
    return C


def _abilities(
    items: tuple[str, ...], a: Codes, b: Codes, sign: Array, model: PairModel
) -> tuple[Ability, ...]:
    C = _abilities_of(len(items), model.beta.size)
    values, errors = C @ model.beta, np.sqrt(np.einsum("ij,jk,ik->i", C, model.robust, C))
    reach = float(special.stdtrit(model.df, 0.975)) * errors
    abilities = []
    for i, item in enumerate(items):
        n_wins = int(((a == i) & (sign > 0)).sum() + ((b == i) & (sign < 0)).sum())
        n_losses = int(((a == i) & (sign < 0)).sum() + ((b == i) & (sign > 0)).sum())
        n_ties = int((((a == i) | (b == i)) & (sign == 0)).sum())
        span = Interval(float(values[i] - reach[i]), float(values[i] + reach[i]))
        abilities.append(
            Ability(item, float(values[i]), float(errors[i]), span, n_wins, n_ties, n_losses)
        )
    return tuple(abilities)


def _odds(
    fit: BradleyTerry,
    term: tuple[str, ...],
    pairs: Sequence[LevelPairs | str],
    L: Array,
    k: int,
    adjust: ContrastAdjustment,
) -> Contrasts:
    """Return contrasts of log odds with the odds as their effect."""
    estimates = L @ fit.model.beta
    ses = np.sqrt(np.einsum("ij,jk,ik->i", L, fit.model.robust, L))
    dfs = np.full(estimates.size, float(fit.model.df))
    effects = [
        estimate_effect(float(e), float(s), float(d), ratio="odds")
        for e, s, d in zip(estimates, ses, dfs, strict=True)
    ]
    return contrast_family(
        term,
        pairs,
        estimates,
        ses,
        dfs,
        k=k,
        adjustment=adjust,
        effects=effects,
        provenance=replace(fit.provenance, test="log odds of being preferred", notes=()),
    )


def _fit(votes: _Votes, beta: Array, a: Codes, b: Codes) -> PairFit | None:
    """Return the deviance from all pairs by themselves; None where nothing is left to test."""
    turn = np.where(a < b, 1.0, -1.0)
    low, high = np.minimum(a, b), np.maximum(a, b)
    outcomes = (1.0, -1.0, 0.0) if votes.has_ties else (1.0, -1.0)
    deviance, pairs = 0.0, 0
    for i, j in combinations(range(int(high.max()) + 1), 2):
        rows = np.flatnonzero((low == i) & (high == j))
        if not rows.size:
            continue
        pairs += 1
        X = votes.X[rows[:1]] * turn[rows[0]]
        for outcome in outcomes:
            count = int(((votes.sign * turn)[rows] == outcome).sum())
            if count:
                row = replace(votes.rows, sign=np.array([outcome]))
                q = X.shape[1]
                log_p = float(row.terms(beta[q:], X @ beta[:q], is_curved=False).log_p[0])
                deviance += 2 * count * (float(np.log(count / rows.size)) - log_p)
    df = pairs * (len(outcomes) - 1) - beta.size
    if df < 1:
        return None
    deviance = max(deviance, 0.0)
    return PairFit(deviance, df, float(special.chdtrc(df, deviance)))


def _refuse_unbeaten(items: tuple[str, ...], a: Codes, b: Codes, sign: Array, where: str) -> None:
    """Refuse items of which some were never preferred to the others: their odds are infinite."""
    better = np.concatenate([a[sign >= 0], b[sign <= 0]])
    worse = np.concatenate([b[sign >= 0], a[sign <= 0]])
    k = len(items)
    graph = sparse.coo_array((np.ones(better.size), (better, worse)), shape=(k, k))
    parts, part = sparse.csgraph.connected_components(graph, connection="strong")
    if parts == 1:
        return
    crossing = part[better] != part[worse]
    ahead = set(part[better[crossing]])
    behind = next(p for p in range(parts) if p not in ahead)
    names = ", ".join(items[i] for i in np.flatnonzero(part == behind))
    raise NotConverged(
        f"{names}: never preferred to any of the other items{where}, so that the odds have no "
        "finite estimate; judge more pairs, or leave these items out"
    )


def _refuse_two_groups(
    person: Codes, kind: Codes, persons: npt.NDArray[np.str_], subject: str, between: str
) -> None:
    for i, name in enumerate(persons):
        if np.unique(kind[person == i]).size > 1:
            raise SubjectInTwoGroups(f"{subject} {name} stands in two groups of {between}")


def _labels(frame: Frame, name: str) -> list[str]:
    values = list(np.asarray(column_of(frame, name), dtype=object))
    missing = [i for i, v in enumerate(values) if v is None or v != v or str(v) == ""]
    if missing:
        raise MissingValue(f"{name} is missing in {rows_text(missing)}")
    return [str(v) for v in values]


def _in_natural_order(names: set[str]) -> list[str]:
    try:
        return sorted(names, key=float)
    except ValueError:
        return sorted(names)
