"""Make the pictures of the documentation: `python -m tools.pictures [NAME …]` (`--list` says how).

Every picture in docs/pictures has a line here. Those that need people from elsewhere, or hands on a
page, say in a sentence how they were made. Pages are photographed by Chromium.
"""

import argparse
import io
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
from PIL import Image

from visavis.lab.clock import StopWatch
from visavis.lab.errors import UsageError

ROOT: Final = Path(__file__).resolve().parents[1]
FOLDER: Final = ROOT / "docs" / "pictures"
MAX_BYTES: Final = 150_000
QUALITIES: Final = (86, 80, 72, 64, 56)
"""Of JPEG; the first that is small enough is taken."""
PLACE_PX: Final = 720
MAX_WAIT_S: Final = 240.0
WITHIN_TRIAL: Final = re.compile(r"T0[1-9]\s+trial ends in\s+\d")
"""What the desk says then."""
PEOPLE: Final = "simulate stare --participants 8 --seed 1"
"""Sessions that several pictures show."""
STUDY: Final = "data/dry_runs/stare_n8_seed1/simulated/stare"


IN_HEADSET: Final = """
from visavis import Factor, Rating, Study

study = Study("apart", factors=[Factor("place", [1, 2])], on="browser", uses=(), calibrate=False,
              xr="required", texts="apart_texts")


@study.trial
def trial(t):
    yield t.ask(Rating("answer", 1, 9))
"""
BY_GAZE: Final = """
from visavis import Factor, Image, Study

study = Study("window", factors=[Factor("seen", ["gaze", "around gaze"])], order="fixed")


@study.trial
def trial(t):
    desk = Image("examples/desks/full_1.png", width_deg=30, areas="examples/desks/full_1.yaml")
    yield t.show(desk, 4, background="grey", reveal=t.seen, window_deg=8, edge_deg=1)
"""
CONSENT: Final = """consent: I agree that my answers and movements are kept without my name.
"""
HEADSET: Final = ROOT / "tests" / "running" / "page" / "headsets" / "standard.js"
"""What a page meets in a headset's browser."""


@dataclass(frozen=True)
class Recipe:
    """How a picture is made: commands of visavis, then the file of them that is the picture.

    `{file}` in a command is a new PNG, which is taken if no `found` (a pattern) names another. Of a
    page the first screen of `screen_px` is taken.
    """

    commands: tuple[str, ...]
    found: str = ""
    screen_px: tuple[int, int] | None = None
    width_px: int = 960


@dataclass(frozen=True)
class FilmRecipe:
    """One film of a study at moments of it, side by side; `film` is its place among the films."""

    study: str
    film: int
    moments_01: tuple[float, ...] = (0.15, 0.5, 0.85)
    height_px: int = 300


@dataclass(frozen=True)
class DeskRecipe:
    """The desk beside a session in real time, within a trial."""

    study: str
    screen_px: tuple[int, int] = (1280, 800)


@dataclass(frozen=True)
class EntryRecipe:
    """The pages by which a headset comes into a study that `serve --lan` offers, side by side:
    the code, the consent, and the button that enters VR.
    """

    study: str
    screen_px: tuple[int, int] = (480, 600)


@dataclass(frozen=True)
class TrialsRecipe:
    """Trials of a study before a monitor, each `at_s` after its begin, side by side."""

    study: str
    at_s: tuple[float, ...]
    size_px: str = "640x400"


@dataclass(frozen=True)
class ByHand:
    """Why no command makes a picture, and how it was made."""

    how: str


