"""A short path through the trials of a page: the same trials and people, no server, no files."""

from collections.abc import Iterator, Mapping
from typing import Any

from visavis.protocol.people.simulated_participant import SimulatedParticipant
from visavis.protocol.plan.session_plan import Trial
from visavis.protocol.plan.steps import Mark
from visavis.running.film_store import film_store
from visavis.running.page.steps import PageStep, Reply, check_reply, ns_of_ms
from visavis.running.page.trial import perform_on_page
from visavis.running.page.visitor import visitor_of
from visavis.study.experiment import StudyExperiment
from visavis.study.trial import TrialScript


def page_rows(
    experiment: StudyExperiment, person: SimulatedParticipant, *, index: int, seed: int
) -> Iterator[tuple[Trial, Mapping[str, Any]]]:
    """Perform every trial of a person's plan but practice; yield each with its row."""
    store = film_store(experiment)
    visitor = visitor_of(person, experiment, store)
    for trial in experiment.plan(index, seed).trials:
        if trial.is_practice:
            continue
        performing = perform_on_page(
            TrialScript(trial, experiment.settings),
            experiment.study.trial_plan,
            lambda film: store.told(film, is_simulated=True),
        )
        reply: Reply | None = None
        told = {"trial": trial.number, "is_practice": False}
        try:
            while True:
                out = performing.send(reply)
                reply = None
                if not isinstance(out, Mark):
                    step = PageStep(out.kind, {**out.content, **told})
                    content = visitor.reply(step)
                    check_reply(step, content)
                    reply = Reply(content, ns_of_ms(visitor.now_ms), ns_of_ms)
        except StopIteration as end:
            yield trial, dict(end.value or {})
