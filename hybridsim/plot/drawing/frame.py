"""This module defines what each shape is drawn with: all poses at one time, and the colours."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from hybridsim.plot.drawing.layout import Layout
from hybridsim.plot.drawing.outlines import Label, Outline
from hybridsim.plot.drawing.poses import Pose, Poses
from hybridsim.plot.drawing.theme import Theme

BAR = 4.5  # width of a line in the colour of a mode, in points


@dataclass(frozen=True)
class Frame:
    """A drawing at one time: all poses, the layout, and the colour of the mode of each shape that shows one."""

    poses: Poses
    layout: Layout
    theme: Theme
    colours: dict[str, str]

    def colour(self, pose: Pose, default: str) -> str:
        """Return the colour of the mode of a shape, or another one."""
        return self.colours.get(pose.shape.name, default)


Items = Iterator[Outline | Label]
