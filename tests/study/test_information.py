"""Participants are told all that is recorded: the text is made from it, in every language."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.running.page.pages import TAB, begin_session, config, experiment, study
from visavis.devices import streams
from visavis.protocol.session import streams as session_streams
from visavis.recording.reader import Recording
from visavis.recording.sharing import EVENT_CLASSES
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.running.page.course import consent_of
from visavis.study.information import (
    ABOUT_PAGE,
    EVENT_FACTS,
    LAB_EVENT_FACTS,
    STREAM_FACTS,
    facts_in_event,
    information_at_devices,
    information_on_page,
)

LANGUAGES = ("en", "de", "fr")
ON_PAGES = (
    "adjectives",
    "cameras",
    "gesture_pairs",
    "gestures",
    "hybrid",
    "interpolation",
    "matching",
    "waving_page",
)
AT_DEVICES = ("crowd", "stare", "waving")


def opened(name: str) -> OpenedStudy:
    opened_study = find_study(name)
    assert isinstance(opened_study, OpenedStudy)
    return opened_study


@pytest.mark.parametrize("screening", [(), ("card", "sound")], ids=["unscreened", "screened"])
def test_every_event_of_a_session_on_a_page_is_covered_by_what_people_were_told(
    screening: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    declared = study().study
    procedure = replace(declared.procedure, screening=screening)
    monkeypatch.setattr(declared, "procedure", procedure)
    with begin_session(tmp_path) as (page, path):
        (shown,) = [s for s in page.desk.trial_steps if s.kind == "consent"]
        page.answer()
        about: dict[str, Any] = dict.fromkeys(ABOUT_PAGE, 1)
        sent = {"n": 2, "kind": "about", "at_ms": page.visitor.now_ms, "about": about}
        page.desk.take(TAB, [sent])
        page.answer_all()
        page.desk.recorder.close("complete")
    texts = experiment().texts
    lines = shown.content["recorded"]["lines"]
    events = Recording(path).events()
    covered = set()
    for name, payload in zip(events["name"], events["payload"], strict=True):
        covered |= facts_in_event(name, payload)
    titles = ", ".join(q.title for q in study().questionnaires(config(tmp_path)))
    missing = [f for f in covered if texts.get(f"recorded.{f}", {"titles": titles}) not in lines]
    assert [] == missing
    assert {"browser", "screen", "films", "questionnaires"} <= covered
    assert bool(screening) == ({"card", "voice"} <= covered)


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("name", ON_PAGES)
def test_the_consent_of_a_study_on_pages_names_every_kind_of_record(
    name: str, language: str, tmp_path: Path
) -> None:
    one = opened(name)
    study_experiment = one.experiment({"language": language})
    lab = config(tmp_path).model_copy(update={"language": language})
    questionnaires = one.questionnaires(lab)
    consent = consent_of(study_experiment, study_experiment.plan(0, 1), questionnaires)
    assert consent is not None
    facts = {*ABOUT_PAGE.values(), "agreement", "answers", "course", "panel"}
    facts |= ({"films"} if study_experiment.films else set()) | (
        {"moulding"} if study_experiment.lives else set()
    )
    assert {study_experiment.texts.get(f"recorded.{f}") for f in facts} <= set(
        consent.recorded.lines
    )
    told = " ".join(consent.recorded.lines)
    assert all(q.title in told for q in questionnaires)


def test_another_text_about_records_is_another_version_of_the_consent() -> None:
    study_experiment = experiment()
    consent = consent_of(study_experiment, study_experiment.plan(0, 1), ())
    assert consent is not None
    fewer = replace(consent, recorded=replace(consent.recorded, lines=consent.recorded.lines[1:]))
    assert consent.version != fewer.version
    assert consent.version != replace(consent, information="Another").version


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("name", AT_DEVICES)
def test_the_information_in_a_lab_names_what_every_device_in_use_measures(
    name: str, language: str, tmp_path: Path
) -> None:
    one = opened(name)
    study_experiment = one.experiment({"language": language})
    lab = config(tmp_path).model_copy(update={"language": language})
    told = information_at_devices(study_experiment, one.questionnaires(lab)).lines
    facts = {"head", "shown", "presses"}
    roles = {*study_experiment.needed_roles, *study_experiment.useful_roles}
    facts |= {"gaze"} if "eye_tracker" in roles else set()
    facts |= {"body"} if "body_tracker" in roles else set()
    facts |= {"vibrations"} if any(r.startswith("armband") for r in roles) else set()
    assert {study_experiment.texts.get(f"recorded.{f}") for f in facts} <= set(told)


def test_every_stream_that_visavis_defines_is_covered_by_a_fact() -> None:
    schemas = [v.name for v in vars(streams).values() if isinstance(v, streams.StreamSchema)]
    schemas += [session_streams.FRAMES.name, session_streams.gaze_targets_schema(2, 90.0).name]
    assert [] == [name for name in schemas if name not in STREAM_FACTS]


def test_every_event_that_visavis_defines_is_covered_by_facts() -> None:
    covered = {*EVENT_FACTS, *LAB_EVENT_FACTS, "page_event"}
    assert set() == covered ^ set(EVENT_CLASSES)


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("name", AT_DEVICES)
def test_the_information_in_a_lab_names_every_event_that_any_session_may_hold(
    name: str, language: str, tmp_path: Path
) -> None:
    one = opened(name)
    study_experiment = one.experiment({"language": language})
    lab = config(tmp_path).model_copy(update={"language": language})
    questionnaires = one.questionnaires(lab)
    told = information_at_devices(study_experiment, questionnaires).lines
    of_devices = {"vibrations", "body", "sounds"} | (
        set() if study_experiment.lives else {"moulding_in_lab"}
    )
    of_devices |= {"turning"}  # of panoramas, which none of them shows
    facts = {fact for of in LAB_EVENT_FACTS.values() for fact in of} - of_devices
    titles = ", ".join(q.title for q in questionnaires)
    assert {study_experiment.texts.get(f"recorded.{f}", {"titles": titles}) for f in facts} <= set(
        told
    )


def test_a_device_of_the_labs_own_is_named_by_its_role() -> None:
    study_experiment = experiment()

    class Lab:
        texts, needed_roles, useful_roles = study_experiment.texts, ("breath",), ()
        lives, panoramas = (), ()

    lab: Any = Lab()
    told = information_at_devices(lab, ()).lines
    assert "what the device called breath measures of you" in told
    assert all("{" not in line for line in information_on_page(study_experiment, ()).lines)
