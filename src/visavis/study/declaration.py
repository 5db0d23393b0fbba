"""A study as data: what varies, what is asked, what is measured and compared, in what words.

A study file makes one `Study` and gives it a trial:

    study = Study("duel", "Whom do people look at?", factors=[...], compare=[...])

    @study.trial
    def trial(t):
        yield t.show(Scene("two_people", active=t.side, eyes=t.gaze), seconds=4)

Everything else follows from it once, for every study: planning, sessions, simulated people,
tables with their dictionaries, statistics, figures, report, power.
"""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from visavis.lab.errors import DesignError
from visavis.lab.kinds import wrong_kind
from visavis.lab.parts import missing_attribute, part_of, parts_from, takes_keywords_of
from visavis.protocol.plan.design import Design, Factor
from visavis.protocol.plan.parameters import parameters_from
from visavis.study.items import order_rules
from visavis.study.parts import (
    KINDS,
    SETTABLE,
    AnalysisPlan,
    Asks,
    DeviceNeeds,
    Procedure,
    Reporting,
    SimulatedPeople,
    StudyDesign,
    StudyFiles,
)
from visavis.study.scenes import Maker
from visavis.study.sections import ConcludeOf, SectionOf
from visavis.study.study_functions import (
    AnswerOf,
    CheckOf,
    DemandsOf,
    FactsOf,
    FurtherOf,
    IntertrialPlan,
    PersonOf,
    PrepareOf,
    QuickOf,
    ScaledOf,
    ViewsOf,
)
from visavis.study.trial import TrialPlan

PARTS: Final[Mapping[str, type[Any]]] = {
    "design": StudyDesign,
    "procedure": Procedure,
    "asks": Asks,
    "devices": DeviceNeeds,
    "simulated": SimulatedPeople,
    "analysis": AnalysisPlan,
    "report": Reporting,
    "files": StudyFiles,
}
"""The parts of a study by the names under which it has them."""
PART_OF: Final = part_of(PARTS)
"""The part to which each keyword of a study belongs."""


@dataclass(frozen=True)
class _Keywords(
    StudyFiles,
    Reporting,
    AnalysisPlan,
    SimulatedPeople,
    DeviceNeeds,
    Asks,
    Procedure,
    StudyDesign,
):
    """The keywords of `Study`: every field of every part. For type checkers only."""

    name: str
    title: str = ""
    question: str = ""
    version: str = field(default="1", kw_only=True)
    base: "Study | None" = field(default=None, kw_only=True)
    design: StudyDesign | None = field(default=None, kw_only=True)
    procedure: Procedure | None = field(default=None, kw_only=True)
    asks: Asks | None = field(default=None, kw_only=True)
    devices: DeviceNeeds | None = field(default=None, kw_only=True)
    simulated: SimulatedPeople | None = field(default=None, kw_only=True)
    analysis: AnalysisPlan | None = field(default=None, kw_only=True)
    report: Reporting | None = field(default=None, kw_only=True)
    files: StudyFiles | None = field(default=None, kw_only=True)


