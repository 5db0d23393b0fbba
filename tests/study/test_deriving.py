"""A study derived from another differs where it says so, and nowhere else."""

from pathlib import Path

import pytest

from tests.sessions import STUDIES, opened
from visavis import Exclusion, derive
from visavis.lab.errors import ConfigError, DesignError
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.study.catalogue import digest_of
from visavis.study.declaration import Study

DUEL = STUDIES / "duel.py"


def derived(**differs: object) -> Study:
    return derive(DUEL, "my_duel", **differs)


def test_everything_that_is_not_named_stays() -> None:
    base = opened("duel").study
    own = derive(base, "my_duel", title="Mine")
    assert ("my_duel", "Mine") == (own.name, own.title)
    for part in ("design", "procedure", "asks", "devices", "simulated", "analysis", "report"):
        assert getattr(base, part) == getattr(own, part), part
    plan = OpenedStudy(own).experiment({}).plan(0, 1)
    of_base = opened("duel").experiment({}).plan(0, 1)
    assert [b.instruction for b in of_base.blocks] == [b.instruction for b in plan.blocks]


def test_base_stays_as_it_was() -> None:
    base = opened("duel").study
    own = derive(base, "my_duel", repetitions=1)

    @own.scene("wall")
    def wall(staging: object) -> None:
        """Show nothing."""

    assert (5, {}) == (base.design.repetitions, base.procedure.makers)


def test_levels_of_a_factor_and_what_every_study_has_are_parameters() -> None:
    own = derived(parameters={"side": ["left"], "repetitions": 2})
    plan = OpenedStudy(own).experiment({}).plan(0, 1)
    assert {"left"} == {t.factors["side"] for t in plan.trials}
    assert 4 == sum(not t.is_practice for t in plan.trials)


def test_limits_of_exclusions_are_changed_by_name() -> None:
    own = derived(exclusions={"max_trial_lost_01": 0.25, "min_cell_trials": None})
    limits = {rule.name: rule.limit for rule in own.analysis.exclusions}
    assert (0.25, None, 0.5) == (
        limits["max_trial_lost_01"],
        limits["min_cell_trials"],
        limits["max_bad_trials_01"],
    )
    assert all(isinstance(rule, Exclusion) for rule in own.analysis.exclusions)


@pytest.mark.parametrize(
    ("differs", "said"),
    [
        ({"repetition": 2}, "did you mean 'repetitions'"),
        ({"exclusions": {"max_trial_lost": 0.3}}, "did you mean 'max_trial_lost_01'"),
    ],
)
def test_what_a_study_has_not_is_refused(differs: dict[str, object], said: str) -> None:
    with pytest.raises(DesignError, match=said):
        derived(**differs)


def test_parameter_that_the_base_has_not_is_refused() -> None:
    with pytest.raises(ConfigError, match="did you mean side"):
        derived(parameters={"sides_": ["left"]})


def write(folder: Path, text: str) -> Path:
    path = folder / "my_duel.py"
    path.write_text(f"from visavis import derive\n{text}", encoding="utf-8")
    return path


def test_file_of_the_base_is_looked_for_beside_the_file_that_derives(tmp_path: Path) -> None:
    (tmp_path / "duel.py").write_text(DUEL.read_text("utf-8"), encoding="utf-8")
    (tmp_path / "texts").mkdir()
    for text in (STUDIES / "texts").glob("*.yaml"):
        (tmp_path / "texts" / text.name).write_text(text.read_text("utf-8"), encoding="utf-8")
    path = write(tmp_path, 'study = derive("./duel.py", "my_duel", repetitions=1)\n')
    found = find_study(str(path))
    assert 6 == len(found.experiment({}).plan(0, 1).trials)
    before = digest_of(path)
    base = tmp_path / "duel.py"
    base.write_text(base.read_text("utf-8") + "# changed\n", encoding="utf-8")
    assert before != digest_of(path)


def test_own_texts_lie_over_those_of_the_base(tmp_path: Path) -> None:
    (tmp_path / "words").mkdir()
    (tmp_path / "words" / "en.yaml").write_text("instruction: Look.\n", encoding="utf-8")
    path = write(tmp_path, f'study = derive({str(DUEL)!r}, "my_duel", texts="words")\n')
    experiment = find_study(str(path)).experiment({})
    practice, block = experiment.plan(0, 1).blocks
    assert "Look." == block.instruction
    assert practice.instruction.startswith("You will see two people")
    with pytest.raises(ConfigError, match=r"has no de\.yaml; it has en"):
        find_study(str(path)).experiment({"language": "de"})


def test_a_package_that_names_no_study_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("visavis.study.catalogue.SHIPPED_STUDIES", {"elsewhere": "builtins:dict"})
    with pytest.raises(DesignError, match="builtins:dict is a dict; an entry point names a Study"):
        derive("elsewhere", "own")


@pytest.mark.parametrize("part", ["trial", "person"])
def test_short_path_of_the_base_does_not_hold_for_another_trial_or_person(part: str) -> None:
    own = derive("stare", "my_stare")
    assert own.simulated.quick_of is not None
    getattr(own, part)(lambda *_: None)
    assert own.simulated.quick_of is None
