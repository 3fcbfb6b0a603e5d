"""Pictures of the atlas."""

from hybridsim.plot.atlas.matrix import matrix
from hybridsim.plot.atlas.scene import scene

__all__ = ["matrix", "scene"]
