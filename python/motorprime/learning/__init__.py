"""Learning visuomotor maps: babbling, storing, training, choosing."""
