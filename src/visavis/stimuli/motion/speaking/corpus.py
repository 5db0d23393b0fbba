"""A lab's own speaker: a folder of recordings of the body, each beside its annotation."""

from pathlib import Path
from typing import Final

from visavis.lab.errors import UsageError
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.motion_file import MOTION_SUFFIXES, read_motion
from visavis.stimuli.motion.skeleton import canonical_skeleton
from visavis.stimuli.motion.speaking.annotations import SCRIPT_SUFFIXES, Tiers, read_any_script
from visavis.stimuli.motion.speaking.body_track import measure_body
from visavis.stimuli.motion.speaking.speaker import Speaker, Take

PAIRED: Final = f"{' or '.join(MOTION_SUFFIXES)} beside {', '.join(SCRIPT_SUFFIXES)}"


def read_corpus(
    folder: Path, *, unit_m: float = 0.01, tiers: Tiers | None = None, beta: float = 0.65
) -> Speaker:
    """Return the speaker of a folder: `take.bvh` beside `take.anvil`, and so on, by name.

    `unit_m` is the unit of BVH files in metres.

    Raises:
        UsageError: there is no such folder.
        MotionError: a recording has no annotation or an annotation no recording; they are named.
        ConfigError: an annotation is wrong, with all its lines.
    """
    if not folder.is_dir():
        raise UsageError(f"{folder} is no folder; give one with {PAIRED}")
    motions: dict[str, Path] = {}
    scripts: dict[str, Path] = {}
    for path in sorted(folder.iterdir()):
        suffix = path.suffix.lower()
        kind = motions if suffix in MOTION_SUFFIXES else scripts
        if suffix not in (*MOTION_SUFFIXES, *SCRIPT_SUFFIXES) or path.name.startswith("."):
            continue
        if path.stem in kind:
            raise MotionError(f"{kind[path.stem].name} and {path.name} are one take; keep one")
        kind[path.stem] = path
    alone = [motions[name].name for name in motions if name not in scripts]
    alone += [scripts[name].name for name in scripts if name not in motions]
    if alone or not motions:
        what = f"nothing belongs to {', '.join(alone)}" if alone else "there is no take"
        raise MotionError(f"{folder}: {what}; give each take the same name: {PAIRED}")
    skeleton = canonical_skeleton()
    takes = []
    for name, path in motions.items():
        clip = read_motion(path, skeleton, unit_m=unit_m)
        script = read_any_script(scripts[name], tiers, any_lexeme=True)
        takes.append(Take(path.name, measure_body(clip, path.name), script))
    return Speaker(tuple(takes), beta)
