"""This module defines the lines and filled outlines that make up the drawn shapes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]

BEHIND, MIDDLE, BODY, FRONT = 2.0, 2.2, 2.4, 2.6  # order of drawing


@dataclass(frozen=True)
class Outline:
    """A line through points, or a closed and filled outline, with its style."""

    points: Points
    line: str | None
    width: float = 1.3
    fill: str | None = None
    order: float = BODY

    def style(self) -> tuple[float, str | None, float, str | None]:
        """Return the style of the outline: order, line colour, line width and fill colour."""
        return self.order, self.line, self.width, self.fill


@dataclass(frozen=True)
class Label:
    """A short text at a point."""

    point: Points
    text: str
    colour: str


def turned(points: Points, angle: float, about: Points) -> Points:
    """Return points that are rotated about a point."""
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray((points - about) @ np.array([[c, s], [-s, c]]) + about)


def circle(centre: Points, radius: float, start: float = 0.0, stop: float = 2 * np.pi) -> Points:
    """Return points of a circle or of an arc."""
    count = max(8, round(abs(stop - start) / (2 * np.pi) * 72)) + 1
    phi = np.linspace(start, stop, count)
    return centre + radius * np.column_stack([np.cos(phi), np.sin(phi)])


def rectangle(low: Points, width: float, height: float, radius: float = 0.0) -> Points:
    """Return the outline of a rectangle from the middle of its lower edge; a radius rounds the corners."""
    x, y, r = width / 2, height, min(radius, width / 2, height / 2)
    corners = [(x - r, r, -0.5), (x - r, y - r, 0.0), (r - x, y - r, 0.5), (r - x, r, 1.0)]
    if not r:
        return low + np.array([[x, 0], [x, y], [-x, y], [-x, 0]])
    arcs = []
    for cx, cy, start in corners:
        phi = np.linspace(start, start + 0.5, 7) * np.pi
        arcs.append(np.column_stack([cx + r * np.cos(phi), cy + r * np.sin(phi)]))
    return np.asarray(low + np.concatenate(arcs))


def along(start: Points, end: Points, points: Points) -> Points:
    """Return points (s, n) in the frame of a line: s runs along the line from its start, n points to its left."""
    direction = _unit(end - start)
    normal = np.array([-direction[1], direction[0]])
    return np.asarray(start + points[:, :1] * direction + points[:, 1:] * normal)


def coils(length: float, width: float, count: int = 8) -> Points:
    """Return a coil spring along the s axis, with straight leads at both ends."""
    lead = min(0.12 * length, 0.5 * width)
    phi = np.linspace(0.0, 2 * np.pi * count, 26 * count + 1)
    body = max(length - 2 * lead, 0.0)
    swing = min(0.6 * width, 1.5 * body / count)
    s = lead + body * phi / phi[-1] + swing * (1 - np.cos(phi)) / 2
    n = 0.5 * width * np.sin(phi)
    return np.vstack([[0.0, 0.0], np.column_stack([s, n]), [length, 0.0]])


def hatching(start: Points, end: Points, depth: float) -> list[Points]:
    """Return oblique strokes on the right-hand side of a line."""
    length = float(np.hypot(*(end - start)))
    count = max(2, round(length / (0.75 * depth)))
    gap = length / count
    strokes = [np.array([[(k + 0.9) * gap, 0.0], [(k + 0.9) * gap - depth, -depth]]) for k in range(count)]
    return [along(start, end, stroke) for stroke in strokes]


def on_outline(centre: Points, direction: Points, outline: Points) -> Points:
    """Return the point at which a ray from inside an outline crosses the outline, or else the start of the ray."""
    first, second = outline, np.roll(outline, -1, axis=0)
    edge, to_first = second - first, first - centre
    across = direction[0] * edge[:, 1] - direction[1] * edge[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = (to_first[:, 0] * edge[:, 1] - to_first[:, 1] * edge[:, 0]) / across
        share = (to_first[:, 0] * direction[1] - to_first[:, 1] * direction[0]) / across
    hits = reach[(np.abs(across) > 0) & (share >= -1e-9) & (share <= 1 + 1e-9)]
    return np.asarray(centre + direction * (hits.max() if len(hits) and hits.max() > 0 else 0.0))


def _unit(vector: Points) -> Points:
    size = float(np.hypot(*vector))
    return np.array([1.0, 0.0]) if size == 0 else vector / size


def box_of(points: Sequence[Points]) -> tuple[Points, Points]:
    """Return the least and the largest coordinates of points."""
    every = np.concatenate([p.reshape(-1, 2) for p in points])
    return every.min(axis=0), every.max(axis=0)
