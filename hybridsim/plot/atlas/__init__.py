"""This package draws the pictures of the atlas."""

from hybridsim.plot.atlas.scene import scene
from hybridsim.plot.atlas.small import save_small

__all__ = ["save_small", "scene"]
