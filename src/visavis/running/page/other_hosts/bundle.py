"""Write a study as files that any web host can serve, or as an archive that JATOS imports.

The archive follows JATOS 3 (its study archive, format 3, and jatos.js 3.10.4).
"""

import dis
import hashlib
import json
import shutil
import uuid
import zipfile
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from math import isfinite
from pathlib import Path
from types import FunctionType
from typing import Any, Final
from urllib.parse import urlsplit

import numpy as np

from visavis.lab.errors import DesignError, UsageError
from visavis.recording.manifest import read_manifest
from visavis.results.opened_study import OpenedStudy
from visavis.running.film_store import FilmStore
from visavis.running.live_store import LiveStore, page_files
from visavis.running.page.arrivals import PLACES_AHEAD
from visavis.running.page.course import Notes, Visit, course
from visavis.running.page.flat import of_part_unseen
from visavis.running.page.perform import about_of, experiment_of
from visavis.running.page.server import DRAWN_FILM_FILES, FILES, LIVE_FILES, SITE
from visavis.running.page.steps import PageStep, Reply
from visavis.running.picture_store import PictureStore
from visavis.running.sessions.device_setup import is_simulated
from visavis.running.sessions.session_request import Request
from visavis.running.sound_store import SoundStore
from visavis.study.declaration import Study
from visavis.study.experiment import StudyExperiment

FORMAT: Final = 1
ARCHIVE: Final = ".jzip"
"""Ending of the file name of an archive that JATOS imports."""
MAX_PLACES: Final = 10_000
PROBES: Final = 6
"""Number of ways to answer that test whether steps depend on answers."""
POLICY: Final = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'{results}; "
    "media-src blob:; img-src data: blob:; base-uri 'none'; form-action 'none'"
)
POLICY_OF_JATOS: Final = "default-src 'self' 'unsafe-inline' blob: data:"
"""jatos.js inserts scripts into the page; still nothing from third parties is loaded."""


@dataclass(frozen=True)
class Bundle:
    """What was written: where, for how many places, how many films, and the whole size."""

    path: Path
    places: int
    films: int
    size_bytes: int


def completed_places(study_folder: Path) -> Counter[int]:
    """Return how many people completed each place of the plan, of all sessions of a study.

    A place that somebody left, declined or withdrew from, or that nobody had, is in none.
    """
    completions: Counter[int] = Counter()
    for path in sorted(study_folder.glob("sub-*/ses-*/manifest.json")):
        manifest = read_manifest(path.parent)
        if manifest.parts and manifest.parts[-1].status == "complete":
            completions[int(manifest.plan["participant_index"])] += 1
    return completions


def open_places(
    request: Request, wanted: int | None, of_group: int | None, done: Mapping[int, int]
) -> tuple[int, ...]:
    """Return the first places of the plan for as many people as are missing.

    `wanted` people in all or `of_group` of each group are to complete the study, `done` of each
    place have. A place that somebody completed is given to nobody else.

    Raises:
        UsageError: as many as are wanted have completed it, or they are too many.
    """
    experiment, most = experiment_of(request), of_group or wanted or 0

    def group_of(index: int) -> str:
        return experiment.plan(index, request.seed).group if of_group else ""

    missing = dict.fromkeys(map(group_of, range(PLACES_AHEAD if of_group else 1)), most)
    if not 1 <= most * len(missing) <= MAX_PLACES:
        raise UsageError(f"--places takes 1 to {MAX_PLACES} in all, not {most * len(missing)}")
    for index, n in done.items():
        missing[group_of(index)] -= n
    places: list[int] = []
    index = 0
    while any(n > 0 for n in missing.values()):
        if not done.get(index) and missing[group_of(index)] > 0:
            missing[group_of(index)] -= 1
            places.append(index)
        index += 1
    if not places:
        raise UsageError("as many people as that have completed the study; raise --places")
    return tuple(places)


