"""The stare study as the command line uses it: declared on the kit, analysed by its own rules."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from analysis.report.sources import provenance_of_sessions
from experiments.stare.analysis_parameters import AnalysisParameters
from experiments.stare.comparisons import LEVELS
from experiments.stare.study import study
from protocol.parameters import parameters_from
from recording.reader import Recording
from visavis.intake import SessionIntake
from visavis.opened import OpenedStudy, overrides_of
from visavis.study import Study


@dataclass(frozen=True, eq=False)
class StareBundle(OpenedStudy):
    """The declared study with an analysis of its own."""

    study: Study = field(default_factory=lambda: study)

    def levels(self, plan: Mapping[str, Any]) -> Mapping[str, tuple[str, ...]]:
        """Return what a recorded study varied, places in the order of the audience."""
        cells = list(self.experiment(overrides_of(plan)).conditions())
        return {name: tuple(dict.fromkeys(str(c[name]) for c in cells)) for name in LEVELS}

    def analyse(
        self,
        sessions: Sequence[SessionIntake],
        out_dir: Path,
        *,
        is_simulated: bool,
        commands: tuple[str, ...],
        example: Recording | None,
        settings: Mapping[str, Any] | None = None,
    ) -> Path:
        """Write tables, figures and the report of a study; return the report's path."""
        # Figures take a second to import; sessions and previews do without.
        from experiments.stare.study_outputs import analyse_study
        from experiments.stare.trial_example import example_of

        outputs = analyse_study(
            pd.concat([s.rows for s in sessions], ignore_index=True),
            pd.DataFrame([s.person for s in sessions]),
            out_dir,
            is_simulated=is_simulated,
            provenance=provenance_of_sessions(
                self.name, [s.manifest for s in sessions], [s.source for s in sessions], commands
            ),
            sensitivity_rows=pd.concat([s.sensitivity for s in sessions], ignore_index=True),
            example=None if example is None else example_of(example),
            parameters=parameters_from(AnalysisParameters, settings or {}, "analysis of stare"),
            facts=sessions[0].facts,
            measures=self.study.looks[0].rules(sessions[0].manifest.plan),
            levels=self.levels(sessions[0].manifest.plan),
            study_parameters=sessions[0].manifest.plan["parameters"],
        )
        return outputs.report


MAKE_STUDY = StareBundle
"""What the command line calls to get the study."""
