"""The parts of a study: what varies, what happens, what is asked, measured, compared, reported.

A study file gives all of it by keywords of `Study`; each goes to the part that has a field of its
name. Fields that end in `_of` are functions, which decorators of the study set.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal, TypeAlias, get_args

from visavis.protocol.plan.columns import Column
from visavis.protocol.plan.design import SESSION, BlockOrder, Design, Factor, TrialOrder
from visavis.protocol.plan.orders import Constraint
from visavis.protocol.plan.parameters import Range
from visavis.protocol.plan.steps import Scalar
from visavis.study.comparisons import Compare
from visavis.study.conditions import Groups
from visavis.study.criterion import Criterion
from visavis.study.exclusions import STANDARD_RULES, Exclusion
from visavis.study.items import Items
from visavis.study.look_measures import LooksOn
from visavis.study.measures import Measure
from visavis.study.names import impossible_levels, is_name, reserved_names
from visavis.study.pairs import Family
from visavis.study.pieces import Pieces
from visavis.study.responses import Response
from visavis.study.returning import Returning
from visavis.study.scenes import Maker
from visavis.study.sections import ConcludeOf, Confusion, SectionOf, import_object
from visavis.study.source import Source
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

RESERVED_NAMES: Final = frozenset(name for name in dir(TrialScript) if not name.startswith("_")) | {
    "trial",
    "settings",
    "row",
    "view",
}
"""Names that a trial script uses itself; no factor or parameter may have them."""
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

KINDS: Final[Mapping[str, tuple[type[Any], ...]]] = {
    "factors": (Factor,),
    "constraints": (Constraint,),
    "responses": get_args(Response),
    "columns": (Column,),
    "measures": (Measure,),
    "looks": (LooksOn,),
    "exclusions": (Exclusion,),
    "compare": (Compare,),
    "families": get_args(Family),
    **dict.fromkeys(
        (
            "questionnaires",
            "after_block",
            "needs",
            "spares",
            "cells",
            "balanced",
            "primary",
            "references",
            "sessions",
        ),
        (str,),
    ),
}
"""What the lists among the keywords of a study hold."""

On: TypeAlias = Literal["lab", "browser"]
Xr: TypeAlias = Literal["never", "optional", "required"]
Instructions: TypeAlias = Literal["read", "read out"]
Posture: TypeAlias = Literal["seated", "standing"]
Screening: TypeAlias = Literal["card", "sound"]
AnswerBy: TypeAlias = Literal["board", "ray", "keyboard"]


@dataclass(frozen=True, kw_only=True)
class StudyDesign:
    """What varies, how often and in which order, and what a lab may set (`--set`)."""

    factors: Sequence[Factor] = ()
    """What varies between trials or people. A factor between people that has one level makes no
    groups."""
    items: Items | None = None
    """A table of stimuli, of which every trial shows one."""
    repetitions: int = 1
    """Number of repetitions of every combination of the factors within people."""
    practice: int | Sequence[Mapping[str, Any]] = 0
    """Practice trials before the others, which never count: a number of trials, drawn from the
    combinations, or each trial as its levels by factor."""
    practice_until: Criterion | None = None
    """The criterion until which practice is repeated: `Criterion("answer_is_right")`."""
    blocks: int = 1
    """Number of equal blocks, for each level of `blocked_by` where there is one."""
    order: TrialOrder = "random"
    """Order of trials: "fixed", as listed; "random", over the whole session; "balanced_blocks",
    random within blocks that hold equally many of every level; "latin_square" or "williams", a row
    of the square over the combinations for every repetition."""
    balanced: Sequence[str] = ()
    """Factors whose levels "balanced_blocks" makes equally frequent in every block. By default all
    factors for which the numbers allow it."""
    blocked_by: str | None = None
    """The factor that changes only between blocks."""
    block_order: BlockOrder = "fixed"
    """Order of the levels of `blocked_by`, over participants: "fixed", "random", "latin_square" or
    "williams"."""
    sessions: Sequence[str] = ()
    """The sessions that everybody comes to, in their order, such as "before" and "after". They are
    a factor within people called "session"; each has an order of trials of its own."""
    days_between: tuple[float, float] | None = None
    """The fewest and the most days from the end of one session to the next; None: any."""
    phased_by: str | None = None
    """The factor whose levels follow one another as listed in every block, such as a guess and then
    an adjustment; the others come in `order` at each of them."""
    constraints: Sequence[Constraint] = ()
    """Rules about neighbours in a random order."""
    derived: Mapping[str, Callable[[Mapping[str, Any]], Scalar]] = field(default_factory=dict)
    """Columns computed from a trial's factors, such as a place from its zone and its depth."""
    parameters: Mapping[str, Any] = field(default_factory=dict)
    """Numbers, texts and booleans that a lab may change; a trial reads them as attributes."""
    ranges: Mapping[str, Range] = field(default_factory=dict)
    """Limits of parameters, and the levels that factors may have: `Within(0, 1)`, or names."""
    check_of: CheckOf | None = None
    """Raises DesignError for parameters in force that do not fit each other."""

    def problems(self) -> list[str]:
        """Say what is wrong with it."""
        names = [f.name for f in self.factors]
        reserved = reserved_names(self.factors)
        return [
            *([] if names else ["there is no factor; add one, if need be with one level"]),
            *(
                f"{name!r} cannot be a name: a trial uses it itself, or it is not an identifier"
                for name in (*names, *self.parameters, *self.derived)
                if name in RESERVED_NAMES or not name.isidentifier()
            ),
            *(
                f"{name!r} is a word of Python or R, or begins with _; name it otherwise"
                for name in (*names, *self.derived)
                if name.isidentifier() and not is_name(name)
            ),
            *(
                f"{name!r} is a column of every trial; name yours otherwise"
                for name in (*names, *self.derived)
                if name in reserved
            ),
            *(f"{n!r} is a factor and a derived column" for n in names if n in self.derived),
            *(
                problem
                for f in self.factors
                for problem in impossible_levels(f.name, (*f.levels, *f.practice_only))
            ),
            *(f"{n!r} is a factor and a parameter" for n in names if n in self.parameters),
            *(
                f"{n!r} is a parameter of every study; name yours otherwise"
                for n in self.parameters
                if n in SETTABLE
            ),
            *self._session_problems(),
            *self._practice_problems(),
        ]

    def _practice_problems(self) -> list[str]:
        if self.practice_until is None or self.practice:
            return []
        return ["practice_until needs practice trials: practice=6"]

    def _session_problems(self) -> list[str]:
        problems = list(impossible_levels(SESSION, self.sessions))
        if len(self.sessions) == 1:
            problems.append("sessions names one; name two or more, or leave it out")
        if len(set(self.sessions)) < len(self.sessions):
            problems.append(f"sessions names one twice: {', '.join(self.sessions)}")
        if self.sessions and SESSION in self.parameters:
            problems.append("'session' is the factor that sessions= makes; name the parameter else")
        days = self.days_between
        if days is not None and not (self.sessions and len(days) == 2 and 0 <= days[0] <= days[1]):
            problems.append(
                f"days_between is {days!r}; give the fewest and the most days, such as (6, 8), "
                "with sessions="
            )
        return problems


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
    """Largest number of people in one picture, where scenes show more people than their agents."""
    on: On = "lab"
    """Where it is performed: on the lab's devices, or on a page in a browser."""
    xr: Xr = "never"
    """Whether its page enters a headset by WebXR: never; "optional", where somebody has one and
    likes to; "required", or it does not begin. In the lab it says nothing."""
    xr_variant: str = ""
    """The study that does in a headset's browser what this one cannot, and is named instead."""
    posture: Posture | None = None
    """Whether participants sit or stand, as films and the viewer draw them. None: they sit where
    their eyes are less than 1.35 m above the floor."""
    instructions: Instructions = "read out"
    """Who goes on after an instruction or a break before a screen: the operator, who has it read
    out, or the participant, who has read it there and presses a key."""
    blind: bool = False
    """Whether operators see neither conditions nor groups: every session runs as with `--blind`,
    and lists of people do not say who is in which group."""
    screening: Sequence[Screening] = ()
    """What a page checks before its first trial: "card", the size of the screen; "sound", whether
    spoken digits are heard."""
    returning: Returning = field(default_factory=Returning)
    """How old a visit to a page may be that somebody comes back to, and where it goes on."""

    def shown_group(self, group: str) -> str:
        """Return what operators read for a person's group."""
        return "hidden" if self.blind and group else group