def write_bundle(
    request: Request,
    store: FilmStore,
    path: Path,
    *,
    places: int | Sequence[int],
    completion: str = "",
    results: str = "",
) -> Bundle:
    """Write a study for another web host: a folder, or JATOS's archive if the name ends in .jzip.

    `places` are places of the plan (from 0), or how many of its first ones. `results` is an address
    to which each line of results is posted.

    Raises:
        UsageError: the path exists already, or the options do not fit together.
        DesignError: its steps depend on answers; only a server can perform it.
    """
    is_archive = path.suffix == ARCHIVE
    indices = tuple(range(places)) if isinstance(places, int) else tuple(places)
    if not 1 <= len(indices) <= MAX_PLACES:
        raise UsageError(f"--places takes 1 to {MAX_PLACES}, not {len(indices)}")
    if results and is_archive:
        raise UsageError("JATOS takes the results itself; leave --results out")
    returning = experiment_of(request).study.procedure.returning
    if returning.resumes != "step" or returning.later != "refuse":
        raise DesignError(
            f"{request.study.name} has resumes={returning.resumes!r}, later={returning.later!r}; "
            "a bundle goes on at its step or not at all: serve the study (visavis serve)"
        )
    if path.exists() and (path.is_file() or any(path.iterdir())):
        raise UsageError(f"{path} is there already; name a new one")
    draft = path.with_name(f".{path.name}.draft")
    shutil.rmtree(draft, ignore_errors=True)
    try:
        films = _write(request, store, draft, indices, completion, results, is_archive)
        if is_archive:
            _archive(request, draft, path)
        else:
            draft.replace(path)
    finally:
        shutil.rmtree(draft, ignore_errors=True)
    files = [path] if is_archive else [f for f in path.rglob("*") if f.is_file()]
    return Bundle(path, len(indices), films, sum(f.stat().st_size for f in files))


def steps_of_place(request: Request, store: FilmStore, index: int) -> tuple[PageStep, ...]:
    """Return every step of a place, in order; `store` has its films.

    Raises:
        DesignError: the steps depend on what is answered, or enter a headset.
    """
    experiment = experiment_of(request)
    if experiment.study.procedure.xr != "never":
        raise DesignError(
            f"the page of {experiment.name} enters a headset, whose samples only Visavis's own "
            'server takes; serve it (visavis serve), or write it with xr="never"'
        )
    if experiment.study.design.practice_until is not None or changes_its_course(experiment.study):
        raise DesignError(
            f"{experiment.name} repeats trials or practice, or ends early, by what is answered, so "
            "that its steps cannot be written down beforehand; serve it (visavis serve)"
        )
    describe = files_of(store, experiment)[0]
    plan = experiment.plan(index, request.seed)
    common_steps: tuple[PageStep, ...] | None = None
    for choose in _ways_to_answer(index):
        visit = visit_of(request, describe, index, plan.group)
        steps = tuple(_steps(visit, choose))
        if common_steps is not None and common_steps != steps:
            differ = next(
                (a for a, b in zip(common_steps, steps, strict=False) if a != b), steps[-1]
            )
            trial = differ.content.get("trial")
            where = f"at trial {trial}" if trial else f"at a step {differ.kind}"
            raise DesignError(
                f"what {request.study.name} shows depends on answers ({where}), so it cannot be "
                "written down beforehand; serve it (visavis serve)"
            )
        common_steps = steps
    assert common_steps is not None  # noqa: S101  # there is a way to answer
    return common_steps


@lru_cache(maxsize=8)
def files_of(
    store: FilmStore, experiment: StudyExperiment
) -> tuple[Callable[[Any], Mapping[str, Any]], Mapping[str, bytes], Mapping[str, Path]]:
    """Return what describes everything that a study shows on pages, and the files of live figures,
    pictures and sounds, and where films of its own lie: there once they were described.
    """
    settings, assets = experiment.settings, dict[str, bytes]()
    lives = LiveStore(experiment.lives, assets)
    pictures = PictureStore(experiment.pictures, settings.folder, assets)
    sounds = SoundStore(settings.sound_of, assets)
    describe = page_files(store, lives, is_simulated=False, pictures=pictures, sounds=sounds)
    return describe, assets, pictures.films


def visit_of(
    request: Request, describe: Callable[[Any], Mapping[str, Any]], index: int, group: str
) -> Visit:
    """Return what the course of a place depends on, with a clock that stands still."""
    study, experiment = request.study, experiment_of(request)
    if not isinstance(study, OpenedStudy):
        raise UsageError(f"{study.name} is not declared on the kit; it shows no page")
    config = request.config.model_copy(update={"language": experiment.language})
    plan = experiment.plan(index, request.seed, group)
    return Visit(
        experiment, plan, "", 1, 1, study.questionnaires(config), describe, lambda: 0, Notes()
    )