@dataclass(init=False)
class Study:
    """A study. Only name, title, factors and a trial are needed.

    Every field of its parts is a keyword: `Study("duel", factors=[…], repetitions=5)`. A whole part
    may be given too; keywords beside it replace its fields.

    Raises:
        TypeError: there is no such keyword; it says which one is nearest.
        DesignError: listing everything that is wrong.
    """

    name: str
    """Its name in commands and folders: small letters, digits and _."""
    title: str
    """Its title in reports; the name in words if left out."""
    question: str
    """The question it asks, as a sentence."""
    version: str
    """Its version, kept in every plan."""
    base: "Study | None"
    """The study it was derived from, if it was."""
    design: StudyDesign
    """What varies, how often and in which order."""
    procedure: Procedure
    """What happens in a trial and before it."""
    asks: Asks
    """What participants are asked, and how they answer."""
    devices: DeviceNeeds
    """Which devices it uses and calibrates."""
    simulated: SimulatedPeople
    """Who takes part in simulations."""
    analysis: AnalysisPlan
    """What is measured, left out and compared."""
    report: Reporting
    """The text of its report besides the results."""
    files: StudyFiles
    """The places of its files."""

    @takes_keywords_of(_Keywords)
    def __init__(
        self,
        name: str,
        title: str = "",
        question: str = "",
        *,
        version: str = "1",
        base: "Study | None" = None,
        **keywords: Any,
    ) -> None:
        own = {"name": name, "title": title, "question": question, "version": version}
        problems = [p for k, value in {**own, **keywords}.items() for p in _other_kind(k, value)]
        other: Any = base
        if other is not None and not isinstance(other, Study):
            problems.append(f"base is {other!r}; it takes a Study")
        thresholds = keywords.get("thresholds")
        if thresholds is not None and (
            isinstance(thresholds, type) or not is_dataclass(thresholds)
        ):
            problems.append(f"thresholds is {thresholds!r}; it takes a dataclass of numbers")
        if problems:  # what follows reads them
            raise DesignError(f"study {name}: {'; '.join(problems)}")
        self.name, self.question, self.version, self.base = name, question, version, base
        self.title = title or name.replace("_", " ").capitalize()
        for part, value in parts_from(PARTS, keywords).items():
            setattr(self, part, value)
        if not name.isidentifier() or not name.islower():
            problems.append(f"the name {name!r} is not made of small letters, digits and _")
        problems += self.design.problems()
        if problems:
            raise DesignError(f"study {name}: {'; '.join(problems)}")

    if not TYPE_CHECKING:  # type checkers report a missing attribute themselves

        def __getattr__(self, name: str) -> Any:
            """Raise with the part that has this attribute."""
            raise missing_attribute(self, name, PARTS)

    def with_changes(self, **keywords: Any) -> "Study":
        """Return a copy of this study with other keywords, given as to `Study`."""
        whole: dict[str, Any] = {f.name: getattr(self, f.name) for f in fields(self)}
        return Study(**{**whole, **keywords})

    # ---- what a study file adds ----

    def trial(self, plan: TrialPlan) -> TrialPlan:
        """Take a generator as the study's trial (a decorator)."""
        self.procedure = replace(self.procedure, plan_of=plan)
        self.files = replace(self.files, plan_folder=None)
        self.simulated = replace(self.simulated, quick_of=None)
        return plan

    def intertrial(self, plan: IntertrialPlan) -> IntertrialPlan:
        """Take a generator as what happens before a trial instead of darkness (a decorator).

        It begins at a frame (`t.now_ns`); how long it took is the row's `intertrial_ms`.
        """
        self.procedure = replace(self.procedure, intertrial_of=plan)
        return plan

    def check(self, check: CheckOf) -> CheckOf:
        """Take a function that raises DesignError for parameters that do not fit (a decorator)."""
        self.design = replace(self.design, check_of=check)
        return check

    def demands(self, demands: DemandsOf) -> DemandsOf:
        """Take the function that returns the study's demands on a lab (a decorator)."""
        self.devices = replace(self.devices, demands_of=demands)
        return demands

    def prepare(self, prepare: PrepareOf) -> PrepareOf:
        """Take a function that prepares a session (a decorator).

        It gets the experiment and returns calls without arguments, which are made in turn.
        """
        self.procedure = replace(self.procedure, prepare_of=prepare)
        return prepare

    def answer(self, answer: AnswerOf) -> AnswerOf:
        """Take the function that answers for simulated people (a decorator)."""
        self.simulated = replace(self.simulated, answer_of=answer)
        return answer

    def scene(self, name: str) -> Callable[[Maker], Maker]:
        """Take a function as the maker of a scene of this study (a decorator)."""

        def register(maker: Maker) -> Maker:
            makers = {**self.procedure.makers, name: maker}
            self.procedure = replace(self.procedure, makers=makers)
            return maker

        return register

    def person(self, make: PersonOf) -> PersonOf:
        """Take the function of place, seed, effect and experiment that makes a simulated
        participant (a decorator).
        """
        self.simulated = replace(self.simulated, person_of=make, scaled_of=None, quick_of=None)
        return make

    def scaled(self, make: ScaledOf) -> ScaledOf:
        """Take the function that makes simulated participants with a multiple of the usual effect
        of the stimuli: 0 none, 1 the usual (a decorator). It replaces `person`.
        """
        self.simulated = replace(self.simulated, scaled_of=make)
        return make

    def quick(self, quick: QuickOf) -> QuickOf:
        """Take a function as a path through trials shorter than the kit's (a decorator).

        It holds for the trial and the person declared before it. Given experiment, person and
        tracker it returns a function that performs a plan: every trial that is not practice, with
        the columns of its row and measures.
        """
        self.simulated = replace(self.simulated, quick_of=quick)
        return quick

    def facts(self, facts: FactsOf) -> FactsOf:
        """Take the function that returns facts about each person from all trials (a decorator).

        It returns one row per `participant`; rules of exclusion may name its columns.
        """
        self.analysis = replace(self.analysis, facts_of=facts)
        return facts

    def further(self, further: FurtherOf) -> FurtherOf:
        """Take the function that returns further results of the analysis (a decorator).

        Conclusions and sections read it as `analysis.further`; power does without.
        """
        self.analysis = replace(self.analysis, further_of=further)
        return further

    def conclude(self, conclude: ConcludeOf) -> ConcludeOf:
        """Take the function that answers the study's questions from the analysis (a decorator)."""
        self.analysis = replace(self.analysis, conclude_of=conclude)
        return conclude

    def views(self, views: ViewsOf) -> ViewsOf:
        """Take the function that rebuilds the views a recorded frame may have shown, the likeliest
        first (a decorator).
        """
        self.procedure = replace(self.procedure, views_of=views)
        return views

    def section(self, section: SectionOf) -> SectionOf:
        """Take a function as the maker of a section of the report (a decorator)."""
        self.report = replace(self.report, sections=(*self.report.sections, section))
        return section

    # ---- what follows ----

    @property
    def usual_parameters(self) -> dict[str, Any]:
        """The parameters that every study has, by name (`SETTABLE`)."""
        return {n: getattr(getattr(self, PART_OF[n]), n) for n in SETTABLE}

    def thresholds_with(self, settings: Mapping[str, Any]) -> Any:
        """Return the thresholds of its own analysis with those that were set; None if it has none.

        Raises:
            ConfigError: a value has the wrong type.
            UsageError: it is out of range.
        """
        thresholds = self.analysis.thresholds
        if thresholds is None:
            return None
        threshold_names = {f.name for f in fields(thresholds)}
        own = {k: v for k, v in settings.items() if k in threshold_names}
        return parameters_from(type(thresholds), own, f"analysis of {self.name}")

    @property
    def trial_plan(self) -> TrialPlan:
        """The trial.

        Raises:
            DesignError: the study has none.
        """
        if self.procedure.plan_of is None:
            raise DesignError(f"study {self.name} has no trial; write one under @study.trial")
        return self.procedure.plan_of

    def design_with(self, parameters: Mapping[str, Any]) -> Design:
        """Return the design with parameters in force, levels of factors among them.

        Raises:
            DesignError: it cannot be balanced or ordered in this way.
        """
        own, practice = self.design, parameters["practice"]
        all_factors = (replace(f, levels=parameters.get(f.name, f.levels)) for f in own.factors)
        factors = tuple(f for f in all_factors if len(f.levels) > 1 or not f.between)
        return Design(
            study=self.name,
            version=self.version,
            factors=factors,
            repetitions=int(parameters["repetitions"]),
            blocks=int(parameters["blocks"]),
            order=parameters["order"],
            balanced=tuple(own.balanced),
            blocked_by=own.blocked_by,
            block_order=own.block_order,
            phased_by=own.phased_by,
            constraints=(*own.constraints, *order_rules(own.items, factors)),
            practice=practice
            if isinstance(practice, int)
            else tuple(_possible(cell, factors) for cell in practice),
            calibrate_blocks=self.devices.calibrate_blocks,
            calibrate_practice=self.devices.calibrate,
            questionnaires=tuple(self.asks.questionnaires),
            sessions=tuple(own.sessions),
        )

    @property
    def folders(self) -> tuple[Path, ...]:
        """The study's folder, then those of the studies it was derived from."""
        return (self.files.folder, *(() if self.base is None else self.base.folders))

    @property
    def text_folders(self) -> tuple[Path, ...]:
        """The folders of its texts: the base's first, over which its own lie."""
        before, texts = () if self.base is None else self.base.text_folders, self.files.texts
        return before if texts is None else (*before, self.files.folder / texts)

    def factor(self, name: str) -> Factor:
        """Return a factor by name.

        Raises:
            DesignError: there is none.
        """
        for factor in self.design.factors:
            if factor.name == name:
                return factor
        names = ", ".join(f.name for f in self.design.factors)
        raise DesignError(f"study {self.name} has no factor {name!r}; it has {names}")


