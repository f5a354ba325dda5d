"""Where the palm must be to grasp an upright glass from the side, and how the hand gets there and away.

The palm stands on edge, its fingers level and its thumb up; the glass stands between thumb and fingers. With
the azimuth a of the palm's facing (0 to the left, 90 degrees straight ahead), in the robot's root frame
(x backwards, y right, z up)::

    palm z = (-sin a, -cos a, 0)   towards the glass
    palm y = (0, 0, -1)            from index to little finger: down
    palm x = y x z                 along the fingers
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .._arrays import Floats, finite, fixed, not_negative, numbers, positive, rigid


@dataclass(frozen=True)
class SideGrasp:
    """The palm's place beside a glass, lengths in metres.

    The opposed thumb is a post 16 mm to the wrist's side of the palm's origin. So what must not change with
    the glass's size is the gap between thumb and glass: the axis lies ``radius + along`` along the fingers.

    Args:
        along: of the glass's near side, along the fingers, from the palm's origin. Less, and the thumb's tip
            pushes the glass on the way in; more, and the fingers drag it farther, or do not reach round it.
        gap: between the palm's origin and the glass's surface. The palm itself is 8 to 10 mm of it.
        above: of the palm's origin over the middle of the glass. The wrist needs it over the table.
        retreat: from the grasp back to the pre-grasp, along the facing: the way on which thumb and fingers,
            which point along it and across it, pass the glass on its sides.
        lift: how far the glass is lifted.
        roomy: least opening of the hand that lets a glass of any size in; see :meth:`opening`.
        arrived: distance of the palm from the grasp within which the hand may close.
        azimuths: the sides [rad] from which the iCub's arm reaches the table before it.
    """

    along: float = -0.006
    gap: float = 0.011
    above: float = 0.010
    retreat: float = 0.08
    lift: float = 0.06
    roomy: float = 0.6
    arrived: float = 0.005
    azimuths: tuple[float, ...] = tuple(float(a) for a in np.deg2rad(np.arange(-20.0, 91.0, 10.0)))

    def __post_init__(self) -> None:
        for name in ("along", "gap", "above", "lift", "roomy", "arrived"):
            fixed(name, getattr(self, name), ())
        positive("retreat", self.retreat)
        finite("azimuths", numbers("azimuths", self.azimuths))

    def pose(self, centre: npt.ArrayLike, azimuth: float, radius: float) -> Floats:
        """The palm's pose (4, 4) at the grasp, in the root frame.

        Args:
            centre: (3,) middle of the glass's axis [m].
            azimuth: of the palm's facing [rad].
            radius: of the glass [m].
        """
        place, radius = fixed("centre", centre, (3,)), positive("radius", radius)
        azimuth = float(fixed("azimuth", azimuth, ()))
        facing = np.array([-np.sin(azimuth), -np.cos(azimuth), 0.0])
        down = np.array([0.0, 0.0, -1.0])
        fingers = np.cross(down, facing)
        pose = np.eye(4)
        pose[:3, :3] = np.column_stack([fingers, down, facing])
        pose[:3, 3] = place - self.above * down
        pose[:3, 3] -= (radius + self.along) * fingers + (radius + self.gap) * facing
        return pose

    def pregrasp(self, pose: npt.ArrayLike, share: float = 1.0) -> Floats:
        """The palm's pose (4, 4), ``share`` of the retreat back from a grasp's (4, 4) along its facing."""
        back: Floats = rigid("pose", pose).copy()
        back[:3, 3] -= float(fixed("share", share, ())) * self.retreat * back[:3, 2]
        return back

    def opening(self, wanted: float, distance: float) -> float:
        """The opening nearest to a wanted one that pushes no glass away: roomy until the palm has arrived.

        People close the hand on the way, and so does a hand that learned from them. This hand is small: one
        that is half closed meets a wide glass with its fingertips, and now and then does not take it.

        Args:
            wanted: opening of the hand, as of :meth:`.hand.Hand.targets`.
            distance: of the palm from the grasp [m].
        """
        wanted = float(fixed("wanted", wanted, ()))
        return wanted if not_negative("distance", distance) <= self.arrived else max(wanted, self.roomy)

    def lifted(self, pose: npt.ArrayLike, share: float = 1.0) -> Floats:
        """The palm's pose (4, 4), ``share`` of the lift straight above a grasp's (4, 4)."""
        up: Floats = rigid("pose", pose).copy()
        up[2, 3] += float(fixed("share", share, ())) * self.lift
        return up


SIDE_GRASP = SideGrasp()
"""The iCub's: amid the values that lift glasses of every size and weight with the palm 4 mm and 2 deg off."""
