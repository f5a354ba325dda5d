"""OpenCV's lens model with up to 14 coefficients, forwards, backwards and differentiated.

With x = X / Z, y = Y / Z, s = x^2 + y^2 and the coefficients (k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4,
tx, ty), of which the missing ones are zero::

    c  = (1 + k1 s + k2 s^2 + k3 s^3) / (1 + k4 s + k5 s^2 + k6 s^3)
    x' = c x + 2 p1 x y + p2 (s + 2 x^2) + s1 s + s2 s^2
    y' = c y + p1 (s + 2 y^2) + 2 p2 x y + s3 s + s4 s^2

followed by the homography of a sensor tilted by tx and ty [rad].
"""

from __future__ import annotations

import math

import numpy as np

from ._arrays import Floats

_KNOTS = 257  # of the table from which the inversion starts
_WIDEST = math.atan(100.0)  # the table ends 0.6 degrees before the image plane
_TOLERANCE = 1e-12  # of the inversion, in units of the focal length


class Lens:
    """A lens that bends normalised image coordinates.

    ``limit`` is the largest radius r = sqrt(x^2 + y^2) up to which r c(r^2) grows: beyond it the polynomial
    folds the scene back into the image, where nothing is seen in truth. It is infinite if it never folds.
    """

    def __init__(self, coefficients: tuple[float, ...]) -> None:
        """Take 0 to 14 coefficients in OpenCV's order."""
        self._k = tuple(coefficients) + (0.0,) * (14 - len(coefficients))
        k1, k2, _, _, k3, k4, k5, k6 = self._k[:8]
        # Polynomials in s, highest power first.
        self._top = np.array([k3, k2, k1, 1.0])
        self._bottom = np.array([k6, k5, k4, 1.0])
        self.limit = self._find_limit()
        self._tilt = _tilt_homography(self._k[12], self._k[13])
        self._untilt = None if self._tilt is None else np.asarray(np.linalg.inv(self._tilt), np.float64)
        radius = np.tan(np.linspace(0.0, min(math.atan(self.limit) * (1.0 - 1e-9), _WIDEST), _KNOTS))
        self._table = radius * self._radial(radius**2)[0], radius

    def distort(self, xy: Floats) -> Floats:
        """Bend normalised coordinates: (N, 2) to (N, 2). Rows beyond ``limit`` become NaN."""
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            bent = self._bend(xy)
            return bent if self._tilt is None else _apply(self._tilt, bent)

    def _bend(self, xy: Floats) -> Floats:
        """Bend without the tilt."""
        _, _, p1, p2 = self._k[:4]
        s1, s2, s3, s4 = self._k[8:12]
        x, y = xy[:, 0], xy[:, 1]
        s = x * x + y * y
        c = np.where(s <= self.limit**2, self._radial(s)[0], np.nan)
        bent = np.empty_like(xy)
        bent[:, 0] = c * x + 2.0 * p1 * x * y + p2 * (s + 2.0 * x * x) + s * (s1 + s2 * s)
        bent[:, 1] = c * y + p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y + s * (s3 + s4 * s)
        return bent

    def jacobian(self, xy: Floats) -> Floats:
        """Derive ``distort``: (N, 2) to (N, 2, 2), [n, i, j] = d out_i / d in_j."""
        jacobian = self._bend_jacobian(xy)
        if self._tilt is None:
            return jacobian
        bent = self._bend(xy)
        weight = bent @ self._tilt[2, :2] + self._tilt[2, 2]
        tilted = _apply(self._tilt, bent)
        outer = self._tilt[None, :2, :2] - tilted[:, :, None] * self._tilt[None, None, 2, :2]
        result: Floats = (outer / weight[:, None, None]) @ jacobian
        return result

    def undistort(self, xy: Floats) -> Floats:
        """Invert ``distort``: (N, 2) to (N, 2), by Newton's method from the inverse of the radial part.

        Iterated until the residual is below 1e-12 of the focal length. A row that no direction within
        ``limit`` maps to becomes NaN.
        """
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            target: Floats = xy if self._untilt is None else _apply(self._untilt, xy)
            radius = np.hypot(target[:, 0], target[:, 1])
            start = np.interp(radius, *self._table)
            guess: Floats = target * np.where(radius > 0.0, start / radius, 1.0)[:, None]
            for _ in range(30):
                error = self._bend(guess) - target
                if not (np.abs(error) > _TOLERANCE).any():
                    break
                # A step may leave the range of the model: let it go at most half of the way to the limit.
                furthest = (np.hypot(guess[:, 0], guess[:, 1]) + self.limit) / 2.0
                guess = guess - _solve2(self._bend_jacobian(guess), error)
                guess /= np.maximum(1.0, np.hypot(guess[:, 0], guess[:, 1]) / furthest)[:, None]
            # Far out the rounding of the coordinates themselves is larger than the tolerance.
            missed = ~(np.abs(self._bend(guess) - target).max(axis=1) <= 1e-9 * (1.0 + radius))
        guess[missed] = np.nan
        return guess

    def _radial(self, s: Floats) -> tuple[Floats, Floats]:
        """Return c(s) and dc/ds."""
        k1, k2, _, _, k3, k4, k5, k6 = self._k[:8]
        top, top_slope = 1.0 + s * (k1 + s * (k2 + s * k3)), k1 + s * (2.0 * k2 + s * (3.0 * k3))
        if k4 == k5 == k6 == 0.0:
            return top, top_slope
        bottom, bottom_slope = 1.0 + s * (k4 + s * (k5 + s * k6)), k4 + s * (2.0 * k5 + s * (3.0 * k6))
        return top / bottom, (top_slope - top / bottom * bottom_slope) / bottom

    def _bend_jacobian(self, xy: Floats) -> Floats:
        """Derive the model without the tilt."""
        _, _, p1, p2 = self._k[:4]
        s1, s2, s3, s4 = self._k[8:12]
        x, y = xy[:, 0], xy[:, 1]
        s = x * x + y * y
        c, dc = self._radial(s)
        prism_u, prism_v = 2.0 * s1 + 4.0 * s2 * s, 2.0 * s3 + 4.0 * s4 * s
        cross = 2.0 * (x * y * dc + p1 * x + p2 * y)
        jacobian = np.empty((len(xy), 2, 2))
        jacobian[:, 0, 0] = c + 2.0 * x * x * dc + 2.0 * p1 * y + 6.0 * p2 * x + prism_u * x
        jacobian[:, 0, 1] = cross + prism_u * y
        jacobian[:, 1, 0] = cross + prism_v * x
        jacobian[:, 1, 1] = c + 2.0 * y * y * dc + 6.0 * p1 * y + 2.0 * p2 * x + prism_v * y
        return jacobian

    def _find_limit(self) -> float:
        """Return the smallest r > 0 where d(r c)/dr = 0 or the denominator vanishes.

        With c = T / B: d(r c)/dr = ((T + 2 s T') B - 2 s T B') / B^2, a polynomial in s above.
        """
        double_s = np.array([2.0, 0.0])
        grown = np.polyadd(self._top, np.polymul(double_s, np.polyder(self._top)))
        shrunk = np.polymul(double_s, np.polymul(self._top, np.polyder(self._bottom)))
        slope: Floats = np.polysub(np.polymul(grown, self._bottom), shrunk)
        roots = np.concatenate([np.roots(slope), np.roots(self._bottom)])
        real = roots.real[(np.abs(roots.imag) <= 1e-9 * np.abs(roots)) & (roots.real > 0.0)]
        return float(np.sqrt(real.min())) if real.size else math.inf


