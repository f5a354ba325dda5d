"""The simulated world: pybullet, the iCub, its cameras and the scene. Needs the extra ``sim``."""
