"""A study as data: what varies, what is asked, what is measured and compared, in what words.

A study file makes one `Study` and gives it a trial:

    study = Study("duel", "Whom do people look at?", factors=[...], compare=[...])

    @study.trial
    def trial(t):
        yield t.show(Scene("two_people", active=t.side, eyes=t.gaze), seconds=4)

Everything else follows from it once, for every study: planning, sessions, simulated people,
tables with their dictionaries, statistics, figures, report, power.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple, TypeAlias, get_args

from visavis.lab.errors import DesignError
from visavis.protocol.plan.columns import Column
from visavis.protocol.plan.design import BlockOrder, Design, Factor, TrialOrder
from visavis.protocol.plan.orders import Constraint
from visavis.protocol.plan.parameters import Range, parameters_from
from visavis.protocol.plan.steps import Scalar
from visavis.study.comparisons import Compare
from visavis.study.exclusions import STANDARD_RULES, Exclusion
from visavis.study.look_measures import LooksOn
from visavis.study.measures import Measure
from visavis.study.pairs import Family
from visavis.study.pieces import Pieces
from visavis.study.responses import Response
from visavis.study.scenes import Maker
from visavis.study.sections import ConcludeOf, Confusion, SectionOf, named
from visavis.study.study_functions import (
    AnswerOf,
    DemandsOf,
    FactsOf,
    FurtherOf,
    IntertrialPlan,
    PeopleOf,
    PersonOf,
    PrepareOf,
    QuickOf,
    RolesOf,
    ScaledOf,
    ViewsOf,
)
from visavis.study.trial import TrialPlan, TrialScript

RESERVED: Final = frozenset(name for name in dir(TrialScript) if not name.startswith("_")) | {
    "trial",
    "settings",
    "row",
    "view",
}
"""Names a trial script has already; no factor or parameter can be called so."""
SETTABLE: Final = (
    "repetitions",
    "practice",
    "blocks",
    "order",
    "intertrial_s",
    "answer_by",
    "answer_limit_s",
)
"""Parameters that every study has."""

On: TypeAlias = Literal["lab", "browser"]
Screening: TypeAlias = Literal["card", "sound"]


class MeanSd(NamedTuple):
    """A printed mean with its standard deviation over participants."""

    mean: float
    sd: float


@dataclass(frozen=True)
class Source:
    """Where a study comes from: the citation, and what is printed of it.

    `cells` are published means (and SDs) by measure and level: {"dwell_ms": {"D": (1210, 480)}}.
    """

    citation: str
    participants: int | None = None
    cells: Mapping[str, Mapping[str, tuple[float, float | None]]] = field(default_factory=dict)
    note: str = ""
    only: Mapping[str, Scalar] = field(default_factory=dict)
    """Levels of other factors that trials must have to stand beside it."""


@dataclass
class Study:
    """A study. Only name, title, factors and a trial are needed.

    `texts` names the folder of text files beside the study file. `parameters` are numbers, texts
    and truths a lab may replace with `--set`; a trial reads them as attributes. `ranges` say what
    they may be, and which levels of factors there are: `Within(0, 1)`, or names. `responses` need
    not be listed: they are found by reading the trial without performing it; list them where a
    trial asks only in some cases. `needs` and `uses` are roles of devices beside the headset;
    `spares` those without which the operator may go on (None: all used on which nothing rests).
    `uses` left out is the eye tracker, and the body tracker where answers are pointed: by ray, at
    people, on boards where no gaze is calibrated that could choose.
    `uses` and `people` may be functions of the parameters. `after_block` are questionnaires asked
    after every block that counts, `questionnaires` those at the end; `unasked` gives those of
    `after_block` that make no sense with the parameters in force, and are left out. `people` is
    at most how many people are seen at once, where scenes show others than their agents. A factor
    between people whose levels are one level makes no groups.
    `looks` ask for everything about looks on an agent (whole, by ray, in parts, by other detectors,
    by padding and minimum duration).
    `families` are families of simple tests: pairs of levels, correlations with a score; the first
    one of pairs is made again without rules of exclusion, and by padding and minimum duration.
    `questions` name what `conclude` answers and say what a yes would claim: power is found of them.
    `derived` are columns that follow from a trial's factors (a place from its zone and its depth);
    `cells` are the factors whose combinations are compared and described, where not all within
    people are: others only vary the situation. `columns` describe what the trial writes into its
    row besides. Where `validate` is no, gaze is recorded along and nothing rests on it.
    `dressed_by` names what dresses scenes that a trial makes itself ("module:function"). The eye
    tracker is calibrated at the beginning, and before every block with `calibrate_blocks`.
    `screening` is what a page looks at before its first trial: "card", how large the screen is;
    "sound", whether spoken digits are heard.
    `setup` answers items of the reporting list for eye tracking that follow from the study.
    `thresholds` is a dataclass of numbers of its own analysis, `pieces` how trials are measured
    one by one ("module:name" of it): `analyse --set` replaces fields of both by name.
    """

    name: str
    title: str = ""
    question: str = ""
    factors: Sequence[Factor] = ()
    repetitions: int = 1
    practice: int | Sequence[Mapping[str, Any]] = 0
    blocks: int = 1
    order: TrialOrder = "random"
    balanced: Sequence[str] = ()
    blocked_by: str | None = None
    block_order: BlockOrder = "fixed"
    constraints: Sequence[Constraint] = ()
    cells: Sequence[str] = ()
    derived: Mapping[str, Callable[[Mapping[str, Any]], Scalar]] = field(default_factory=dict)
    parameters: Mapping[str, Any] = field(default_factory=dict)
    ranges: Mapping[str, Range] = field(default_factory=dict)
    texts: str | None = None
    responses: Sequence[Response] = ()
    columns: Sequence[Column] = ()
    measures: Sequence[Measure] = ()
    looks: Sequence[LooksOn] = ()
    compare: Sequence[Compare] = ()
    families: Sequence[Family] = ()
    questions: Mapping[str, str] = field(default_factory=dict)
    exclusions: Sequence[Exclusion] = STANDARD_RULES
    thresholds: Any = None
    pieces: Pieces | str | None = None
    questionnaires: Sequence[str] = ()
    after_block: Sequence[str] = ()
    unasked: RolesOf | None = None
    needs: Sequence[str] = ()
    uses: Sequence[str] | RolesOf | None = None
    spares: Sequence[str] | None = None
    on: On = "lab"
    screening: Sequence[Screening] = ()
    people: int | PeopleOf = 0
    calibrate: bool = True
    calibrate_blocks: bool = False
    validate: bool = True
    intertrial_s: float = 1.0
    answer_by: Literal["board", "ray", "keyboard"] = "board"
    answer_limit_s: float = 30.0
    source: Source | None = None
    methods: str = ""
    references: Sequence[str] = ()
    setup: Mapping[str, str] = field(default_factory=dict)
    version: str = "1"
    folder: Path = field(default_factory=Path)
    dressed_by: str = ""
    plan_of: TrialPlan | None = None
    intertrial_of: IntertrialPlan | None = None
    check_of: Callable[[Mapping[str, Any]], None] | None = None
    demands_of: DemandsOf | None = None
    prepare_of: PrepareOf | None = None
    answer_of: AnswerOf | None = None
    person_of: PersonOf | None = None
    scaled_of: ScaledOf | None = None
    quick_of: QuickOf | None = None
    facts_of: FactsOf | None = None
    further_of: FurtherOf | None = None
    conclude_of: ConcludeOf | None = None
    views_of: ViewsOf | None = None
    sections: list[SectionOf | Confusion | str] = field(default_factory=list)
    """Sections of the report: functions that make them ("module:function" for one that takes long
    to import), or confusion matrices.
    """
    makers: dict[str, Maker] = field(default_factory=dict)
    path: Path | None = None
    """The file it was read from; None for a study of an installed package."""
    base: "Study | None" = None
    """The study it was derived from, if it was."""
    plan_folder: Path | None = None
    """Where the files of a trial lie that was taken over; None: in the study's own folder."""

    def __post_init__(self) -> None:
        problems = []
        if not self.name.isidentifier() or not self.name.islower():
            problems.append(f"the name {self.name!r} is not made of small letters, digits and _")
        if not self.factors:
            problems.append("there is no factor; add one, if need be with one level")
        problems += [
            f"nothing can be called {name!r}: a trial uses that name itself"
            for name in (*(f.name for f in self.factors), *self.parameters, *self.derived)
            if name in RESERVED or not name.isidentifier()
        ]
        names = [f.name for f in self.factors]
        problems += [f"{n!r} is a factor and a parameter" for n in names if n in self.parameters]
        problems += [
            f"{n!r} is a parameter of every study" for n in self.parameters if n in SETTABLE
        ]
        problems += [
            f"screening knows no {n!r}; it knows {', '.join(get_args(Screening))}"
            for n in self.screening
            if n not in get_args(Screening)
        ]
        if problems:
            raise DesignError(f"study {self.name}: {'; '.join(problems)}")
        self.title = self.title or self.name.replace("_", " ").capitalize()

    # ---- what a study file adds ----

    def trial(self, plan: TrialPlan) -> TrialPlan:
        """Take a generator as the study's trial (a decorator)."""
        self.plan_of, self.plan_folder, self.quick_of = plan, None, None
        return plan

    def intertrial(self, plan: IntertrialPlan) -> IntertrialPlan:
        """Take a generator as what happens before a trial, darkness otherwise (a decorator).

        It begins at a frame (`t.now_ns`); how long it took is the row's `intertrial_ms`.
        """
        self.intertrial_of = plan
        return plan

    def check(
        self, check: Callable[[Mapping[str, Any]], None]
    ) -> Callable[[Mapping[str, Any]], None]:
        """Take a function that raises DesignError for parameters that do not fit (a decorator)."""
        self.check_of = check
        return check

    def demands(self, demands: DemandsOf) -> DemandsOf:
        """Take a function of the parameters as what the study asks of a lab (a decorator)."""
        self.demands_of = demands
        return demands

    def prepare(self, prepare: PrepareOf) -> PrepareOf:
        """Take what is loaded or computed before a session (a decorator).

        A function of the experiment returns it as calls without arguments, to be made in turn.
        """
        self.prepare_of = prepare
        return prepare

    def answer(self, answer: AnswerOf) -> AnswerOf:
        """Take a function as what simulated people answer (a decorator)."""
        self.answer_of = answer
        return answer

    def scene(self, name: str) -> Callable[[Maker], Maker]:
        """Take a function as the maker of a scene of this study (a decorator)."""

        def taken(maker: Maker) -> Maker:
            self.makers[name] = maker
            return maker

        return taken

    def person(self, make: PersonOf) -> PersonOf:
        """Take a function of place, seed, effect and experiment as what makes the simulated
        participant (a decorator).
        """
        self.person_of, self.scaled_of, self.quick_of = make, None, None
        return make

    def scaled(self, make: ScaledOf) -> ScaledOf:
        """Take a function as what makes simulated participants to whom what is shown makes a
        multiple of the usual difference: 0 none, 1 the usual (a decorator). It stands in place of
        `person`.
        """
        self.scaled_of = make
        return make

    def quick(self, quick: QuickOf) -> QuickOf:
        """Take a function as a path through trials shorter than the kit's (a decorator).

        It holds for the trial and the person declared before it. Given experiment, person and
        tracker it returns what performs a plan: every trial that is
        no practice with the columns of its row, measures among them.
        """
        self.quick_of = quick
        return quick

    def facts(self, facts: FactsOf) -> FactsOf:
        """Take a function of all trials as what is known of each person (a decorator).

        It returns one row per `participant`; rules of exclusion may name its columns.
        """
        self.facts_of = facts
        return facts

    def further(self, further: FurtherOf) -> FurtherOf:
        """Take a function of the analysis as what the study finds besides (a decorator).

        Conclusions and sections read it as `analysis.further`; power does without.
        """
        self.further_of = further
        return further

    def conclude(self, conclude: ConcludeOf) -> ConcludeOf:
        """Take a function of the analysis as what answers the study's questions (a decorator)."""
        self.conclude_of = conclude
        return conclude

    def views(self, views: ViewsOf) -> ViewsOf:
        """Take a function as what rebuilds the views a recorded frame may have shown, the
        likeliest first (a decorator).
        """
        self.views_of = views
        return views

    def section(self, section: SectionOf) -> SectionOf:
        """Take a function as the maker of a section of the report (a decorator)."""
        self.sections.append(section)
        return section

    # ---- what follows ----

    @property
    def measured_in_pieces(self) -> Pieces | None:
        """How its trials are measured one by one; None where a session is measured at once."""
        found: Pieces | None = named(self.pieces) if isinstance(self.pieces, str) else self.pieces
        return found

    def thresholds_with(self, settings: Mapping[str, Any]) -> Any:
        """Return the numbers of its own analysis with those that were set; None without any.

        Raises:
            ConfigError: a value is none of the kind.
            UsageError: it is out of range.
        """
        if self.thresholds is None:
            return None
        known = {f.name for f in fields(self.thresholds)}
        own = {k: v for k, v in settings.items() if k in known}
        return parameters_from(type(self.thresholds), own, f"analysis of {self.name}")

    @property
    def trial_plan(self) -> TrialPlan:
        """The trial.

        Raises:
            DesignError: the study has none.
        """
        if self.plan_of is None:
            raise DesignError(f"study {self.name} has no trial; write one under @study.trial")
        return self.plan_of

    def design(self, parameters: Mapping[str, Any]) -> Design:
        """Return the design with parameters in force, levels of factors among them.

        Raises:
            DesignError: it cannot be balanced or ordered so.
        """
        practice = parameters["practice"]
        chosen = (replace(f, levels=parameters.get(f.name, f.levels)) for f in self.factors)
        factors = tuple(f for f in chosen if len(f.levels) > 1 or not f.between)
        return Design(
            study=self.name,
            version=self.version,
            factors=factors,
            repetitions=int(parameters["repetitions"]),
            blocks=int(parameters["blocks"]),
            order=parameters["order"],
            balanced=tuple(self.balanced),
            blocked_by=self.blocked_by,
            block_order=self.block_order,
            constraints=tuple(self.constraints),
            practice=practice
            if isinstance(practice, int)
            else tuple(_possible(cell, factors) for cell in practice),
            calibrate_blocks=self.calibrate_blocks,
            calibrate_practice=self.calibrate,
            questionnaires=tuple(self.questionnaires),
        )

    @property
    def files_folder(self) -> Path:
        """The folder from which the relative paths in the trial's scenes start."""
        return self.folder if self.plan_folder is None else self.plan_folder

    @property
    def folders(self) -> tuple[Path, ...]:
        """The study's folder, then those of the studies it was derived from."""
        return (self.folder, *(() if self.base is None else self.base.folders))

    @property
    def text_folders(self) -> tuple[Path, ...]:
        """The folders of its texts: the base's first, over which its own lie."""
        before = () if self.base is None else self.base.text_folders
        return before if self.texts is None else (*before, self.folder / self.texts)

    def cells_of(self, design: Design) -> tuple[Factor, ...]:
        """Return the factors within people whose combinations are compared and described."""
        return tuple(f for f in design.within if not self.cells or f.name in self.cells)

    def factor(self, name: str) -> Factor:
        """Return a factor by name.

        Raises:
            DesignError: there is none.
        """
        for factor in self.factors:
            if factor.name == name:
                return factor
        known = ", ".join(f.name for f in self.factors)
        raise DesignError(f"study {self.name} has no factor {name!r}; it has {known}")


def _possible(cell: Mapping[str, Any], factors: Sequence[Factor]) -> dict[str, Any]:
    """Return a practice trial with the first level of a factor that lost the one it names."""
    levels = {f.name: (*f.levels, *f.practice_only) for f in factors}
    return {
        name: levels[name][0] if name in levels and level not in levels[name] else level
        for name, level in cell.items()
    }
