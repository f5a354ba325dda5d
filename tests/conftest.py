"""What many tests share: the composed robot, and skipping of what cannot run here, with the reason."""

import importlib.util

import numpy as np
import pytest


def _installed(module):
    try:
        return importlib.util.find_spec(module) is not None
    except (ImportError, ValueError):
        return False


_MISSING = [
    module
    for module in ("pybullet", "icub_models", "scipy", "trimesh", "fast_simplification")
    if not _installed(module)
]
_REASON = f"pip install 'motorprime[sim]' (CPython 3.10 or 3.11): {', '.join(_MISSING)} not installed"


class _SkippedModule(pytest.Module):
    def collect(self):
        pytest.skip(_REASON, allow_module_level=True)


def pytest_pycollect_makemodule(module_path, parent):
    """A test file marked ``sim`` as a whole may import the simulator: it is not even imported without it."""
    if _MISSING and "\npytestmark = pytest.mark.sim\n" in module_path.read_text():
        return _SkippedModule.from_parent(parent, path=module_path)
    return None


def pytest_collection_modifyitems(items):
    if _MISSING:
        for item in items:
            if item.get_closest_marker("sim"):
                item.add_marker(pytest.mark.skip(reason=_REASON))


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


@pytest.fixture
def rng():
    return np.random.default_rng(20)
