"""redraw: draw a recorded frame again, from the recording alone."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from visavis.cli.app import (
    AcceptDamage,
    ConfigOption,
    OfParticipant,
    SessionArgument,
    app,
    new_file,
    say,
    say_written,
    verbatim,
)
from visavis.cli.personal_copies import protect_and_register, require_whole
from visavis.cli.preview.pictures import SIMULATED, check_picture_name, write_below
from visavis.cli.redraw import redraw as draw_again
from visavis.cli.redraw import was_drawn
from visavis.cli.studies import session_of
from visavis.recording.cached import CachedRecording
from visavis.running.sessions.study_folder import study_of_session
from visavis.study.cast import use_recorded_cast


@app.command()
def redraw(
    session_path: SessionArgument,
    frame: Annotated[int, typer.Option(help="Number of the frame, as in the stream `drawn`.")],
    png: Annotated[Path, typer.Option(help="Write both eyes side by side.")],
    part: Annotated[int | None, typer.Option(help="Part of a resumed session.")] = None,
    participant: OfParticipant = "",
    accept_damage: AcceptDamage = False,
    config: ConfigOption = None,
) -> None:
    """Draw what a participant was shown in one frame, as it was; boards and own body with it.

    Where nothing was drawn in the session, the frame is drawn as it would have been. Below a
    simulated participant's a line says so; the picture itself is left as it was.

    Example: visavis redraw data/simulated/stare/sub-S07H/ses-001 --frame 4711 --png frame.png
    """
    from PIL import Image

    session_path = session_of(session_path, config, participant)
    check_picture_name(png)
    new_file(png)
    require_whole(session_path, accept=accept_damage)
    recording = CachedRecording(session_path)
    use_recorded_cast(recording)
    study, change_note = study_of_session(recording)
    if change_note:
        say(f"[yellow]{verbatim(change_note)}[/]")
    images = draw_again(study, recording, frame, part=part)
    both = np.concatenate(images, axis=1)
    if recording.is_simulated:
        write_below(both, f"{SIMULATED}  ·  frame {frame}").save(png)
    else:
        Image.fromarray(both).save(png)
    say_written(png)
    protect_and_register("picture", [session_path], png.parent, [png])
    if not was_drawn(recording):
        say("nothing was drawn in this session; the picture is what would have been")
