"""What the test beside a study's file imports to check the study before anybody is invited."""

from visavis.running.study_check import check_study

__all__ = ["check_study"]
