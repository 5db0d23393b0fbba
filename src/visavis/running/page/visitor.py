"""The simulated participant at a page: speaks its protocol, watches films, answers.

They see only the films and the questions.
"""

import base64
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from itertools import takewhile
from typing import Any, Final

import numpy as np

from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.errors import ConfigError, DataError
from visavis.people.moulder import Task
from visavis.people.person import LISTEN_S, StudyPerson
from visavis.protocol.people.simulated_participant import STRETCH_AGAIN
from visavis.running.film_store import FilmStore
from visavis.running.page.flat import flat_scene, is_seen, of_part_unseen, screen_of
from visavis.running.page.simulated_headset import ENTERED, SimulatedHeadset
from visavis.running.page.spoken_digits import hear_digits, spoken_digits
from visavis.running.page.steps import BY_LIMIT, PageStep
from visavis.stimuli.audible import Audible, gain_db_of
from visavis.stimuli.motion.synthesis.pose_distance import Likeness
from visavis.stimuli.panels import Surface
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.sound import Waveform
from visavis.stimuli.view_turns import ViewTurns
from visavis.study.dry_run import still_view
from visavis.study.experiment import StudyExperiment
from visavis.study.films import Film, Lens, LiveFilm, Pair, films_of, scene_of, seconds_of
from visavis.study.live import Live, LiveScene
from visavis.study.responses import Keys, Response
from visavis.study.scenes import Staging, stage

READING_S: Final = 4.0
"""Time to read a page of text."""
FIRST_FRAME_MS: Final = 40.0
"""From a step to the first picture that a simulated browser presents."""
PX_PER_MM: Final = 96 / 25.4
"""Size of a CSS pixel by its standard (96 to the inch)."""
VIEW_PX: Final = (1280, 800)
"""Size of a simulated person's page where it matters."""
DISTANCE_MM: Final = 600.0
"""Distance from a simulated person's eyes to their screen."""
SCREEN: Final = {"px_per_mm": PX_PER_MM, "distance_mm": DISTANCE_MM}
MOVE_MS: Final = 50.0
"""From one movement of a slider to the next, while it is dragged."""
MOVE_SHARE: Final = 0.05
"""How far such a movement leads, as a share of the slider."""
MOVES_AT_ONCE: Final = 20
LOOKS_AROUND_S: Final = 120.0
"""How long somebody turns the view onto a panorama, at most."""
REFRESH_HZ: Final = 60.0
FRAME_MS: Final = 1000.0 / REFRESH_HZ
PRACTICE_STRETCH: Final = 100_000
ANSWERED_BY: Final = "keys"
ANSWERED_BY_MOUSE: Final = "mouse"
ANSWERED_BY_RAY: Final = "ray"
HELD_MS: Final = 80.0
"""How long a simulated participant holds a key, where that is measured."""

Views = Callable[[Mapping[str, Film]], tuple[SceneFrame, SceneFrame]]
"""Returns the first and the last frame of films by place: what is seen of them."""


