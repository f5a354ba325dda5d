"""What many tests share: the composed robot, and skipping of what cannot run here, with the reason."""

import importlib.util
import signal

import numpy as np
import pytest

if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    # A shell that starts a run in the background makes it deaf to Ctrl-C, and so the programs tests start.
    signal.signal(signal.SIGINT, signal.default_int_handler)


def _installed(module):
    try:
        return importlib.util.find_spec(module) is not None
    except (ImportError, ValueError):
        return False


_NEEDS = {
    "sim": ("pybullet", "icub_models", "scipy", "trimesh", "fast_simplification"),
    "learn": ("clarabel", "cvxpy", "duckdb", "joblib", "pyarrow", "scipy", "sklearn"),
    "scale": ("distributed",),
    "viz": ("matplotlib",),
    "onnx": ("onnxruntime",),
}
_REASONS = {
    extra: f"pip install 'motorprime[{extra}]': {', '.join(missing)} not installed"
    for extra, modules in _NEEDS.items()
    if (missing := [module for module in modules if not _installed(module)])
}
"""Extras that are not here, each a marker of the tests that need it, and why those are skipped."""


class _SkippedModule(pytest.Module):
    reason = ""

    def collect(self):
        pytest.skip(self.reason, allow_module_level=True)


def pytest_pycollect_makemodule(module_path, parent):
    """A test file marked as a whole may import what its extra brings: it is not even imported without it."""
    for extra, reason in _REASONS.items():
        if f"\npytestmark = pytest.mark.{extra}\n" in module_path.read_text():
            module = _SkippedModule.from_parent(parent, path=module_path)
            module.reason = reason
            return module
    return None


def pytest_collection_modifyitems(items):
    for extra, reason in _REASONS.items():
        for item in items:
            if item.get_closest_marker(extra):
                item.add_marker(pytest.mark.skip(reason=reason))


@pytest.fixture(scope="session")
def icub():
    """The composed iCub."""
    from motorprime.sim.icub import load_icub

    return load_icub()


@pytest.fixture(scope="session")
def cloud(icub):
    """The iCub's reachable space; do not change it."""
    from motorprime import ReachCloud

    reach_cloud = ReachCloud(icub)
    reach_cloud.points.flags.writeable = False
    return reach_cloud


@pytest.fixture(scope="session")
def painted(icub, cloud):
    """Makes a task of picking up on a painted body, with the shipped dynamics."""
    from motorprime import Attention, KinematicProjection, shipped
    from motorprime.tasks.pick import Pick
    from painted_body import BENCH, IN_REACH, PaintedBody, can, target
    from picking_up import QUICK

    dynamics = shipped.coupled_dynamics()

    def make(glass=IN_REACH, *, robot=icub, settings=QUICK, seed=1, body=None, **angles):
        body = body or PaintedBody(robot, glass, **angles)
        attention = Attention(KinematicProjection(robot), cloud=cloud)
        return Pick(
            body, target(), attention, BENCH, dynamics, obstacles=(can(),), settings=settings, seed=seed
        )

    return make


@pytest.fixture
def rng():
    return np.random.default_rng(20)
