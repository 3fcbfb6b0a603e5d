"""This module simplifies SymPy expressions with limited effort.

`sympy.simplify` expands products of sums and functions of sums, which may take minutes for a formula of one line. The
number of terms after expansion therefore decides which simplification is tried.
"""

from __future__ import annotations

from typing import Any

import sympy

# For random formulas with at most _CHEAP_TERMS terms sympy.simplify took at most 1 s, and above this limit sometimes
# more than 10 s. With at most _MANY_TERMS terms, quotients of polynomials took at most 0.25 s.
_CHEAP_TERMS = 16
_MANY_TERMS = 200


def simplified(e: Any) -> Any:
    """Return an equal expression in a shorter form if one is found quickly.

    Arguments of functions and roots are simplified separately and then treated as names.
    """
    names: dict[Any, Any] = {}
    plain = _named(e, names)
    terms = terms_of(plain)
    if terms > _MANY_TERMS:
        return e
    if terms <= _CHEAP_TERMS:
        found = sympy.simplify(plain)
    else:
        found = sympy.factor(sympy.cancel(sympy.together(plain)))
    found = found.xreplace({name: part for part, name in names.items()})
    return min(found, e, key=sympy.count_ops)  # the expanded form may be longer


def written_out(e: Any) -> Any:
    """Return an equal expression, expanded to a sum over one denominator.

    Exponentials are treated as names. Otherwise exp(-t) would become a quotient, and all other terms would be
    multiplied by exp(t).
    """
    names = {part: sympy.Dummy(real=True) for part in e.atoms(sympy.exp)}
    found = sympy.expand(sympy.cancel(sympy.together(e.xreplace(names))))
    return found.xreplace({name: part for part, name in names.items()})


def is_short(e: Any) -> bool:
    """Return whether an expression, including the arguments of its functions, stays short when expanded."""
    return all(
        terms_of(part) <= _MANY_TERMS for part in (e, *(a for f in e.atoms(sympy.Function) for a in f.args))
    )


def factor_between(one: Any, other: Any) -> float | None:
    """Return the number c != 0 for which one = c*other, or None if no such number is found quickly."""
    if one.free_symbols != other.free_symbols or not one.free_symbols:
        return None
    if not (is_short(one) and is_short(other)):
        return 1.0 if one == other else None
    name = min(one.free_symbols, key=str)
    factor = sympy.diff(one, name) / sympy.diff(other, name)
    if not factor.is_number or not factor.is_finite or factor.is_zero:
        return None
    return float(factor) if sympy.expand(one - factor * other) == 0 else None


def terms_of(e: Any) -> int:
    """Return an upper bound of the number of terms after expansion of all products."""
    if e.is_Add:
        return sum(map(terms_of, e.args))
    if e.is_Mul:
        count = 1
        for factor in e.args:
            count *= terms_of(factor)
        return count
    if e.is_Pow and e.exp.is_Integer:
        return int(terms_of(e.base) ** min(abs(int(e.exp)), _MANY_TERMS))
    return 1


def _named(e: Any, names: dict[Any, Any]) -> Any:
    """Replace function arguments and parts that are not polynomials by names, and return the expression."""
    if e.is_Symbol or e.is_number:
        return e
    if e.is_Pow and not e.exp.is_Integer:
        return e.func(_name(simplified(e.base), names), _named(e.exp, names))
    if e.is_Add or e.is_Mul or e.is_Pow:
        return e.func(*(_named(part, names) for part in e.args))
    if isinstance(e, sympy.Function) and len(e.args) == 1:
        return e.func(_name(simplified(e.args[0]), names))
    return _name(e, names)


def _name(part: Any, names: dict[Any, Any]) -> Any:
    if part.is_Symbol or part.is_number:
        return part
    if part not in names:
        names[part] = sympy.Dummy(real=True)
    return names[part]
