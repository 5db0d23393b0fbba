"""What the source of the cameras' study says; it shows its films to nobody."""

from typing import Final

from visavis.stimuli.camera.director import Style
from visavis.study.source import Fact

_STYLE: Final = Style()

FACTS: Final = (
    Fact(
        "design",
        "who judges films",
        "nobody",
        "section 5.4",
        "viewers, who prefer one of two films and say where they could see what was done",
        because="computing times do not tell whether films are good",
        is_stronger=True,
    ),
    Fact(
        "design",
        "compared with",
        "a roadmap of scattered places, by computing time",
        "section 5.4.2, table 5.2",
        "the roadmap, a camera that follows, and five placed by hand; the comparison of times is "
        "`python -m benchmarks.camera`",
        because="a roadmap alone is no rival that films are made with",
        is_stronger=True,
    ),
    Fact(
        "design",
        "place and walks",
        "a trench scene and a corridor in a game engine",
        "section 5.4",
        "a gallery and three walks of ours",
        because="its models may not be passed on",
    ),
    Fact(
        "procedure",
        "skeleton of the floor",
        "straight skeleton; mean curvature skeleton where floors overlap",
        "section 5.2.1",
        "medial axis of the walkable floor; floors do not lie above each other",
        because="a medial axis has the same branches, and no room of Visavis has two floors",
    ),
    Fact(
        "procedure",
        "tracks",
        "rays from the skeleton, lines by sequential RANSAC, four filters, graph",
        "sections 5.2.2 to 5.2.6",
    ),
    Fact(
        "procedure",
        "seconds that a subject may be hidden before a cut",
        0.2,
        "section 5.3.1",
        here=_STYLE.lost_s,
    ),
    Fact(
        "procedure",
        "seconds that its size may be wrong before a cut",
        0.2,
        "section 5.3.1",
        here=_STYLE.lost_s,
    ),
    Fact(
        "procedure",
        "shortest shot in seconds",
        "none",
        "section 5.3.1",
        here=f"{_STYLE.min_shot_s:g}, unless the subject is hidden",
        because="shots of a few pictures cannot be watched",
    ),
    Fact(
        "procedure",
        "where a cut goes",
        "size, direct and indirect visibility, 30° rule, direction of movement",
        "section 5.3.3",
        "the same; to a place from which the subject will be hidden within a second only where "
        "there is no other",
        because="such a cut is followed by another at once",
    ),
    Fact(
        "procedure",
        "degrees between cameras of a cut, at least",
        30,
        "section 5.3.3",
        here=_STYLE.min_angle_deg,
    ),
    Fact(
        "procedure",
        "score of the 30° rule",
        "the cosine of the subject's velocities as both cameras see them, as for the direction of "
        "movement",
        "section 5.3.3",
        "the angle between the cameras as a share of 30°; less is chosen where nothing else is "
        "there or the subject is hidden",
        because="the printed cosine is that of the other rule and knows no angle of the view",
    ),
    Fact("procedure", "lengths of shots", "log-normal", "section 5.3.1"),
    Fact(
        "procedure",
        "mass of the camera in kg",
        1,
        "section 5.3.4",
        here=_STYLE.drive.mass_kg,
    ),
    Fact(
        "procedure",
        "density of the roadmap on a square metre, longest link in metres",
        "1.5, 5",
        "figure 5.12",
        "1.5, 5",
    ),
    Fact(
        "procedure",
        "camera that follows",
        "none",
        "",
        "2.6 m behind, over the right shoulder; comes nearer where a wall stands between, goes "
        "through people",
        because="it is what games do, and needs no knowledge of the place",
    ),
)
