"""The parts of a study: what varies, what happens, what is asked, measured, compared, reported.

A study file gives all of it by keywords of `Study`; each goes to the part that has a field of its
name. Fields that end in `_of` are functions, which decorators of the study set.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple, TypeAlias, get_args

from visavis.protocol.plan.columns import Column
from visavis.protocol.plan.design import BlockOrder, Design, Factor, TrialOrder
from visavis.protocol.plan.orders import Constraint
from visavis.protocol.plan.parameters import Range
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
    CheckOf,
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
AnswerBy: TypeAlias = Literal["board", "ray", "keyboard"]


@dataclass(frozen=True, kw_only=True)
class StudyDesign:
    """What varies, how often and in which order, and what a lab may set (`--set`)."""

    factors: Sequence[Factor] = ()
    """What varies between trials or people. A factor between people that has one level makes no
    groups."""
    repetitions: int = 1
    """How often every combination of the factors within people comes."""
    practice: int | Sequence[Mapping[str, Any]] = 0
    """Trials that never count, before the others: so many, drawn from the combinations, or each
    as its levels by factor."""
    blocks: int = 1
    """Number of equal blocks, for each level of `blocked_by` where there is one."""
    order: TrialOrder = "random"
    """Order of trials: "fixed", as listed; "random", over the whole session; "balanced_blocks",
    random within blocks that hold equally many of every level; "latin_square" or "williams", a row
    of the square over the combinations for every repetition."""
    balanced: Sequence[str] = ()
    """Factors of which "balanced_blocks" puts equally many of every level into a block; all that
    divide, where none is named."""
    blocked_by: str | None = None
    """The factor that changes between blocks alone."""
    block_order: BlockOrder = "fixed"
    """In which order, over participants, the levels of `blocked_by` come: "fixed", "random",
    "latin_square" or "williams"."""
    constraints: Sequence[Constraint] = ()
    """Rules about neighbours in a random order."""
    derived: Mapping[str, Callable[[Mapping[str, Any]], Scalar]] = field(default_factory=dict)
    """Columns that follow from a trial's factors: a place from its zone and its depth."""
    parameters: Mapping[str, Any] = field(default_factory=dict)
    """Numbers, texts and truths that a lab may replace; a trial reads them as attributes."""
    ranges: Mapping[str, Range] = field(default_factory=dict)
    """What parameters may be, and which levels factors may have: `Within(0, 1)`, or names."""
    check_of: CheckOf | None = None
    """Raises DesignError for parameters in force that do not fit each other."""

    def problems(self) -> list[str]:
        """Say what is wrong with it."""
        names = [f.name for f in self.factors]
        return [
            *([] if names else ["there is no factor; add one, if need be with one level"]),
            *(
                f"nothing can be called {name!r}: a trial uses that name itself"
                for name in (*names, *self.parameters, *self.derived)
                if name in RESERVED or not name.isidentifier()
            ),
            *(f"{n!r} is a factor and a parameter" for n in names if n in self.parameters),
            *(f"{n!r} is a parameter of every study" for n in self.parameters if n in SETTABLE),
        ]


@dataclass(frozen=True, kw_only=True)
class Procedure:
    """What happens: each trial, what comes before it, and what is shown where."""

    plan_of: TrialPlan | None = None
    """Performs a trial: a generator over its script."""
    intertrial_s: float = 1.0
    """How long it is dark before a trial, in seconds."""
    intertrial_of: IntertrialPlan | None = None
    """Performs what comes before a trial instead of darkness."""
    prepare_of: PrepareOf | None = None
    """Returns what is loaded or computed before a session."""
    makers: Mapping[str, Maker] = field(default_factory=dict)
    """The study's own scenes by name."""
    dressed_by: str = ""
    """What dresses scenes that a trial makes itself: "module:function"."""
    views_of: ViewsOf | None = None
    """Rebuilds the views that a recorded frame may have shown, the likeliest first."""
    people: int | PeopleOf = 0
    """At most how many people are seen at once, where scenes show others than their agents."""
    on: On = "lab"
    """Where it is performed: on the lab's devices, or on a page in a browser."""
    screening: Sequence[Screening] = ()
    """What a page looks at before its first trial: "card", how large the screen is; "sound",
    whether spoken digits are heard."""

    def problems(self) -> list[str]:
        """Say what is wrong with it."""
        return [
            f"screening knows no {n!r}; it knows {', '.join(get_args(Screening))}"
            for n in self.screening
            if n not in get_args(Screening)
        ]


@dataclass(frozen=True, kw_only=True)
class Asks:
    """What participants are asked, and how they answer."""

    responses: Sequence[Response] = ()
    """What trials ask. Reading a trial without performing it finds them; list those that it asks
    in some cases only."""
    questionnaires: Sequence[str] = ()
    """Questionnaires at the end, by name."""
    after_block: Sequence[str] = ()
    """Questionnaires after every block that counts, by name."""
    unasked: RolesOf | None = None
    """Returns those of `after_block` that make no sense with the parameters in force."""
    answer_by: AnswerBy = "board"
    """How questions are answered: on boards by hand, gaze or head; by hand or head; at the
    terminal."""
    answer_limit_s: float = 30.0
    """Seconds after which a question is left."""


