"""What the source of the stare study says about its design, procedure, measures and tests."""

from typing import Final

from visavis.analysis.gaze.looks import DEFAULT_LOOK_PARAMETERS
from visavis.experiments.stare.comparisons import MEASURES
from visavis.experiments.stare.design import DEPTHS, ZONES
from visavis.experiments.stare.published import COMPARISONS
from visavis.stimuli.gaze.behaviour import MAXIMUM_TURN_DEG
from visavis.stimuli.scenes.audience import AUDIENCE_TURN_DEG, PARTICIPANT_TURN_DEG
from visavis.study.look_measures import FIRST_FIXATION_TIME_MS, FIXATION_COUNT
from visavis.study.source import Fact, PrintedOrder

FACTS: Final = (
    Fact("design", "conditions of gaze", 4, "section 3.2.1", of="condition"),
    Fact("design", "agents in the audience", 11, "section 3.2.2", of="agents"),
    Fact("design", "places of the active agent", 9, "section 3.2.2", here=len(ZONES) * len(DEPTHS)),
    Fact("design", "repetitions of condition and place", 2, "section 3.2.5", of="repetitions"),
    Fact("design", "trials", 72, "section 3.2.5", of="trials"),
    Fact("design", "blocks", 3, "section 3.2.5", of="blocks"),
    Fact("design", "trials in a block", 24, "section 3.2.5", of="trials_in_block"),
    Fact(
        "design",
        "order",
        "random within blocks; conditions equally often in each, places balanced",
        "section 3.2.5",
    ),
    Fact("design", "models of agents", "shuffled over places at every trial", "section 3.2.5"),
    Fact(
        "design",
        "places and distances of agents and speaker",
        "a figure; nobody nearer than 1 m, no head hides another, all in view",
        "section 3.2.2, figure 3.3",
        "chosen by us within what the figure and the text say",
        because="the source prints no coordinates",
    ),
    Fact(
        "design",
        "turn of the audience in degrees",
        10,
        "section 3.2.2",
        here=int(AUDIENCE_TURN_DEG),
    ),
    Fact(
        "design",
        "turn of the participant in degrees",
        20,
        "section 3.2.2",
        here=int(PARTICIPANT_TURN_DEG),
    ),
    Fact(
        "design",
        "which right both are turned to",
        "not said",
        "section 3.2.2",
        "each one's own",
        because="that is how we read it",
    ),
    Fact(
        "design",
        "models",
        "Microsoft Rocketbox, six women and five men",
        "section 3.2.2",
        "six women and five men of Visavis' own cast, or those that a lab imports",
        because="only models that may be passed on come with Visavis",
    ),
    Fact("procedure", "posture", "seated", "section 3.2.3", of="posture"),
    Fact(
        "procedure",
        "headset",
        "FOVE: 100° of field, 120 Hz, accuracy below 1°",
        "section 3.2.3",
        "any headset with an eye tracker that Visavis drives, the FOVE among them",
        because="labs have others; field of view, rate and accuracy stand in the report",
    ),
    Fact("procedure", "seconds of a trial", 16, "section 3.2.2", of="trial_s"),
    Fact("procedure", "dark seconds before a trial", 3, "section 3.2.5", of="intertrial_s"),
    Fact("procedure", "mark while it is dark", "small, top centre", "section 3.2.5"),
    Fact(
        "procedure",
        "start and end of a scene",
        "fades in and out",
        "section 3.2.2",
        "on and off between two frames",
        because="times to a first fixation need an onset of one frame",
        is_stronger=True,
    ),
    Fact(
        "procedure",
        "change of gaze without a look, as a share of the trial",
        0.5,
        "section 3.2.2",
        of="switch_at_01",
    ),
    Fact(
        "procedure",
        "what changes the gaze in AD and DA",
        "a look at the active agent",
        "section 3.2.1",
        "the first valid sample of gaze on its head, padded by {pad_deg}°",
        because="a program needs a rule for what is a look",
        is_stronger=True,
    ),
    Fact(
        "procedure",
        "largest turn of eyes in the head, in degrees",
        30,
        "section 3.2.2",
        here=int(MAXIMUM_TURN_DEG),
    ),
    Fact("procedure", "speaker", "behind the participant, silent", "section 3.2.2"),
    Fact(
        "procedure",
        "training",
        "one scene of averted gaze; the task is to observe the audience, gaze is not named",
        "section 3.2.5",
        "the same, for {practice_s} s or longer",
        because="people look round at their own pace, and everybody long enough",
    ),
    Fact(
        "procedure",
        "calibration",
        "before the training, and again in the breaks between blocks",
        "section 3.2.5",
        "the same, with validation",
        because="only a validation says what accuracy is left",
        is_stronger=True,
    ),
    Fact(
        "procedure",
        "questions after the session",
        "age, gender, experience with virtual reality and with games, a comment",
        "section 3.2.5",
        "the same, and how one sees",
        because="lenses and glasses are what eye trackers err by",
        is_stronger=True,
    ),
    Fact(
        "procedure",
        "social anxiety",
        "Liebowitz scale, 0 to 144, after the session",
        "section 3.2.4",
        "its structure and range, reworded, not validated; a lab puts its licensed wording in",
        because="the wording belongs to its authors",
    ),
    Fact("measure", "measures of gaze", 6, "section 3.2.6", here=len(MEASURES)),
    Fact(
        "measure",
        "shortest fixation in ms",
        150,
        "section 3.2.6",
        here=int(DEFAULT_LOOK_PARAMETERS.minimum_fixation_ms),
    ),
    Fact(
        "measure",
        "gaze on a head",
        "the point of gaze on the screen hits the active agent's head",
        "section 3.2.4",
        "the angle to the head's centre, padded by {pad_deg}°, nothing before it; by the bare ray "
        "beside it",
        because="trackers err by about a degree, and a look past another head is no look",
        is_stronger=True,
    ),
    Fact("test", "comparisons of conditions", 5, "section 3.3.1", here=len(COMPARISONS)),
    Fact(
        "test",
        "test of a comparison",
        "paired t, or Wilcoxon's signed ranks where Shapiro–Wilk rejects normal differences",
        "section 3.3.1",
    ),
    Fact(
        "test",
        "alpha of the thirty tests",
        "0.05 over 30, cut off to .00166",
        "section 3.3.1",
        "0.05 over 30",
        because="a threshold is not rounded here; no printed star depends on it",
        is_stronger=True,
    ),
    Fact(
        "test",
        "correlations with social anxiety",
        "Spearman, each at .05",
        "section 3.3.2",
        "Spearman; decided by Holm's correction, each p at .05 beside it",
        because="of 24 coefficients one is significant by chance",
        is_stronger=True,
    ),
    Fact(
        "test",
        "who is left out",
        "not said",
        "",
        "trials with 30 % of gaze lost and more, people with too many of them or a calibration "
        "worse than 2.5°",
        because="a rule has to stand before data are looked at",
        is_stronger=True,
    ),
)
_CENTRE: Final = {"zone": "centre"}
ORDERS: Final = (
    PrintedOrder(
        "A, AD > D",
        FIRST_FIXATION_TIME_MS,
        "table A.5",
        factor="condition",
        only=_CENTRE,
        words="in the centre, first fixations are sooner in D than in A and AD",
    ),
    PrintedOrder(
        "A > DA",
        FIRST_FIXATION_TIME_MS,
        "table A.5",
        factor="condition",
        only=_CENTRE,
        words="in the centre, first fixations are sooner in DA than in A",
    ),
    PrintedOrder(
        "D > AD, DA",
        FIXATION_COUNT,
        "section 3.4",
        factor="condition",
        words="fewer fixations in both changing conditions than in D",
        not_reproduced="the printed means of D and AD, 2.35 and 2.18, do not differ (p = .16), and "
        "in a fifth of simulated studies they lie the other way round",
    ),
)
"""What the source says of zones and in its discussion, beside its tests of the main tables."""