def _apply(homography: Floats, xy: Floats) -> Floats:
    mapped = xy @ homography[:, :2].T + homography[:, 2]
    result: Floats = mapped[:, :2] / mapped[:, 2:]
    return result


def _tilt_homography(tx: float, ty: float) -> Floats | None:
    """Return the homography of a sensor turned by tx about x, then ty about y; None without a tilt."""
    if tx == 0.0 and ty == 0.0:
        return None
    about_x = np.array([[1, 0, 0], [0, math.cos(tx), math.sin(tx)], [0, -math.sin(tx), math.cos(tx)]])
    about_y = np.array([[math.cos(ty), 0, -math.sin(ty)], [0, 1, 0], [math.sin(ty), 0, math.cos(ty)]])
    turn = about_y @ about_x
    onto = np.array([[turn[2, 2], 0, -turn[0, 2]], [0, turn[2, 2], -turn[1, 2]], [0, 0, 1]])
    result: Floats = onto @ turn
    return result


def _solve2(matrix: Floats, vector: Floats) -> Floats:
    """Solve N systems of two equations; a singular one gives infinities, not an exception."""
    (a, b), (c, d) = matrix[:, 0].T, matrix[:, 1].T
    e, f = vector.T
    determinant = a * d - b * c
    return np.stack([(d * e - b * f) / determinant, (a * f - c * e) / determinant], axis=1)