PICTURES: Final[
    Mapping[str, Recipe | FilmRecipe | TrialsRecipe | DeskRecipe | EntryRecipe | ByHand]
] = {
    "stare_eyes.jpg": Recipe(("preview stare --trial 5 --png {file}",)),
    "crowd_eyes.jpg": Recipe(("preview crowd --trial 8 --at 3 --png {file}",)),
    "waving_eyes.jpg": Recipe(("preview waving --trial 16 --at 1.5 --png {file}",)),
    "approach_eyes.jpg": Recipe(
        ("examples", "preview examples/approach.py --trial 2 --at 3 --png {file}")
    ),
    "faces.jpg": Recipe(
        ("character sheet {file} anna henrik chloe jun --at 0.5,1,2 --px-per-deg 11",)
    ),
    "expressions.jpg": Recipe(
        ("character sheet {file} anna karim --face neutral,smile,frown,open_mouth",)
    ),
    "gaze_map.jpg": Recipe(
        (PEOPLE, f"gaze-map {STUDY} --by condition"), "**/gaze_map_by_condition.png"
    ),
    "time_course.png": Recipe((PEOPLE, f"analyse {STUDY}"), "**/figures/time_course.png"),
    "scan_paths.png": Recipe((PEOPLE, f"analyse {STUDY}"), "**/figures/scan_paths.png"),
    "gaze_moves.png": Recipe((PEOPLE, f"analyse {STUDY}"), "**/figures/gaze_moves.png"),
    "panorama.jpg": Recipe(("examples", "preview examples/around.py --png {file}")),
    "gaze_window.jpg": TrialsRecipe(BY_GAZE, (1.0, 3.0)),
    "desk.jpg": DeskRecipe("stare"),
    "report.jpg": Recipe((PEOPLE, f"analyse {STUDY}"), "**/report.html", (1280, 800)),
    "viewer.jpg": Recipe(
        (PEOPLE, f"view {STUDY}/sub-S01B/ses-001 --output view.html"), "view.html", (1280, 800)
    ),
    "interpolation_film.jpg": FilmRecipe("interpolation", 4),
    "hybrid_film.jpg": FilmRecipe("hybrid", 0, height_px=400),
    "gestures_film.jpg": FilmRecipe("gestures", 0, (0.0, 0.2, 0.4, 0.6, 0.8, 0.98), 320),
    "lexemes.jpg": Recipe(("corpus lexemes -o {file}",), width_px=1000),
    "reach_set_b.png": Recipe(("blend --examples set_b --reach {file}",), width_px=1215),
    "walks_set_b.jpg": ByHand("`python -m benchmarks.blind_walks`, its tiles in rows of emotions"),
    "film_and_page.jpg": ByHand("`python -m benchmarks.live_figure --out FOLDER`"),
    "moulding_page.jpg": ByHand("the study of docs/moulding.md in Chromium, its slider moved"),
    "headset_entry.jpg": EntryRecipe(IN_HEADSET),
    "headset_in_a_browser.jpg": ByHand(
        "what `tests/running/page/headsets/standard.js` drew for both eyes, 480 pixels each"
    ),
    "waving_in_a_headset.jpg": ByHand(
        "what the same drew of `waving_page`, in `tests/running/page/test_waving_in_browser.py`"
    ),
    "session_in_a_headset.jpg": ByHand(
        "`visavis view SESSION --headset` of a duel in Chromium, entered with the emulator IWER"
    ),
    "moulding_monitor.jpg": ByHand("the same study before a monitor (`display.show: screen`)"),
    "viewer_together.jpg": ByHand(
        "`visavis view STUDY --trial T02 --participants all` of three people in Chromium, keys F, N"
    ),
    "gestures_heard.jpg": ByHand(
        "a picture of every half second of gestures_heard.webm, above its sound's spectrogram"
    ),
    "shadows_by_bounds.jpg": ByHand(
        "drawn before and after decision 0028 with 4 samples, cut from 800 by 600 pixels"
    ),
    "matching_page.jpg": ByHand("`visavis run matching --devices sim` in Chromium, an adjustment"),
    "matching_survival.png": ByHand("figure `survival` of `visavis simulate matching`"),
    "adjectives_dendrogram.png": ByHand("figure `dendrogram` of `visavis simulate adjectives`"),
    "valid_stare.jpg": ByHand("`visavis preview stare` with VALID figures (`cast:`), once fetched"),
    "valid_crowd.jpg": ByHand("`visavis preview crowd` with VALID figures (`cast:`)"),
    "valid_waving.jpg": ByHand("`visavis preview waving` with VALID figures (`cast:`)"),
}
"""Every picture in docs/pictures by its name."""
PLACES: Final[Mapping[str, FilmRecipe | ByHand]] = {
    "interpolation/interpolation_place.jpg": FilmRecipe("interpolation", 4),
    "hybrid/hybrid_place.jpg": FilmRecipe("hybrid", 0),
    "gestures/gestures_place.jpg": FilmRecipe("gestures", 0),
    "gestures/gesture_pairs_place.jpg": FilmRecipe("gestures", 0),
    "cameras/cameras_place.jpg": FilmRecipe("cameras", 0, (0.2, 0.8), 240),
    "adjectives/adjectives_place.jpg": ByHand("two live figures of `adjectives` at three moments"),
}
"""What reports of studies of films show as the place (`results.report.opening`)."""


