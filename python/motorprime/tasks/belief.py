"""Where a thing is believed to be, from one sighting after the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import Floats
from ..cylinder import Located

FADING = 0.98  # of the trust in an old estimate, per sighting
BETTER = 0.1  # silhouettes that overlap so much more with the prediction are seen better
DOUBTFUL = 0.2  # seen so much worse, it is not believed to be elsewhere
JUMP = 0.03  # a larger change of the estimate is a new place, not noise [m]


@dataclass
class Belief:
    """A place, averaged over sightings nearby.

    Attributes:
        place: (3,) [m] in the root frame; None before the first sighting.
        trust: overlap of the silhouettes that it rests on, 0 to 1, fading.
    """

    place: Floats | None = None
    trust: float = 0.0

    def update(self, located: Located) -> bool:
        """Average with the last places nearby; take a place as it is when seen better, or after a jump.

        A jump that is seen far worse than what was seen before is doubted, and not taken.

        Returns:
            Whether the thing is now somewhere else.
        """
        self.trust *= FADING
        jumped = self.place is None or float(np.linalg.norm(located.centre - self.place)) > JUMP
        if jumped and located.overlap < self.trust - DOUBTFUL:
            return False  # more likely half hidden than elsewhere; the trust fades, so this cannot last
        if self.place is None or jumped or located.overlap > self.trust + BETTER:
            self.place, self.trust = located.centre, located.overlap
            return jumped
        share = 0.5 if located.overlap > self.trust - BETTER else 0.1
        self.place = (1.0 - share) * self.place + share * located.centre
        self.trust = max(self.trust, located.overlap)
        return False
