"""gesture and corpus: from a gesture script to a moving body, and what a speaker does."""

from dataclasses import fields, replace
from pathlib import Path
from typing import Annotated, Final, cast

import typer
from rich.progress import Progress

from visavis.cli.app import (
    JsonOption,
    app,
    console,
    new_file,
    say,
    say_json,
    say_written,
    verbatim,
)
from visavis.cli.commands.preview import picture_size
from visavis.cli.speaker_sheet import (
    draw_lexemes,
    motion_summary,
    motion_table,
    speaker_summary,
    speaker_text,
    write_motion_film,
)
from visavis.lab.errors import UsageError
from visavis.stage.film_sound import CODECS
from visavis.stimuli.characters.cast import load_character
from visavis.stimuli.characters.gltf.exporting import glb_of_character, write_glb
from visavis.stimuli.motion.build import build_of_character
from visavis.stimuli.motion.bvh import write_bvh
from visavis.stimuli.motion.bvh_clip import bvh_of_clip
from visavis.stimuli.motion.clip_file import read_clip, write_clip
from visavis.stimuli.motion.motion_file import read_motion
from visavis.stimuli.motion.skeleton import canonical_skeleton
from visavis.stimuli.motion.speaking.annotations import Tiers, read_any_script
from visavis.stimuli.motion.speaking.body_plan import Fill
from visavis.stimuli.motion.speaking.corpus import read_corpus
from visavis.stimuli.motion.speaking.performance import perform
from visavis.stimuli.motion.speaking.speaker import Speaker
from visavis.stimuli.motion.speaking.speech import speech_of, words_path, write_speech
from visavis.stimuli.motion.speaking.synthesiser import SynthesisVoice, read_text, synthesised
from visavis.stimuli.motion.speaking.synthetic_speaker import synthetic_speaker

SYNTHETIC: Final = "synthetic"
MOTIONS: Final = (".bvh", ".npz", ".glb")
FILMS: Final = (".mp4", ".webm", ".avi")

corpus_app = typer.Typer(help="A speaker's recordings: what they teach.", no_args_is_help=True)
app.add_typer(corpus_app, name="corpus")

UnitOption = Annotated[float, typer.Option("--unit-m", help="Metres per unit of BVH files.")]
TierOption = Annotated[
    list[str] | None,
    typer.Option("--tier", help="Name of a tier or attribute: phrase, phase, hand or lexeme=NAME."),
]


@app.command()
def gesture(
    script: Annotated[
        Path,
        typer.Argument(help="Gesture script: .yaml, .csv, or annotations of ANVIL or ELAN (.eaf)."),
    ],
    corpus: Annotated[
        list[str] | None,
        typer.Option(
            help="Folder of a speaker's takes, each beside its annotation; or synthetic, as by "
            "default. Of two the first gives the body, the second the habits of posture."
        ),
    ] = None,
    fill: Annotated[
        str,
        typer.Option(
            help="Between gestures: F motion of the corpus, I interpolate and hold; none: still."
        ),
    ] = "F",
    seed: Annotated[int, typer.Option(help="Draws postures, pieces and variation.")] = 0,
    beta: Annotated[float, typer.Option(help="Share of the rules beside the transitions.")] = 0.65,
    character: Annotated[str, typer.Option(help="Who speaks.")] = "gabriel",
    rate: Annotated[int, typer.Option(help="Frames a second.")] = 30,
    size: Annotated[str, typer.Option(help="Of a film: width x height.")] = "480x640",
    unit_m: UnitOption = 0.01,
    tier: TierOption = None,
    output: Annotated[
        Path,
        typer.Option("-o", "--output", help=f"New file: {', '.join((*MOTIONS, *FILMS))}."),
    ] = Path("gesture.bvh"),
) -> None:
    """Perform a gesture script: arms by lexeme, the body as a speaker would move it.

    Films (.mp4, .webm) carry the script's recording, and lips move with it. A .glb holds the
    figure with its motion.

    Example: visavis gesture speech.yaml --corpus synthetic --fill F --seed 1 -o speech.bvh
    """
    suffix = output.suffix.lower()
    if not 1 <= rate <= 240:
        raise UsageError(f"--rate {rate}; give 1 to 240 frames a second")
    new_file(output)
    who = load_character(character)
    if suffix not in (*MOTIONS, *FILMS):
        raise UsageError(
            f"{output}: name it {', '.join(MOTIONS)} for a motion, {', '.join(FILMS)} for films"
        )
    if fill not in ("F", "I", "none"):
        raise UsageError(f"--fill {fill!r}; give F, I or none")
    size_px = picture_size(size)
    tiers = _tiers(tier)
    gestures = read_any_script(script, tiers)
    folders = corpus or [SYNTHETIC]
    if len(folders) > 2:
        raise UsageError(
            f"--corpus {folders[2]}: give one speaker, or one's body and another's habits"
        )
    speaker, *models = (_speaker(folder, unit_m, tiers, beta) for folder in folders)
    if models:
        speaker = replace(speaker, model=models[0])
    # A script names its recording; that of annotations has their name.
    recording = gestures.speech or script.with_suffix(".wav")
    speech = speech_of(recording) if suffix in CODECS and recording.exists() else None
    clip = perform(
        gestures,
        speaker,
        build_of_character(who),
        fill=cast(Fill, fill),
        seed=seed,
        rate_hz=rate,
    )
    if suffix == ".bvh":
        write_bvh(output, bvh_of_clip(clip), decimals=5)
    elif suffix == ".npz":
        write_clip(output, clip)
    elif suffix == ".glb":
        write_glb(output, glb_of_character(who, clip, name=output.stem))
    else:
        with Progress(console=console, transient=True) as bar:
            task = bar.add_task("drawing", total=None)
            write_motion_film(
                output,
                who,
                clip,
                size_px,
                lambda count, total: bar.update(task, completed=count, total=total),
                speech,
            )
    say_written(output, f", {clip.duration_s:.1f} s, {len(gestures.phrases)} gestures")