@dataclass
class Workshop:
    """A folder in which commands run, each once."""

    folder: Path
    done: set[str] = field(default_factory=set)

    def run(self, command: str) -> None:
        """Run a command of visavis, unless it was run before.

        Raises:
            UsageError: it failed.
        """
        if command in self.done:
            return
        self.done.add(command)
        sys.stdout.write(f"  visavis {command}\n")
        words = [sys.executable, "-m", "visavis.cli.main", *command.split()]
        done = subprocess.run(  # noqa: S603  # commands of this file
            words, cwd=self.folder, capture_output=True, text=True, check=False
        )
        if done.returncode:
            raise UsageError(f"visavis {command} failed:\n{done.stdout}{done.stderr}")


def make(name: str, shop: Workshop, folder: Path = FOLDER) -> Path | None:
    """Make a picture anew; None for one that is made by hand.

    Raises:
        UsageError: a command failed, or wrote no such file; or the picture stays too large.
    """
    place = PLACES.get(name)
    if isinstance(place, FilmRecipe):
        path = ROOT / "experiments" / name
        save(_at_most(_moments(place), PLACE_PX), path)
        return path
    recipe = place or PICTURES[name]
    match recipe:
        case ByHand():
            return None
        case FilmRecipe():
            image = _moments(recipe)
        case DeskRecipe():
            image = _desk(recipe, shop)
        case EntryRecipe():
            image = _entry(recipe, shop)
        case TrialsRecipe():
            image = _trials(recipe, shop.folder / "monitor")
        case Recipe():
            image = _by_commands(name, recipe, shop)
    path = folder / name
    save(image, path)
    return path


def save(image: Image.Image, path: Path) -> None:
    """Write a picture in no more bytes than a page should load.

    Raises:
        UsageError: it stays larger.
    """
    draft = path.with_name(f".{path.name}")
    for quality in QUALITIES if path.suffix == ".jpg" else (None,):
        if quality is None:
            image.quantize(128).save(draft, "PNG", optimize=True)
        else:
            image.convert("RGB").save(draft, "JPEG", quality=quality, optimize=True)
        if draft.stat().st_size <= MAX_BYTES:
            draft.replace(path)
            return
    size = draft.stat().st_size
    draft.unlink()
    raise UsageError(f"{path.name} has {size} bytes, more than {MAX_BYTES}; give it fewer pixels")


def _by_commands(name: str, recipe: Recipe, shop: Workshop) -> Image.Image:
    png = shop.folder / f"{Path(name).stem}.png"
    for command in recipe.commands:
        shop.run(command.format(file=png.name))
    files = sorted(shop.folder.glob(recipe.found)) if recipe.found else [png]
    if not files or not files[0].exists():
        raise UsageError(f"{recipe.commands[-1]} wrote no {recipe.found or png.name}")
    if recipe.screen_px is None:
        image = Image.open(files[0]).convert("RGB")
    else:
        image = photograph(files[0].as_uri(), recipe.screen_px, shop.folder / "page.png")
    return _at_most(image, recipe.width_px)


