"""Types of the compiled kernels; the documented functions are in ``motorprime.landscape``."""

from collections.abc import Iterable, Sequence
from typing import Any, final

import numpy as np
import numpy.typing as npt

__all__ = [
    "CoupledSystem",
    "Mlp",
    "attention_step",
    "empty_landscape",
    "gaussian_landscape",
    "gaussian_landscapes",
    "gibbs_sample",
    "hue_saturation_bins",
    "instruction_set",
    "intersections",
    "kernel_landscape",
    "kernel_landscapes",
    "merge_hits",
    "merge_windows",
    "sample",
    "surf",
    "threshold",
    "window_hits",
    "window_intersections",
]

_Array = npt.NDArray[np.floating[Any]]
_Numbers = _Array | Sequence[float]
_Rows = _Array | Sequence[Sequence[float]]
_Landscape = npt.NDArray[np.float32]
_Width = float | tuple[float, float] | _Array

def gaussian_landscape(
    mean: _Numbers,
    chol: _Numbers,
    shape: tuple[int, int],
    cutoff: float,
    mixing: float,
    out: _Landscape | None,
    /,
) -> _Landscape: ...
def gaussian_landscapes(
    means: _Rows,
    chols: _Rows,
    shape: tuple[int, int],
    cutoff: float,
    mixing: float,
    out: Sequence[_Landscape] | None,
    /,
) -> list[_Landscape]: ...
def kernel_landscape(
    points: _Rows,
    shape: tuple[int, int],
    width: _Width,
    kernel: str,
    weights: _Numbers | None,
    out: _Landscape | None,
    /,
) -> _Landscape: ...
def kernel_landscapes(
    points: Sequence[_Rows],
    shape: tuple[int, int],
    width: _Width | list[_Width],
    kernel: str,
    weights: Sequence[_Numbers | None] | None,
    out: Sequence[_Landscape] | None,
    /,
) -> list[_Landscape]: ...
def threshold(
    landscape: _Array, fraction: float | None, count: int | None, method: str, stride: int, /
) -> float: ...
def gibbs_sample(
    landscape: _Array,
    n: int,
    seed: int,
    start: tuple[int, int] | None,
    burn_in: int,
    thin: int,
    out: npt.NDArray[np.int32] | None,
    /,
) -> npt.NDArray[np.int32]: ...
def empty_landscape(shape: tuple[int, int], /) -> _Landscape:
    """Return an array for a landscape, with anything in it."""

def instruction_set() -> str:
    """Return the instruction set that the kernels run on: 'baseline', 'avx2' or 'avx512'."""

def sample(
    landscape: _Array, n: int, seed: int, min_distance: float, out: npt.NDArray[np.int32] | None, /
) -> npt.NDArray[np.int32]: ...
def intersections(
    bins: npt.NDArray[np.uint8] | npt.NDArray[np.uint16],
    target: _Numbers,
    window: tuple[int, int],
    stride: int,
    wanted: npt.NDArray[np.bool_] | None,
    out: _Landscape | None,
    /,
) -> _Landscape: ...
def hue_saturation_bins(
    rgb: npt.NDArray[np.uint8],
    bins: tuple[int, int],
    min_saturation: int,
    min_value: int,
    out: npt.NDArray[np.uint16] | None,
    /,
) -> npt.NDArray[np.uint16]: ...
def merge_windows(corners: npt.NDArray[np.int32], size: int, gap: int, /) -> npt.NDArray[np.int32]: ...
def merge_hits(scores: _Landscape, hit: float, size: int, gap: int, /) -> npt.NDArray[np.int32]: ...
def window_hits(
    rgb: npt.NDArray[np.uint8],
    centres: npt.NDArray[np.int32],
    target: _Numbers,
    size: int,
    hit: float,
    gap: int,
    bins: tuple[int, int],
    min_saturation: int,
    min_value: int,
    /,
) -> npt.NDArray[np.int32]: ...
def window_intersections(
    rgb: npt.NDArray[np.uint8],
    corners: npt.NDArray[np.int32],
    target: _Numbers,
    window: tuple[int, int],
    bins: tuple[int, int],
    min_saturation: int,
    min_value: int,
    /,
) -> npt.NDArray[np.float32]: ...
def attention_step(
    cameras: list[tuple[str, Any, tuple[int, int], float | tuple[float, float], _Landscape, Any]],
    points: _Rows | None,
    joints: _Numbers | None,
    kernel: str,
    cutoff: float,
    mixing: float,
    fraction: float | None,
    count: int | None,
    stride: int,
    seed: int,
    threads: bool,
    /,
) -> list[float | bool | None]: ...
def surf(
    gray: npt.NDArray[np.uint8],
    mask: npt.NDArray[np.bool_] | None,
    hessian_threshold: float,
    octaves: int,
    layers: int,
    upright: bool,
    extended: bool,
    threads: int | None,
    /,
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32], npt.NDArray[np.float32]]:
    """Return (N, 5) u, v, size, angle, response; (N, 2) octave, laplacian; descriptors (N, 64 or 128)."""

