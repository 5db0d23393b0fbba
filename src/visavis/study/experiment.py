"""A study of the kit as the session performs it: plan, trials and the dark between them."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from typing import Any, Final, Self

import numpy as np

from visavis.lab.clock import NS_PER_MS
from visavis.lab.errors import ConfigError, DesignError
from visavis.lab.geometry import Vector
from visavis.lab.yaml_lines import did_you_mean
from visavis.protocol.plan.design import SESSION, combinations_of, make_plan
from visavis.protocol.plan.experiment import AfterPractice, Demands, no_progress
from visavis.protocol.plan.session_plan import Block, SessionPlan, Trial
from visavis.protocol.plan.steps import Plan
from visavis.protocol.session.boards import DwellRule, Ways
from visavis.stimuli.area_paths import FilesGone
from visavis.stimuli.audible import Audible
from visavis.stimuli.flat import Flat, Image, Panorama, Video
from visavis.stimuli.gaze_window import GAZE_WINDOW
from visavis.stimuli.scene import Scene as StageScene
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.sound import Waveform, part_of
from visavis.study.actions import Action
from visavis.study.asking import frame
from visavis.study.comparisons import Compare, possible
from visavis.study.criterion import practice_state
from visavis.study.declaration import Study
from visavis.study.dry_run import TrialRead, first_lit, read_trial, read_trials
from visavis.study.films import Film, LiveFilm, Voice, films_of
from visavis.study.items import ItemTable, fits, items_of_plan, read_items
from visavis.study.live import Live, Slider
from visavis.study.parameters import parameters_in_force
from visavis.study.parts import RESERVED_NAMES
from visavis.study.performing import perform
from visavis.study.responses import FreeText, Keys, Number, Pointing, Rating, Response
from visavis.study.scenes import FLAT
from visavis.study.texts import DEFAULT_LANGUAGE, Texts, read_texts
from visavis.study.trial import TrialScript
from visavis.study.trial_settings import Settings

HANDS: Final = "hands"
STREAMS_OF_HEADSET: Final = ("head", "frame_timing", "pointer", "responses")
"""What every page in a headset sends."""
WAYS: Final = ("board", "ray", "keyboard")
"""How questions are answered: "board" by hand, gaze or head; "ray" by hand or head; "keyboard"."""


@dataclass(frozen=True, eq=False)
class StudyExperiment:
    """Implement `visavis.protocol.plan.experiment.Experiment` for any study on the kit.

    `overrides` replace parameters by name (`language` among them).

    Raises:
        ConfigError: a parameter, a value or a text does not exist.
        DesignError: a trial of the study cannot be run through.
    """

    study: Study
    overrides: Mapping[str, Any] = field(default_factory=dict)
    session: int = field(default=1, kw_only=True)
    """The number of the session, from 1; it matters where sessions are a factor of the study."""
    heads_move: bool = field(default=True, kw_only=True)
    """False repeats a session of an older version: see `Staging.heads_move`."""
    files_gone: FilesGone | None = field(default=None, kw_only=True)
    """Files of stimuli and areas that are gone; None refuses them: see `Settings.files_gone`."""

    def __post_init__(self) -> None:
        criterion = self.study.design.practice_until
        trials = self.read.values()  # so that errors appear before anything begins
        if criterion is None:
            return
        columns = [c.name for t in trials for r in t.responses for c in r.columns()]
        columns += [name for t in trials for name in t.row_columns]
        if criterion.of not in columns:
            raise DesignError(
                f"study {self.name}: practice_until names {criterion.of!r}, which no trial writes"
                f"{did_you_mean(criterion.of, columns)}. Give a column that is true or false, such "
                "as that of Keys or a Choice with right="
            )

    def of_session(self, number: int) -> Self:
        """Return the experiment of one session of everybody.

        Raises:
            DesignError: the study names fewer sessions.
        """
        names = self.study.design.sessions
        if number == self.session or not names:
            return self
        if number > len(names):
            raise DesignError(
                f"study {self.name} has {len(names)} sessions ({', '.join(names)}); there is no "
                f"session {number}"
            )
        return replace(self, session=number)

    @property
    def session_name(self) -> str:
        """What the study calls this session; "" where it names none."""
        names = self.study.design.sessions
        return names[self.session - 1] if names else ""

    @property
    def name(self) -> str:
        """The study's name on the command line."""
        return self.study.name

    @cached_property
    def language(self) -> str:
        """The language of everything a participant reads."""
        return str(self.overrides.get("language", DEFAULT_LANGUAGE))

    @cached_property
    def parameters(self) -> dict[str, Any]:
        """Every parameter in force."""
        overrides = {k: v for k, v in self.overrides.items() if k != "language"}
        return parameters_in_force(self.study, overrides)

    @cached_property
    def texts(self) -> Texts:
        """Everything a participant reads."""
        return read_texts(self.study.text_folders, self.language)

    @cached_property
    def settings(self) -> Settings:
        """What all trials share."""
        return self._settings_of(self.session_name)

    def _settings_of(self, session_name: str) -> Settings:
        p = self.parameters
        if p["answer_by"] not in WAYS:
            raise ConfigError(f"{self.name}: answer_by is {p['answer_by']!r}; {', '.join(WAYS)}")
        return Settings(
            parameters={**p, SESSION: session_name} if session_name else p,
            texts=self.texts,
            values={k: v for k, v in p.items() if isinstance(v, str | int | float)},
            makers=self.study.procedure.makers,
            ways=Ways(float(p["answer_limit_s"]), None if p["answer_by"] == "ray" else DwellRule()),
            answer_by=str(p["answer_by"]),
            folder=self.study.files.trial_folder,
            measured_roles=frozenset(
                role for m in self.study.analysis.measures for role in (m.role, *m.areas) if role
            ),
            held_answers=frozenset(m.held for m in self.study.analysis.measures if m.held),
            heads_move=self.heads_move,
            files_gone=self.files_gone,
        )

    @cached_property
    def read(self) -> Mapping[tuple[tuple[str, Any], ...], TrialRead]:
        """What every condition shows and asks, in all sessions."""
        design = self.study.design_with(self.parameters)
        cells = (self._with_derived_columns(cell) for cell in combinations_of(design.factors))
        trials = [
            Trial(f"T{i}", i, 0, False, cell, i)
            for i, cell in enumerate(chain.from_iterable(map(self._with_items, cells)), start=1)
        ]
        if not design.sessions:
            return read_trials(self.study.trial_plan, trials, self.settings)
        return {
            (*key, (SESSION, name)): read
            for name in design.sessions
            for key, read in read_trials(
                self.study.trial_plan, trials, self._settings_of(name)
            ).items()
        }

    def first_lit(self, trial: Trial) -> SceneFrame | None:
        """Return the first lit frame of a trial before it is performed; None where it has none."""
        return first_lit(self.study.trial_plan, trial, self.settings)

    @cached_property
    def responses(self) -> dict[str, Response]:
        """Everything that is asked, by name."""
        trial_responses = [r for t in self.read.values() for r in t.responses]
        return {r.name: r for r in (*trial_responses, *self.study.asks.responses)}

    @cached_property
    def films(self) -> tuple[Film, ...]:
        """Every film that a condition shows, each once."""
        films = (
            film for t in self.read.values() for of in t.films for film in films_of(of).values()
        )
        return tuple(dict.fromkeys(films))

    @cached_property
    def item_table(self) -> ItemTable | None:
        """The table of the study's items; None where it has none.

        Raises:
            DesignError: the table is wrong, by line.
        """
        own = self.study.design
        if own.items is None:
            return None
        factors = self.study.design_with(self.parameters).factors
        table = read_items(own.items, self.settings.folder, factors)
        taken = {*self.parameters, *own.derived, *RESERVED_NAMES} - {f.name for f in own.factors}
        for column in table.columns:
            if column in taken:
                raise DesignError(
                    f"{table.file}: the column {column!r} is a name of the study's or the kit's; "
                    "name it otherwise"
                )
        return table

    def _with_items(self, cell: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
        """Yield a condition with every item that it may show."""
        items, table = self.study.design.items, self.item_table
        if items is None or table is None:
            yield cell
            return
        for row, item in enumerate(table.rows):
            if fits(items, table, row, cell):
                yield {**item, **cell}

    @cached_property
    def flats(self) -> tuple[Flat, ...]:
        """Every flat stimulus that a condition shows, each once."""
        scenes = (s for t in self.read.values() for s in t.scenes if s.name == FLAT)
        return tuple(dict.fromkeys(item for s in scenes for item in s.options["items"]))

    @cached_property
    def panoramas(self) -> tuple[Panorama, ...]:
        """Every panorama that a condition shows, each once."""
        scenes = (s for t in self.read.values() for s in t.scenes if "panorama" in s.options)
        return tuple(dict.fromkeys(scene.options["panorama"] for scene in scenes))

    @property
    def fills_screen(self) -> bool:
        """Whether a condition shows flat stimuli, or a panorama: on a page the size of its screen
        counts.
        """
        return bool(self.flats or self.panoramas)

    @property
    def pictures(self) -> tuple[Image, ...]:
        """One picture of every file that a condition shows."""
        pictures = {item.file: item for item in self.flats if isinstance(item, Image)}
        return tuple(pictures.values())

    @property
    def videos(self) -> tuple[Video, ...]:
        """One video of every file that a condition shows."""
        videos = {item.file: item for item in self.flats if isinstance(item, Video)}
        return tuple(videos.values())

    @property
    def audibles(self) -> tuple[Audible, ...]:
        """Every tone and sound that a condition shows, each once."""
        sources = (s for t in self.read.values() for s in t.sounds)
        return tuple(dict.fromkeys(s for s in sources if isinstance(s, Audible)))

    @cached_property
    def lives(self) -> tuple[Live | LiveFilm, ...]:
        """Everything drawn live that a condition shows, each once."""
        return tuple(dict.fromkeys(live for t in self.read.values() for live in t.lives.values()))

    def lives_of(self, trial: Trial) -> Mapping[str, Live]:
        """Return a trial's live figures by the names under which they are recorded."""
        apart = replace(self.settings, memory={})
        lives = read_trial(self.study.trial_plan, trial, apart).lives
        return {name: live for name, live in lives.items() if isinstance(live, Live)}

    def check_at_devices(self) -> None:
        """Check that everything can be shown before a monitor or in a headset.

        Raises:
            DesignError: a window follows the pointer, a film is drawn live, or the examples of a
                live figure are for another body.
        """
        if any("pointer" in t.rests_on for t in self.read.values()):
            raise DesignError(
                f'{self.name}: reveal="pointer" is for pages; write on="browser" in the study (or '
                'give --on browser), or let the window follow gaze: reveal="gaze"'
            )
        for live in self.lives:
            if isinstance(live, LiveFilm):
                raise DesignError(
                    f"{self.name}: a LiveFilm is drawn by pages; perform it on one (--on browser)"
                )
            live.check_bodies()

    def check_in_headset(self) -> None:
        """Check that a page in a headset can do all that the trials need, where it may enter one.

        Raises:
            DesignError: naming everything that no page in a headset can do, and the way out.
        """
        xr = self.study.procedure.xr
        problems = () if xr == "never" else tuple(self._beyond_a_headset_page())
        if problems:
            raise DesignError(
                f'{self.name} cannot be performed in a headset\'s browser (xr="{xr}"): '
                + "; ".join(problems)
            )

    def _beyond_a_headset_page(self) -> Iterator[str]:
        """Yield what the study needs and a page in a headset cannot do, with the way out."""
        reads, demands = self.read.values(), self.demands
        roles = set(self.needed_roles)
        if self.needs_gaze:
            yield (
                "it needs gaze, which browsers give no page, and the direction of the head is no "
                'gaze; perform it in the lab with an eye tracker (on="lab", such as openxr_gaze)'
            )
        if any(t.vibrates for t in reads) or demands.vibrations:
            yield 'armbands vibrate in it, which no page drives; perform it in the lab (on="lab")'
        if demands.floor_side_m > 0:
            yield (
                f"it is walked on a floor of {demands.floor_side_m:g} m, and nobody sees whether "
                'there is one; perform it in the lab (on="lab")'
            )
        if demands.own_body:
            yield 'people see a body of their own, which takes a body tracker (on="lab")'
        others = sorted(r for r in roles - {"eye_tracker", HANDS} if not r.startswith("armband"))
        if others:
            yield f'it needs {", ".join(others)} of a lab (on="lab")'
        if not all(t.fits_a_page for t in reads):
            variant = self.study.procedure.xr_variant
            yield "its trials show single frames; " + (
                f"perform {variant}, its variant for headsets' browsers"
                if variant
                else "show live figures (t.watch(LiveScene(…)))"
            )
        if any(t.films for t in reads):
            yield (
                "it shows films, which are watched on the flat page; leave xr out, or show live "
                "figures (t.watch(LiveScene(…))), which are another stimulus"
            )
        if self.panoramas:
            yield (
                "it shows a Panorama, which pages show on the screen; leave xr out, or perform it "
                'in a headset of the laboratory (on="lab")'
            )
        if self.flats:
            yield "t.show is for a screen; leave xr out, or show live figures"
        typed = {
            r.name
            for t in reads
            for r in t.responses
            if isinstance(r, FreeText) or (isinstance(r, Number) and not r.step)
        }
        if typed:
            yield (
                f"{', '.join(sorted(typed))} would be typed; ask a Rating, a Choice or a Number "
                "with a step, or ask it in a questionnaire"
            )

    @property
    def headset_streams(self) -> tuple[str, ...]:
        """The streams that its page sends from a headset; none where it enters none.

        Hands are among them where the study names the role.
        """
        if self.study.procedure.xr == "never":
            return ()
        roles = {*self.needed_roles, *self.useful_roles}
        return (*STREAMS_OF_HEADSET, *({HANDS} & roles))

    @property
    def needs_gaze(self) -> bool:
        """Whether anything is measured by gaze or ends with it."""
        analysis = self.study.analysis
        is_measured = bool(analysis.looks) or any(m.needs_gaze for m in analysis.measures)
        return is_measured or "eye_tracker" in self.needed_roles

    @property
    def words(self) -> dict[str, Response]:
        """Every response by the text of its question."""
        script = TrialScript(Trial("T1", 1, 0, False, {}, 0), self.settings)
        responses = self.responses.values()
        ratings = {
            script.bare_prompt(r): r
            for r in responses
            if isinstance(r, Rating) and not script.has_own_prompt(r)
        }
        return ratings | {script.words_of(r)[0]: r for r in responses}

    @cached_property
    def agent_count(self) -> int:
        """Number of agents in every scene of a trial; fixes the width of recorded columns."""
        counts = {t.agents for t in self.read.values()}
        if len(counts - {0}) > 1:
            raise DesignError(
                f"study {self.name} shows scenes of {', '.join(map(str, sorted(counts)))} people; "
                "all scenes of a study hold equally many (or none)"
            )
        # Where scenes show people other than their agents, columns always had the width of one.
        return max(counts, default=0) or (1 if self.study.procedure.people else 0)

    @property
    def people_count(self) -> int:
        """Largest number of people in one picture; an audience includes its speaker."""
        people = self.study.procedure.people
        figures = (live for live in self.lives if isinstance(live, Live))
        live = max((1 + bool(figure.beside) for figure in figures), default=0)
        of_study = people(self.parameters) if callable(people) else people
        return max(self.agent_count + 1, of_study, live)

    @property
    def trial_s(self) -> float:
        """Usual duration of a trial, for the time left on the operator's screen."""
        trial_s = self.parameters.get("trial_s")
        return (
            float(np.mean([t.seconds for t in self.read.values()]))
            if trial_s is None
            else float(trial_s)
        )

    @property
    def intertrial_s(self) -> float:
        """Duration of the dark before a trial."""
        return float(self.parameters["intertrial_s"])

    @property
    def needed_roles(self) -> tuple[str, ...]:
        """Devices the study cannot do without, beside the headset."""
        plays = ("sound",) if self.voices or any(t.sounds for t in self.read.values()) else ()
        follows = ("eye_tracker",) if self._waits_for_gaze else ()
        return tuple(dict.fromkeys((*self.study.devices.needs, *plays, *follows)))

    @property
    def has_gaze_windows(self) -> bool:
        """Whether a window that follows gaze is seen in a trial."""
        return any(GAZE_WINDOW in t.rests_on for t in self.read.values())

    @property
    def _waits_for_gaze(self) -> bool:
        """Whether gaze ends a step of a trial, or moves its window."""
        return any("gaze" in t.rests_on for t in self.read.values())

    @property
    def useful_roles(self) -> tuple[str, ...]:
        """Devices it uses where the lab has them."""
        uses = self.study.devices.uses
        if uses is None:
            return ("eye_tracker", "body_tracker") if self._is_pointed else ("eye_tracker",)
        return tuple(uses(self.parameters) if callable(uses) else uses)

    @property
    def rests_on_gaze(self) -> bool:
        """Whether it calibrates or needs an eye tracker, or measures anything by gaze."""
        return self.study.devices.calibrate or self.needs_gaze

    @property
    def _is_pointed(self) -> bool:
        """Whether answers are given by a hand; no other part of the body is used."""
        responses = self.responses.values()
        way = self.settings.answer_by
        on_boards = way == "board" and any(r.options for r in responses if not isinstance(r, Keys))
        by_hand_alone = on_boards and not self.study.devices.calibrate
        return (
            way == "ray"
            or by_hand_alone
            or any(isinstance(r, Pointing | Slider) for r in responses)
        )

    @property
    def demands(self) -> Demands:
        """What the study demands of a lab besides the presence of devices."""
        of = self.study.devices.demands_of
        demands = Demands() if of is None else of(self.parameters)
        return replace(demands, sounds=self.sounds) if self.sounds else demands

    @cached_property
    def sounds(self) -> tuple[Waveform, ...]:
        """All sounds of all conditions, each once.

        Raises:
            DesignError: a file cannot be played.
        """
        of = self.settings.sound_of
        sounds = [of(sound) for trial in self.read.values() for sound in trial.sounds]
        for film in self.films:
            if (voice := film.voice) is not None:
                whole = of(self.settings.folder / voice.file)
                sounds.append(part_of(whole, voice.from_s, film.frame_count / film.rate_hz))
        return tuple({sound.sha256: sound for sound in sounds}.values())

    @property
    def voices(self) -> tuple[Voice, ...]:
        """What is heard with films, each once."""
        return tuple(dict.fromkeys(film.voice for film in self.films if film.voice is not None))

    @property
    def unplayable(self) -> tuple[str, ...]:
        """The error of each sound that cannot be played, or not at its level."""
        sources = [sound for trial in self.read.values() for sound in trial.sounds]
        sources += [self.settings.folder / voice.file for voice in self.voices]
        problems = []
        for file in sorted(set(sources), key=str):
            try:
                self.settings.sound_of(file)
            except DesignError as problem:
                problems.append(str(problem))
        return tuple(problems)

    @property
    def still_staircases(self) -> tuple[str, ...]:
        """The staircases whose level never moves: no condition lets them hear of an answer."""
        all_names = {s.name for trial in self.read.values() for s in trial.staircases}
        moves = {
            s.name
            for trial in self.read.values()
            for s in trial.staircases
            if s.name not in trial.still_staircases
        }
        return tuple(sorted(all_names - moves))

    @property
    def areas_in_part(self) -> tuple[str, ...]:
        """Of each measured area that some conditions with areas lack, or show as something other
        than is measured: how many, and which first.
        """
        with_areas = {key: trial for key, trial in self.read.items() if trial.areas}
        notes = []
        for area in dict.fromkeys(a for m in self.study.analysis.measures for a in m.areas):
            lacking = [k for k, t in with_areas.items() if area not in t.areas | t.roles]
            if lacking:
                first = ", ".join(f"{name} {level}" for name, level in lacking[0])
                notes.append(
                    f"{len(lacking)} of {len(with_areas)} conditions show no area {area!r}, "
                    "so that their trials have no value of its measures: the first with "
                    f"{first}{did_you_mean(area, with_areas[lacking[0]].areas)}"
                )
        measured = ((m.scene, a) for m in self.study.analysis.measures if m.scene for a in m.areas)
        for scene, area in dict.fromkeys(measured):
            other = {
                key: shown
                for key, t in with_areas.items()
                if area not in t.roles | t.areas_of.get(scene, frozenset())
                and (shown := [name for name, areas in t.areas_of.items() if area in areas])
            }
            if other:
                key, (name, *_) = next(iter(other.items()))
                first = ", ".join(f"{factor} {level}" for factor, level in key)
                notes.append(
                    f"{len(other)} of {len(with_areas)} conditions show the area {area!r} as "
                    f"{name}, but its measures are of {scene}, so that their trials have no value: "
                    f"the first with {first}; give the measures scene={name!r}, or name what is "
                    f"shown before otherwise: t.show(…, name=…)"
                )
        return tuple(notes)

    def prepare(self, on_progress: Callable[[int, int], None] = no_progress) -> None:
        """Load and compute in advance; `on_progress` gets how many steps are done and the total."""
        of = self.study.procedure.prepare_of
        steps = () if of is None else tuple(of(self))
        for count, step in enumerate(steps):
            on_progress(count, len(steps))
            step()
        on_progress(len(steps), len(steps))

    @property
    def spare_roles(self) -> tuple[str, ...]:
        """Devices without which a session may go on if the operator agrees.

        If the study does not name them: the devices it uses without needing them, except an eye
        tracker that it calibrates and response devices whose keys or ray it asks for.
        """
        devices = self.study.devices
        if devices.spares is not None:
            return tuple(devices.spares)
        needed_roles = {*devices.needs, *(("eye_tracker",) if self._waits_for_gaze else ())}
        needed_roles |= {"eye_tracker"} if devices.calibrate and devices.validate else set()
        asks_presses = any(isinstance(r, Keys | Pointing | Slider) for r in self.responses.values())
        needed_roles |= {"responses"} if asks_presses or self.settings.answer_by == "ray" else set()
        return tuple(role for role in (*self.useful_roles, "responses") if role not in needed_roles)

    def plan(self, participant_index: int, seed: int, group: str = "") -> SessionPlan:
        """Return everything one participant will do; clears the memory of earlier trials.

        Raises:
            DesignError: there is no such group, or the design cannot be ordered in this way.
        """
        self.settings.memory.clear()
        self.settings.rows.clear()
        self.settings.repeats.clear()
        design = self.study.design_with(self.parameters)

        def plan_of(session: int) -> SessionPlan:
            return make_plan(
                design,
                seed=seed,
                participant_index=participant_index,
                group=group or None,
                session=session,
            )

        plan = plan_of(self.session)
        rows: Mapping[str, Mapping[str, Any]] = {}
        items = self.study.design.items
        if items is not None and self.item_table is not None:
            first = plan_of(1) if self.session > 1 else None
            table = self.item_table
            rows = items_of_plan(items, table, plan, design.factors, first, self.session)
        values = self.values_of(plan)
        blocks = []
        for block in plan.blocks:
            text_values = values | self._values_of_block(plan, block)
            titles = ("blocks.practice",) if block.is_practice else ("blocks.part",)
            instruction_names = self._instructions(text_values, block)
            blocks.append(
                replace(
                    block,
                    trials=tuple(
                        replace(
                            t,
                            factors={
                                **self._with_derived_columns(t.factors),
                                **{
                                    name: value
                                    for name, value in rows.get(t.trial_id, {}).items()
                                    if name not in t.factors
                                },
                            },
                        )
                        for t in block.trials
                    ),
                    name=self.texts.find(*titles, values=text_values) or block.name,
                    instruction=self.texts.find(*instruction_names, values=text_values) or "",
                    calibrate=self.study.devices.calibrate
                    and (block.index == 0 or self.study.devices.calibrate_blocks),
                    questionnaires=() if block.is_practice else self._questionnaires_after_blocks(),
                )
            )
        parameters = {
            name: value if isinstance(value, str | int | float | bool) else json.dumps(list(value))
            for name, value in self.parameters.items()
        }
        parameters["language"] = self.language
        return replace(plan, blocks=tuple(blocks), parameters=parameters)

    def _questionnaires_after_blocks(self) -> tuple[str, ...]:
        asks = self.study.asks
        omissions = () if asks.skip_after_block is None else asks.skip_after_block(self.parameters)
        return tuple(name for name in asks.after_block if name not in omissions)

    def values_of(self, plan: SessionPlan) -> dict[str, Any]:
        """Return the values for placeholders of texts: parameters, and numbers from the plan."""
        main_trials = [t for t in plan.trials if not t.is_practice]
        return {
            **self.settings.values,
            "trials": len(main_trials),
            "practice": len(plan.trials) - len(main_trials),
            "trial_s": self.parameters.get("trial_s", round(self.trial_s)),
            **{
                f"{r.name}_{end}": getattr(r, end)
                for r in self.responses.values()
                if isinstance(r, Rating)
                for end in ("low", "high")
            },
            "blocks": sum(any(not t.is_practice for t in b.trials) for b in plan.blocks),
        }

    def _values_of_block(self, plan: SessionPlan, block: Block) -> dict[str, Any]:
        """Return the further values for the texts before a block."""
        own = sum(b.is_practice for b in plan.blocks)
        blocked_by = self.study.design.blocked_by
        return {
            "part": block.index + 1 - own,
            "parts": len(plan.blocks) - own,
            "part_trials": len(block.trials),
            **({"level": block.trials[0].factors[blocked_by]} if blocked_by is not None else {}),
        }

    def _instructions(self, values: Mapping[str, Any], block: Block) -> tuple[str, ...]:
        """Return names of texts; the first that exists is the block's instruction."""
        if block.is_practice:
            return ("practice",)
        part, parts = values["part"], values["parts"]
        if parts == 1:
            place = "only"
        else:
            place = "first" if part == 1 else "last" if part == parts else "between"
        blocked_by = self.study.design.blocked_by
        of_level = () if blocked_by is None else (f"instructions.{blocked_by}.{values['level']}",)
        return (f"instructions.{part}", *of_level, f"instructions.{place}", "instruction")

    def pause_before(self, plan: SessionPlan, block: Block) -> str:
        """Return what participants read in the break before a block; "" without words of its own.

        Raises:
            ConfigError: nothing fills a placeholder.
        """
        if "pause" not in self.texts.own:
            return ""
        return self.texts.get("pause", self.values_of(plan) | self._values_of_block(plan, block))

    def after_practice(
        self, block: Block, rounds: int, rows: Sequence[Mapping[str, Any]] | None = None
    ) -> AfterPractice:
        """Return what follows so many rounds of a block of practice; `rows` are those of the
        session's complete trials (None: those of this experiment's session).
        """
        criterion = self.study.design.practice_until
        if criterion is None:
            return AfterPractice()
        state = practice_state(
            criterion, self.settings.rows if rows is None else rows, len(block.trials)
        )
        if state.trials == 0 or state.is_reached(criterion):
            return AfterPractice()
        if rounds < criterion.max_rounds:
            values = {"right": state.right, "practised": state.trials}
            words = self.texts.get("practice_again", {**self.settings.values, **values})
            return AfterPractice(again=words)
        if criterion.otherwise == "go on":
            return AfterPractice()
        return AfterPractice(
            ends=f"practice: {criterion.of} held in {state.right} of {state.trials} trials after "
            f"{rounds} rounds"
        )

    def run_trial(self, trial: Trial) -> Plan:
        """Perform a trial; later trials know its row."""
        script = TrialScript(trial, self.settings)
        row = yield from perform(script, self.study.trial_plan)
        script.remember(row)
        if script.wish is not None:
            yield script.wish
        return row

    def recall(self, rows: Sequence[Mapping[str, Any]]) -> None:
        """Take up the rows that a session recorded before it was resumed, in their order."""
        self.settings.rows[:] = [row for row in rows if row["status"] == "complete"]
        for row in rows:
            if row["status"] == "repeated":
                self.settings.note_repeat(str(row["trial_id"]))

    def intertrial(self, trial: Trial) -> Plan:
        """Stay dark before a trial, or do what the study does instead."""
        script = TrialScript(trial, self.settings)
        script.view = yield from frame()
        start_ns = script.now_ns
        row = yield from perform(script, self.study.procedure.intertrial_of or _darkness)
        return {"intertrial_ms": (script.now_ns - start_ns) / NS_PER_MS, **row}

    @property
    def is_self_paced(self) -> bool:
        """Whether participants go on by themselves after an instruction that they have read."""
        return self.study.procedure.instructions == "read"

    def blank(self, mark_m: Vector | None) -> StageScene:
        """Return a dark scene without people, for calibrations and breaks."""
        return StageScene(name="blank", agents=(), brightness_01=0.0, mark_m=mark_m)

    def conditions(self) -> Iterator[Mapping[str, Any]]:
        """Yield every condition of the design."""
        for cell in combinations_of(self.study.design_with(self.parameters).factors):
            yield self._with_derived_columns(cell)

    @cached_property
    def levels(self) -> dict[str, tuple[Any, ...]]:
        """The levels of every factor, sessions among them, and the values of columns derived from
        factors.
        """
        design = self.study.design_with(self.parameters)
        levels: dict[str, tuple[Any, ...]] = {f.name: tuple(f.levels) for f in design.factors}
        if design.sessions:
            levels[SESSION] = design.sessions
        cells = list(self.conditions())
        return levels | {
            n: tuple(dict.fromkeys(c[n] for c in cells)) for n in self.study.design.derived
        }

    @cached_property
    def compare(self) -> tuple[Compare, ...]:
        """The comparisons that the design in force can make."""
        in_force = self.levels | {
            f.name: self.parameters.get(f.name, f.levels) for f in self.study.design.factors
        }
        design = self.study.design_with(self.parameters)
        return possible(
            self.study.analysis.compare,
            in_force,
            tuple(self.levels),
            [f.name for f in design.between],
            self.study.analysis.groups,
        )

    def _with_derived_columns(self, factors: Mapping[str, Any]) -> dict[str, Any]:
        """Return a trial's factors with the columns derived from them."""
        return {**factors, **{name: of(factors) for name, of in self.study.design.derived.items()}}


def _darkness(t: TrialScript) -> Iterator[Action]:
    yield t.dark(t.intertrial_s)
