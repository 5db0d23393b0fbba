"""Keep what a runtime's loader prints of itself off the operator's screen: it is logged."""

import logging
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager

_LOG = logging.getLogger(__name__)


@contextmanager
def loader_output_logged(loader: str) -> Iterator[None]:
    """Log what native code writes to standard error meanwhile, line by line, at level INFO.

    What goes wrong is told by the errors the loader returns; its own lines would stand between
    the command's.
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
