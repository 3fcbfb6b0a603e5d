"""This module draws each kind of shape as outlines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hybridsim.plot.drawing.belt import belt
from hybridsim.plot.drawing.frame import BAR, Frame, Items
from hybridsim.plot.drawing.layout import bob_of, centre_of, direction_of, ends_of, outline_of
from hybridsim.plot.drawing.outlines import (
    BEHIND,
    FRONT,
    MIDDLE,
    Label,
    Outline,
    along,
    circle,
    coils,
    hatching,
    rectangle,
    turned,
)
from hybridsim.plot.drawing.poses import Pose
from hybridsim.plot.drawing.theme import Theme

Points = NDArray[np.float64]


def _text(pose: Pose, frame: Frame, point: Points) -> Items:
    if pose.shape.text:
        yield Label(point, pose.shape.text, frame.theme.ink)


def _mass(pose: Pose, frame: Frame) -> Items:
    width, height = frame.layout.size(pose)
    angle, ink = pose.number("angle"), frame.theme.ink
    shape = turned(rectangle(pose.at, width, height, 0.08 * min(width, height)), angle, pose.at)
    yield Outline(shape, ink, 1.4, frame.theme.body)
    if pose.shape.name in frame.colours:
        half = np.array([0.5 * width, 0.0])
        edge = turned(np.array([pose.at - half, pose.at + half]), angle, pose.at)
        yield Outline(edge, frame.colours[pose.shape.name], BAR, order=FRONT)
    yield from _text(pose, frame, centre_of(pose, frame.layout))


def _ball(pose: Pose, frame: Frame) -> Items:
    centre, radius = centre_of(pose, frame.layout), frame.layout.size(pose)[0] / 2
    angle = pose.number("angle")
    yield Outline(circle(centre, radius), frame.theme.ink, 1.4, frame.theme.body)
    yield Outline(
        circle(centre, 0.72 * radius, angle + 0.62 * np.pi, angle + 0.9 * np.pi),
        frame.theme.rim,
        2.4,
        order=FRONT,
    )
    if pose.shape.name in frame.colours:
        yield Outline(
            circle(centre, radius, -0.72 * np.pi, -0.28 * np.pi),
            frame.colours[pose.shape.name],
            BAR,
            order=FRONT,
        )
    yield from _text(pose, frame, centre)


def _rim(pose: Pose, frame: Frame, radius: float) -> Items:
    if pose.shape.name in frame.colours:
        yield Outline(circle(pose.at, radius), frame.colours[pose.shape.name], BAR, order=FRONT)


def _rotor(pose: Pose, frame: Frame) -> Items:
    radius, angle, theme = frame.layout.size(pose)[0] / 2, pose.number("angle"), frame.theme
    yield Outline(circle(pose.at, radius), frame.colour(pose, theme.ink), 1.4, theme.body)
    yield from _rim(pose, frame, radius)
    yield Outline(circle(pose.at, 0.78 * radius), theme.rim, 1.0)
    for k in range(6):
        hole = pose.at + 0.52 * radius * np.array(
            [np.cos(angle + k * np.pi / 3), np.sin(angle + k * np.pi / 3)]
        )
        yield Outline(circle(hole, 0.13 * radius), theme.ink, 0.9, theme.paper if k else theme.ink)
    tip = np.array([[0.78 * radius, 0.0], [radius, 0.0]]) + pose.at
    yield Outline(turned(tip, angle, pose.at), theme.ink, 2.2, order=FRONT)
    yield Outline(circle(pose.at, 0.15 * radius), theme.ink, 1.2, theme.rim)
    yield from _text(pose, frame, pose.at)


def _wheel(pose: Pose, frame: Frame) -> Items:
    radius, angle, theme = frame.layout.size(pose)[0] / 2, pose.number("angle"), frame.theme
    yield Outline(circle(pose.at, radius), theme.ink, 1.4, theme.rim)
    yield Outline(circle(pose.at, 0.8 * radius), theme.ink, 1.0, theme.paper)
    for k in range(6):
        spoke = np.array([pose.at, pose.at + [0.8 * radius, 0.0]])
        yield Outline(turned(spoke, angle + k * np.pi / 3, pose.at), theme.ink, 2.4 if k == 0 else 1.2)
    yield Outline(circle(pose.at, 0.16 * radius), theme.ink, 1.2, theme.body)
    yield from _rim(pose, frame, radius)
    yield from _text(pose, frame, pose.at)


def _pendulum(pose: Pose, frame: Frame) -> Items:
    unit, theme, bob = frame.layout.unit, frame.theme, bob_of(pose)
    radius = frame.layout.size(pose)[0] / 2
    if pose.shape.name in frame.layout.hung:
        yield from _support(pose, frame)
    yield Outline(np.array([pose.at, bob]), theme.ink, 2.6, order=MIDDLE)
    yield Outline(circle(bob, radius), theme.ink, 1.4, theme.body)
    joint = frame.colour(pose, theme.ink)
    yield Outline(
        circle(pose.at, 0.1 * unit),
        joint,
        3.2 if pose.shape.name in frame.colours else 1.2,
        theme.paper,
        FRONT,
    )
    yield from _text(pose, frame, bob)


def _support(pose: Pose, frame: Frame) -> Items:
    """Draw the fixed support above the pivot of a pendulum."""
    unit, theme = frame.layout.unit, frame.theme
    tip, foot = 0.3 * unit, 0.2 * unit
    yield Outline(
        pose.at + np.array([[0, 0], [-foot, tip], [foot, tip]]), theme.ink, 1.2, theme.paper, BEHIND
    )
    yield from _hatched(
        pose.at + [0.38 * unit, tip], pose.at + [-0.38 * unit, tip], theme, theme.ink, frame.layout.hatch
    )


def _hatched(start: Points, end: Points, theme: Theme, line: str, depth: float, width: float = 1.6) -> Items:
    """Draw a line with hatching on its right-hand side."""
    for stroke in hatching(start, end, depth):
        yield Outline(stroke, theme.weak, 0.9, order=BEHIND)
    yield Outline(np.array([start, end]), line, width, order=BEHIND)


def _wall(pose: Pose, frame: Frame) -> Items:
    direction = direction_of(pose)
    low, high = frame.layout.spans[pose.shape.name]
    start, end = pose.at + low * direction, pose.at + high * direction
    if frame.layout.sides[pose.shape.name] < 0:
        start, end = end, start
    shows = pose.shape.name in frame.colours
    line = frame.colour(pose, frame.theme.ink)
    yield from _hatched(start, end, frame.theme, line, frame.layout.hatch, 3.0 if shows else 1.6)


def _tank(pose: Pose, frame: Frame) -> Items:
    width, height = frame.layout.size(pose)
    level = min(max(pose.number("level"), 0.0), height)
    theme = frame.theme
    yield Outline(rectangle(pose.at, width, level), None, 0.0, theme.water, MIDDLE)
    surface = pose.at + np.array([[-width / 2, level], [width / 2, level]])
    yield Outline(surface, frame.colour(pose, theme.ink), 1.2, order=MIDDLE)
    x, y = width / 2, height
    yield Outline(pose.at + np.array([[-x, y], [-x, 0], [x, 0], [x, y]]), theme.ink, 2.2)
    yield from _text(pose, frame, pose.at + [0.0, 0.5 * height])


def _spring(pose: Pose, frame: Frame) -> Items:
    start, end = ends_of(pose, frame.poses, frame.layout)
    length = float(np.hypot(*(end - start)))
    width = frame.layout.size(pose)[0]
    count = int(np.clip(round(frame.layout.rests[pose.shape.name] / (0.75 * width)), 4, 12))
    yield Outline(along(start, end, coils(length, width, count)), frame.theme.ink, 1.2, order=MIDDLE)


def _damper(pose: Pose, frame: Frame) -> Items:
    start, end = ends_of(pose, frame.poses, frame.layout)
    length, rest = float(np.hypot(*(end - start))), frame.layout.rests[pose.shape.name]
    half = 0.5 * frame.layout.size(pose)[0]
    back, front = length - 0.2 * rest, length - 0.72 * rest  # bottom and mouth of the cylinder
    piston = float(np.clip(0.54 * rest, front + 0.04 * rest, back - 0.04 * rest))
    ink = frame.theme.ink

    def line(points: list[tuple[float, float]], width: float) -> Outline:
        return Outline(along(start, end, np.array(points)), ink, width, order=MIDDLE)

    inside = along(start, end, np.array([(front, half), (back, half), (back, -half), (front, -half)]))
    yield Outline(inside, None, 0.0, frame.theme.body, BEHIND)
    yield line([(front, half), (back, half), (back, -half), (front, -half)], 1.4)
    yield line([(0.0, 0.0), (piston, 0.0)], 1.4)
    yield line([(piston, 0.84 * half), (piston, -0.84 * half)], 3.2)
    yield line([(back, 0.0), (length, 0.0)], 1.4)


def _rod(pose: Pose, frame: Frame) -> Items:
    yield Outline(np.array(ends_of(pose, frame.poses, frame.layout)), frame.theme.ink, 2.6, order=MIDDLE)


def _shaft(pose: Pose, frame: Frame) -> Items:
    """Draw a shaft from the side, with lines on its surface that show its twist."""
    start, end = ends_of(pose, frame.poses, frame.layout)
    length, radius = float(np.hypot(*(end - start))), frame.layout.size(pose)[0] / 2
    first, twist = pose.number("angle"), pose.number("twist")
    theme = frame.theme
    side = np.array([(0.0, radius), (length, radius), (length, -radius), (0.0, -radius)])
    yield Outline(along(start, end, side), theme.ink, 1.3, theme.body, MIDDLE)
    share = np.linspace(0.0, 1.0, 121)
    for k in range(3):
        angle = first + twist * share + k * 2 * np.pi / 3
        points = np.column_stack([share * length, radius * np.sin(angle)])
        visible = np.where((np.cos(angle) > 0)[:, None], points, np.nan)
        yield Outline(along(start, end, visible), theme.ink, 1.3 if k else 2.4, order=MIDDLE)


def _arrow(pose: Pose, frame: Frame) -> Items:
    length, unit = float(np.hypot(*pose.vector)), frame.layout.unit
    if length < 1e-3 * unit:
        return
    tip, colour = pose.at + pose.vector, frame.theme.force
    head = min(0.24 * unit, length)
    yield Outline(
        along(pose.at, tip, np.array([[0.0, 0.0], [length - 0.7 * head, 0.0]])), colour, 2.2, order=FRONT
    )
    barbs = np.array([[length, 0.0], [length - head, 0.42 * head], [length - head, -0.42 * head]])
    yield Outline(along(pose.at, tip, barbs), colour, 0.8, colour, FRONT)
    if pose.shape.text:
        # above the tip, or behind the tail if the shaft is there
        is_downward = pose.vector[1] < -0.5 * length
        point = pose.at - 0.3 * unit / length * pose.vector if is_downward else tip + [0.0, 0.3 * unit]
        yield Label(point, pose.shape.text, colour)


def _line(pose: Pose, frame: Frame) -> Items:
    colour = frame.colour(pose, frame.theme.ink)
    yield Outline(pose.points, colour, 3.0 if pose.shape.name in frame.colours else 1.6, order=MIDDLE)


def _body(pose: Pose, frame: Frame) -> Items:
    shows = pose.shape.name in frame.colours
    outline = Outline(pose.points, frame.theme.ink, 1.4, frame.theme.body)
    yield outline
    if shows:
        yield replace(outline, line=frame.colours[pose.shape.name], width=2.6)
    yield from _text(pose, frame, outline_of(pose, frame.layout).mean(axis=0))


_DRAWN: dict[str, Callable[[Pose, Frame], Items]] = {
    "mass": _mass, "ball": _ball, "rotor": _rotor, "wheel": _wheel, "pendulum": _pendulum, "ground": _wall,
    "wall": _wall, "belt": belt, "tank": _tank, "spring": _spring, "damper": _damper, "rod": _rod, "shaft": _shaft,
    "arrow": _arrow, "line": _line, "body": _body,
}  # fmt: skip


def items_of(frame: Frame) -> Items:
    """Yield the outlines and labels of all shapes."""
    for pose in frame.poses.values():
        yield from _DRAWN[pose.shape.kind](pose, frame)
