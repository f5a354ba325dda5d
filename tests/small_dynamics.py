"""Coupled dynamics written by hand, and random ones; all certified."""

from __future__ import annotations

import numpy as np

from motorprime.control.cds import CoupledDynamics
from motorprime.control.coupling import Coupling
from motorprime.control.lpvds import LpvDs

STEP = 0.02


def linear(rates, step=STEP):
    """x' = -rates x, one component."""
    d = len(rates)
    return LpvDs(
        np.ones(1), np.zeros((1, d)), np.eye(d)[None], -np.diag(rates)[None].astype(float), np.eye(d), step
    )


def line(slope, at=0.2, near=0.02):
    """Expects y = slope psi: one component on that line."""
    covariance = np.array([[0.01, 0.01 * slope], [0.01 * slope, 0.01 * slope**2 + 1e-4]])
    return Coupling(np.ones(1), np.array([[at, slope * at]]), covariance[None], near)


def simple(**changes):
    """One component each: eye 6/s, arm 2/s, hand 5/s; the arm expected at 0.8 |e|, the hand open far off."""
    parts = {
        "eye": linear([6.0] * 3),
        "arm": linear([2.0] * 3 + [3.0] * 3),
        "hand": linear([5.0]),
        "eye_arm": line(0.8),
        "arm_hand": open_until(0.02),
    }
    return CoupledDynamics(**(parts | changes))


def open_until(near):
    """Expects an opening of 0.9 at any distance, from ``near`` on."""
    return Coupling(np.ones(1), np.array([[0.3, 0.9]]), np.diag([0.01, 0.01])[None], near)


def certified(rng, components, d, m, *, spread=0.3, blocks=None):
    """A random system with its own metric: each A_k decays at 0.5/s to 5/s and turns by up to 3 rad/s."""
    blocks = blocks or [d]
    matrices, lyapunov = np.zeros((components, d, d)), np.zeros((d, d))
    first = 0
    for size in blocks:
        inside = slice(first, first + size)
        shear = np.eye(size) + 0.2 * rng.normal(size=(size, size))
        for k in range(components):
            axes = np.linalg.qr(rng.normal(size=(size, size)))[0]
            turn = rng.uniform(-3.0, 3.0) * (axes[:, :1] @ axes[:, -1:].T - axes[:, -1:] @ axes[:, :1].T)
            decay = (axes * -rng.uniform(0.5, 5.0, size)) @ axes.T
            matrices[k, inside, inside] = np.linalg.solve(shear, (turn + decay) @ shear)
        lyapunov[inside, inside] = shear.T @ shear
        first += size
    factors = spread * (np.eye(m) + 0.3 * rng.normal(size=(components, m, m)))
    covariances = factors @ factors.transpose(0, 2, 1) + 1e-3 * np.eye(m)
    weights = rng.dirichlet(np.full(components, 3.0))
    return LpvDs(weights, spread * rng.normal(size=(components, m)), covariances, matrices, lyapunov, STEP)


def coupling(rng, components):
    factors = 0.2 * rng.normal(size=(components, 2, 2))
    covariances = factors @ factors.transpose(0, 2, 1) + 1e-3 * np.eye(2)
    means = np.abs(rng.normal(size=(components, 2))) * [0.3, 0.6]
    return Coupling(
        rng.dirichlet(np.full(components, 3.0)), means, covariances, float(rng.uniform(0.01, 0.05))
    )


def random_model(rng, components=4):
    """Random systems of the shape that is learned: the arm's mixture is over its place only."""
    return CoupledDynamics(
        certified(rng, components, 3, 3),
        certified(rng, components, 6, 3, blocks=[3, 3]),
        certified(rng, components, 1, 1),
        coupling(rng, components),
        coupling(rng, components),
        alpha=rng.uniform(0.4, 1.3, 3),
        beta=rng.uniform(0.4, 1.3, 3),
    )


def random_pose(rng, reach=0.5):
    pose = np.eye(4)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    pose[:3, :3] = turn * np.sign(np.linalg.det(turn))
    pose[:3, 3] = rng.uniform(-reach, reach, 3)
    return pose