_System = tuple[_Array, _Array, _Array, _Array]
_Coupling = tuple[_Array, _Array, _Array, float]

@final
class CoupledSystem:
    """Eye, arm and hand as coupled dynamical systems; see ``motorprime.control.cds``.

    A state is relative to the goal: fixation point (3) [m], place (3) [m] and rotation vector (3) [rad] of
    the palm, opening of the hand. Whether a system converges is for the caller to certify.
    """

    def __new__(
        cls,
        eye: _System,
        arm: _System,
        hand: _System,
        eye_arm: _Coupling,
        arm_hand: _Coupling,
        alpha: _Numbers,
        beta: _Numbers,
        close: float,
    ) -> CoupledSystem: ...
    def roll_out(
        self, state: _Numbers, amplitude: float, dt: float, steps: int, tolerance: _Numbers, /
    ) -> tuple[npt.NDArray[np.float64], bool]:
        """Return the states (N, 10) of one movement, and whether it arrived.

        Args:
            state: (10,) start, the first row of what is returned.
            amplitude: of the hand's opening, >= 0.
            dt: Euler step [s].
            steps: how many at most, up to a million.
            tolerance: (4,) of fixation [m], place [m], turn [rad] and opening. The movement ends where all
                four are less than these.

        Raises:
            ArgumentError: a wrong shape, a number that is not finite, a system that grows beyond all numbers.
            ArgumentTypeError: a wrong type or dtype.
        """

    def ends(
        self,
        states: _Rows,
        amplitude: float,
        dt: float,
        steps: Iterable[int],
        tolerance: _Numbers,
        watch: _Numbers,
        /,
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
        """Return how many movements end, computed side by side; the same on any number of threads.

        Args:
            states: (N, 10) starts.
            amplitude, dt, tolerance: as for one movement.
            steps: (N,) how many steps each may take.
            watch: (2,) opening and distance [m]: a hand that is open less while the palm is farther has
                closed early.

        Returns:
            Last states (N, 10), steps until each arrived (N,) or -1, and whether its hand closed early (N,).

        Raises:
            ArgumentError, ArgumentTypeError: as for one movement.
        """

@final
class Mlp:
    """A small feed-forward network: tanh on every layer but the last, which is linear."""

    def __new__(
        cls,
        weights: Sequence[_Rows],
        biases: Sequence[_Numbers],
        input_mean: _Numbers,
        input_std: _Numbers,
        output_mean: _Numbers,
        output_std: _Numbers,
    ) -> Mlp: ...
    def __call__(self, x: _Rows, /, *, out: npt.NDArray[np.float32] | None = None) -> npt.NDArray[np.float32]:
        """Outputs of the network, ``net((x - input_mean) / input_std) * output_std + output_mean``.

        Args:
            x: (N, in) raw inputs, float32 or float64, in the units of ``input_mean``. Arrays in C order are
                read in place.
            out: (N, out) float32 in C order to write to, apart from ``x`` in memory; what it held when an
                error is raised may be lost.

        Returns:
            (N, out) float32 in the units of ``output_mean``: ``out``, or a new array. Every row depends on
            its own input only, and has the same bits on every instruction set.

        Raises:
            ArgumentError: a wrong shape, an input that is not finite, a row whose output overflows float32,
                an ``out`` that is read-only, not in C order, or overlaps ``x``.
            ArgumentTypeError: a wrong type or dtype.
            StateError: another thread is writing to ``x``, or using ``out``.
        """

    def jacobian(self, x: _Rows, /, *, out: npt.NDArray[np.float32] | None = None) -> npt.NDArray[np.float32]:
        """Derivatives of the raw outputs by the raw inputs.

        Args:
            x: (N, in) raw inputs, as for a call.
            out: (N, out, in) float32 in C order to write to, as for a call.

        Returns:
            (N, out, in) float32, in units of the outputs per unit of the inputs: ``out``, or a new array.

        Raises:
            ArgumentError, ArgumentTypeError, StateError: as for a call.
        """
    @property
    def sizes(self) -> tuple[int, ...]: ...
    def __getnewargs__(self) -> tuple[Any, ...]: ...