@dataclass
class Visitor:
    """Answer a page's steps as a person would.

    `films` maps names on the wire to films, `responses` the text of a question to its response;
    `store` knows what a moving camera showed.
    """

    person: StudyPerson
    films: Mapping[str, Film]
    responses: Mapping[str, Response]
    views: Views
    store: FilmStore
    sound_of: Callable[[Audible], Waveform]
    now_ms: float = 0.0
    digits: Sequence[bytes] = ()
    """Recordings of the digits in the language of the page."""
    lives: Sequence[Live | LiveFilm] = ()
    """The study's live figures, by number on the wire."""
    presses: Mapping[str, Keys] = field(default_factory=dict)
    """The study's keys, by the name of their answer."""
    moves: list[dict[str, Any]] = field(default_factory=list, repr=False)
    """Movements during the last step, for the page to send before its reply."""
    batches: list[dict[str, Any]] = field(default_factory=list, repr=False)
    """What a headset measured meanwhile, for the page to send before its reply."""
    _headset: SimulatedHeadset | None = field(default=None, repr=False)
    _turns: dict[int, ViewTurns] = field(default_factory=dict, repr=False)
    """How the person turns the view onto each panorama of a step, by the place of its part."""
    _trial: tuple[int, bool, int] = field(default=(0, False, 0), repr=False)

    def reply(self, step: PageStep) -> dict[str, Any]:
        """Return the reply to a step; advance the visitor's clock by the time it took.

        Whoever has entered a headset answers by ray, and it measures how.
        """
        begun_ms = self.now_ms
        reply = self._reply(step)
        if self._headset is not None:
            answers = [a for a in reply.get("answers", {}).values() if isinstance(a, dict)]
            for answer in answers:
                if answer["by"] != BY_LIMIT:
                    answer["by"] = ANSWERED_BY_RAY
                answer.pop("released_ms", None)  # no key is held
            presses_ms = [answer["at_ms"] for answer in answers]
            self.batches += self._headset.batches(begun_ms, self.now_ms, presses_ms)
        return reply

    def _reply(self, step: PageStep) -> dict[str, Any]:
        content = step.content
        match step.kind:
            case "consent":
                self.now_ms += READING_S * 1000
                return {"agreed": True}
            case "card":
                self.now_ms += READING_S * 1000
                distance = {"distance_mm": DISTANCE_MM} if "usual_distance_mm" in content else {}
                return {"px_per_mm": PX_PER_MM, **distance}
            case "sound":
                self.now_ms += READING_S * 1000
                return {
                    "heard": hear_digits(base64.b64decode(content["wav"]), self.digits),
                    "played": 1,
                }
            case "enter":
                self.now_ms += READING_S * 1000
                self._headset = SimulatedHeadset()
                return dict(ENTERED)
            case "preload":
                return {"films": {f["film"]: "simulated" for f in content["films"]}}
            case "show":
                return self._show(content)
            case "hush":
                return {}
            case "text":
                self.now_ms += READING_S * 1000
                return {}
            case "blank":
                self.now_ms += content["seconds"] * 1000
                return {}
            case "watch":
                return self._watch(content)
            case "mould":
                return self._mould(content)
            case "questions":
                return {"answers": {q["name"]: self._question(q) for q in content["questions"]}}
            case _:
                raise DataError(f"a simulated participant knows no step {step.kind!r}")

    def look_again(self, step: PageStep) -> None:
        """See what a step showed before a session was resumed."""
        if step.kind == "watch":
            self.look(step.content)
        else:
            self._see_parts(step.content)

    def _see_parts(self, content: Mapping[str, Any]) -> None:
        """See everything that a step shows up to what is answered, as the person would."""
        self._begin_trial(content)
        keys, parts, at_ms = content["keys"], content["parts"], self.now_ms + FIRST_FRAME_MS
        limit_s = keys["limit_s"] if keys else 0.0
        self._turns = {}
        for k, part in enumerate(parts[: keys["from"] + 1] if keys else parts):
            scene = flat_scene(part, self.store.study_folder)
            if scene.panorama is not None:
                if part.get("goes_on"):
                    continue  # they look on
                scene = replace(scene, surface=self._surface())
            if scene.items or scene.sounds or scene.panorama is not None:
                self.person.see(SceneFrame(scene, 0, np.zeros((0, 3)), np.zeros(0)), 0)
            if scene.panorama is not None:
                waits = takewhile(lambda later: later.get("goes_on"), parts[k + 1 :])
                lengths_ms = filter(math.isfinite, map(_lasts_ms, (part, *waits)))
                seconds = min(limit_s + sum(lengths_ms) / 1000, LOOKS_AROUND_S)
                self._turns[k] = self.person.view_turns(seconds, round(FRAME_MS * NS_PER_MS))
            for one in scene.sounds:
                sound = self.sound_of(one)
                samples = sound.at_both_ears(gain_db_of(one, sound))
                self.person.hear(samples, sound.rate_hz, round(at_ms * NS_PER_MS))
            if math.isfinite(lasts_ms := _lasts_ms(part)):
                at_ms += lasts_ms

    def _surface(self) -> Surface:
        """Return the screen that a page is for this person, before their eyes."""
        return self.person.before_eyes(screen_of({"screen": SCREEN, "view_px": VIEW_PX}))

    def _show(self, content: Mapping[str, Any]) -> dict[str, Any]:
        """See what is shown, part by part, and press a key where one is asked for."""
        shown_ms = self.now_ms
        self._see_parts(content)
        keys, at_ms = content["keys"], self.now_ms + FIRST_FRAME_MS
        parts: list[dict[str, Any]] = []
        answer, end_ms = None, math.inf
        for k, part in enumerate(content["parts"]):
            if keys is not None and k == keys["from"]:
                end_ms = at_ms + 1000 * keys["limit_s"]
                option, takes_s = self.person.press(self.presses[keys["question"]])
                lengths_s = [min(LISTEN_S, sound["length_s"]) for sound in part.get("sounds", ())]
                takes_s = max([takes_s, *lengths_s])
                if option is not None and at_ms + 1000 * takes_s <= end_ms:
                    end_ms = at_ms + 1000 * takes_s
                    answer = {"option": option, "at_ms": end_ms, "by": ANSWERED_BY}
            lasts_ms = _lasts_ms(part)
            frames = max(1, math.ceil((min(at_ms + lasts_ms, end_ms) - at_ms) / FRAME_MS - 1e-6))
            off_ms = at_ms + frames * FRAME_MS
            parts.append({"on_ms": at_ms, "off_ms": off_ms, "frames": frames, "dropped": 0})
            parts[-1] |= of_part_unseen(part, at_ms, (off_ms - at_ms) / 1000)
            if "panorama" in part:
                first = next(n for n in range(k, -1, -1) if not content["parts"][n].get("goes_on"))
                turns = self._turns[first].turns if first in self._turns else ()
                since_ms = parts[first]["on_ms"]
                rows = [[since_ms + t.since_ns / NS_PER_MS, t.from_deg, t.to_deg] for t in turns]
                parts[-1]["turns"] = [
                    [t_ms, list(a), list(b)] for t_ms, a, b in rows if at_ms <= t_ms < off_ms
                ]
            if "reveal" in part:
                scene = flat_scene(part, self.store.study_folder)
                path = self.person.pointer_path(scene, (off_ms - at_ms) / 1000)
                parts[-1]["pointer"] = [
                    [at_ms + 1000 * t_s, *_page_px(right_deg, up_deg)]
                    for t_s, right_deg, up_deg in path
                ]
            at_ms = off_ms
            if at_ms >= end_ms:
                break
        self.now_ms = at_ms
        facts = set().union(*parts)
        return {
            "shown_ms": shown_ms,
            "hidden_ms": 0.0,
            "parts": parts,
            "screen": dict(SCREEN),
            "outside": 0,
            "answer": answer,
            "view_px": list(VIEW_PX),
            **({"frame_ms": FRAME_MS} if "turns" in facts else {}),
        }

    def look(self, content: Mapping[str, Any]) -> float:
        """Look at a step's films or figures once; return how long a round takes, in milliseconds.

        The person remembers what they saw in a trial until the next one begins.
        """
        self._begin_trial(content)
        if "live" in content:
            live = self.lives[content["live"]["figure"]]
            if isinstance(live, LiveFilm):
                return self._see_films({"film": live.film})
            names = live.examples.names
            motions = [dict(zip(names, w, strict=True)) for w in content["motions"]]
            self.person.watch_figures(LiveScene(live, *motions), content["caption"])
            return float(content["cycle_s"] * 1000)
        film_entries = {f["place"]: f for f in content["films"]}
        if not film_entries:
            return 0.0
        films = {p: self.films[f["film"]] for p, f in film_entries.items()}
        round_ms = self._see_films(films)
        moving = {p: film for p, film in films.items() if not isinstance(film.lens, Lens)}
        self.person.watch({p: self.store.film_seen(film) for p, film in moving.items()})
        return round_ms

    def _see_films(self, films: Mapping[str, Film]) -> float:
        """See the first and the last frame of films; return how long they take in milliseconds."""
        round_ms = 1000.0 * max(film.frame_count / film.rate_hz for film in films.values())
        first, last = self.views(films)
        self.person.see(first, 0)
        self.person.see(last, max(1, round(round_ms * NS_PER_MS)))
        return round_ms

    def _begin_trial(self, content: Mapping[str, Any]) -> None:
        trial = (content["trial"], content["is_practice"], content.get("again", 0))
        if trial != self._trial:
            self._trial = trial
            number, is_practice, again = trial
            self.person.prepare(number + PRACTICE_STRETCH * is_practice + STRETCH_AGAIN * again, 0)

    def _mould(self, content: Mapping[str, Any]) -> dict[str, Any]:
        """Mould a figure as the person does: after a target that is seen, or to what they want."""
        shown_ms, first_ms = self.now_ms, self.now_ms + FIRST_FRAME_MS
        self._begin_trial(content)
        live, until = self.lives[content["live"]["figure"]], content["until"]
        self.person.mould(live, content["caption"])
        likeness = None
        if until is not None:
            target = np.array(until["weights"])
            likeness = Likeness(live.examples, target, until["poses"], tuple(until["joints"]))
        if likeness is not None and live.beside:
            rows, ended_by = self._match(content, likeness, first_ms)
        else:
            rows, ended_by = self._settle(content, likeness, first_ms)
        values = [float(question["start"]) for question in content["questions"]]
        moved_ms = [self.now_ms] * len(values)
        ways = [ANSWERED_BY_MOUSE if ended_by == "button" else BY_LIMIT] * len(values)
        for at_ms, i, value in rows:
            values[int(i)], moved_ms[int(i)], ways[int(i)] = value, at_ms, ANSWERED_BY_MOUSE
        questions = content["questions"]
        names = [question["name"] for question in questions]
        self.moves = [
            {"names": names, "sliders": rows[k : k + MOVES_AT_ONCE], "camera": []}
            for k in range(0, len(rows), MOVES_AT_ONCE)
        ]
        return {
            "shown_ms": shown_ms,
            "first_ms": first_ms,
            "off_ms": self.now_ms,
            "hidden_ms": 0.0,
            "ended_by": ended_by,
            "frames": round((self.now_ms - first_ms) / 1000 * REFRESH_HZ),
            "dropped": 0,
            "slider_frames": 1 if rows else 0,
            "distance_m": None if likeness is None else likeness.exact_m(live.shares(values)),
            "renderer": "simulated",
            "answers": {
                name: {"option": f"{value:.10g}", "at_ms": at_ms, "by": by}
                for name, value, at_ms, by in zip(names, values, moved_ms, ways, strict=True)
            },
        }

    def _match(
        self, content: Mapping[str, Any], likeness: Likeness, first_ms: float
    ) -> tuple[list[list[float]], str]:
        """Mould the figure after its target; return movements, and what ended it."""
        live, questions = self.lives[content["live"]["figure"]], content["questions"]
        low, high, step, start = (
            np.array([q[name] for q in questions], dtype=np.float64)
            for name in ("low", "high", "step", "start")
        )
        task = Task(
            low,
            high,
            step,
            start,
            lambda values: likeness.rough_m(live.shares(values)),
            lambda values: likeness.exact_m(live.shares(values)),
        )
        limit_s, is_blind = float(content["limit_s"]), bool(content["is_blind"])
        within_m = float(content["until"]["within_m"])
        outcome = self.person.mould_to(task, within_m=within_m, limit_s=limit_s, is_blind=is_blind)
        rows = [[first_ms + 1000 * m.t_s, m.slider, m.value] for m in outcome.moves]
        if outcome.reached_s is not None:
            self.now_ms = first_ms + 1000 * outcome.reached_s + FRAME_MS
            return rows, "near"
        if is_blind:
            self.now_ms = min((rows[-1][0] if rows else first_ms) + 1000, first_ms + 1000 * limit_s)
            return rows, "button"
        self.now_ms = first_ms + 1000 * limit_s
        return rows, "limit"

    def _settle(
        self, content: Mapping[str, Any], likeness: Likeness | None, first_ms: float
    ) -> tuple[list[list[float]], str]:
        """Move one slider after the other to where the person wants it, then press the button;
        return movements, and what ended it.
        """
        live = self.lives[content["live"]["figure"]]
        limit_ms = first_ms + content["limit_s"] * 1000
        values = [float(question["start"]) for question in content["questions"]]
        rows: list[list[float]] = []
        at_ms = first_ms
        for i, question in enumerate(content["questions"]):
            response = self.responses[question["prompt"]]
            at_ms += self.person.takes_s(response) * 1000
            text = self.person.answer(question["name"], question["prompt"], ())
            goal = question["start"] if text is None else float(text)
            goal = float(np.clip(goal, question["low"], question["high"]))
            goal = question["low"] + question["step"] * round(
                (goal - question["low"]) / question["step"]
            )
            value = question["start"]
            n = math.ceil(abs(goal - value) / (MOVE_SHARE * (question["high"] - question["low"])))
            for k in range(1, n + 1):
                if at_ms + MOVE_MS > limit_ms:
                    break
                at_ms += MOVE_MS
                value = round(question["start"] + (goal - question["start"]) * k / n, 10)
                rows.append([at_ms, i, value])
                values[i] = value
                if likeness is not None:
                    apart_m = likeness.exact_m(live.shares(values))
                    if apart_m < content["until"]["within_m"]:
                        self.now_ms = at_ms + FRAME_MS
                        return rows, "near"
        is_over = likeness is not None or at_ms + MOVE_MS > limit_ms
        self.now_ms = limit_ms if is_over else at_ms + MOVE_MS
        return rows, "limit" if is_over else "button"

    def _watch(self, content: Mapping[str, Any]) -> dict[str, Any]:
        first_ms = shown_ms = self.now_ms
        film_entries = {f["place"]: f for f in content["films"]}
        round_ms = self.look(content)
        first_ms += FIRST_FRAME_MS if round_ms else 0.0
        opened_ms = at_ms = first_ms + content["min_rounds"] * round_ms
        answers = {}
        for question in content["questions"]:
            response = self.responses[question["prompt"]]
            at_ms += self.person.takes_s(response) * 1000
            labels = [o["label"] for o in question.get("options", ())]
            answer = self.person.answer(question["name"], question["prompt"], labels)
            if answer is not None and labels:
                answer = question["options"][labels.index(answer)]["value"]
            answers[question["name"]] = {"option": answer, "at_ms": at_ms, "by": ANSWERED_BY}
            if question.get("is_held") and labels and answer is not None:
                answers[question["name"]]["released_ms"] = at_ms + HELD_MS
        self.now_ms = at_ms
        rounds = int((at_ms - first_ms) // round_ms) if round_ms else 0
        shown_s = (at_ms - first_ms) / 1000
        if content.get("once"):
            rounds, shown_s = min(rounds, 1), min(shown_s, round_ms / 1000)
        drawing: dict[str, Any] = {}
        if "live" in content:
            drawing = {
                "first_ms": first_ms,
                "opened_ms": opened_ms,
                "ended_by": "button",
                "frames": round(shown_s * REFRESH_HZ),
                "dropped": 0,
                "slider_frames": 0,
                "distance_m": None,
                "rounds": rounds,
                "renderer": "simulated",
            }
        return {
            **drawing,
            "shown_ms": shown_ms,
            "off_ms": at_ms,
            "hidden_ms": 0.0,
            "apart_ms": 0.0,
            "answers": answers,
            "films": {
                place: {
                    "first_ms": first_ms,
                    "first_at_ms": 0.0,
                    "frames": round(shown_s * f["rate_hz"]),
                    "dropped": 0,
                    "rounds": rounds,
                    "stalls": 0,
                    **({"sound_ms": first_ms, "volume_01": 1.0} if f.get("sound") else {}),
                }
                for place, f in film_entries.items()
            },
        }

    def _question(self, question: Mapping[str, Any]) -> str | None:
        labels = [o["label"] for o in question["options"]]
        answer = self.person.answer(question["name"], question["prompt"], labels)
        self.now_ms += READING_S * 1000
        if answer is None or not labels:
            return answer
        return next((str(o["value"]) for o in question["options"] if o["label"] == answer), None)


def _page_px(right_deg: float, up_deg: float) -> tuple[float, float]:
    """Return the pixel of the page in a direction."""
    tangents = np.tan(np.radians([right_deg, -up_deg]))
    x, y = (np.array(VIEW_PX) / 2 + tangents * DISTANCE_MM * PX_PER_MM).tolist()
    return x, y


def _lasts_ms(part: Mapping[str, Any]) -> float:
    """Return for how long a part is shown: whole frames, or until a key."""
    if part["frames"] is not None:
        return float(part["frames"] * FRAME_MS)
    if part["seconds"] is None:
        return math.inf
    if part.get("sounds") and not is_seen(part):  # a sound alone is not hurried
        return float((math.floor(part["seconds"] * REFRESH_HZ) + 1) * FRAME_MS)
    return float(round(part["seconds"] * REFRESH_HZ) * FRAME_MS)


def scenes_seen(staged_frames: Callable[[Film | Pair], tuple[SceneFrame, SceneFrame]]) -> Views:
    """Return the views of films on a page: of a single film, or of two as a pair."""

    def views(films: Mapping[str, Film]) -> tuple[SceneFrame, SceneFrame]:
        if "film" in films:
            return staged_frames(films["film"])
        return staged_frames(Pair(films["left"], films["right"]))

    return views


def visitor_of(person: Any, experiment: StudyExperiment, store: FilmStore) -> Visitor:
    """Return a simulated participant at a page.

    Raises:
        ConfigError: the study's own simulated person cannot use a page.
    """
    if not isinstance(person, StudyPerson):
        raise ConfigError(
            f"the simulated person of {experiment.name} looks at no page; give the study an "
            "@study.answer, or perform it on the lab's devices"
        )
    films = {store.describe(film, is_simulated=True)["film"]: film for film in experiment.films}
    digits = (
        spoken_digits(experiment.language, experiment.settings.folder)
        if "sound" in experiment.study.procedure.screening
        else ()
    )
    return Visitor(
        person,
        films,
        experiment.words,
        scenes_seen(partial(_first_and_last, store)),
        store,
        experiment.settings.sound_of,
        digits=digits,
        lives=experiment.lives,
        presses={n: r for n, r in experiment.responses.items() if isinstance(r, Keys)},
    )


@lru_cache(maxsize=256)  # for all visitors of an experiment, who see the same films
def _first_and_last(store: FilmStore, film: Film | Pair) -> tuple[SceneFrame, SceneFrame]:
    seconds = seconds_of(film)
    seed = next(iter(films_of(film).values())).seed
    staging = Staging(np.random.default_rng(seed), seconds, 0, store.study_folder)
    staged_scene = stage(scene_of(film), staging, store.makers)
    end_ns = max(1, round(seconds * NS_PER_S))
    first = staged_scene.frame(still_view(0), 0)
    if first is None:
        raise ConfigError(f"scene {scene_of(film).name} shows nothing at its onset")
    last = staged_scene.frame(still_view(end_ns), end_ns) or first
    return first, replace(last, t_ns=end_ns)
