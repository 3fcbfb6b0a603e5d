"""This module computes linear forms of a model's quantities in states and functions of time.

A register that depends on time alone is a polynomial over atoms: local time, sines and cosines of angles that
grow linearly, exponentials of linear time, and values that are constant in a segment. Derivatives of such
polynomials are such polynomials, so the states and the monomials that occur obey one linear system with
constant coefficients.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from hybridsim.engine.linear.recipe import Traced, computed
from hybridsim.engine.linear.terms import ONE, Form, Key, Monomial, Product, degree_of, joined
from hybridsim.engine.series import operations as ops
from hybridsim.engine.system.failures import StepFailure

TIME, VALUE, ANGLE, GROWTH = range(4)  # kinds of atoms
Read = Form | float  # a register that is a plain number is stored as a float

_PAIRED = (ops.SINCOS, ops.SINHCOSH, ops.TANGENT)
_SINGLE = (ops.NEG, ops.ABS, ops.SIGN, ops.NOT, ops.EXP, ops.SQRT, ops.SINCOS, ops.SINHCOSH, ops.TANGENT)
_HIGHEST = (
    8  # largest degree of a monomial or product; the closure under derivatives would be large beyond it
)
MOST_PRODUCTS = 64  # most products of states in the guards of a model


class NotLinear(StepFailure):
    """Raised if a rate or a guard is not linear in the states; the text names the nonlinear operation."""


class DividesByZero(NotLinear):
    """Raised for a division by zero, which occurs if several modes determine the same force."""


@dataclass(frozen=True)
class Atom:
    """A basic function of time: local time, a constant, or a function whose angle or exponent is linear in time."""

    kind: int
    rate: float
    offset: float
    terms: tuple[tuple[int, float], ...]  # (source in p, weight)


class Atoms:
    """The basic functions of time found so far, with numbers; number 0 is local time."""

    def __init__(self) -> None:
        self.known: list[Atom] = [Atom(TIME, 1.0, 0.0, ())]

    def number(self, atom: Atom) -> int:
        """Return the number of a basic function of time; a new function gets the next number."""
        if atom not in self.known:
            self.known.append(atom)
        return self.known.index(atom)

    def derivative(self, monomial: Monomial) -> Form:
        """Return the derivative of a monomial with respect to time."""
        result: Form = {}
        for i, (a, part) in enumerate(monomial):
            rest, atom = monomial[:i] + monomial[i + 1 :], self.known[a]
            if atom.kind == TIME:
                _accumulate(result, rest, 1.0)
            elif atom.kind == GROWTH:
                _accumulate(result, monomial, atom.rate)
            elif atom.kind == ANGLE:
                other = tuple(sorted((*rest, (a, 1 - part))))
                _accumulate(result, other, atom.rate if part == 0 else -atom.rate)
        return result

    def closure(self, monomials: Iterable[Monomial]) -> list[Monomial]:
        """Return some monomials, and all monomials that occur in their derivatives."""
        found: list[Monomial] = []
        waiting = sorted(set(monomials))
        while waiting:
            monomial = waiting.pop()
            if monomial not in found:
                found.append(monomial)
                waiting += [m for m in self.derivative(monomial) if isinstance(m, tuple)]
        return sorted(found, key=lambda m: (len(m), m))


def _accumulate(form: Form, key: Key, weight: float) -> None:
    form[key] = form.get(key, 0.0) + weight
    if form[key] == 0.0:
        del form[key]


class LinearReader:
    """Computes the linear forms of the registers of one instruction tape, for given values of the parameters.

    constants: (register, value); parameters: (register, source in p); varying: sources that differ from
    segment to segment; p: the run-time vector, from which only the other sources are read, as numbers or as
    numbers of a `hybridsim.engine.linear.recipe`. If p is None, the form must hold for any values: a
    parameter and everything computed from parameters alone is then NaN, and a condition on it cannot be read.
    A register that is a linear form in this case is one at any values, since special values can only make
    terms vanish. keeps_products: whether registers may be polynomials of the states.
    """

    def __init__(
        self,
        atoms: Atoms,
        time: int,
        states: Iterable[int],
        constants: Iterable[tuple[int, float]],
        parameters: Iterable[tuple[int, int]],
        varying: range,
        p: Sequence[float] | None,
        keeps_products: bool,
    ) -> None:
        self.atoms, self.is_open, self._keeps_products = atoms, p is None, keeps_products
        self.forms: dict[int, Read | NotLinear] = {time: {((0, 0),): 1.0}}
        self.forms |= {register: {i: 1.0} for i, register in enumerate(states)}
        self.forms |= constants
        for register, source in parameters:
            if source in varying:
                value_of = Atom(VALUE, 0.0, 0.0, ((source, 1.0),))
                self.forms[register] = {((atoms.number(value_of), 0),): 1.0}
            else:
                self.forms[register] = math.nan if p is None else p[source]

    def read(self, rows: Iterable[tuple[int, ...]]) -> None:
        """Convert instructions of a tape to linear forms; store the reason if a result is nonlinear."""
        for op, a, b, c, out in rows:
            if op == ops.COPY:
                self.forms[out] = self.forms[a]
                continue
            try:
                found = self._apply(op, a, b, c)
            except NotLinear as reason:
                self.forms[out] = reason
                if op in _PAIRED:
                    self.forms[out + 1] = reason
                continue
            self.forms[out] = found[0]
            if len(found) > 1:
                self.forms[out + 1] = found[1]

    def form(self, register: int) -> Form:
        """Return the linear form of a register, or raise NotLinear."""
        found = self.polynomial(register)
        for key in found:
            if isinstance(key, Product):
                raise NotLinear(str(key))
        return found

    def polynomial(self, register: int) -> Form:
        """Return the polynomial of a register, or raise NotLinear."""
        return _form(self._read(register))

    def _read(self, register: int) -> Read:
        found = self.forms[register]
        if isinstance(found, NotLinear):
            raise found
        return found

    def _apply(self, op: int, a: int, b: int, c: int) -> tuple[Read, ...]:
        first = self._read(a)
        if op == ops.SELECT:
            if isinstance(first, dict) or (self.is_open and math.isnan(first)):
                raise NotLinear("a condition on a state or on time")
            return (self._read(b) if first != 0.0 else self._read(c),)
        if op in _SINGLE:
            if isinstance(first, float):
                return self._evaluated(op, b, c, first)
            return self._of_form(op, first)
        second = self._read(b)
        if isinstance(first, float) and isinstance(second, float):
            if op in _ARITHMETIC and (op != ops.DIV or second != 0.0):
                return (_ARITHMETIC[op](first, second),)
            return self._evaluated(op, b, c, first, second)
        if op in (ops.ADD, ops.SUB):
            return (_plain(_sum(_form(first), _form(second), 1.0 if op == ops.ADD else -1.0)),)
        if op == ops.MUL:
            return (_plain(_product(_form(first), _form(second), self._keeps_products)),)
        if op == ops.DIV and isinstance(first, dict) and isinstance(second, float):
            if second == 0.0:
                raise DividesByZero("a division by zero")
            return (_plain({key: weight / second for key, weight in first.items()}),)
        raise NotLinear(_IN_THE_WAY.get(op, _OTHER))

    def _of_form(self, op: int, form: Form) -> tuple[Read, ...]:
        """Apply an operation to one linear form that is not constant."""
        if op == ops.NEG:
            return ({key: -weight for key, weight in form.items()},)
        if op == ops.SINCOS:
            number = self.atoms.number(_linear_atom(ANGLE, form, self.atoms))
            return {((number, 0),): 1.0}, {((number, 1),): 1.0}
        if op == ops.EXP:
            return ({((self.atoms.number(_linear_atom(GROWTH, form, self.atoms)), 0),): 1.0},)
        raise NotLinear(_IN_THE_WAY.get(op, _OTHER))

    def _evaluated(self, op: int, b: int, c: int, *values: float) -> tuple[Read, ...]:
        """Apply an operation to numbers."""
        if op == ops.NEG:
            return (-values[0],)
        if self.is_open and any(map(math.isnan, values)):
            return (math.nan, math.nan) if op in _PAIRED else (math.nan,)
        for value in values:
            if isinstance(value, Traced):
                found = value.numbers.operation(op, values, b, c)
                return found if op in _PAIRED else found[:1]
        first, second = computed(op, values, b, c)
        return (first, second) if op in _PAIRED else (first,)


_ARITHMETIC = {ops.ADD: operator.add, ops.SUB: operator.sub, ops.MUL: operator.mul, ops.DIV: operator.truediv}
_OTHER = "a corner, a jump or another nonlinear function of a state or of time"
_IN_THE_WAY = {
    ops.DIV: "a division by a state or by a function of time",
    ops.SQRT: "a square root of a state or of a function of time",
    ops.SINHCOSH: "a hyperbolic function of a state or of time",
    ops.TANGENT: "a tangent or a tanh of a state or of time",
}


def _form(read: Read) -> Form:
    if isinstance(read, dict):
        return read
    return {ONE: read} if read != 0.0 else {}


def _plain(form: Form) -> Read:
    """Convert a linear form that is a single number to this number."""
    if not form:
        return 0.0
    return form[ONE] if len(form) == 1 and ONE in form else form


def _sum(a: Form, b: Form, sign: float) -> Form:
    result = dict(a)
    for key, weight in b.items():
        _accumulate(result, key, sign * weight)
    return result


def _product(a: Form, b: Form, keeps_products: bool) -> Form:
    """Return the product of two forms, or raise NotLinear if it has a product of states that is not kept."""
    result: Form = {}
    for left, u in a.items():
        for right, v in b.items():
            key = joined(left, right)
            if degree_of(key) > _HIGHEST:
                of = "functions of time" if isinstance(key, tuple) else "states and functions of time"
                raise NotLinear(f"a product of more than {_HIGHEST} {of}")
            if isinstance(key, Product) and not keeps_products:
                raise NotLinear(str(key))
            _accumulate(result, key, u * v)
    if sum(isinstance(key, Product) for key in result) > MOST_PRODUCTS:
        raise NotLinear(f"more than {MOST_PRODUCTS} products of states")
    return result


def _linear_atom(kind: int, form: Form, atoms: Atoms) -> Atom:
    """Return the basic function of an angle or exponent, which must be linear in time and free of states."""
    rate, offset, terms = 0.0, 0.0, []
    for key, weight in form.items():
        if key == ONE:
            offset = weight
        elif isinstance(key, tuple) and len(key) == 1 and atoms.known[key[0][0]].kind == TIME:
            rate = weight
        elif isinstance(key, tuple) and len(key) == 1 and atoms.known[key[0][0]].kind == VALUE:
            terms += [(source, weight * w) for source, w in atoms.known[key[0][0]].terms]
        else:
            raise NotLinear("a sine or an exponential whose argument is not linear in time")
    return Atom(kind, rate, offset, tuple(sorted(terms, key=operator.itemgetter(0))))
