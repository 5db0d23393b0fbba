"""What a recording gives to analysis: the trials' own padding, frozen gaze lost."""

import numpy as np
import numpy.typing as npt
import pytest

from analysis.gaze.aoi import LOST
from analysis.gaze.targets import targets_of_part
from experiments.stare.intake import measure_parameters_of


class FewSamples:
    """A recording of 24 samples at 120 Hz; the first twelve repeat one direction."""

    def stream_arrays(self, name: str, *, part: int) -> dict[str, npt.NDArray[np.generic]]:
        n, m = 24, 2
        t_ns = np.arange(n, dtype=np.int64) * 10**9 // 120
        direction = np.zeros((n, 3), dtype=np.float32)
        direction[:, 2] = -1
        direction[12:, 0] = np.linspace(0.01, 0.1, 12)
        if name == "gaze":
            return {"seq": np.arange(n), "t_device_ns": t_ns, "direction_head": direction}
        return {
            "gaze_seq": np.arange(n),
            "t_sample_ns": t_ns,
            "valid": np.ones(n, dtype=np.bool_),
            "direction_world": direction,
            "angle_deg": np.zeros((n, m)),
            "radius_deg": np.ones((n, m)),
            "pad_limit_deg": np.ones((n, m)),
            "hit": np.zeros(n, dtype=np.int16),
        }


def test_gaze_that_repeats_one_direction_for_100_ms_is_lost() -> None:
    samples, frozen = targets_of_part(FewSamples(), 1)  # type: ignore[arg-type]  # only its streams are read

    assert [True] * 12 + [False] * 12 == frozen.tolist()
    assert [LOST] * 12 + [0] * 12 == samples.hit.tolist()
    assert not samples.valid[:12].any()
    assert samples.valid[12:].all()


def test_measures_pad_heads_as_the_trials_did_online() -> None:
    assert measure_parameters_of({"parameters": {"pad_deg": 0.5}}).pad_deg == 0.5
    assert measure_parameters_of({}).pad_deg == pytest.approx(1.0)
