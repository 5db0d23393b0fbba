"""Which trials and people count by the rules of a study, and why the others do not.

Rules act in order: trials that were not finished or were performed again, then trials, then
people. Every row keeps its place in the table with `is_analysed` and the reason.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import pandas as pd

from visavis.analysis.report.notation import count_of
from visavis.recording.integrity import DAMAGED_STATUS, LOST_STATUS
from visavis.study.exclusions import Exclusion, Level

REASON: Final = "left_out_because"
IS_ANALYSED: Final = "is_analysed"
PRACTICE: Final = "practice"
NOT_FINISHED: Final = "not finished"
PERFORMED_AGAIN: Final = "performed again later"
UNREADABLE: Final = "the recording is damaged"
HAND_TRIAL: Final = "excluded_by_hand"
HAND_PERSON: Final = "person_excluded_by_hand"
"""Columns of the reasons for which the lab left out a trial, or somebody, after the session."""
PERSON_OUT: Final = "participant left out: "


@dataclass(frozen=True)
class Left:
    """What a rule left out: how many trials or people, and its words."""

    rule: str
    level: Level
    count: int
    words: str


@dataclass(frozen=True)
class Selection:
    """What counts: `rows` holds every trial with `is_analysed` and the reason, `left` the steps."""

    rows: pd.DataFrame
    people: pd.DataFrame
    row_count: int
    left: tuple[Left, ...]
    limits: Mapping[str, float | None]

    @property
    def counted(self) -> pd.DataFrame:
        """The trials that count."""
        trials: pd.DataFrame = self.rows[self.rows[IS_ANALYSED]].reset_index(drop=True)
        return trials

    def applied(self, rules: Sequence[Exclusion]) -> list[Exclusion]:
        """Return the rules that are on and whose column there is."""
        return [
            r
            for r in rules
            if self.limits[r.name] is not None
            and r.column in (self.rows if r.level == "trial" else self.people)
        ]

    @property
    def finished(self) -> pd.DataFrame:
        """Finished trials, each once and without practice, whether they count or not.

        All of them would count without rules.
        """
        out = (PRACTICE, UNREADABLE, NOT_FINISHED, PERFORMED_AGAIN)
        trials: pd.DataFrame = self.rows[~self.rows[REASON].isin(out)]
        return trials


def left_out_lines(selection: Selection, rules: Sequence[Exclusion]) -> list[str]:
    """Return who and what does not count and why: trials by rule, then each person by name."""
    trials = [left for left in selection.left if left.level == "trial" and left.rule != PRACTICE]
    lines = [
        f"left out: {count_of(left.count, 'trial')}, {rule_words(selection, rules, left.rule)}"
        for left in trials
    ]
    people = selection.people[~selection.people[IS_ANALYSED].astype(bool)]
    lines += [
        f"left out: participant {name}, {why}"
        for name, why in zip(people["participant"], people[REASON], strict=True)
    ]
    return lines


def rule_words(selection: Selection, rules: Sequence[Exclusion], name: str) -> str:
    """Return in words what a step leaves out; for a rule, its column and the limit in force."""
    rule = next((r for r in rules if r.name == name), None)
    if rule is None:
        standard_words = {
            "damaged": f"unreadable, {UNREADABLE}",
            "unfinished": NOT_FINISHED,
            "repeated": PERFORMED_AGAIN,
            "by_hand": "by hand, after the session",
        }
        return standard_words.get(name, name.replace("_", " "))
    if rule.if_missing:
        return rule.words
    limit = selection.limits[name]
    what = rule.column_words
    return f"{what} {'above' if rule.above else 'below'} {limit:g}"


def select(
    rows: pd.DataFrame,
    rules: Sequence[Exclusion],
    limits: Mapping[str, float | None],
    *,
    cells: Sequence[str],
    planned_counts: Mapping[str, int],
    cell_count: int,
    facts: pd.DataFrame | None = None,
) -> Selection:
    """Decide which trials count.

    Where a trial was performed again, the last finished attempt counts. An attempt without a value
    that a rule requires (`if_missing`) does not replace an earlier one. `cells` are the factors
    within people whose combinations each person must meet, `planned_counts` the number of trials
    planned for each participant, `cell_count` how many cells each person meets. `facts` has one row
    per participant, with further columns that rules may name.
    """
    table = rows.reset_index(drop=True)  # a copy: the caller's table is not changed
    reasons = pd.Series([""] * len(table), dtype=object)
    left: list[Left] = []

    def exclude(
        out: "pd.Series[bool]", rule: str, level: Level, words: Sequence[str] | str
    ) -> None:
        # The first reason stays, so the order of the steps decides which one a trial gets.
        fresh = out & (reasons == "")
        texts = [words] * len(table) if isinstance(words, str) else list(words)
        reasons[fresh] = pd.Series(texts, dtype=object)[fresh]
        count = int(fresh.sum()) if level == "trial" else table.loc[out, "participant"].nunique()
        if count:
            left.append(Left(rule, level, int(count), texts[int(np.flatnonzero(out)[0])]))

    def judge(rule: Exclusion) -> None:
        limit = limits[rule.name]
        values = table[rule.column]
        out = values.map(lambda v, r=rule, n=limit: r.breaks(v, n)).astype(bool)
        exclude(
            out,
            rule.name,
            "trial",
            [rule.reason(v, limit) if bad else "" for v, bad in zip(values, out, strict=True)],
        )

    exclude(table["is_practice"].astype(bool), "practice", "trial", PRACTICE)
    unreadable = table["status"].isin((DAMAGED_STATUS, LOST_STATUS))
    exclude(unreadable, "damaged", "trial", UNREADABLE)
    exclude(table["status"] != "complete", "unfinished", "trial", NOT_FINISHED)
    if HAND_TRIAL in table:
        by_hand = table[HAND_TRIAL].fillna("").astype(str)
        exclude(by_hand != "", "by_hand", "trial", list(by_hand))
    trial_rules = [r for r in rules if r.level == "trial" and r.column in table]
    for rule in (r for r in trial_rules if r.if_missing):
        judge(rule)
    # Only complete attempts with every required value can be the last one of a trial.
    finished_attempts = table[reasons == ""].sort_values("attempt", kind="stable")
    again = pd.Series(False, index=table.index)
    again[
        finished_attempts.index[
            finished_attempts.duplicated(["participant", "session", "trial_id"], keep="last")
        ]
    ] = True
    exclude(again, "repeated", "trial", PERFORMED_AGAIN)
    finished_trials = table[reasons == ""]
    for rule in (r for r in trial_rules if not r.if_missing):
        judge(rule)
    # Rules on people come last: they look at the trials that the rules on trials left.
    people = participant_facts(
        table, finished_trials, reasons == "", cells, planned_counts, cell_count
    )
    if facts is not None:
        people = people.merge(facts, on="participant", how="left")
    if HAND_PERSON in table:
        of_rows = zip(table["participant"], table[HAND_PERSON].fillna(""), strict=True)
        by_hand_of = {str(name): str(reason) for name, reason in of_rows if reason}
        who = [by_hand_of.get(str(name), "") for name in table["participant"]]
        is_out = pd.Series([reason != "" for reason in who], index=table.index)
        exclude(is_out, "by_hand", "participant", [f"{PERSON_OUT}{reason}" for reason in who])
        people[REASON] = [
            "; ".join(filter(None, (before, by_hand_of.get(str(name), ""))))
            for name, before in zip(people["participant"], people[REASON], strict=True)
        ]
    for rule in (r for r in rules if r.level == "participant"):
        limit = limits[rule.name]
        texts = {}
        for name, value in zip(people["participant"], people.get(rule.column, ()), strict=False):
            if rule.breaks(value, limit):
                texts[name] = rule.reason(value, limit)
        out = table["participant"].astype(str).isin(texts)
        exclude(
            out,
            rule.name,
            "participant",
            [f"{PERSON_OUT}{texts.get(str(p), '')}" for p in table["participant"]],
        )
        for name, words in texts.items():
            at = people["participant"] == name
            people.loc[at, REASON] = [
                "; ".join(filter(None, (before, words))) for before in people.loc[at, REASON]
            ]
    table[IS_ANALYSED] = (reasons == "").to_numpy()
    table[REASON] = reasons.to_numpy()
    people[IS_ANALYSED] = people[REASON] == ""
    return Selection(table, people, len(table), tuple(left), dict(limits))


def participant_facts(
    rows: pd.DataFrame,
    finished: pd.DataFrame,
    counts: "pd.Series[bool]",
    cells: Sequence[str],
    planned_counts: Mapping[str, int],
    cell_count: int,
) -> pd.DataFrame:
    """Return the columns that rules on people use, one row per participant.

    `completed_01` is the share of planned trials that were finished, without those of damaged
    recordings, `bad_trials_01` the share of finished trials that were left out.
    `smallest_cell_trials` is the number of trials that count in the emptiest cell,
    `smallest_cell_01` the smallest share of a cell's planned trials that count,
    `calibration_error_deg` the mean error over the validations in force during the trials.
    """
    facts = []
    for name in sorted({*rows["participant"].astype(str), *planned_counts}):
        mine = finished[finished["participant"].astype(str) == name]
        good = mine[counts.reindex(mine.index, fill_value=False)]
        damaged_trials = _damaged_trials(rows, name)
        intact = planned_counts.get(name, 0) - len(damaged_trials)
        sizes = good.groupby(list(cells)).size() if cells and len(good) else pd.Series([len(good)])
        smallest = 0 if len(sizes) < cell_count else int(sizes.min())
        facts.append(
            {
                "participant": name,
                "trials_finished": len(mine),
                "completed_01": len(mine) / intact if intact > 0 else np.nan,
                "bad_trials_01": (len(mine) - len(good)) / len(mine) if len(mine) else np.nan,
                "smallest_cell_trials": smallest,
                "smallest_cell_01": _smallest_share(
                    good, damaged_trials, cells, planned_counts.get(name, 0), cell_count
                ),
                "calibration_error_deg": mean_error_deg(mine),
                REASON: "",
            }
        )
    return pd.DataFrame(facts)


def _smallest_share(
    good: pd.DataFrame,
    damaged_trials: pd.DataFrame,
    cells: Sequence[str],
    planned_count: int,
    cell_count: int,
) -> float:
    """Return the smallest share of a cell's planned trials that count.

    Trials lost to a damaged recording are not counted as planned. Where their cell is unknown they
    are divided equally among the cells.
    """
    if not planned_count:
        return float("nan")
    key = list(cells) or (lambda row: 0)
    sizes = good.groupby(key).size()
    if len(sizes) < cell_count:
        return 0.0
    unknown = damaged_trials[list(cells)].isna().any(axis=1)
    lost_per_cell = damaged_trials[~unknown].groupby(key).size().reindex(sizes.index, fill_value=0)
    intact = (planned_count - int(unknown.sum())) / cell_count - lost_per_cell
    return float((sizes / intact.clip(lower=1)).min())


def _damaged_trials(rows: pd.DataFrame, name: str) -> pd.DataFrame:
    """Return a participant's trials that were lost to a damaged recording, each once."""
    is_damaged = rows["status"].isin((DAMAGED_STATUS, LOST_STATUS)) & ~rows["is_practice"].astype(
        bool
    )
    mine = rows["participant"].astype(str) == name
    return rows[is_damaged & mine].drop_duplicates(
        [c for c in ("session", "trial_id") if c in rows]
    )


def mean_error_deg(rows: pd.DataFrame) -> float:
    """Return the mean error over the calibrations in force during one participant's trials."""
    if "calibration_accuracy_deg" not in rows:
        return float("nan")
    each = rows.dropna(subset=["calibration_accuracy_deg"])
    if "calibration_id" in each and each["calibration_id"].notna().all():
        each = each.drop_duplicates([c for c in ("session", "calibration_id") if c in each])
    return float(each["calibration_accuracy_deg"].astype(float).mean()) if len(each) else np.nan
