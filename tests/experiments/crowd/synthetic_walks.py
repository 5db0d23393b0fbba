"""Tables of a made-up crowd study: numbers are drawn, nothing walks."""

import json
from typing import Any

import numpy as np
import pandas as pd

from visavis.experiments.crowd.design import CONDITIONS
from visavis.experiments.crowd.measures import MeasuredWalk, crowd_cells
from visavis.experiments.crowd.measuring import narrow_gaps
from visavis.stimuli.scenes.station_crowd import station_crowd

COLLISIONS = (71.0, 62.8, 60.7)
VOLUME = (0.8, 0.6, 0.65)
TO_GAP = (34.3, 40.1, 38.7)
SPEED = (0.43, 0.40, 0.42)


def walks(
    people: int,
    seed: int = 1,
    *,
    effect: bool = True,
    configurations: int = 2,
    group: str = "",
) -> list[MeasuredWalk]:
    """Return walks of people in three blocks; `effect` False gives every block the first mean."""
    rng = np.random.default_rng(seed)
    cells = {c: sorted(crowd_cells(station_crowd(c)).triangles) for c in range(1, 9)}
    found = []
    for person in range(people):
        own = rng.standard_normal(4)
        for block, condition in enumerate(CONDITIONS):
            at = block if effect else 0
            for configuration in range(1, configurations + 1):
                noise = rng.standard_normal(8)
                collisions = COLLISIONS[at] + 8 * own[0] + 3 * noise[0]
                row: dict[str, Any] = {
                    "participant": f"S{group[:1]}{person:02d}",
                    "session": 1,
                    "trial_id": f"T{block}{configuration}",
                    "attempt": 1,
                    "status": "complete",
                    "is_practice": False,
                    "condition": condition,
                    "configuration": configuration,
                    "group": group,
                    "is_simulated": True,
                    "came_back": True,
                    "lost_01": 0.0,
                    "flags": "",
                    "measure_rule": "volume",
                    "measure_surface": "fine",
                    "collisions": round(collisions),
                    "max_volume_dm3": VOLUME[at] + 0.05 * own[1] + 0.04 * noise[1],
                    "shoulders_to_gap_deg": TO_GAP[at] + 4 * own[2] + 2 * noise[2],
                    "shoulders_to_way_deg": TO_GAP[at] - 5 + 4 * own[2] + 2 * noise[3],
                    "speed_m_s": SPEED[at] + 0.04 * own[3] + 0.01 * noise[4],
                    "path_m": 29 + 0.5 * noise[5],
                    "time_s": 70 + 3 * noise[6],
                    "collision_s": 0.5 + 0.02 * noise[7],
                    "collision_speed_m_s": 0.4 + 0.02 * noise[5],
                    "clearance_mean_m": 0.5 + 0.01 * noise[6],
                    "hesitations": int(abs(noise[7]) > 1),
                }
                some = rng.choice(len(cells[configuration]), 30, replace=False)
                visited = tuple(cells[configuration][k] for k in some)
                crossing = {
                    "trial_id": row["trial_id"],
                    "centres_apart_m": 0.7 + 0.5 * rng.random(),
                    "shoulders_to_gap_deg": 40.0,
                    "shoulders_to_way_deg": 30.0,
                }
                collision = {
                    "trial_id": row["trial_id"],
                    "counted": True,
                    "cut": False,
                    "body_part": "hand",
                    "side": "left",
                    "max_volume_dm3": 0.5,
                    "duration_s": 0.3,
                    "x_m": 0.5,
                    "z_m": -0.5,
                    "speed_m_s": 0.4,
                }
                track = np.cumsum(rng.standard_normal((20, 2)) * 0.2, axis=0)
                found.append(MeasuredWalk(row, [collision], [crossing], visited, track))
    return found


def tables_of_walks(walked: list[MeasuredWalk]) -> dict[str, pd.DataFrame]:
    """Return the tables of walks as sessions of the study give them."""
    trials, collisions, crossings, cells = [], [], [], []
    for walk in walked:
        place = {n: walk.row[n] for n in ("participant", "condition", "configuration", "trial_id")}
        gaps = narrow_gaps(walk.row | {"crossings": len(walk.crossings)}, walk.crossings, 1.5)
        trials.append(walk.row | gaps)
        collisions += [{**place, **c} for c in walk.collisions]
        crossings += [{**place, **c} for c in walk.crossings]
        told = {"cells": json.dumps(walk.cells), "track_m": json.dumps(walk.track_m.tolist())}
        cells.append({**place, **told})
    found = {"trials": trials, "collisions": collisions, "crossings": crossings, "cells": cells}
    return {name: pd.DataFrame(rows) for name, rows in found.items()}


def tables(walked: list[MeasuredWalk], seed: int = 2) -> dict[str, pd.DataFrame]:
    """Return all tables of a study with these walks, ratings drawn without any effect."""
    rng = np.random.default_rng(seed)
    people = sorted({(w.row["participant"], w.row["group"]) for w in walked})
    blocks = [
        {
            "participant": person,
            "block": k + 1,
            "condition": condition,
            **{s: 4 + rng.standard_normal() for s in ("agency", "change", "ownership", "presence")},
        }
        for person, _ in people
        for k, condition in enumerate(CONDITIONS)
    ]
    pulse = {
        "participant": people[0][0],
        "acknowledged": True,
        "commanded_ms": 0.1,
        "sent_ms": 1.0,
        "acknowledged_ms": 6.0,
        "risen_ms": 40.0,
        "held_ms": 300.0,
    }
    found = tables_of_walks(walked)
    ratings = pd.DataFrame(blocks)
    found["trials"] = found["trials"].merge(ratings.drop(columns="block"), how="left")
    return {
        **found,
        "pulses": pd.DataFrame([pulse]),
        "blocks": ratings,
    }
