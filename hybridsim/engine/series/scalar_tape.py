"""This module converts a function of a few arguments to an optimised instruction tape."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp

from hybridsim.engine.series.operations import ABS, ANGLE, EQUAL, INTEGRAL
from hybridsim.engine.series.optimise import optimised
from hybridsim.engine.series.tape import TapeBuilder
from hybridsim.errors import ModelError
from hybridsim.expr import Expression
from hybridsim.expr.symbolic import to_sympy


@dataclass(frozen=True)
class ScalarTape:
    """The optimised instruction tape of one function, with the registers of its arguments and of its value.

    Parameters
    ----------
    registers : number of registers.
    constant_rows, rows : rows that run once, and rows that run at every order.
    moving, constants : register of each argument.
    numbers : register and value of each number in the expression.
    out : register of the value.
    """

    registers: int
    constant_rows: np.ndarray
    rows: np.ndarray
    moving: tuple[int, ...]
    constants: tuple[int, ...]
    numbers: tuple[tuple[int, float], ...]
    out: int


@lru_cache(maxsize=256)
def scalar_tape(
    expression: Expression, moving: tuple[str, ...], constants: tuple[str, ...], positive: str
) -> ScalarTape:
    """Return the optimised instruction tape of an expression.

    Parameters
    ----------
    moving, constants : names of the arguments that vary in time, and of the constant ones.
    positive : name of the argument that varies in time and is never negative.

    Raises
    ------
    ModelError
        If the expression has a corner or a jump, or a power that has no Taylor series at zero.
    """
    form = _form(expression, (*moving, *constants), positive)
    _refuse_powers(expression, form, moving)
    builder = TapeBuilder()
    inputs = [builder.register(f"v_{name}") for name in moving]
    constant_registers = [builder.register(f"v_{name}") for name in constants]
    clock = builder.register("clock")
    rows = builder.rows([("value", form)], {})
    corners = [row for row in rows if ABS <= row[0] <= EQUAL or (row[0] == INTEGRAL and row[3] == ANGLE)]
    if corners:
        raise ModelError(
            f"'{expression.text}' has a corner or a jump",
            place=expression.place,
            remedy="use a smooth expression",
        )
    tape: dict[str, Any] = {
        "registers": builder.count,
        "states": inputs,
        "time": clock,
        "derivatives": [],
        "guards": [],
        "surfaces": [],
        "monitors": [builder.register("value")],
    }
    tape_form = optimised(tape, rows, [])
    return ScalarTape(
        builder.count,
        tape_form.constant_rows,
        tape_form.rows,
        tuple(inputs),
        tuple(constant_registers),
        tuple((register, value) for (value, _), register in builder.constants.items()),
        int(tape_form.monitors[0]),
    )


@lru_cache(maxsize=256)
def is_same(first: Expression, second: Expression, vanishing: str) -> bool:
    """Return whether two expressions agree algebraically when one of their arguments is zero."""
    from hybridsim.expr.simplify import simplified

    names = tuple(sorted(first.names | second.names | {vanishing}))
    difference = _form(first, names, "") - _form(second, names, "")
    return bool(simplified(difference.subs(sp.Symbol(f"v_{vanishing}", real=True), 0)) == 0)


def _form(expression: Expression, names: Sequence[str], positive: str) -> Any:
    plain = {name: sp.Symbol(f"v_{name}", real=True) for name in names}
    form = to_sympy(expression, plain)
    if positive in plain:  # so that |v| is v
        marked = sp.Symbol(f"v_{positive}", nonnegative=True)
        form = form.subs(plain[positive], marked)
    return form


def _refuse_powers(expression: Expression, form: Any, moving: Sequence[str]) -> None:
    names = {f"v_{name}" for name in moving}
    for power in form.atoms(type(form**0.123)) if form.free_symbols else ():
        if not power.is_Pow:
            continue
        moves = {s.name for s in power.base.free_symbols} & names
        if moves and power.base.subs({s: 0 for s in power.base.free_symbols if s.name in names}) == 0:
            whole = power.exp.is_number and float(power.exp).is_integer()
            if not whole:
                raise ModelError(
                    f"'{expression.text}' has no Taylor series at rest: its power {power.exp} has a base that is "
                    "zero there",
                    place=expression.place,
                    remedy="use a law with integer powers, or convert with to_model() and use dop853",
                )
