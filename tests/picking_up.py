"""How tests of picking up run a task, and what they read off its cycles."""

import numpy as np

from motorprime.tasks.cycle import Settings

QUICK = Settings(compare=False)
PHASES = ["search", "fixate", "survey", "reach", "grasp", "lift"]


def run(task, each=lambda cycle: None, *, until=None):
    """All cycles, or those up to the first of a phase; ``each`` may do something after any of them."""
    cycles = []
    for cycle in task.run():
        cycles.append(cycle)
        each(cycle)
        if cycle.phase == until:
            break
    return cycles


def of(cycles, phase):
    return [cycle for cycle in cycles if cycle.phase == phase]


def moved(body, names):
    return any(name in move for move in body.moves for name in names)


def distances(places, thing, centre):
    """Of places (N, 3) outside a standing cylinder."""
    offset = np.asarray(places) - centre
    beside = np.maximum(np.linalg.norm(offset[:, :2], axis=1) - thing.radius, 0.0)
    return np.hypot(beside, np.maximum(np.abs(offset[:, 2]) - thing.height / 2, 0.0))


def commanded_palms(task):
    """Poses (N, 4, 4) of the palm at every command that moved the arm, on a body that obeys."""
    body, arm = task.body, task.controller.arm
    angles, palms = dict(zip(arm.names, arm.rest, strict=True)), []
    for move in body.moves:
        if arm.names[-1] in move:
            angles |= {name: move[name] for name in arm.names if name in move}
            palms.append(arm.palm(np.array([angles[name] for name in arm.names])))
    return np.array(palms)
