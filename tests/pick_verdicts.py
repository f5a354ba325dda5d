"""A trial of picking up that takes no time: what becomes of it follows from its number alone."""

from typing import ClassVar

from motorprime.tasks.pick_trial import PickVerdict


def verdict(number, *, obstacle=False, perturb=False):
    """Of every ten: 0 and 5 are refused, 1 is not found, 2 missed, 3 dropped, and 4 touches an obstacle."""
    kind = number % 10
    outcome = {0: "refused", 5: "refused", 1: "not found", 2: "missed"}.get(kind, "lifted")
    return PickVerdict(
        outcome=outcome,
        reason="" if outcome == "lifted" else outcome,
        lifted=outcome == "lifted" and kind != 3,
        touched_obstacle=obstacle and kind == 4,
        height_m=0.06 if outcome == "lifted" else None,
        glass_error_m=1e-3 * kind if outcome == "lifted" else None,
        mass_kg=0.1,
        width_m=0.07,
        disturbed=perturb and kind not in (0, 5, 6),
        touched=(),
    )


class FakePickTrial:
    """Instead of :class:`.PickTrial`."""

    made: ClassVar[list] = []

    def __init__(self, robot, seed, dynamics, *, obstacle, perturb, settings, cloud):
        assert not settings.compare
        self.made.append((seed, obstacle, perturb))
        self._verdict = verdict(seed[1], obstacle=obstacle, perturb=perturb)
        self._over = False

    def __enter__(self):
        return self

    def __exit__(self, *raised):
        return None

    def run(self):
        yield from range(3)
        self._over = True

    def judge(self):
        assert self._over
        return self._verdict


def run_fake(asked):
    """As a worker process runs it; the one that asks has replaced the trial only in itself."""
    return verdict(asked.number, obstacle=asked.obstacle, perturb=asked.perturb)