_HINTS: Final = {f.name: f.type for f in fields(_Keywords)}


def _other_kind(keyword: str, value: Any) -> Iterator[str]:
    """Yield what is wrong with a keyword that got a value of another kind than it takes."""
    problems = list(_no_list(keyword, value))
    if not problems and (wrong := wrong_kind(keyword, value, _HINTS[keyword])):
        problems = [wrong]
    yield from problems


def _no_list(keyword: str, value: Any) -> Iterator[str]:
    """Yield what is wrong with a keyword that takes a list and got something else, or others."""
    kinds = KINDS.get(keyword, ())
    if not kinds or value is None:
        return
    names = " or ".join(kind.__name__ for kind in kinds)
    example = '["NAME"]' if kinds == (str,) else f"[{kinds[0].__name__}(…)]"
    if isinstance(value, str | Mapping) or not isinstance(value, Collection):
        limits = keyword == "exclusions" and isinstance(value, Mapping)
        of_base = "; limits by name are given to derive, or to analyse --set" if limits else ""
        yield f"{keyword} is {value!r}; it takes a list: {keyword}={example}{of_base}"
        return
    for item in value:
        if not isinstance(item, kinds):
            yield f"{keyword} holds {item!r}, which is no {names}; write {keyword}={example}"


def _possible(cell: Mapping[str, Any], factors: Sequence[Factor]) -> dict[str, Any]:
    """Return a practice trial; a level that no longer exists becomes the first of its factor."""
    levels = {f.name: (*f.levels, *f.practice_only) for f in factors}
    return {
        name: levels[name][0] if name in levels and level not in levels[name] else level
        for name, level in cell.items()
    }
