"""What native loaders print of themselves does not reach the operator's screen."""

import logging
import os

import pytest

from visavis.devices.drivers.runtimes.loader_output import loader_output_logged


def test_lines_of_a_loader_are_logged_and_not_shown(capfd, caplog):
    with caplog.at_level(logging.INFO), loader_output_logged("Loader"):
        os.write(2, b"cannot find this\nnor that\n")
    os.write(2, b"shown again\n")

    assert "shown again\n" == capfd.readouterr().err
    assert ["Loader: cannot find this", "Loader: nor that"] == caplog.messages


def test_the_screen_is_given_back_after_an_error(capfd):
    with pytest.raises(OSError, match="absent"), loader_output_logged("Loader"):
        raise OSError("absent")
    os.write(2, b"shown\n")

    assert "shown\n" == capfd.readouterr().err
