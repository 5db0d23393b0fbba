"""Record the stored captures anew: `python -m tests.wire.record`.

All of them are from simulators (their headers say `is_simulated`), half a second of virtual time,
for an armband or a headset the conformance check itself. They pin what drivers make of bytes that
were on the wire when they were recorded; no capture of a real unit was available. Recording them
anew is a change of a reference: say in the commit why the bytes changed.
"""

import json
from pathlib import Path

import numpy as np

from tests.devices.every_driver import capture, check_on_replay, checks_of
from visavis.devices.conformance import check_headset, collect
from visavis.devices.registry import built_in
from visavis.lab.schema import SampleBatch

FOLDER = Path(__file__).resolve().parent
EXPECTED = FOLDER / "decoded.json"
SECONDS = 0.5
OTHERWISE_S = {
    "ble_sensor": 2.0,
    "openvr_trackers": 0.12,
    "openvr_controllers": 0.12,
    "openxr_hands": 0.12,
    "xsens": 0.3,
    "pupil_core": 0.3,
    "natnet": 0.3,
    "qualisys": 0.3,
    "vicon": 0.3,
}
FRAMES = 12


def record(driver: str, folder: Path = FOLDER) -> Path:
    """Write one driver's capture."""
    path = folder / f"{driver}.wire"
    path.unlink(missing_ok=True)
    kind = built_in()[driver].kind

    def check(make, let_pass):  # type: ignore[no-untyped-def]  # as the suite's checks are
        if kind in ("armband", "triggers"):
            checks_of(driver)[kind](make, let_pass)
        elif kind == "headset":
            check_headset(make, n_frames=FRAMES)
        else:
            device = make()
            collect(device, let_pass, seconds=OTHERWISE_S.get(driver, SECONDS))
            device.close()

    capture(driver, check, path)
    return path


def decoded(driver: str) -> dict[str, dict[str, float | int]]:
    """Play a stored capture back; return rows and the mean of every number, by stream."""
    batches: list[SampleBatch] = []

    def keep(make, let_pass):  # type: ignore[no-untyped-def]  # as the suite's checks are
        device = make()
        device.open(1.0)
        device.start(batches.append)
        for _ in range(60):
            if built_in()[driver].kind == "headset":
                if len(batches) >= FRAMES - 2:
                    break
                device.wait_frame()
            else:
                let_pass(0.01)
            device.poll(0.0)
        device.close()

    check_on_replay(FOLDER / f"{driver}.wire", keep)
    found: dict[str, dict[str, float | int]] = {}
    for name in sorted({batch.schema.name for batch in batches}):
        values = np.concatenate([b.values for b in batches if b.schema.name == name])
        found[name] = {"rows": int(values.size)}
        for field in values.dtype.names or ():
            known = values[field][np.isfinite(values[field])]
            if known.size:
                found[name][field] = float(np.mean(np.abs(known.astype("f8"))))
    return found


def wired() -> list[str]:
    """Return the drivers that have a wire and speak by themselves, unlike bands and triggers."""
    told = ("armband", "triggers")
    return [d for d in _captured() if built_in()[d].kind not in told]


def _captured() -> list[str]:
    wires = {name: spec.wire for name, spec in sorted(built_in().items())}
    return [d for d, wire in wires.items() if wire.medium != "none" and wire.carries != "nothing"]


def main() -> None:
    """Write every capture, say how large it is, and write what they decode to."""
    for driver in _captured():
        path = record(driver)
        print(f"{path.name} {path.stat().st_size}")  # noqa: T201 - what the command is for
    expected = {driver: decoded(driver) for driver in wired()}
    EXPECTED.write_text(json.dumps(expected, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    main()
