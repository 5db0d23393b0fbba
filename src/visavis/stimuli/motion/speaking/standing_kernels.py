"""A speaker who stands: everything but where the hips are, what the spine turns, and the arms."""

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.motion.standing_kernels import breathe, hang_arms, stand, stir_body


@compiled
def speaker_rows(t_s: Vector, person: int, lively: float, build: Vector, controls: Vector) -> None:
    """Write postures (n, SIZE) of one person at times (n,): feet planted, arms hanging, breathing;
    trunk and head stir by `lively`.
    """
    for i in range(t_s.shape[0]):
        c = controls[i]
        c[:] = 0.0
        stand(c, t_s[i], build, person, 0.0)
        hang_arms(c, person)
        stir_body(c, t_s[i], person, lively)
        breathe(c, t_s[i], person, 1.0)
