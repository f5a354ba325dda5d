"""Weights that come with the package, for the simulated iCub; weights/README.md says how they were made."""

from __future__ import annotations

from collections.abc import Callable
from importlib.resources import as_file, files
from pathlib import Path
from typing import TypeVar

from .control.cds import CoupledDynamics
from .control.swivel import Swivel
from .errors import StateError
from .peripersonal_model import PeripersonalModel
from .projection import HybridProjection, KinematicProjection, NeuralProjection
from .robot import Robot

NEURAL = "icub-projection.safetensors"
PERIPERSONAL = "icub-peripersonal.safetensors"
COUPLED = "cds.safetensors"
ELBOW = "human-elbow.safetensors"

T = TypeVar("T")


def neural_projection(robot: Robot) -> NeuralProjection:
    """The projection that networks learned from babbling with the simulated iCub.

    Raises:
        ArgumentError: another robot.
        StateError: the file is missing from the installation.
    """
    learned = _read(NEURAL, lambda path: NeuralProjection.load(path, robot=robot.name))
    shapes = _shapes(robot)
    return learned if shapes == learned.shapes else learned.resized(shapes)


def peripersonal_model(robot: Robot) -> PeripersonalModel:
    """The reachable space's ellipses that networks learned of the simulated iCub.

    Raises:
        ArgumentError: another robot.
        StateError: the file is missing from the installation.
    """
    learned = _read(PERIPERSONAL, lambda path: PeripersonalModel.load(path, robot=robot.name))
    shapes = _shapes(robot)
    return learned if shapes == learned.shapes else learned.resized(shapes)


def elbow_swivel() -> Swivel:
    """Where a person's elbow is while reaching, learned from motion capture of 21 reaches.

    Raises:
        StateError: the file is missing from the installation.
    """
    return _read(ELBOW, Swivel.load)


def hybrid_projection(robot: Robot) -> HybridProjection:
    """Kinematics, with room for networks that :meth:`HybridProjection.adapt` adds where they help."""
    return HybridProjection(KinematicProjection(robot))


def coupled_dynamics() -> CoupledDynamics:
    """Eye, arm and hand as learned from recorded human reaches, with a gaze made up from published timings.

    Raises:
        StateError: the file is missing from the installation, or its certificate does not hold.
    """
    return _read(COUPLED, CoupledDynamics.load)


def _shapes(robot: Robot) -> dict[str, tuple[int, int]]:
    return {name: mount.camera.shape for name, mount in robot.cameras.items()}


def _read(name: str, load: Callable[[Path], T]) -> T:
    with as_file(files(__package__) / "weights" / name) as path:
        if not path.is_file():
            raise StateError(f"the package's file weights/{name} is missing; install motorprime again")
        return load(path)
