"""A few trials of a study, performed unseen before a session: what compiles, loads and fills."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

from visavis.protocol.plan.session_plan import SessionPlan, Trial
from visavis.study.experiment import StudyExperiment

MAX_TRIALS, MAX_S = 8, 130.0
"""So many, or so long, beside the first trial of every block.

A level more brings other numbers, seldom other code.
"""


@dataclass(frozen=True, eq=False)
class FewTrials(StudyExperiment):
    """An experiment whose plan holds the first trial of every block, and levels not met there."""

    def plan(self, participant_index: int, seed: int, group: str = "") -> SessionPlan:
        """Return the plan with those trials alone."""
        made = super().plan(participant_index, seed, group)
        first = [block.trials[0] for block in made.blocks if block.trials]
        most = min(MAX_TRIALS, int(MAX_S / max(self.trial_s, 1.0)))
        kept = {t.trial_id for t in (*first, *_of_other_levels(made.trials, first, most))}
        blocks = (
            replace(b, trials=tuple(t for t in b.trials if t.trial_id in kept)) for b in made.blocks
        )
        return replace(made, blocks=tuple(blocks))


def _of_other_levels(trials: Sequence[Trial], met_in: Sequence[Trial], most: int) -> list[Trial]:
    """Return trials in which further levels are met, those of the smallest factors first."""
    everything = {level for trial in trials for level in trial.factors.items()}
    worth = Counter(name for name, _ in everything)
    met = {level for trial in met_in for level in trial.factors.items()}
    chosen: list[Trial] = []
    while len(chosen) < most and met != everything:
        best = max(
            trials,
            key=lambda t: sum(1 / worth[k] for k, v in t.factors.items() if (k, v) not in met),
        )
        chosen.append(best)
        met |= set(best.factors.items())
    return chosen