def changes_its_course(study: Study) -> bool:
    """Tell whether the trial of a study names `t.repeat` or `t.end`, reached or not: itself, or a
    function of its file that it calls.
    """
    functions, seen = [study.trial_plan], set[Any]()
    while functions:
        function = functions.pop()
        seen.add(function)
        code = function.__code__
        arguments = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
        if any(
            a.argval in arguments and b.argval in ("repeat", "end")
            for a, b in pairwise(dis.get_instructions(code))
            if b.opname in ("LOAD_METHOD", "LOAD_ATTR")
        ):
            return True
        called = (function.__globals__.get(name) for name in code.co_names)
        functions += [
            one
            for one in called
            if isinstance(one, FunctionType)
            and one.__module__ == function.__module__
            and one not in seen
        ]
    return False


def digest_of(steps: Sequence[PageStep]) -> str:
    """Return the SHA-256 of steps."""
    return hashlib.sha256(_json(_as_data(steps))).hexdigest()


# ---- within ----------------------------------------------------------------------------------


def _write(
    request: Request,
    store: FilmStore,
    folder: Path,
    places: tuple[int, ...],
    completion: str,
    results: str,
    is_archive: bool,
) -> int:
    experiment = experiment_of(request)
    returning = experiment.study.procedure.returning
    (folder / "places").mkdir(parents=True)
    digests = []
    for index in places:
        steps = steps_of_place(request, store, index)
        digests.append(digest_of(steps))
        content = {"sha256": digests[-1], "steps": _as_data(steps)}
        (folder / "places" / f"{index}.json").write_bytes(_json(content))
    config = request.config
    about = about_of(experiment, is_simulated(config), config.privacy.contact)
    head = {"format": FORMAT, "study": request.study.name, "seed": request.seed}
    bundle = {
        **head,
        "places": len(places) if places == tuple(range(len(places))) else list(places),
        "about": about,
        "completion": completion,
        "results": results,
        **({"within_h": returning.within_h} if isfinite(returning.within_h) else {}),
    }
    bundle["id"] = hashlib.sha256(_json([bundle, digests])).hexdigest()[:12]
    (folder / "bundle.json").write_bytes(_json(bundle))
    drawing_files = LIVE_FILES | DRAWN_FILM_FILES if experiment.lives else {}
    for name in (FILES | drawing_files).values():
        shutil.copyfile(SITE / name, folder / name)
    for name in ("wire.js", "worker.js"):
        shutil.copyfile(SITE / "bundle" / name, folder / name)
    _write_page(folder / "index.html", results, is_archive)
    for film in experiment.films:
        film_file = store.file_of(film)
        assert film_file is not None  # noqa: S101  # `steps_of_place` needed it
        (folder / "films").mkdir(exist_ok=True)
        shutil.copyfile(film_file.path, folder / "films" / film_file.path.name)
    for name, own_film in files_of(store, experiment)[2].items():
        (folder / "films").mkdir(exist_ok=True)
        shutil.copyfile(own_film, folder / "films" / f"{name}.webm")  # whatever its kind
    for name, data in files_of(store, experiment)[1].items():
        (folder / "assets").mkdir(exist_ok=True)
        (folder / "assets" / name).write_bytes(data)
    return len({store.name_of(film) for film in experiment.films})


def _write_page(path: Path, results: str, is_archive: bool) -> None:
    """Write the page with a policy of its own, as its host may send none."""
    parts = urlsplit(results)
    policy = (
        POLICY_OF_JATOS
        if is_archive
        else POLICY.format(results=f" {parts.scheme}://{parts.netloc}" if results else "")
    )
    more = f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
    more += '<meta name="referrer" content="no-referrer">\n'
    if is_archive:
        more += '<script src="jatos.js"></script>\n'
    page = path.read_text("utf-8")
    mark = '<meta name="viewport"'
    path.write_text(page.replace(mark, more + mark, 1), "utf-8")


def _archive(request: Request, folder: Path, path: Path) -> None:
    """Write the archive of a JATOS study: a folder with its files, and a description beside it."""
    name = f"visavis_{request.study.name}"
    title = experiment_of(request).study.title
    ours = uuid.uuid5(uuid.NAMESPACE_URL, f"visavis/{request.study.name}")
    component = {
        "uuid": str(uuid.uuid5(ours, "page")),
        "title": title,
        "htmlFilePath": "index.html",
        "reloadable": True,
        "active": True,
        "comments": "",
        "componentInput": None,
    }
    study = {
        "uuid": str(ours),
        "title": title,
        "description": "",
        "groupStudy": False,
        "linearStudy": True,
        "allowPreview": False,
        "dirName": name,
        "comments": "",
        "studyInput": None,
        "endRedirectUrl": None,
        "studyEntryMsg": None,
        "componentList": [component],
        "batchList": [],
    }
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(folder.rglob("*")):
            if file.is_file():
                how = zipfile.ZIP_STORED if file.suffix == ".webm" else None
                inside = f"{name}/{file.relative_to(folder).as_posix()}"
                archive.write(file, inside, compress_type=how)
        archive.writestr(f"{name}.jas", json.dumps({"version": "3", "data": study}))


