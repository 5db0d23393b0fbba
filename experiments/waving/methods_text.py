"""The method section, written from the parameters in force."""

from typing import Final

from experiments.waving.clips import SETTINGS, UNITS, WARPED_PARTS
from experiments.waving.design import DEFAULT_PARAMETERS, WavingParameters
from experiments.waving.published import IN_WORDS
from stimuli.scenes.office import STANDING_EYE_M

REFERENCES: Final = (
    "Jovane, A. (2023). Thesis, Université de Rennes, chapter 2 (the study, its published values "
    "and the method of visual motion warping).",
    "Wobbrock, J. O., Findlater, L., Gergle, D., & Higgins, J. J. (2011). The aligned rank "
    "transform for nonparametric factorial analyses. CHI '11, 143–146.",
    "Elkin, L. A., Kay, M., Higgins, J. J., & Wobbrock, J. O. (2021). An aligned rank transform "
    "procedure for multifactor contrast tests. UIST '21, 754–768.",
    "Chaumette, F., & Hutchinson, S. (2006). Visual servo control, part I. IEEE Robotics & "
    "Automation Magazine, 13, 82–90.",
)


def method_paragraphs(params: WavingParameters) -> tuple[str, ...]:
    """Return the paragraphs: design, techniques, measures, statistics."""
    parts = ", and as much more of ".join(" with ".join(p) for p in WARPED_PARTS).replace("_", " ")
    units = [u.replace("_", " ") for u in UNITS]
    return (
        "Participants stood in a line of five customers of an office, in one of the three middle "
        "places. Behind people, plants and furniture that hide more on the right than on the "
        "left, one of three clerks waved at the participant, at the customer to the left or at "
        "the one to the right. Two techniques × three directions × nine situations (every clerk "
        "at every place of one's own) made 54 trials in random order after two to try. The scene "
        f"was there for {params.scene_s:g} s, of which the hand waved for {params.wave_s:g} s. "
        "Then participants said to whom the wave was directed, of five places, and how realistic "
        "it was from 1 to 9.",
        "With orientation the whole body was turned towards the addressee. With visual warping "
        + (
            "the same turned wave "
            if params.warp_from == "oriented"
            else "the wave straight ahead "
        )
        + f"was warped to the addressee's view: {100 * params.increment:.0f} % more coverage of "
        f"{parts}, all warping units of {', '.join(units[:-1])} and {units[-1]} allowed "
        f"to move (probe {SETTINGS.probe_deg:g}°, damping {SETTINGS.damping:g}, at most "
        f"{SETTINGS.most_steps} steps at {SETTINGS.rate_hz:g} Hz, smoothing "
        f"{SETTINGS.smooth_s:g} s). The eyes were led to the addressee by the same controller "
        "with both techniques.",
        "Accuracy is the share of right answers of a cell, realism the mean rating, response time "
        "the median from the question's onset to the answer. Cells of each participant were "
        "compared by a two-way repeated-measures ANOVA on aligned ranks with Tukey contrasts on "
        "ranks aligned for them, α = .05. Participants without all cells were left out.",
        f"What the source says besides its numbers: {IN_WORDS[0].lower()}{IN_WORDS[1:]}",
    )


def choices(params: WavingParameters) -> tuple[str, ...]:
    """Return, one sentence each, what was chosen or set otherwise than usual."""
    found = [
        "The office's measures: only a sketch is published.",
        "Nine repetitions are the nine combinations of clerk and own place.",
        "Coverage is wanted of the face, not the whole head: a head in profile covers more.",
        "The warp starts from the wave that is already turned to the addressee.",
        f"Waves at the participant are warped for eyes {STANDING_EYE_M:g} m above the floor.",
        "An answer is pointed at with a tracked hand, or the head where none is tracked.",
    ]
    if params.warp_from != "oriented":
        found[3] = "The warp starts from a wave straight ahead (set for this study)."
    for name, usual in vars(DEFAULT_PARAMETERS).items():
        if getattr(params, name) != usual:
            found.append(f"Set for this study: {name} {getattr(params, name)} (usually {usual}).")
    return tuple(found)
