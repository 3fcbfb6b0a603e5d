"""This module evaluates the coordinates of the shapes of a drawing at given times of a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from hybridsim.errors import UsageError
from hybridsim.expr import Expression, evaluate
from hybridsim.expr.grammar import TIME
from hybridsim.model.parts.model import Model
from hybridsim.model.parts.shape import Point, Shape
from hybridsim.solution import Solution

Points = NDArray[np.float64]


@dataclass(frozen=True)
class Pose:
    """The coordinates and sizes of a shape at one time; `ends` contains points, or names of other shapes."""

    shape: Shape
    at: Points
    ends: tuple[Points | str, ...] = ()
    points: Points = field(default_factory=lambda: np.zeros((0, 2)))
    vector: Points = field(default_factory=lambda: np.zeros(2))
    size: tuple[float, ...] = ()
    numbers: Mapping[str, float] = field(default_factory=dict)

    def holds(self, name: str) -> bool:
        """Return whether an end is fixed to the shape with a given name."""
        return any(isinstance(end, str) and end == name for end in self.ends)

    def number(self, name: str, default: float = 0.0) -> float:
        """Return the value of a field such as ``angle``."""
        return self.numbers.get(name, default)


Poses = dict[str, Pose]


def refuse_without_drawing(model: Model) -> None:
    """Raise an error if a model has no drawing."""
    if not model.drawing:
        raise UsageError(
            f"model {model.name} has no drawing",
            remedy="add [drawing] to the model file, or drawing=[hs.Shape(...)] to the hs.Model",
        )


def poses_at(solution: Solution, times: NDArray[np.float64]) -> list[Poses]:
    """Return the poses of all shapes by name, for each time."""
    shapes = solution.model.drawing
    refuse_without_drawing(solution.model)
    names = {name for shape in shapes for _, expr in shape.expressions() for name in expr.names}
    series = _values(solution, names, times)
    constants = {name: float(value) for name, value in series.items() if np.ndim(value) == 0}
    fixed: dict[Expression, float] = {}

    def at(expr: Expression, values: Mapping[str, float]) -> float:
        if expr.names <= constants.keys():
            if expr not in fixed:
                fixed[expr] = evaluate(expr, constants)
            return fixed[expr]
        return evaluate(expr, values)

    found = []
    for k in range(len(times)):
        values = {name: float(value if name in constants else value[k]) for name, value in series.items()}
        found.append({shape.name: _pose(shape, partial(at, values=values)) for shape in shapes})
    return found


def _values(
    solution: Solution, names: set[str], times: NDArray[np.float64]
) -> dict[str, NDArray[np.float64]]:
    """Return the values of quantities at given times; a constant quantity has one value for all times."""
    model = solution.model
    parameters, definitions = model.parameter_values(), dict(model.definitions)
    found: dict[str, NDArray[np.float64]] = {}
    for name in sorted(names):
        if name == TIME:
            found[name] = times
        elif name in parameters:
            found[name] = np.array(parameters[name])
        elif name in definitions and name in model.constant_names():
            inner = _values(solution, set(definitions[name].names), times)
            found[name] = np.array(evaluate(definitions[name], {k: float(v) for k, v in inner.items()}))
        else:
            found[name] = np.asarray(solution.output(name, times))
    return found


def _pose(shape: Shape, value: Callable[[Expression], float]) -> Pose:
    def point(pair: Point | None) -> Points:
        return np.zeros(2) if pair is None else np.array([value(pair[0]), value(pair[1])])

    numbers = {
        name: value(expr)
        for name in ("length", "angle", "twist", "travel", "level", "offset")
        if (expr := getattr(shape, name)) is not None
    }
    return Pose(
        shape,
        point(shape.at),
        tuple(end if isinstance(end, str) else point(end) for end in shape.ends),
        np.array([point(pair) for pair in shape.points]).reshape(-1, 2),
        point(shape.vector),
        tuple(value(expr) for expr in shape.size),
        numbers,
    )
