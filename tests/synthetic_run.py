"""Vision cycles made by hand, for the tests of pictures, recordings and reports: no simulator runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from motorprime import Look, Windows
from motorprime.cylinder import Cylinder, Located
from motorprime.detectors.histogram import Search, Silhouette
from motorprime.tasks.cycle import Cycle, FullFrame
from motorprime.tasks.explore import Sight

SHAPE = (60, 80)
CAMERAS = ("left", "right")
CANISTER = Cylinder(0.03, 0.13)
BESIDE = np.array([-0.25, 0.2, 0.005])  # where it stands
PLANNED = ("survey", "reach", "grasp", "lift")


def cycle(phase="reach", k=0, *, found=True, looks=True, full=True, path=True, attended=0.2, **more):
    """One cycle of two small cameras; ``k`` moves everything a little. ``more`` fields are taken as given."""
    generator = np.random.default_rng(k)
    images = {c: generator.integers(0, 255, (*SHAPE, 3), dtype=np.uint8) for c in CAMERAS}
    landscape = np.zeros(SHAPE, np.float32)
    landscape[20:40, 30:60] = 1.0
    windows = Windows(np.array([[40, 30], [50, 25]], np.int32), 10)
    silhouette = Silhouette(np.ones((8, 6), np.bool_), (38, 26), np.array([40.5, 29.5]), 0.8)
    mask = np.zeros(SHAPE, np.bool_)
    search = Search(
        (silhouette,) if found else (),
        np.array([[35, 25]], np.intp) if found else np.zeros((0, 2), np.intp),
        mask,
    )
    centre = np.array([-0.3, 0.1, 0.05])
    made = Cycle(
        phase=phase,
        time=0.1 * k,
        joints=np.zeros(9),
        images=images,
        looks={c: Look(landscape) for c in CAMERAS} if looks else {},
        sight=Sight(
            Located(centre, 0.9, 0.9, 0.9) if found else None,
            dict.fromkeys(CAMERAS, windows) if looks else {},
            dict.fromkeys(CAMERAS, search) if looks else {},
            attended,
        ),
        palm=np.array([-0.2, 0.2, 0.1]) + 0.01 * k,
        seconds={
            "projection": 0.002,
            "landscape": 0.0005,
            "sampling": 0.0005,
            "detection": 0.002,
            "triangulation": 0.001,
        },
        path=np.zeros((3, 3)) if path else None,
        path_pixels={c: np.array([[10.0, 10.0], [30.0, 20.0], [40.0, 30.0]]) for c in CAMERAS}
        if path
        else {},
        estimate=centre if found else None,
        goal=centre + 0.05 if phase in PLANNED else None,
        full=FullFrame(0.06, 0.001, Located(centre, 0.9, 0.9, 0.9) if found else None) if full else None,
    )
    return replace(made, **more)


def run():
    """A whole run: a search that finds, a fixation, a reach."""
    return [
        cycle("search", 0, found=False, path=False),
        cycle("search", 1, path=False),
        cycle("fixate", 2, path=False),
        *(cycle("reach", k) for k in range(3, 9)),
    ]


def pick():
    """A run that looks for what is in the way, passes it by a via-point, grasps and lifts."""
    outline = np.array([[50.0, 10.0], [60.0, 10.0], [60.0, 30.0], [50.0, 30.0]], np.float32)
    way = [np.array([-0.2, 0.15, 0.1]), np.array([-0.25, 0.15, 0.1]), np.array([-0.25, 0.15, 0.1])]
    known = {"obstacles": ((BESIDE, CANISTER),), "outlines": dict.fromkeys(CAMERAS, (outline,))}
    return [
        cycle("search", 0, path=False),
        cycle("fixate", 1, path=False),
        cycle("survey", 2, **known),
        *(cycle("reach", k, legs=tuple(way[max(0, k - 4) :][:3]), opening=1.0, **known) for k in range(3, 6)),
        cycle("reach", 6, legs=tuple(way[2:]), opening=0.6, event="The glass jumps 10 cm", **known),
        cycle("grasp", 7, legs=tuple(way[2:]), opening=0.1, found=False, **known),
        cycle("lift", 8, legs=tuple(way[2:]), opening=-0.5, found=False, **known),
    ]


LIFTED = {
    "lifted": True,
    "touched_obstacle": False,
    "height_m": 0.0597,
    "glass_error_m": 0.004,
    "mass_kg": 0.153,
    "width_m": 0.066,
    "disturbed": True,
    "touched": [],
}
"""What a judge says of it."""

CERTIFICATES = {
    "eye": {"continuous": -1.25, "discrete": 0.98, "step": 0.015},
    "arm": {"continuous": -0.5, "discrete": 0.99, "step": 0.02},
}
