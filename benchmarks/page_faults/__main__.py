"""Kill the server of a study on a page, kill its browser, cut its network; count what is lost.

    python -m benchmarks.page_faults [--kills N] [--browser N] [--cuts N] [--json]

Around random answers the server's process is killed and begun anew, the browser is killed and
opened again with the same profile (of a page that is served, and of a bundle on another host), or
the connection is closed before the acknowledgement is read. Every acknowledged answer must be
recorded once, as it was given, and every session must end whole. Exits with 1 where anything is
lost. Programs are begun from nothing after each kill; a browser's own start is not counted.
"""

import argparse
import json
import sys
import tempfile
from dataclasses import asdict
from pathlib import Path

import numpy as np

from benchmarks.page_faults.browser_kills import kills_of_browser
from benchmarks.page_faults.server_kills import faults_of_server
from benchmarks.page_faults.study import Found, write_study

MAX_RESUME_S = 2.0


def main(arguments: list[str]) -> int:
    """Print what was lost."""
    parser = argparse.ArgumentParser(prog="benchmarks.page_faults", description=__doc__)
    parser.add_argument("--kills", type=int, default=200, help="kills of the server")
    parser.add_argument("--browser", type=int, default=200, help="kills of the browser, each way")
    parser.add_argument("--cuts", type=int, default=50, help="cuts of the network")
    parser.add_argument("--json", action="store_true", help="print JSON, a line for each")
    options = parser.parse_args(arguments)
    kinds = (
        "kills of the server",
        "cuts of its network",
        "kills of the browser, served",
        "kills of the browser, bundle",
    )
    found = [Found(kind) for kind in kinds]
    rng = np.random.default_rng(1)
    with tempfile.TemporaryDirectory(prefix="page_faults") as folder:
        root = Path(folder) / "lab"  # its keys are beside it
        root.mkdir()
        write_study(root)
        faults_of_server(root, found[0], found[1], (options.kills, options.cuts), rng)
        _print(found[:2], as_json=options.json)
        if options.browser:
            kills_of_browser(root, found[2], found[3], options.browser, rng)
            _print(found[2:], as_json=options.json)
    return int(any(one.is_bad for one in found))


def _print(found: list[Found], *, as_json: bool) -> None:
    for one in found:
        print(json.dumps(asdict(one)) if as_json else _line(one), flush=True)


def _line(one: Found) -> str:
    line = f"{one.faults} {one.kind}"
    if one.acknowledged:
        line += (
            f" in {one.sessions} sessions: {one.acknowledged} answers acknowledged, "
            f"{one.lost} lost (limit 0), {one.twice} recorded twice (limit 0), "
            f"{one.not_whole} sessions not whole (limit 0)"
        )
    if one.asked_again:
        line += f"; {one.asked_again} answers not yet kept as it came, asked again"
    if one.resumes_s:
        line += (
            f"; back in the trial after {np.median(one.resumes_s):.2f} s (median), "
            f"{max(one.resumes_s):.2f} s at most (limit {MAX_RESUME_S:g})"
        )
    return line


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
