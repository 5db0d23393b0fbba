"""Make listed kernels ready, perform a few trials of their study; print what else was called."""

import json
import sys
from pathlib import Path

from tools.kernel_list import used_in
from visavis.lab.compile_ahead import MEASURING, SIMULATING, compile_kernel, kernels_in_use
from visavis.results.opened_study import find_study
from visavis.running.sessions.simulation import kernels_of

if __name__ == "__main__":
    study = sys.argv[1]
    experiment = find_study(study).experiment({})
    listed = (*kernels_of(experiment, SIMULATING), *kernels_of(experiment, MEASURING))
    for line in listed:
        compile_kernel(line)
    ready = kernels_in_use()
    used = used_in(study, Path(sys.argv[2]))
    called = {line for lines in used.values() for line in lines}
    sys.stdout.write(json.dumps([len(listed), sorted(called - ready)]))