@corpus_app.command()
def fit(
    folder: Annotated[
        str, typer.Argument(help="Folder of takes, each beside its annotation; or synthetic.")
    ],
    unit_m: UnitOption = 0.01,
    tier: TierOption = None,
    as_json: JsonOption = False,
) -> None:
    """Say what a speaker does: transitions, rules and delays, and how sure they are.

    Example: visavis corpus fit recordings/speaker_1
    """
    speaker = _speaker(folder, unit_m, _tiers(tier), 0.65)
    if as_json:
        say_json(speaker_summary(speaker))
        return
    for line in speaker_text(speaker):
        say(verbatim(line))


@corpus_app.command()
def measure(
    motions: Annotated[
        list[Path], typer.Argument(help="Motions of standing speakers: .bvh, .npz.")
    ],
    corpus: Annotated[
        str, typer.Option(help="Folder of takes that postures are compared with; or synthetic.")
    ] = SYNTHETIC,
    unit_m: UnitOption = 0.01,
    tier: TierOption = None,
    as_json: JsonOption = False,
) -> None:
    """Measure how motions look: share of time that hips stand still, feet that slide, jerk,
    postures beside the corpus.

    Example: visavis corpus measure speech.bvh recordings/speaker_1/take_1.bvh
    """
    skeleton = canonical_skeleton()
    # A clip of ours keeps its own skeleton, in which its feet stand.
    clips = {
        path: read_clip(path)
        if path.suffix.lower() == ".npz"
        else read_motion(path, skeleton, unit_m=unit_m)
        for path in motions
    }
    tracks = tuple(take.track for take in _speaker(corpus, unit_m, _tiers(tier), 0.65).takes)
    rows = [motion_summary(path.name, clip, tracks) for path, clip in clips.items()]
    if as_json:
        say_json(rows)
        return
    console.print(motion_table(rows))


@corpus_app.command()
def speak(
    text: Annotated[Path, typer.Argument(help="Text, a clause a line: 2.6: lend me your ears")],
    voice: Annotated[str, typer.Option(help="A voice or language of espeak-ng.")] = "en-gb",
    words_a_minute: Annotated[int, typer.Option(help="How fast.")] = 150,
    pitch: Annotated[int, typer.Option(help="0 to 99.")] = 40,
    seconds: Annotated[float | None, typer.Option(help="Length; else as the text takes.")] = None,
    output: Annotated[Path, typer.Option("-o", "--output", help="New file: .wav.")] = Path(
        "speech.wav"
    ),
) -> None:
    """Let espeak-ng say a text; the times of words and phones go beside the sound.

    Example: visavis corpus speak speech.txt -o speech.wav
    """
    if output.suffix.lower() != ".wav":
        raise UsageError(f"{output}: speech is a recording; name it .wav")
    new_file(output)
    new_file(words_path(output))
    clauses = read_text(text)
    of = SynthesisVoice(voice, words_a_minute, pitch)
    speech = synthesised(output.stem, clauses, of, seconds)
    write_speech(output, speech)
    say_written(output, f", {speech.sound.duration_s:.1f} s, {len(speech.words)} words")


@corpus_app.command()
def lexemes(
    character: Annotated[str, typer.Option(help="Who gestures.")] = "gabriel",
    seed: Annotated[int, typer.Option(help="Draws the variation of every gesture.")] = 0,
    output: Annotated[Path, typer.Option("-o", "--output", help="New file: .png.")] = Path(
        "lexemes.png"
    ),
) -> None:
    """Draw the gestures that scripts can name, all as one picture.

    Example: visavis corpus lexemes -o lexemes.png
    """
    if output.suffix.lower() != ".png":
        raise UsageError(f"{output}: a sheet is a picture; name it .png")
    new_file(output)
    draw_lexemes(output, load_character(character), seed)
    say_written(output)


def _tiers(assignments: list[str] | None) -> Tiers:
    """Return the names of tiers from texts such as phrase=Gesten."""
    names = [field.name for field in fields(Tiers)]
    of: dict[str, str] = {}
    for text in assignments or []:
        role, sign, name = text.partition("=")
        if role not in names or not sign or not name:
            raise UsageError(
                f"--tier {text!r}; give one of {', '.join(names)} and a name: phrase=NAME"
            )
        of[role] = name
    return Tiers(**of)


def _speaker(corpus: str, unit_m: float, tiers: Tiers, beta: float) -> Speaker:
    if not 0.0 <= beta <= 1.0:
        raise UsageError(f"--beta {beta}; give a share from 0 to 1")
    if corpus == SYNTHETIC:
        speaker, _ = synthetic_speaker()
        return Speaker(speaker.takes, beta)
    return read_corpus(Path(corpus), unit_m=unit_m, tiers=tiers, beta=beta)
