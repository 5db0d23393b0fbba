"""Serve one session in a process of its own, which others may kill: ROOT LABEL."""

import sys
from pathlib import Path

from benchmarks.page_faults.study import request_of, session_path
from visavis.running.sessions.perform import perform_new, perform_rest
from visavis.running.sessions.session_request import PageAddress


def main(root: Path, label: str) -> None:
    """Begin or go on with the session; its address is printed once it can be opened."""
    page = PageAddress(0, lambda address: print(address, flush=True))
    request, path = request_of(root, label, page), session_path(root, label)
    if path.exists():
        perform_rest(request, path)
    else:
        perform_new(request)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2])
