"""One trial of several sessions on one page: everybody's gaze, fixations and walk at once."""

from collections.abc import Callable, Sequence
from typing import Any

from visavis.cli.recorded_trial import recorded_trial
from visavis.cli.viewer.bundle import Bundle
from visavis.cli.viewer.content import (
    AROUND_NS,
    InSpace,
    at_rest,
    models_content,
    models_for,
    trial_content,
    whose,
)
from visavis.cli.viewer.scenes import Times
from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import UsageError
from visavis.recording.cached import CachedRecording
from visavis.results.opened_study import OpenedStudy
from visavis.running.page.seen_trial import is_on_page
from visavis.study.cast import use_recorded_cast


def together_content(
    study: OpenedStudy,
    recordings: Sequence[CachedRecording],
    trial_id: str,
    on_session: Callable[[int, int], None],
) -> tuple[dict[str, Any], Bundle]:
    """Return the header and arrays of a page that shows one trial of several sessions.

    Time counts from the trial's start in each, after a margin. Sessions stand in the header's
    `sessions` with what a page about one of them has; people, rooms and pictures are shared.

    Raises:
        UsageError: the trial is none in space, or a session has no such trial.
    """
    bundle, models = Bundle(), None
    sessions = []
    for number, recording in enumerate(recordings):
        if is_on_page(recording):
            raise UsageError("trials on a page have no place to show several participants in")
        use_recorded_cast(recording)
        trial = recorded_trial(recording, trial_id)
        begin_ns = trial.span_ns[0] - AROUND_NS
        # Clocks of other parts do not matter: nothing of them is on the page.
        times = Times({p.number: -begin_ns / NS_PER_S for p in recording.manifest.parts})
        in_space = InSpace(study, recording, times)
        samples = in_space.samples(trial)
        models = models or models_for(bundle, samples)
        sessions.append(
            {
                **whose(recording),
                **in_space.content(trial, samples, models, bundle),
                "rest": at_rest(study, recording, [trial]),
                **trial_content(recording, trial, bundle, times),
            }
        )
        on_session(number + 1, len(recordings))
    models = models or models_for(bundle, [])
    return {
        "title": f"{study.name} {trial_id}: {len(sessions)} participants",
        "simulated": any(one["simulated"] for one in sessions),
        "sessions": sessions,
        "pages": [],
        "films": [],
        **models_content(models),
    }, bundle
