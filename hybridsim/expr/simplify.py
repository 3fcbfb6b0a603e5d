"""Simplification that soon comes to an end: by identities where little is written, else as quotients of polynomials.

Products of sums grow when they are written out, functions of sums when they are taken apart, and `sympy.simplify` does
both: a formula of one line may take it minutes. Its size when written out says beforehand what is worth trying.
"""

from __future__ import annotations

from typing import Any

import sympy

# Formulas of random sums, products, quotients and functions took sympy.simplify 1 s at most below the first bound, and
# 10 s or more for some above it; as quotients of polynomials they took 0.25 s at most below the second.
_FEW_TERMS = 16
_MANY_TERMS = 200


def simplified(e: Any) -> Any:
    """The same value, in a shorter form where one is soon found; zero where that is seen on the way.

    What functions and roots are of is simplified for itself, and then counts as one name.
    """
    names: dict[Any, Any] = {}
    plain = _named(e, names)
    terms = terms_of(plain)
    if terms > _MANY_TERMS:
        return e
    if terms <= _FEW_TERMS:
        found = sympy.simplify(plain)
    else:
        found = sympy.factor(sympy.cancel(sympy.together(plain)))
    found = found.xreplace({name: part for part, name in names.items()})
    return min(found, e, key=sympy.count_ops)  # written out it may be longer


def written_out(e: Any) -> Any:
    """The same value over one denominator, as the sum that it is.

    Exponentials count as names: exp(-t) would else be a quotient, and all beside it be multiplied by exp(t).
    """
    names = {part: sympy.Dummy(real=True) for part in e.atoms(sympy.exp)}
    found = sympy.expand(sympy.cancel(sympy.together(e.xreplace(names))))
    return found.xreplace({name: part for part, name in names.items()})


def is_short(e: Any) -> bool:
    """Whether an expression stays so when it is written out, its functions' arguments with it."""
    return all(
        terms_of(part) <= _MANY_TERMS for part in (e, *(a for f in e.atoms(sympy.Function) for a in f.args))
    )


def terms_of(e: Any) -> int:
    """How many terms a sum has, at most, when all products in it are written out."""
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
    """An expression with names for what functions and roots are of, and for what is no sum, product or power."""
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
