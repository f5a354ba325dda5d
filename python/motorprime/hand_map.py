"""Where the hand appears, learned from joint states and pixels alone: no URDF, no calibration.

For each camera a small network learns (u, v) of a point of the hand from the joints that moved. It knows what
it has seen and nothing else: :meth:`HandMap.inside` says where that is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ._arrays import Floats, finite, fixed, generator, integer, numbers
from .errors import ArgumentError, ArgumentTypeError
from .learning.levenberg_marquardt import SHARES, split, train
from .learning.network import Network
from .learning.random_units import fit_random_units
from .model_files import read_model, write_model
from .projection.adaptation import Correction, adapt_networks
from .samples import Samples

KIND = "hand map"
HIDDEN: tuple[tuple[int, ...], ...] = ((25, 25), (15, 15))
"""Hidden layers, of which the first is trained whose weights the samples suffice for."""
LABELS = 1.5
"""Numbers that such a network must learn from, for each of its weights; with fewer a network with random
units is better."""

_STILL = 1e-4  # [rad], a joint that moves less did not move
_SURE = 0.01  # [px], the smallest error that a map is believed to have
_STAYS = 0.01  # [rad], how far a joint that never moved in training may be off
# Prior standard deviations of what `adapt` corrects: joint offsets [rad], how they change over one standard
# deviation of a joint, the pixels' scale and shift [px].
_OFFSET, _MIXING, _SCALE, _SHIFT = 0.05, 0.01, 0.05, 10.0


@dataclass(frozen=True, eq=False)
class HandMap:
    """Networks from the joints to the hand's pixels; :func:`learn_hand_map` makes one.

    Attributes:
        names: the J joints, in the order of the columns of ``joints``.
        constant: {joint: angle [rad]} of those that never moved in training; the map knows nothing of them.
        low, high: (J,) range of each joint in training [rad] over which every camera saw the hand.
        networks: {camera: network from the joints that moved to (u, v)}, as trained.
        errors: {camera: median error [px] on samples that it has not learned from}.
        correction: of the networks by later samples.
    """

    names: tuple[str, ...]
    constant: Mapping[str, float]
    low: Floats
    high: Floats
    networks: Mapping[str, Network]
    errors: Mapping[str, float]
    correction: Correction

    @property
    def cameras(self) -> tuple[str, ...]:
        """The names of the cameras."""
        return tuple(self.networks)

    def hand_pixels(self, joints: npt.ArrayLike) -> dict[str, Floats]:
        """Where the hand appears: {camera: (N, 2)} of (u, v), be it inside the image or not.

        Args:
            joints: (N, J) or (J,) [rad]; (J,) gives (1, 2). Columns of :attr:`constant` are not looked at.

        Raises:
            ArgumentError: another shape, NaN or infinity.
        """
        moving = self._checked(joints)[:, self._moving]
        return {
            camera: self.correction.apply_to_pixels(camera, network).forward(moving)
            for camera, network in self.networks.items()
        }

    def inside(self, joints: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """(N,) whether joints (N, J) or (J,) [rad] are in the range of training, where the map is good.

        Joints that never moved must be where they were, within 0.01 rad. Being inside of every joint's range
        does not mean that such a posture was seen.
        """
        q = self._checked(joints)
        slack = np.where(np.isin(self.names, list(self.constant)), _STAYS, 0.0)
        return np.asarray(((q >= self.low - slack) & (q <= self.high + slack)).all(axis=1))

    def adapt(self, samples: Samples) -> HandMap:
        """A map corrected by about 100 samples of a robot that has changed; this one stays as it is.

        The networks stay; offsets of the joints and scale and shift of the pixels are corrected, and adapting
        again goes on from the knowledge of all samples before. The range of :meth:`inside` stays too.

        Raises:
            ArgumentError: a joint is missing, none of the cameras, or too few labels.
        """
        _check(samples)
        pixels = {camera: samples.pixels[camera] for camera in self.cameras if camera in samples.cameras}
        if not pixels:
            raise ArgumentError(
                f"samples: expected some of the cameras {', '.join(self.cameras)}, "
                f"got {', '.join(samples.cameras)}"
            )
        joints = samples.columns(self.names)[:, self._moving]
        return replace(
            self, correction=adapt_networks(self.networks, self.errors, self.correction, joints, pixels)
        )

    def save(self, path: str | Path) -> None:
        """Write the map to a file (safetensors); it is replaced at once or not at all.

        Raises:
            ArgumentError: the file cannot be written.
        """
        arrays = {"low": self.low, "high": self.high, **self.correction.arrays()}
        for camera, network in self.networks.items():
            arrays |= network.arrays(f"{camera}.")
        about = {
            "joints": list(self.names),
            "constant": dict(self.constant),
            "cameras": dict(self.errors),
        }
        write_model(path, KIND, arrays, about)

    @classmethod
    def load(cls, path: str | Path) -> HandMap:
        """Read what :meth:`save` wrote.

        Raises:
            ArgumentError: the file is missing, cut off or of another kind.
        """
        arrays, about = read_model(path, KIND)
        try:
            names, cameras = tuple(about["joints"]), tuple(about["cameras"])
            constant = {name: float(value) for name, value in about["constant"].items()}
            moving = len(names) - len(constant)
            networks = {camera: Network.from_arrays(arrays, f"{camera}.") for camera in cameras}
            wrong = [camera for camera, n in networks.items() if (n.sizes[0], n.sizes[-1]) != (moving, 2)]
            if wrong or not set(constant) <= set(names):
                raise ValueError(f"{moving} moving joints do not fit the networks")
            return cls(
                names,
                constant,
                fixed("low", arrays["low"], (len(names),)),
                fixed("high", arrays["high"], (len(names),)),
                networks,
                {camera: float(error) for camera, error in about["cameras"].items()},
                Correction.from_arrays(arrays, moving, cameras),
            )
        except (KeyError, ValueError, TypeError, AttributeError) as error:
            raise ArgumentError(f"path: {path} does not hold a whole {KIND}: {error}") from None

    @property
    def _moving(self) -> npt.NDArray[np.intp]:
        return np.flatnonzero(~np.isin(self.names, list(self.constant)))

    def _checked(self, joints: npt.ArrayLike) -> Floats:
        q = finite("joints", numbers("joints", joints))
        if q.ndim not in (1, 2) or q.shape[-1] != len(self.names):
            raise ArgumentError(
                f"joints: expected shape ({len(self.names)},) or (N, {len(self.names)}) of "
                f"{', '.join(self.names)}, got {q.shape}"
            )
        return q.reshape(-1, len(self.names))


def learn_hand_map(
    samples: Samples,
    *,
    seed: int | np.random.Generator | None = None,
    hidden: tuple[int, ...] | None = None,
    restarts: int = 1,
    iterations: int = 150,
) -> HandMap:
    """Learn where the hand appears.

    Few samples set the output weights of a network with random units
    (:func:`motorprime.learning.random_units.fit_random_units`). Many train all weights of two hidden layers
    (:func:`motorprime.learning.levenberg_marquardt.train`).

    Args:
        samples: joint states and the pixels of one point of the hand. Columns of joints that never moved are
            held fixed and named in :attr:`HandMap.constant`.
        seed: draws everything that is random.
        hidden: nodes of hidden layers that are to be trained, however many samples there are.
        restarts: random starts of the training; the one with the lowest validation error wins.
        iterations: of training at most, for each start.

    Raises:
        ArgumentError: no joint moved, or too few samples that a camera saw; the message says how many are
            needed.
    """
    _check(samples)
    restarts = integer("restarts", restarts, at_least=1)
    iterations = integer("iterations", iterations, at_least=1)
    if not len(samples):
        raise ArgumentError("samples: expected at least one, got none")
    low, high = _known_range(samples)
    still = high - low < _STILL
    if still.all():
        raise ArgumentError(
            f"samples: none of the joints {', '.join(samples.names)} moves; there is nothing to learn from"
        )
    moving, rng = samples.joints[:, ~still], generator(seed)
    networks: dict[str, Network] = {}
    errors: dict[str, float] = {}
    for camera in samples.cameras:
        seen = samples.seen(camera)
        x, y = moving[seen], samples.pixels[camera][seen]
        _enough(camera, len(x), moving.shape[1])
        layers = hidden or _hidden(len(x), moving.shape[1])
        if layers is None:
            networks[camera], off = fit_random_units(x, y, rng)
        else:
            parts = split(len(x), rng)
            network = train(
                x, y, layers, seed=rng, restarts=restarts, iterations=iterations, parts=parts
            ).network
            off = np.linalg.norm(network.forward(x[parts.test]) - y[parts.test], axis=1)
            networks[camera] = network
        # Adapting weighs labels by it; a map without any error would believe them beyond all measure.
        errors[camera] = max(float(np.median(off)), _SURE)
    middle = samples.joints.mean(axis=0)
    return HandMap(
        names=samples.names,
        constant={name: float(middle[k]) for k, name in enumerate(samples.names) if still[k]},
        low=low,
        high=high,
        networks=networks,
        errors=errors,
        correction=_nothing_known(moving, tuple(networks)),
    )


def _known_range(samples: Samples) -> tuple[Floats, Floats]:
    """Range (J,), (J,) of each joint that every camera knows: one may have seen the hand on one side only."""
    seen = [samples.joints[samples.seen(camera)] for camera in samples.cameras]
    parts = [joints for joints in seen if len(joints)] or [samples.joints]
    low = np.max([joints.min(axis=0) for joints in parts], axis=0)
    high = np.min([joints.max(axis=0) for joints in parts], axis=0)
    return low, high


def _check(samples: object) -> None:
    if not isinstance(samples, Samples):
        raise ArgumentTypeError(f"samples: expected Samples, got {type(samples).__name__}")


def _enough(camera: str, count: int, joints: int) -> None:
    """A linear map has joints + 1 numbers for u and as many for v; a network must see more than it."""
    needed = max(7, 2 * (joints + 1))
    if count < needed:
        raise ArgumentError(
            f"samples: {count} that camera '{camera}' saw are too few for {joints} joints that move; "
            f"at least {needed} are needed"
        )


def _hidden(count: int, joints: int) -> tuple[int, ...] | None:
    """The largest hidden layers that ``count`` samples suffice to train, or None."""
    for hidden in HIDDEN:
        weights = sum((a + 1) * b for a, b in pairwise((joints, *hidden, 2)))
        if SHARES[0] * count * 2 >= LABELS * weights:
            return hidden
    return None


def _nothing_known(joints: Floats, cameras: tuple[str, ...]) -> Correction:
    """No correction, and how large one may be."""
    n = joints.shape[1]
    deviations = np.concatenate(
        [
            np.full(n, _OFFSET),
            np.full(n * n, _MIXING),
            np.tile((*4 * (_SCALE,), _SHIFT, _SHIFT), len(cameras)),
        ]
    )
    return Correction(
        joints.mean(axis=0),
        joints.std(axis=0),
        cameras,
        np.zeros(len(deviations)),
        np.diag(deviations**-2),
    )
