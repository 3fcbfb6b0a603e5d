"""This module checks the shapes of a drawing; the module `expressions` checks their coordinates."""

from __future__ import annotations

from hybridsim.model.checks.names import check_labels
from hybridsim.model.checks.scope import Scope
from hybridsim.model.parts.shape import HOLDS, KINDS, Shape


def check_drawing(scope: Scope) -> None:
    """Report unknown kinds, missing or superfluous fields, and unknown names."""
    shapes = scope.model.drawing
    check_labels(scope, "shape", shapes)
    holding = [shape.name for shape in shapes if shape.kind in HOLDS]
    modes = {*scope.all_names, *(component.name for component in scope.components)}
    for shape in shapes:
        if shape.kind not in KINDS:
            scope.unknown(shape, f"shape {shape.name}: unknown kind", shape.kind, KINDS, "kinds")
            continue
        _fields(scope, shape)
        for end in shape.ends:
            if isinstance(end, str) and end not in holding:
                scope.unknown(
                    shape, f"shape {shape.name}: nothing can be fixed to", end, holding, "other shapes"
                )
        # a regularised model keeps the name of a contact as a quantity without modes
        if shape.mode_of and shape.mode_of not in modes:
            names = [component.name for component in scope.components]
            scope.unknown(shape, f"shape {shape.name}: unknown component", shape.mode_of, names, "components")


def _fields(scope: Scope, shape: Shape) -> None:
    required, optional = KINDS[shape.kind]
    fields = shape.fields()
    for name in required:
        if name not in fields:
            remedy = f"a shape of kind {shape.kind} needs {', '.join(required)}"
            scope.fail(shape, f"shape {shape.name}: '{name}' is missing", remedy)
    for name in fields:
        if name not in (*required, *optional):
            known = ", ".join((*required, *optional))
            scope.fail(shape, f"shape {shape.name}: a {shape.kind} has no '{name}'", f"it can have {known}")
