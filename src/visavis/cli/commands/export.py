"""export: sessions for other programs, people and motions as glTF."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from typer.core import TyperGroup

from visavis.analysis.report.notation import count_of
from visavis.cli.app import (
    ConfigOption,
    OfParticipant,
    SessionArgument,
    app,
    load_lab,
    new_file,
    say,
    say_written,
    verbatim,
)
from visavis.cli.motions import JointMapOption, motion_on_character
from visavis.cli.personal_copies import protect_and_register
from visavis.cli.printed_columns import print_columns
from visavis.cli.printed_sheet import print_sheet
from visavis.cli.sharing import (
    BLURRED_RISK,
    LOSS_NAME,
    dataset_about,
    loss_page,
    losses,
    names_of_people,
    shared_recording,
    withheld_lines,
)
from visavis.cli.studies import folder_of, session_of
from visavis.experiments.crowd.pedestrian_export import export_walks
from visavis.lab.config import LabConfig
from visavis.lab.errors import UsageError
from visavis.recording.export import export_recording, export_together
from visavis.recording.privacy_sheet import privacy_sheet
from visavis.recording.reader import Recording
from visavis.running.sessions.damage import require_intact
from visavis.running.sessions.folder_check import is_study
from visavis.running.sessions.intake_list import share_list
from visavis.running.sessions.study_folder import sessions_of
from visavis.stimuli.characters.cast import load_character
from visavis.stimuli.characters.character import Character
from visavis.stimuli.characters.gltf.exporting import glb_of_character, write_glb

DATA_SET: Final = "dataset_description.json"
FORMATS: Final = ("parquet", "bids", "xdf", "pedpy")
"""What `export session` writes."""
SESSIONS: Final = "session"


class ExportGroup(TyperGroup):
    """Commands below `export`; `export SESSION` stands for `export session SESSION`."""

    default_name = SESSIONS

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the arguments; without the name of a command they are those of `session`."""
        if args and args[0] not in (*self.commands, *ctx.help_option_names):
            args = [SESSIONS, *args]
        return super().parse_args(ctx, args)


exports = typer.Typer(
    cls=ExportGroup,
    help="Copy sessions, people and motions into files that other programs read.",
    no_args_is_help=True,
)
app.add_typer(exports, name="export")


@exports.command(SESSIONS)
def export_session(
    session_path: SessionArgument,
    format_name: Annotated[
        str,
        typer.Option(
            "--format", help="parquet (streams, with trials as CSV), bids, xdf or pedpy (walks)."
        ),
    ] = "parquet",
    output: Annotated[Path, typer.Option("--output", "-o", help="Where to write.")] = Path(
        "exported"
    ),
    participant: OfParticipant = "",
    accept_damage: Annotated[
        bool, typer.Option("--accept-damage", help="Export what is left of a damaged recording.")
    ] = False,
    tier: Annotated[
        str,
        typer.Option(
            "--tier",
            help="shared: no free text, ages in bands of ten years; raw: everything; public: "
            "heights, limb lengths and movements blurred, too.",
        ),
    ] = "shared",
    keep_label: Annotated[
        bool, typer.Option("--keep-label", help="The ledger's label instead of a pseudonym.")
    ] = False,
    dry_run: Annotated[
        bool,
        typer.Option("--dry-run", help="Write nothing; print the privacy sheet of what would."),
    ] = False,
    config: ConfigOption = None,
) -> None:
    """Copy a session into files that other programs read; the recording is not touched.

    Given a study, it copies every session, or the one of --participant.

    People bear a pseudonym that only the study's key file links to their label. A session without
    trial, answer and sample is counted, named and left out, but in the tier raw; whoever wants
    their data deleted is left out of every tier. With --tier public the measures are computed
    before and after the blur, which takes as long as analyse. With --dry-run each column and event
    field is listed with its class and three values, then what in texts tells who somebody is, and
    which answers about themselves fewer than five people give.

    `session` may be left out.

    Example: visavis export data/simulated/stare/sub-S07H/ses-001 --format bids -o out/bids
    """
    if format_name not in FORMATS:
        raise UsageError(f"--format takes {', '.join(FORMATS)}, not {format_name!r}")
    if format_name != "bids" and (output / DATA_SET).exists():
        raise UsageError(
            f"{output} is a BIDS data set, which holds no other files; export {format_name} "
            "elsewhere: -o OTHER_FOLDER"
        )
    candidates = _sessions_to_export(session_path, config, participant)
    shared_list = share_list(candidates, keeps_empty=tier == "raw")
    for line in shared_list.counts():
        say(f"[yellow]{verbatim(line)}[/]")
    sessions = shared_list.sessions
    require_intact(sessions, accept=accept_damage)
    is_simulated = all(Recording(session).is_simulated for session in sessions)
    # Looking up a study by its name has already printed which configuration is used.
    lab = load_lab(config, only_simulates=is_simulated, quiet=not session_path.is_dir())
    shared = [shared_recording(s, lab, tier=tier, keep_label=keep_label) for s in sessions]
    # In the order of what they are called: times of files tell which of them were written first.
    recordings = sorted(shared, key=lambda r: (r.manifest.participant, r.manifest.session))
    if dry_run:
        print_sheet(privacy_sheet(recordings, names_of_people(recordings, lab)))
        for line in withheld_lines(recordings, lab):
            say(f"[yellow]{verbatim(line)}[/]")
        return
    loss_table = losses(recordings, lab) if tier == "public" else None
    paths = _write_recordings(recordings, format_name, output, lab)
    for line in withheld_lines(recordings, lab):
        say(f"[yellow]{verbatim(line)}[/]")
    if loss_table is not None:
        note = output / ("README.md" if format_name == "bids" else LOSS_NAME)
        before = f"{note.read_text('utf-8')}\n" if note in paths else ""
        note.write_text(before + loss_page(loss_table), "utf-8")
        paths = (*dict.fromkeys((*paths, note)),)
        print_columns("what measures lose by the blur", loss_table)
        say(f"[yellow]{BLURRED_RISK}[/]")
    say(f"{len(paths)} files of {count_of(len(sessions), 'session')} in [b]{verbatim(output)}[/]")
    protect_and_register(format_name, sessions, output, paths, tells_risk=tier != "public")


