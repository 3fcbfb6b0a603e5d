"""Terms of linear forms and polynomials: states, functions of time, and products of these."""

from __future__ import annotations

from dataclasses import dataclass

Factor = tuple[int, int]  # an atom's number; 1 for the cosine of an angle, else 0
Monomial = tuple[Factor, ...]  # sorted; () is 1


@dataclass(frozen=True, order=True)
class Product:
    """A product of states, or of states and functions of time, which a polynomial has in addition to linear terms."""

    states: tuple[int, ...]  # sorted
    monomial: Monomial

    def __str__(self) -> str:
        """Return the words for a product in a message."""
        return (
            "a product of states" if len(self.states) > 1 else "a product of a state and a function of time"
        )

    def factors(self) -> tuple[int | Monomial, ...]:
        """Return the states and the function of time."""
        return (*self.states, self.monomial) if self.monomial else self.states


Key = int | Monomial | Product  # a state's index, a monomial over atoms, or a product of these
Form = dict[Key, float]
ONE: Monomial = ()


def degree_of(key: Key) -> int:
    """Return the number of factors of a term."""
    if isinstance(key, int):
        return 1
    return len(key.states) + len(key.monomial) if isinstance(key, Product) else len(key)


def joined(left: Key, right: Key) -> Key:
    """Return the product of two terms of forms."""
    states: list[int] = []
    factors: list[Factor] = []
    for key in (left, right):
        if isinstance(key, int):
            states.append(key)
        elif isinstance(key, Product):
            states += key.states
            factors += key.monomial
        else:
            factors += key
    if not states:
        return tuple(sorted(factors))
    if len(states) == 1 and not factors:
        return states[0]
    return Product(tuple(sorted(states)), tuple(sorted(factors)))
