"""This package draws the pictures of the atlas."""

from hybridsim.plot.atlas.matrix import matrix
from hybridsim.plot.atlas.scene import scene
from hybridsim.plot.atlas.small import save_small

__all__ = ["matrix", "save_small", "scene"]