def _steps(visit: Visit, choose: "Choose") -> "list[PageStep]":
    performing, reply, steps = course(visit), None, []
    try:
        while True:
            out = performing.send(reply)
            reply = None
            if isinstance(out, PageStep):
                steps.append(out)
                reply = Reply(_reply(out, choose), 0, lambda at_ms: 0)
    except StopIteration:
        return steps


Choose = Callable[[Mapping[str, Any]], str | None]
"""Returns an answer to a question, which has the form that pages get."""


def _ways_to_answer(index: int) -> list[Choose]:
    """Return very different ways to answer: both ends of the scales, and at random."""

    def at(share: Callable[[], float]) -> Choose:
        def choose(question: Mapping[str, Any]) -> str | None:
            options = question.get("options") or ()
            if options:
                return str(options[min(len(options) - 1, int(share() * len(options)))]["value"])
            if question["kind"] == "text":
                return "x" * round(9 * share())
            low, high = question.get("low"), question.get("high")
            low, high = 0.0 if low is None else low, 1.0 if high is None else high
            step = question.get("step") or 1
            return f"{low + step * int(share() * (high - low) / step):g}"

        return choose

    rng = np.random.default_rng(index)
    by_chance = [at(lambda: float(rng.random())) for _ in range(PROBES - 2)]
    return [at(lambda: 0.0), at(lambda: 0.999), *by_chance]


def _reply(step: PageStep, choose: Choose) -> dict[str, Any]:
    """Return a reply that a page could send."""
    content = step.content
    match step.kind:
        case "consent":
            return {"agreed": True}
        case "card":
            return {"px_per_mm": None}
        case "sound":
            return {"heard": None, "played": 0}
        case "questions":
            return {"answers": {q["name"]: choose(q) for q in content["questions"]}}
        case "watch":
            film_reply = {"first_ms": 0.0, "frames": 1, "dropped": 0, "rounds": 1, "stalls": 0}
            films = {film["place"]: film_reply for film in content["films"]}
            drawn = _DRAWN if "live" in content else {}
            return {**_timed(content, choose), **drawn, "apart_ms": 0.0, "films": films}
        case "mould":
            return {**_timed(content, choose), **_DRAWN}
        case "show":
            lighting = {"on_ms": 0.0, "off_ms": 0.0, "frames": 1, "dropped": 0}
            parts = content["parts"]
            return {
                "parts": [lighting | of_part_unseen(part) for part in parts],
                "screen": {},
                "view_px": [1280, 720],
                "frame_ms": 16.0,
                "outside": 0,
                "answer": _press(content["keys"], choose),
            }
        case _:
            return {}


_DRAWN: Final[Mapping[str, Any]] = {
    "first_ms": 0.0,
    "ended_by": "button",
    "frames": 1,
    "dropped": 0,
    "slider_frames": 0,
    "distance_m": None,
    "renderer": "",
}
"""What a page says of live figures that it drew."""


def _timed(content: Mapping[str, Any], choose: Choose) -> dict[str, Any]:
    answers = {
        q["name"]: {"option": choose(q), "at_ms": 0.0, "by": "keys"} for q in content["questions"]
    }
    return {"shown_ms": 0.0, "off_ms": 0.0, "hidden_ms": 0.0, "answers": answers}


def _press(keys: Mapping[str, Any] | None, choose: Choose) -> dict[str, Any] | None:
    if keys is None:
        return None
    options = [{"value": option} for option in keys["options"]]
    return {"option": choose({"options": options}), "at_ms": 0.0, "by": "keys"}


def _as_data(steps: Sequence[PageStep]) -> list[dict[str, Any]]:
    return [{"kind": step.kind, **step.content} for step in steps]


def _json(content: Any) -> bytes:
    return json.dumps(content, ensure_ascii=False, separators=(",", ":"), sort_keys=True).encode()