@dataclass(frozen=True, kw_only=True)
class DeviceNeeds:
    """Which devices are used beside the headset, and what is calibrated."""

    needs: Sequence[str] = ()
    """Roles of devices without which a session does not begin."""
    uses: Sequence[str] | RolesOf | None = None
    """Roles used where the lab has them, or a function of the parameters. None: the eye tracker,
    and the body tracker where answers are pointed (by ray, at people, on boards where no gaze is
    calibrated that could choose)."""
    spares: Sequence[str] | None = None
    """Roles without which the operator may go on. None: all used on which nothing rests."""
    demands_of: DemandsOf | None = None
    """Returns what the study asks of a lab beyond devices being there."""
    calibrate: bool = True
    """Whether the eye tracker is calibrated before the first block."""
    calibrate_blocks: bool = False
    """Whether it is calibrated before every other block, too."""
    validate: bool = True
    """Whether calibrations are validated. If not, gaze is recorded and nothing rests on it."""


@dataclass(frozen=True, kw_only=True)
class SimulatedPeople:
    """Who takes part in simulations."""

    answer_of: AnswerOf | None = None
    """What simulated people answer; the rest of them is as in every study."""
    person_of: PersonOf | None = None
    """Makes a simulated participant of the study's own."""
    scaled_of: ScaledOf | None = None
    """The same for people to whom what is shown makes a multiple of the usual difference."""
    quick_of: QuickOf | None = None
    """A path through trials that is shorter than the kit's, for power."""


@dataclass(frozen=True, kw_only=True)
class AnalysisPlan:
    """What is measured, what is left out, what is compared."""

    cells: Sequence[str] = ()
    """Factors within people whose combinations are compared and described; all, where none is
    named. The others only vary the situation."""
    columns: Sequence[Column] = ()
    """Describe what a trial writes into its row besides answers and measures."""
    measures: Sequence[Measure] = ()
    """What is measured in every trial, beside the answers."""
    looks: Sequence[LooksOn] = ()
    """Ask for everything about looks on an agent: whole, by ray, in parts, by other detectors, by
    padding and minimum duration."""
    exclusions: Sequence[Exclusion] = STANDARD_RULES
    """Rules that leave out trials and people."""
    compare: Sequence[Compare] = ()
    """Comparisons of a measure over factors."""
    families: Sequence[Family] = ()
    """Families of simple tests: pairs of levels, correlations with a score. The first one of
    pairs is made again without rules of exclusion, and by padding and minimum duration."""
    questions: Mapping[str, str] = field(default_factory=dict)
    """What `conclude_of` answers, by name, and what a yes would claim: power is found of them."""
    thresholds: Any = None
    """A dataclass of numbers of the study's own analysis; `analyse --set` replaces its fields."""
    pieces: Pieces | str | None = None
    """How trials are measured one by one, or "module:name" of it; `analyse --set` replaces fields
    of its `how`."""
    facts_of: FactsOf | None = None
    """Returns what is known of each person, from all trials."""
    further_of: FurtherOf | None = None
    """Returns what the study finds besides, from the analysis."""
    conclude_of: ConcludeOf | None = None
    """Answers the study's questions from the analysis."""

    @property
    def measured_in_pieces(self) -> Pieces | None:
        """How its trials are measured one by one; None where a session is measured at once."""
        pieces: Pieces | None = named(self.pieces) if isinstance(self.pieces, str) else self.pieces
        return pieces

    def cells_of(self, design: Design) -> tuple[Factor, ...]:
        """Return the factors within people whose combinations are compared and described."""
        return tuple(f for f in design.within if not self.cells or f.name in self.cells)


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


@dataclass(frozen=True, kw_only=True)
class Reporting:
    """What a report says beside the results."""

    source: Source | None = None
    """The publication that the study repeats, and what is printed there."""
    methods: str = ""
    """Text of the method section, with parameters in braces."""
    references: Sequence[str] = ()
    """Publications that the report names."""
    setup: Mapping[str, str] = field(default_factory=dict)
    """Items of the reporting list for eye tracking that follow from the study."""
    sections: Sequence[SectionOf | Confusion | str] = ()
    """Sections: functions that make them ("module:function" for one that takes long to import), or
    confusion matrices."""


@dataclass(frozen=True, kw_only=True)
class StudyFiles:
    """Where a study's files lie."""

    folder: Path = field(default_factory=Path)
    """The folder from which its files are named; that of the study file, where there is one."""
    texts: str | None = None
    """The folder of its text files, beside the study file."""
    path: Path | None = None
    """The file it was read from; None for a study of an installed package."""
    plan_folder: Path | None = None
    """Where the files of a trial lie that was taken over; None: in the study's own folder."""

    @property
    def trial_folder(self) -> Path:
        """The folder from which the relative paths in the trial's scenes start."""
        return self.folder if self.plan_folder is None else self.plan_folder
