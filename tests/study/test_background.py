"""Work beside the frames: at once in virtual time, in a process of its own in real time."""

import os

import pytest

from visavis.study.background import BackgroundExecutor, InlineExecutor


def test_work_is_done_at_once_in_the_same_process():
    future = BackgroundExecutor().submit(os.getpid)
    assert future.done()
    assert os.getpid() == future.result()


def test_an_error_comes_out_with_the_result():
    with pytest.raises(ZeroDivisionError):
        InlineExecutor().submit(divmod, 1, 0).result()


def test_in_a_process_work_is_done_elsewhere_and_at_once_again_afterwards():
    beside = BackgroundExecutor()
    with beside.in_process():
        assert os.getpid() != beside.submit(os.getpid).result(timeout=60)
    assert os.getpid() == beside.submit(os.getpid).result()


def test_a_process_that_gets_no_work_is_not_started_and_its_end_waits_for_nothing():
    with BackgroundExecutor().in_process():
        pass
