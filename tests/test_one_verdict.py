"""Who sticks and who slips is decided by `verdict` on one combination and by `joint_choice` among several.

A decision elsewhere would have to use their parts, to compare a guard's series with its bounds, or to write a mode.
Each of these stands in a closed list here, with its reason. The published method (`integrators/fixed_step`) and the
oracle (`reference`) have rules of their own on purpose. A node of `mechanics` is decided by complementarity, with
signs of series from here.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import hybridsim

PACKAGE = Path(hybridsim.__file__).parent
OWN_RULES = ("integrators/fixed_step/", "reference/", "mechanics/")
RUN_PATH = ("engine/", "ensemble/", "integrators/")
CHOICE = "engine/events/choice/"
VERDICT, JOINT = f"{CHOICE}verdict.py", f"{CHOICE}joint_choice.py"
COEFFICIENTS = "engine/linear/guard_coefficients.py"

CHOOSERS = {
    f"{CHOICE}candidates.py",
    "engine/events/compiled/resolve_surface.py",
    "engine/events/compiled/resolve_clear.py",
}
# The parts of the rules, and who may use them besides the two modules.
PARTS = {
    "verdict": {f"{CHOICE}event_verdicts.py", "engine/events/compiled/resolve_surface.py"},
    "verdict_with": {"engine/events/compiled/resolve_clear.py"},
    "decreed_zeros": set(),
    "zeros_of_surface": {"engine/events/compiled/resolve_clear.py"},
    "open_question": {"mechanics/series_loop/decision.py"},
    "is_release": set(),
    "kind_of_change": {f"{CHOICE}event_verdicts.py", "engine/events/compiled/guard_series.py"},
    "is_smooth": {f"{CHOICE}event_verdicts.py", "engine/events/compiled/guard_series.py"},
    "joint_choice": CHOOSERS,
    "is_settled": CHOOSERS,
    "rank_candidates": {f"{CHOICE}candidates.py", "engine/events/compiled/resolve_surface.py"},
    "rank_of": {"engine/events/compiled/resolve_clear.py"},
    "is_below_limit": {f"{CHOICE}uniqueness.py", "engine/events/compiled/start.py"},
    "rough_side": {"engine/events/compiled/resolve_clear.py"},
}

# What holds the series of guards with their bounds.
BOUNDED = ("guard_bounds", "judged", "roundings", "largest")
READERS = {
    f"{VERDICT}::verdict": "",
    f"{VERDICT}::value_of": "",
    f"{JOINT}::is_below_limit": "",
    f"{CHOICE}event_verdicts.py::judged": "passes them to the verdict",
    f"{CHOICE}event_verdicts.py::verdict_on_guards": "passes them to the verdict",
    f"{CHOICE}uniqueness.py::below_limits": "passes them to `is_below_limit`",
    "engine/events/compiled/guard_series.py::interpreted_series": "computes them",
    "engine/events/compiled/guard_series.py::guard_series": "computes them",
    "engine/linear/guard_coefficients.py::_row_coefficient": "computes them",
    "engine/linear/guard_coefficients.py::rough_coefficient": "computes them",
    "engine/linear/guard_coefficients.py::linear_series": "computes them",
    "engine/linear/guard_coefficients.py::_exact_series": "computes them",
    "engine/linear/table_rows.py::write_tables": "passes matrices to kernels that compute them",
    "engine/events/compiled/resolve_impact.py::_coefficient": "reads the series of the gap",
    "engine/events/compiled/resolve_ordinary.py::is_alone": "whether a second guard is zero",
    "engine/events/compiled/at_end.py::may_vanish": "whether a guard is zero at a known time",
    "engine/events/compiled/after_segment.py::is_hidden": "whether a zero was located by rounding",
    "engine/events/compiled/after_segment.py::differ_by_rounding": "whether a step was accurate",
    "engine/events/corner_sides.py::sides_along": "the side of a corner follows from its own guard",
    "engine/events/corner_sides.py::_change_of_number": "a whole number follows from its own guards",
    "engine/events/corner_sides.py::_release_jumped": "which guards a whole number moved off zero",
    "engine/events/corner_sides.py::message_on_numbers": "whether a motion can begin on both sides of a whole value",
    "engine/events/first_modes.py::_negative": "automata that leave their modes in any case",
    "engine/events/zeno/hidden_bounces.py::_departure": "where a hidden bounce begins",
    "engine/run/appointment_events.py::events_before_appointment": "whether a guard turns back at a known time",
    "engine/run/locate.py::_bound": "where a guard is zero",
    "engine/run/locate.py::bound": "where a guard is zero",
    "engine/run/locate.py::contradicts_flow": "whether a step is accurate",
    "engine/run/located.py::_is_near": "which guards are zero at an instant",
    "engine/run/located.py::coincident": "which guards are zero at an instant",
    "engine/run/located.py::located": "which guards are zero at an instant",
    "engine/run/located.py::others_near": "which guards are zero at an instant",
    "engine/run/segment_run.py::_at_step_end": "which guards are zero at the end of a step",
    "engine/run/segment_run.py::_is_zero": "where a guard is zero",
    "engine/run/segment_run.py::_take_roots": "which zeros of a step are events",
    "integrators/runge_kutta/segments.py::is_zero": "where a guard is zero",
    "integrators/taylor/segments.py::taylor_segment": "the largest value of each guard on a segment",
}

# What a vector of modes is called.
MODES = ("z", "trial", "z_plus")
WRITERS = {
    f"{CHOICE}cluster_choice.py::_enter": "enters the chosen modes",
    f"{CHOICE}cluster_choice.py::_pinned": "all surfaces held, to project the states",
    f"{CHOICE}event_verdicts.py::with_modes": "one candidate",
    f"{CHOICE}surface_intersection.py::_pull": "modes in which rates are compared",
    "engine/events/compiled/resolve_clear.py::resolve_clear": "candidates, and the chosen mode",
    "engine/events/compiled/resolve_ordinary.py::take_choice": "the target of a declared transition",
    "engine/events/compiled/resolve_surface.py::choose_modes": "candidates, and the chosen modes",
    "engine/events/compiled/resolve_surface.py::choose_surface_modes": "all surfaces held, to project the states",
    "engine/events/compiled/resolve_impact.py::_apply": "all surfaces left, before an impact",
    "engine/events/compiled/resolve_impact.py::_set_sides": "the sides that follow from the signs of guards",
    "engine/events/corner_sides.py::take_corners": "the sides of corners",
    "engine/events/corner_start.py::cross": "a surface that was crossed before the event",
    "engine/events/first_modes.py::_modes_on_sides": "modes by the signs of the surfaces",
    "engine/events/first_modes.py::as_read_by_conditions": "modes in which conditions read the states",
    "engine/events/first_modes.py::certainly_leaving": "each combination of the surfaces at zero",
    "engine/events/jumps/impact.py::_apply": "a gap that opens in an impact",
    "engine/events/jumps/impact.py::_changes": "a gap that closes or opens in an impact",
    "engine/events/jumps/impact.py::_on_gaps": "all gaps held, to project the states",
    "engine/events/jumps/impact.py::_opens": "a gap that opens in an impact",
    "engine/events/resolve.py::_transitions": "the targets of declared transitions",
    "engine/events/event_data.py::take_sides": "modes by the signs of the surfaces",
    "engine/events/zeno/hidden_bounces.py::_series": "the mode of flight between bounces",
    "engine/events/zeno/limits.py::_at_declared_limit": "the declared mode at a limit",
    "engine/events/zeno/limits.py::_gathered": "modes held at a limit",
    "engine/events/zeno/limits.py::_held_at": "modes held at a limit",
    "engine/linear/modes.py::_reason_at": "each combination of modes, to see whether it is linear",
    "engine/linear/modes.py::_linear_beside_corners_at": "each combination of modes, to see whether it is linear",
    "engine/system/sides.py::modes_by_state": "modes by the signs of the surfaces",
    "engine/system/sides.py::violated": "modes by the signs of the surfaces",
    "engine/events/compiled/start.py::_choose_cluster": "all surfaces held, for projection, and the chosen modes",
    "engine/events/compiled/start.py::_take_sides": "modes by the signs of the surfaces",
}


def function_of(tree: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """Each node of a module with the name of the function that contains it."""

    def walk(node: ast.AST, name: str) -> Iterator[tuple[str, ast.AST]]:
        for child in ast.iter_child_nodes(node):
            inner = child.name if isinstance(child, ast.FunctionDef) else name
            yield inner, child
            yield from walk(child, inner)

    yield from walk(tree, "")


def imported(text: str) -> set[str]:
    """Parts of the rules that a module imports."""
    rules = tuple(
        f"hybridsim.{path.removesuffix('.py').replace('/', '.')}" for path in (VERDICT, JOINT, COEFFICIENTS)
    )
    return {
        alias.name
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.ImportFrom) and node.module in rules
        for alias in node.names
    } & set(PARTS)


def readers(text: str) -> set[str]:
    """Functions that read the series of guards with bounds."""
    return {
        name
        for name, node in function_of(ast.parse(text))
        if isinstance(node, ast.Attribute) and node.attr in BOUNDED and name
    }


def writers(text: str) -> set[str]:
    """Functions that write an entry of a vector of modes."""
    found = set()
    for name, node in function_of(ast.parse(text)):
        if isinstance(node, ast.Subscript) and isinstance(node.ctx, ast.Store):
            base = node.value
            if getattr(base, "id", getattr(base, "attr", "")) in MODES:
                found.add(name)
    return found


def sources(within: tuple[str, ...] = RUN_PATH) -> Iterator[tuple[str, str]]:
    """Path and text of the modules that have no rules of their own."""
    for path in sorted(PACKAGE.rglob("*.py")):
        place = path.relative_to(PACKAGE).as_posix()
        if place.startswith(within) and not place.startswith(OWN_RULES):
            yield place, path.read_text(encoding="utf-8")


def test_the_parts_of_the_rules_are_used_where_they_are_said_to_be() -> None:
    users: dict[str, set[str]] = {name: set() for name in PARTS}
    for path in PACKAGE.rglob("*.py"):
        place = path.relative_to(PACKAGE).as_posix()
        for name in imported(path.read_text(encoding="utf-8")):
            users[name].add(place)
    users = {name: places - {VERDICT, JOINT} for name, places in users.items()}
    assert users == PARTS


def test_the_series_of_guards_are_compared_with_their_bounds_by_the_verdict_alone() -> None:
    found = {f"{place}::{name}" for place, text in sources() for name in readers(text)}
    assert found == set(READERS)


def test_modes_are_written_where_they_are_said_to_be() -> None:
    found = {f"{place}::{name}" for place, text in sources() for name in writers(text)}
    assert found == set(WRITERS)


def test_a_verdict_elsewhere_is_found() -> None:
    general = "def sticks(series, g):\n    return series.guards[g, 0] >= -series.guard_bounds[g, 0]\n"
    compiled = "def sticks(work, g):\n    return work.judged[0, g, 0] >= -work.judged[1, g, 0]\n"
    assert readers(general) == readers(compiled) == {"sticks"}
    assert writers("def stop(state, c, hold):\n    state.z[c] = hold[c]\n") == {"stop"}
    by_parts = "from hybridsim.engine.events.choice.joint_choice import rank_of\n"
    assert imported(by_parts) == {"rank_of"}
