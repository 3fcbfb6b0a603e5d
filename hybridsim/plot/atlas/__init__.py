"""Pictures of the atlas."""

from hybridsim.plot.atlas.matrix import matrix

__all__ = ["matrix"]
