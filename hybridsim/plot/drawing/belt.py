"""This module draws a belt on two rollers, with marks that move with the belt."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hybridsim.plot.drawing.frame import BAR, Frame, Items
from hybridsim.plot.drawing.layout import direction_of
from hybridsim.plot.drawing.outlines import BEHIND, FRONT, Outline, circle
from hybridsim.plot.drawing.poses import Pose

Points = NDArray[np.float64]
_MARKS = 0.55  # distance of the marks, relative to the unit


def belt(pose: Pose, frame: Frame) -> Items:
    """Yield the outlines of a belt."""
    theme, direction = frame.theme, direction_of(pose)
    normal = np.array([-direction[1], direction[0]])
    radius = frame.layout.size(pose)[0] / 2
    low, high = frame.layout.spans[pose.shape.name]
    length, travel = high - low, pose.number("travel")
    left, right = (pose.at + s * direction - radius * normal for s in (low, high))
    angle, start = np.arctan2(direction[1], direction[0]), pose.at + low * direction
    loop = np.vstack(
        [
            start,
            pose.at + high * direction,
            circle(right, radius, angle + np.pi / 2, angle - np.pi / 2),
            circle(left, radius, angle - np.pi / 2, angle - 1.5 * np.pi),
        ]
    )
    yield Outline(loop, theme.weak, 3.0, theme.paper, BEHIND)
    for centre in (left, right):
        yield Outline(circle(centre, 0.8 * radius), theme.ink, 1.1, theme.body, BEHIND)
        for k in range(3):
            turn = angle - travel / radius + k * 2 * np.pi / 3
            spoke = np.array([centre, centre + 0.8 * radius * np.array([np.cos(turn), np.sin(turn)])])
            yield Outline(spoke, theme.ink, 1.1, order=BEHIND)
        yield Outline(circle(centre, 0.15 * radius), theme.ink, 1.1, theme.paper, BEHIND)
    around = 2 * length + 2 * np.pi * radius
    count = max(4, round(around / (_MARKS * frame.layout.unit)))
    for k in range(count):
        s = (k * around / count + travel) % around
        yield Outline(_on_loop(s, length, radius, start, right, left, angle), theme.weak, 1.6, order=BEHIND)
    if pose.shape.name in frame.colours:
        yield Outline(
            np.array([start, pose.at + high * direction]), frame.colours[pose.shape.name], BAR, order=FRONT
        )


def _on_loop(
    s: float, length: float, radius: float, start: Points, right: Points, left: Points, angle: float
) -> Points:
    """Return a short mark inside a belt at the distance s from its upper left corner."""
    half, inner = np.pi * radius, radius * np.array([1.0, 0.76])
    if s < length or length + half <= s < 2 * length + half:
        share, centre, turn = (s, left, np.pi / 2) if s < length else (length + half - s, right, -np.pi / 2)
        point = centre + share * np.array([np.cos(angle), np.sin(angle)])
    else:
        point, first = (right, length) if s < length + half else (left, 2 * length + half)
        turn = (np.pi / 2 if point is right else -np.pi / 2) - (s - first) / radius
    way = np.array([np.cos(angle + turn), np.sin(angle + turn)])
    return np.asarray(point + np.outer(inner, way))
