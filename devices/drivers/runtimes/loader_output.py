"""Log the output of a runtime's loader, to keep it off the operator's screen."""

import logging
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager

_LOG = logging.getLogger(__name__)


@contextmanager
def loader_output_logged(loader: str) -> Iterator[None]:
    """Log the lines that native code writes to standard error meanwhile, at level INFO.

    The loader returns its errors, so its own lines are not needed; they would mix with the
    lines of the command.
    """
    if sys.stderr is not None:
        sys.stderr.flush()
    try:
        screen = os.dup(2)
    except OSError:  # a program without a terminal has nothing to keep clear
        yield
        return
    with tempfile.TemporaryFile() as log_file:
        os.dup2(log_file.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(screen, 2)
            os.close(screen)
            log_file.seek(0)
            for line in log_file.read().decode("utf-8", "replace").splitlines():
                _LOG.info("%s: %s", loader, line)