def _at_most(image: Image.Image, width_px: int) -> Image.Image:
    if image.width <= width_px:
        return image
    return image.resize(
        (width_px, round(image.height * width_px / image.width)), Image.Resampling.LANCZOS
    )


def photograph(
    address: str,
    screen_px: tuple[int, int],
    path: Path,
    ready: Callable[[str], bool] = lambda words: True,
    settle_ms: int = 2_000,
) -> Image.Image:
    """Return the first screen of a page in Chromium, once its words are `ready`."""
    from playwright.sync_api import sync_playwright  # late: previews need no browser

    with sync_playwright() as started:
        program = next((p for p in CHROMIUM if Path(p).exists()), None)
        browser = started.chromium.launch(
            executable_path=program, args=["--no-sandbox", "--use-gl=swiftshader"]
        )
        page = browser.new_page(viewport={"width": screen_px[0], "height": screen_px[1]})
        page.goto(address)
        for _ in range(600):
            if ready(page.inner_text("body")):
                break
            page.wait_for_timeout(500)
        page.wait_for_timeout(settle_ms)
        page.evaluate(WITHOUT_FOLDER, str(path.parent))
        page.screenshot(path=str(path), timeout=120_000)
        browser.close()
    return Image.open(path).convert("RGB")


WITHOUT_FOLDER: Final = """folder => {
    const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    while (texts.nextNode())
        texts.currentNode.nodeValue = texts.currentNode.nodeValue.replaceAll(folder + "/", "");
}"""
"""Takes the scratch folder's path out of what a page says."""
CHROMIUM: Final = ("/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome")


def _moments(recipe: FilmRecipe) -> Image.Image:
    """Return pictures of a film as its raters see them."""
    from visavis.results.opened_study import find_study
    from visavis.running.film_store import film_drawing, film_store

    experiment = find_study(recipe.study).experiment({})
    store, film = film_store(experiment), experiment.films[recipe.film]
    frames = [round(m * (film.frame_count - 1)) for m in recipe.moments_01]
    pictures, cameras = list(store.pictures(film)), store.cameras(film)
    width = round(recipe.height_px * film.size_px[0] / film.size_px[1] / 2) * 2
    size_px = (width, recipe.height_px)
    with film_drawing() as draw:
        return _side_by_side([draw(pictures[k], cameras[k], size_px) for k in frames])


def _trials(recipe: TrialsRecipe, folder: Path) -> Image.Image:
    folder.mkdir()
    (folder / "study.py").write_text(recipe.study, "utf-8")
    monitor = Workshop(folder)
    for command in ("init --screen", "examples"):
        monitor.run(command)
    pictures = []
    for trial, at_s in enumerate(recipe.at_s, 1):
        png = f"trial_{trial}.png"
        how = f"--trial {trial} --at {at_s} --size {recipe.size_px}"
        monitor.run(f"preview ./study.py {how} --png {png}")
        pictures.append(np.asarray(Image.open(folder / png).convert("RGB")))
    return _at_most(_side_by_side(pictures), 960)


def _side_by_side(pictures: Sequence[npt.NDArray[np.uint8]]) -> Image.Image:
    gap = np.full((len(pictures[0]), 8, 3), 255, np.uint8)
    tiles = [tile for picture in pictures for tile in (picture, gap)]
    return Image.fromarray(np.hstack(tiles[:-1]))


