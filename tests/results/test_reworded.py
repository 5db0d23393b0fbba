"""A scale in other words than its authors' is called so wherever one of its scores is named."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml

from visavis.analysis.report import Column, Paragraph, Section, Table
from visavis.protocol.plan.questionnaires import available, load_questionnaire
from visavis.results.report.reworded import with_caveats
from visavis.results.tables.dictionary import people_columns
from visavis.study.pairs import Correlate

REWORDED = (
    "embodiment",
    "igroup_presence",
    "presence",
    "simulator_sickness",
    "social_anxiety",
    "workload",
)
EXPERIMENTS = Path(__file__).parents[2] / "experiments"


def analysis(*score_words: str, columns: dict[str, str] | None = None) -> Any:
    families = [
        Correlate("anxiety", ["dwell_ms"], "gaze", "social_anxiety_total", words, "it")
        for words in score_words
    ]
    findings = [
        SimpleNamespace(measure=SimpleNamespace(column=c, words=w))
        for c, w in (columns or {}).items()
    ]
    return SimpleNamespace(
        findings=findings, study=SimpleNamespace(analysis=SimpleNamespace(families=families))
    )


def said(section: Section) -> str:
    return " ".join(b.text for b in section.blocks if isinstance(b, Paragraph))


@pytest.mark.parametrize("name", available())
def test_scales_that_come_along_say_whether_they_are_reworded(name: str) -> None:
    questionnaire = load_questionnaire(name)
    assert (name in REWORDED) == bool(questionnaire.caveat)
    assert (name in REWORDED) == ("reworded, not validated" in questionnaire.caveat)
    described = " ".join(c.description for c in people_columns([questionnaire]).values())
    assert (name in REWORDED) == ("reworded, not validated" in described)


def test_every_section_that_names_a_score_says_that_its_scale_is_reworded() -> None:
    anxiety, presence = load_questionnaire("social_anxiety"), load_questionnaire("presence")
    table = Table((Column("What"),), (("Dwell time and social anxiety",),), "Correlations")
    sections = (
        Section("summary", "Summary", (Paragraph("Dwell time was longer."),)),
        Section("anxiety", "Anxiety", (table,)),
        Section("presence", "Presence", (Paragraph("The presence felt did not change."),)),
        Section("methods", "Methods", (Paragraph("Factors were …"),)),
    )
    found = with_caveats(
        sections,
        analysis("social anxiety", columns={"presence": "presence felt"}),
        [anxiety, presence],
    )
    summary, of_anxiety, of_presence, methods = map(said, found)
    assert "reworded" not in summary
    assert anxiety.caveat in of_anxiety
    assert presence.caveat not in of_anxiety
    assert presence.caveat in of_presence
    assert anxiety.caveat in methods
    assert presence.caveat in methods


def wording(folder: Path, **changes: Any) -> Path:
    items = {item.id: f"Original {item.id}" for item in load_questionnaire("presence").items}
    content = {"questionnaire": "presence", "language": "en", "items": items, **changes}
    path = folder / "presence.yaml"
    path.write_text(yaml.safe_dump(content), "utf-8")
    return path


def test_a_labs_licensed_wording_of_every_item_takes_the_sentence_away(tmp_path: Path) -> None:
    licensed = wording(tmp_path, licence="Used by permission of the authors.")
    assert "" == load_questionnaire("presence", licensed).caveat


@pytest.mark.parametrize(
    "changes",
    [{}, {"licence": "By permission.", "items": {"presence_there": "Were you there?"}}],
    ids=["without a licence", "of one item"],
)
def test_a_wording_that_is_not_licensed_or_not_whole_leaves_it(
    changes: dict[str, Any], tmp_path: Path
) -> None:
    assert load_questionnaire("presence", wording(tmp_path, **changes)).caveat


@pytest.mark.parametrize("study", ["stare", "crowd"])
def test_the_readme_of_a_study_that_asks_a_reworded_scale_says_so(study: str) -> None:
    text = (EXPERIMENTS / study / "README.md").read_text("utf-8")
    assert "reworded, not validated" in " ".join(text.split())