@dataclass(frozen=True, kw_only=True)
class Asks:
    """What participants are asked, and how they answer."""

    responses: Sequence[Response] = ()
    """Questions of the trials. A dry run of the trials finds them; list those that a trial asks
    only in some cases."""
    questionnaires: Sequence[str] = ()
    """Questionnaires at the end, by name."""
    after_block: Sequence[str] = ()
    """Questionnaires after every block that counts, by name."""
    skip_after_block: RolesOf | None = None
    """Returns the questionnaires of `after_block` to skip with the parameters in force."""
    answer_by: AnswerBy = "board"
    """How questions are answered: on boards by hand, gaze or head; by hand or head; at the
    terminal."""
    answer_limit_s: float = 30.0
    """Time limit of a question in seconds."""


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
    """Roles without which the operator may go on. None: all roles that are used and not needed,
    except a calibrated eye tracker and the response devices of the answers."""
    demands_of: DemandsOf | None = None
    """Returns what the study asks of a lab beyond devices being there."""
    calibrate: bool = True
    """Whether the eye tracker is calibrated before the first block."""
    calibrate_blocks: bool = False
    """Whether it is calibrated before every other block, too."""
    validate: bool = True
    """Whether calibrations are validated. If not, gaze is recorded and no result depends on it."""


@dataclass(frozen=True, kw_only=True)
class SimulatedPeople:
    """Who takes part in simulations."""

    answer_of: AnswerOf | None = None
    """Answers of simulated people, who otherwise behave as in every study."""
    person_of: PersonOf | None = None
    """Makes a simulated participant of the study's own."""
    scaled_of: ScaledOf | None = None
    """The same for people on whom the stimuli have a multiple of the usual effect."""
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
    groups: Groups = field(default_factory=dict)
    """Groups of people that follow from answers: the condition of every level by name. Comparisons
    name them as factors between people (`between`, `by`, `only`)."""
    families: Sequence[Family] = ()
    """Families of simple tests: pairs of levels, correlations with a score. The first one of
    pairs is made again without rules of exclusion, and by padding and minimum duration."""
    questions: Mapping[str, str] = field(default_factory=dict)
    """Questions that `conclude_of` answers, by name, with the claim of a yes. Power is computed for
    them."""
    primary: Sequence[str] = ()
    """The study's primary claims: names of tests as `visavis power STUDY --test list` prints them
    ("MEASURE:FACTOR", "A-B:MEASURE", a question). Everything else is secondary: reports mark it as
    exploratory, and power says how often chance finds something among either. None named: the
    questions, else the claims of comparisons, else everything planned."""
    thresholds: Any = None
    """A dataclass of numbers of the study's own analysis; `analyse --set` replaces its fields."""
    pieces: Pieces | str | None = None
    """How trials are measured one by one, or "module:name" of it; `analyse --set` replaces fields
    of its `how`."""
    facts_of: FactsOf | None = None
    """Returns facts about each person, computed from all trials."""
    further_of: FurtherOf | None = None
    """Returns further results of the study, computed from the analysis."""
    conclude_of: ConcludeOf | None = None
    """Answers the study's questions from the analysis."""

    @property
    def measured_in_pieces(self) -> Pieces | None:
        """How its trials are measured one by one; None where a session is measured at once."""
        pieces: Pieces | None = (
            import_object(self.pieces) if isinstance(self.pieces, str) else self.pieces
        )
        return pieces

    def cells_of(self, design: Design) -> tuple[Factor, ...]:
        """Return the factors within people whose combinations are compared and described.

        Sessions are always among them.
        """
        own = tuple(f for f in design.within if not self.cells or f.name in self.cells)
        return own if design.session_factor is None else (design.session_factor, *own)


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
    """The folder of an inherited trial's files; None: the study's own folder."""

    @property
    def trial_folder(self) -> Path:
        """The folder from which the relative paths in the trial's scenes start."""
        return self.folder if self.plan_folder is None else self.plan_folder
