"""Power by simulation: whole studies run again and again through the planned analysis.

A study takes part by offering a `PowerStudy`; nothing here knows which study it is. A replicate
is one study of the largest number of participants; its first n participants are the study of n.
"""

from visavis.analysis.power.contract import (
    ANYTHING,
    PRIMARY,
    PlannedTestResult,
    PowerStudy,
    PrintedTest,
    Source,
    Verdicts,
)
from visavis.analysis.power.figure import draw_power
from visavis.analysis.power.replicates import (
    PowerRequest,
    Replicate,
    ReplicateJob,
    jobs_of,
    run_job,
    study_seed,
)
from visavis.analysis.power.summary import PowerSummary, TestPower, summarise

__all__ = [
    "ANYTHING",
    "PRIMARY",
    "PlannedTestResult",
    "PowerRequest",
    "PowerStudy",
    "PowerSummary",
    "PrintedTest",
    "Replicate",
    "ReplicateJob",
    "Source",
    "TestPower",
    "Verdicts",
    "draw_power",
    "jobs_of",
    "run_job",
    "study_seed",
    "summarise",
]
