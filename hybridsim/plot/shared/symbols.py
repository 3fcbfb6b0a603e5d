"""This module writes names and units as symbols: theta as the Greek letter, w_bit with an index, m/s^2 as m/s²."""

from __future__ import annotations

import re

from hybridsim.plot.shared.style import literal

_GREEK = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "epsilon": "ε", "zeta": "ζ", "eta": "η", "theta": "θ",
    "kappa": "κ", "lambda": "λ", "mu": "µ", "nu": "ν", "xi": "ξ", "rho": "ρ", "sigma": "σ", "tau": "τ", "phi": "φ",
    "chi": "χ", "psi": "ψ", "omega": "ω", "Gamma": "Γ", "Delta": "Δ", "Theta": "Θ", "Lambda": "Λ", "Phi": "Φ",
    "Psi": "Ψ", "Omega": "Ω",
}  # fmt: skip
_SYMBOL = re.compile(rf"({'|'.join(_GREEK)}|[A-Za-z])(\d*)(?:_(\w+))?")
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_UNITS = {"us": "µs", "um": "µm", "degC": "°C", "deg": "°", "ohm": "Ω", "Ohm": "Ω"}


def label_of(name: str, title: str) -> tuple[str, str]:
    """Return the title and the symbol of a quantity on an axis; a title replaces a name that is not a symbol.

    The name of a quantity of a part remains, because its title does not name the part.
    """
    if title and "." not in name and _SYMBOL.fullmatch(name) is None:
        return literal(title), ""
    return literal(title), symbol_of(name)


def symbol_of(name: str) -> str:
    """Return the symbol of a quantity: a letter with an index if the name has this form, otherwise the name."""
    found = _SYMBOL.fullmatch(name)
    if found is None:
        return literal(name)
    letter, number, index = found.groups()
    below = ",".join(part for part in (number, *(index or "").split("_")) if part)
    return _GREEK.get(letter, letter) + (rf"$_{{\mathregular{{{below}}}}}$" if below else "")


def unit_text(unit: str) -> str:
    """Return a unit with raised exponents and the usual signs, such as m/s² for m/s^2."""
    raised = re.sub(r"(?:\^|\*\*)(-?\d+)", lambda power: power[1].translate(_RAISED), unit)
    return literal(re.sub(r"[A-Za-z]+", lambda word: _UNITS.get(word[0], word[0]), raised).replace("*", "·"))
