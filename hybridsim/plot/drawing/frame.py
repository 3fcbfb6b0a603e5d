"""This module defines a frame, the data for drawing the shapes at one time: poses, layout and colours."""

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
    """The data of a drawing at one time: poses, layout, theme, and mode colours by the names of shapes."""

    poses: Poses
    layout: Layout
    theme: Theme
    colours: dict[str, str]

    def colour(self, pose: Pose, default: str) -> str:
        """Return the mode colour of a shape, or the default colour if the shape shows no mode."""
        return self.colours.get(pose.shape.name, default)


Items = Iterator[Outline | Label]