def _desk(recipe: DeskRecipe, shop: Workshop) -> Image.Image:
    """Begin a rehearsal and a desk, look, and end both."""
    base = [sys.executable, "-m", "visavis.cli.main"]
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    session = [*base, "run", recipe.study, "--participant", "1", "--devices", "sim"]
    opened = [
        subprocess.Popen(  # noqa: S603  # our own command
            words,
            cwd=shop.folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            text=True,
        )
        for words, output in (
            (session, (shop.folder / "session.txt").open("w")),
            ([*base, "desk"], subprocess.PIPE),
        )
    ]
    try:
        out = opened[1].stdout
        assert out is not None  # noqa: S101  # it is a pipe
        address = next(line.strip() for line in out if "http://" in line)
        watch = StopWatch()

        def is_under_way(words: str) -> bool:
            return bool(WITHIN_TRIAL.search(words)) or watch.elapsed_s() > MAX_WAIT_S

        image = photograph(address, recipe.screen_px, shop.folder / "desk.png", is_under_way, 300)
    finally:
        for process in reversed(opened):
            process.terminate()
            process.communicate(timeout=60)
    return _at_most(image, 960)


def _entry(recipe: EntryRecipe, shop: Workshop) -> Image.Image:
    """Serve a study in a rehearsal, and come in as a headset's browser does."""
    from playwright.sync_api import sync_playwright  # late: previews need no browser

    (shop.folder / "apart.py").write_text(recipe.study, "utf-8")
    (shop.folder / "apart_texts").mkdir()
    (shop.folder / "apart_texts" / "en.yaml").write_text(CONSENT, "utf-8")
    words = ["serve", "apart.py", "--lan", "--host", "localhost", "--port", "0", "--devices", "sim"]
    process = subprocess.Popen(  # noqa: S603  # our own command
        [sys.executable, "-m", "visavis.cli.main", *words],
        cwd=shop.folder,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    out = process.stdout
    assert out is not None  # noqa: S101  # it is a pipe
    try:
        address = next(found[0] for line in out if (found := re.search(r"https://\S+", line)))
        code = next(line.strip() for line in out if re.fullmatch(r"\d{3} \d{3}", line.strip()))
        with sync_playwright() as started:
            program = next((p for p in CHROMIUM if Path(p).exists()), None)
            browser = started.chromium.launch(executable_path=program, args=["--no-sandbox"])
            width, height = recipe.screen_px
            page = browser.new_context(
                ignore_https_errors=True, viewport={"width": width, "height": height}
            ).new_page()
            page.set_default_timeout(MAX_WAIT_S * 1000)
            page.add_init_script(path=HEADSET)
            page.goto(address)
            pictures = []

            def look() -> None:
                pictures.append(Image.open(io.BytesIO(page.screenshot())).convert("RGB"))

            page.locator("#code").fill(code)
            look()
            page.keyboard.press("Enter")
            page.locator("#code").wait_for(state="detached")
            page.locator("#agree").check()
            look()
            go = page.locator("#main button:not(.quiet)")
            go.click()
            page.get_by_text("Put the headset on").wait_for()
            go.scroll_into_view_if_needed()
            look()
            browser.close()
    finally:
        process.terminate()
        process.communicate(timeout=60)
    gap = np.full((height, 8, 3), 255, np.uint8)
    tiles = [tile for picture in pictures for tile in (np.asarray(picture), gap)]
    return Image.fromarray(np.hstack(tiles[:-1]))


def main() -> None:
    """Make the pictures named, or all; or list how each is made."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="as --list has them; all left out")
    parser.add_argument("--list", action="store_true", help="say how each is made")
    options = parser.parse_args()
    every = {**PICTURES, **PLACES}
    if strange := [name for name in options.names if name not in every]:
        parser.error(f"no picture {', '.join(strange)}; there are {', '.join(every)}")
    if options.list:
        for name, recipe in every.items():
            sys.stdout.write(f"{name}: {recipe}\n")
        return
    with tempfile.TemporaryDirectory() as scratch:
        shop = Workshop(Path(scratch))
        shop.run("init")
        for name in options.names or every:
            sys.stdout.write(f"{name}\n")
            if make(name, shop) is None:
                sys.stdout.write(f"  by hand: {every[name]}\n")


if __name__ == "__main__":
    main()
