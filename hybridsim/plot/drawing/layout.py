"""This module chooses quantities that are equal in all frames: sizes, lengths of walls, and the visible range."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from hybridsim.plot.drawing.outlines import box_of, circle, on_outline, rectangle, turned
from hybridsim.plot.drawing.poses import Pose, Poses

Points = NDArray[np.float64]

LINES = ("ground", "wall", "belt")  # kinds with a surface
_HATCH = 0.035  # largest depth of hatching as a part of the extent
_SHARE = 0.17  # default size of a body as a part of the extent of all places
_TOUCH = 0.1  # largest distance between a body and the line on which it stands, relative to the unit
_CLOSED = 0.8  # length of a closed damper as a part of its length when it is half open
# Default sizes of each kind, relative to the unit.
_SIZES: dict[str, tuple[float, ...]] = {
    "mass": (1.0, 0.68), "ball": (0.7, 0.7), "rotor": (1.7, 1.7), "wheel": (1.2, 1.2), "pendulum": (0.44, 0.44),
    "belt": (0.62, 0.62), "tank": (1.3, 1.9), "spring": (0.34, 0.34), "damper": (0.34, 0.34), "shaft": (0.34, 0.34),
}  # fmt: skip
_BEYOND, _BEYOND_FIXED = (
    0.62,
    0.4,
)  # of a ground or belt beyond the bodies, and of a wall beyond what is fixed to it


@dataclass(frozen=True)
class Layout:
    """Sizes and ranges that do not change during a run.

    Parameters
    ----------
    unit : the default size of a body.
    hatch : the depth of the hatching behind a ground or wall.
    spans : by name of a ground, wall or belt, its two ends along its direction, counted from its place.
    sides : by name, 1 if the bodies on it are to the left of its direction, otherwise -1.
    hung : the names of the pendulums whose pivot does not move.
    rests : by name of a spring its mean length, and of a damper the length at which it is half open.
    """

    unit: float
    hatch: float
    spans: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    sides: Mapping[str, float] = field(default_factory=dict)
    rests: Mapping[str, float] = field(default_factory=dict)
    hung: frozenset[str] = frozenset()

    def size(self, pose: Pose) -> tuple[float, float]:
        """Return the width and height of a shape."""
        width, *rest = pose.size or [part * self.unit for part in _SIZES[pose.shape.kind]]
        if pose.size and not rest:
            rest = [0.68 * width if pose.shape.kind == "mass" else width]
        return float(width), float(rest[0])


def layout_of(poses: Sequence[Poses]) -> Layout:
    """Return the layout of a drawing from its poses at many times."""
    anchors = [point for one in poses for pose in one.values() for point in _anchors(pose)]
    low, high = box_of(anchors)
    declared = [
        pose.size[0] for pose in poses[0].values() if pose.size and pose.shape.kind in ("mass", "ball")
    ]
    unit = max(declared) if declared else _SHARE * float(np.max(high - low)) or 1.0
    hatch = min(0.17 * unit, _HATCH * float(np.max(high - low)) or unit)
    layout = Layout(unit, hatch)
    bodies = [outline_of(pose, layout) for one in poses for pose in one.values() if _has_body(pose)]
    bodies += [np.vstack([p for p in pose.ends if not isinstance(p, str)]) for one in poses for pose in one.values()
               if any(not isinstance(p, str) for p in pose.ends)]  # fmt: skip
    bodies = bodies or [np.array([(low + high) / 2])]
    spans, sides = {}, {}
    for pose in poses[0].values():
        if pose.shape.kind in LINES:
            name = pose.shape.name
            spans[name] = _span(name, poses, layout, bodies)
            sides[name] = _side(pose, bodies, layout.unit)
    rests: dict[str, float] = {}
    for name, pose in poses[0].items():
        if len(pose.ends) == 2:
            lengths = [np.hypot(*np.subtract(*ends_of(one[name], one, layout))) for one in poses]
            rests[name] = float(np.mean(lengths))
            if pose.shape.kind == "damper":  # its cylinder has room when the damper is shortest
                rests[name] = min(rests[name], float(np.min(lengths)) / _CLOSED)
    hung = frozenset(
        name
        for name, pose in poses[0].items()
        if pose.shape.kind == "pendulum" and all(np.array_equal(one[name].at, pose.at) for one in poses)
    )
    return Layout(unit, hatch, spans, sides, rests, hung)


def _side(pose: Pose, bodies: Sequence[Points], unit: float) -> float:
    """Return the side of a line on which the bodies lie that touch the line, or else on which all bodies lie."""
    direction = direction_of(pose)
    normal = np.array([-direction[1], direction[0]])
    across = [(body - pose.at) @ normal for body in bodies]
    touching = [reach for reach in across if np.min(np.abs(reach)) < _TOUCH * unit < np.max(np.abs(reach))]
    middle = np.mean([np.mean(reach) for reach in touching or across])
    return 1.0 if middle >= 0 else -1.0


def _anchors(pose: Pose) -> Iterator[Points]:
    if pose.shape.at is not None:
        yield pose.at
    yield from (end for end in pose.ends if not isinstance(end, str))
    yield from pose.points
    if pose.shape.kind == "pendulum":
        yield bob_of(pose)


def _has_body(pose: Pose) -> bool:
    return pose.shape.kind not in (*LINES, "spring", "damper", "rod", "shaft", "arrow")


def _span(name: str, poses: Sequence[Poses], layout: Layout, bodies: Sequence[Points]) -> tuple[float, float]:
    """Return the ends of a ground, wall or belt along its direction."""
    pose = poses[0][name]
    if "length" in pose.numbers:
        half = pose.number("length") / 2
        return -half, half
    direction = direction_of(pose)
    others = [(one, other) for one in poses for other in one.values() if other is not pose]

    def share(points: Points) -> list[float]:
        return [float(s) for s in (points.reshape(-1, 2) - pose.at) @ direction]

    if pose.shape.kind == "wall":
        beyond = _BEYOND_FIXED * layout.unit
        held = [np.array(ends_of(other, one, layout)) for one, other in others if other.holds(name)]
        shares = [s for points in held for s in share(points)] or [0.0]
        grounds = [s for one, other in others if other.shape.kind == "ground" for s in share(other.at)]
        low, high = min(shares) - beyond, max(shares) + beyond
        below = [s for s in grounds if s < min(shares)]
        return (max(below) if below else low), high
    beyond = _BEYOND * layout.unit
    shares = [s for body in bodies for s in share(body)] or [0.0]
    if pose.shape.kind == "ground":
        walls = [s for one, other in others if other.shape.kind == "wall" for s in share(other.at)]
        low, high = min(shares) - beyond, max(shares) + beyond
        return min([low, *walls]), max([high, *walls])
    half = max(map(abs, shares)) + beyond
    return -half, half


def direction_of(pose: Pose) -> Points:
    """Return the direction of a ground, wall or belt; at angle 0, a wall points upwards, the others to the right."""
    angle = pose.number("angle") + (np.pi / 2 if pose.shape.kind == "wall" else 0.0)
    return np.array([np.cos(angle), np.sin(angle)])


def bob_of(pose: Pose) -> Points:
    """Return the centre of the bob of a pendulum."""
    angle = pose.number("angle")
    return np.asarray(pose.at + pose.number("length") * np.array([np.sin(angle), -np.cos(angle)]))


def outline_of(pose: Pose, layout: Layout) -> Points:
    """Return the outline of a body."""
    kind = pose.shape.kind
    if kind in ("line", "body"):
        return pose.points
    width, height = layout.size(pose)
    if kind in ("mass", "tank"):
        return turned(rectangle(pose.at, width, height), pose.number("angle"), pose.at)
    return circle(centre_of(pose, layout), width / 2)


def centre_of(pose: Pose, layout: Layout) -> Points:
    """Return the centre of a body."""
    if pose.shape.kind == "pendulum":
        return bob_of(pose)
    if pose.shape.kind in ("mass", "ball", "tank"):
        up = np.array([0.0, layout.size(pose)[1] / 2])
        angle = pose.number("angle") if pose.shape.kind == "mass" else 0.0
        return turned(pose.at + up, angle, pose.at)
    return pose.at


def ends_of(pose: Pose, poses: Poses, layout: Layout) -> tuple[Points, Points]:
    """Return both ends of a spring, damper, rod or shaft, on the outlines of the shapes to which it is fixed."""
    held = [poses[end] if isinstance(end, str) else None for end in pose.ends]
    middle: list[Points | None] = [
        end if not isinstance(end, str) else centre_of(other, layout) if other and _has_body(other) else None
        for end, other in zip(pose.ends, held)
    ]
    for k in (0, 1):  # an end at a wall is opposite to the other end
        if middle[k] is None:
            other, wall = middle[1 - k], held[k]
            assert wall is not None
            d = direction_of(wall)
            middle[k] = wall.at if other is None else wall.at + d * float((other - wall.at) @ d)
    first, second = middle[0], middle[1]
    assert first is not None and second is not None
    way = second - first
    length = float(np.hypot(*way)) or 1.0
    direction = way / length
    shift = pose.number("offset") * np.array([-direction[1], direction[0]])
    found = []
    for point, body, sign in ((first, held[0], 1.0), (second, held[1], -1.0)):
        start = point + shift
        if body is not None and _has_body(body):
            start = on_outline(start, sign * direction, outline_of(body, layout))
        found.append(start)
    return found[0], found[1]