def _write_recordings(
    recordings: Sequence[Recording], format_name: str, output: Path, lab: LabConfig
) -> tuple[Path, ...]:
    """Export recordings and return the files.

    BIDS is one data set for all; Parquet tables of several sessions go to a folder each.
    """
    if format_name == "bids":
        return export_together(recordings, output, dataset_about(recordings[0], lab))
    paths: list[Path] = []
    for recording in recordings:
        manifest = recording.manifest
        session_folder = output / f"sub-{manifest.participant}" / f"ses-{manifest.session:03d}"
        if format_name == "pedpy":
            paths += export_walks(recording, output)
        else:
            target = session_folder if format_name == "parquet" and len(recordings) > 1 else output
            paths += export_recording(recording, format_name, target)
    return tuple(paths)


def _sessions_to_export(path: Path, config: Path | None, participant: str) -> list[Path]:
    """Return the sessions to export: one given by its folder, or those of a study."""
    if participant or (path.is_dir() and not is_study(path)):
        return [session_of(path, config, participant)]
    return list(sessions_of(folder_of(path, config, "export")))


OutputOption = Annotated[Path, typer.Option("--output", "-o", help="A new .glb file.")]
LevelOption = Annotated[
    int, typer.Option("--level", help="Level of detail: 0 the finest, 2 the lightest.")
]


@exports.command("character")
def export_character(
    name: Annotated[str, typer.Argument(help="Somebody of visavis character list.")],
    output: OutputOption,
    level: LevelOption = 0,
    config: ConfigOption = None,
) -> None:
    """Write a person as glTF 2.0 for Blender, Unity or a page: mesh, skeleton, looks, face shapes.

    `visavis character import` reads such a file back as the person was.

    Example: visavis export character anna -o anna.glb
    """
    who = _person(name, config)
    _write(output, glb_of_character(who, level=level))


@exports.command("motion")
def export_motion(
    clip: Annotated[str, typer.Argument(help="A .bvh or .npz file, or a motion by its name.")],
    output: OutputOption,
    character: Annotated[
        str, typer.Option("--character", help="Who moves: somebody of visavis character list.")
    ] = "anna",
    level: LevelOption = 0,
    seconds: Annotated[float, typer.Option(help="How much of a motion by name.")] = 4.0,
    unit_m: Annotated[float, typer.Option(help="Metres per unit of a BVH file.")] = 0.01,
    joint_map: JointMapOption = None,
    config: ConfigOption = None,
) -> None:
    """Write a person who moves as glTF 2.0: mesh, skeleton, looks and the motion.

    Example: visavis export motion walk --character anna -o walk.glb
    """
    who = _person(character, config)
    motion = motion_on_character(clip, who, seconds, unit_m, joint_map)
    _write(output, glb_of_character(who, motion, level=level, name=Path(clip).stem))


def _person(name: str, config: Path | None) -> Character:
    lab = load_lab(config, only_simulates=True, with_cast=False)
    return load_character(name, lab.characters)


def _write(path: Path, data: bytes) -> None:
    if path.suffix != ".glb":
        raise UsageError(f"--output {path}: a glTF binary is named .glb, such as {path.stem}.glb")
    write_glb(new_file(path), data)
    say_written(path, f", {len(data) / 1e6:.1f} MB")
