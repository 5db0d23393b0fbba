"""Perform a trial of the kit: its steps become steps of the engine, also when it is interrupted."""

from collections.abc import Callable
from typing import Any

from visavis.lab.errors import DesignError
from visavis.protocol.plan.steps import FrameView, NextFrame, Plan, Silence, TrialInterrupted
from visavis.study.actions import Action, Performing
from visavis.study.trial import TrialPlan, TrialScript


def perform(script: TrialScript, plan: TrialPlan) -> Plan:
    """Perform a study's trial as the session does: split actions into steps of the engine.

    An interruption is thrown into the study's generator too, so that its `finally` runs; motors
    are silenced in any case.
    """
    steps: Any = plan(script)
    reply: Any = None
    try:
        while True:
            step = steps.send(reply)
            if isinstance(step, Action):
                reply = yield from _store_onsets_during(script, step.perform())
            else:
                reply = yield step
                if isinstance(step, NextFrame):
                    script.view = reply
                    script.store_onsets(reply.sound_onsets)
    except StopIteration as end:
        return {**script.row, **(end.value or {})}
    except TrialInterrupted as stop:
        yield Silence()
        yield from _finish_interrupted(steps, stop)
        raise


def _store_onsets_during(script: TrialScript, steps: Performing) -> Performing:
    """Perform the parts of a step and store the onsets of sounds meanwhile."""
    go_on: Callable[[Any], Any] = steps.send
    value: Any = None
    while True:
        try:
            step = go_on(value)
        except StopIteration as end:
            return end.value
        try:
            value = yield step
        except TrialInterrupted as stop:
            go_on, value = steps.throw, stop
        else:
            go_on = steps.send
            if isinstance(value, FrameView) and value.sound_onsets:
                script.store_onsets(value.sound_onsets)


def _finish_interrupted(steps: Any, stop: TrialInterrupted) -> Performing:
    try:
        step = steps.throw(stop)
        while True:
            if isinstance(step, Action):
                if step.name not in ("mark", "vibrate"):
                    raise DesignError(
                        f"a trial that was interrupted may still mark, not {step.name}"
                    )
                reply = yield from step.perform()
            else:
                reply = yield step
            step = steps.send(reply)
    except (StopIteration, TrialInterrupted):
        return
