"""Random expressions: well-formed ones as text, and texts that are nearly expressions."""

from __future__ import annotations

import re

from hypothesis import strategies as st

NAMES = ("a", "b", "x", "omega", "t")

# A template holds {e} for an expression, {c} for a condition, {n} for a name.
_FORMS = (
    "({e} + {e})", "({e} - {e})", "({e}*{e})", "({e}/{e})", "{e} - {e}", "{e}*{e}", "(-{e})", "({e})**2", "({e})**3",
    "({e})**0.5", "({e})**-1", "({e})**(1/3)", "sin({e})", "cos({e})", "tan({e})", "asin({e})", "acos({e})",
    "atan({e})", "sinh({e})", "cosh({e})", "tanh({e})", "exp({e})", "log({e})", "sqrt({e})", "abs({e})",
    "sign({e})", "min({e}, {e})", "max({e}, {e}, {e})", "atan2({e}, {e})", "({e} if {c} else {e})",
)  # fmt: skip
_CONDITIONS = (
    "{n} < {e}", "({e} >= {n})", "{e} <= {n} < {e}", "not ({e} > {e})", "({c} and {c})", "({c} or {c})",
)  # fmt: skip
# Parts of order one, jumps and conditions on names alone: no value hangs on a rounding.
_TAME = (
    "({e} + {e})/2", "({e} - {e})/2", "({e})*({e})", "({e})/(3 + cos({e}))", "-({e})", "sin({e})", "cos({e})",
    "atan({e})", "tanh({e})", "abs({e})", "exp(sin({e}))", "sinh(sin({e}))", "cosh(sin({e}))", "tan(sin({e})/1.2)",
    "asin(sin({e})/1.2)", "acos(sin({e})/1.2)", "log(2 + sin({e}))", "sqrt(2 + sin({e}))", "(2 + sin({e}))**2",
    "(2 + sin({e}))**2.0", "(2 + sin({e}))**0.5", "(2 + sin({e}))**-1", "(2 + sin({e}))**(1/3)",
    "(2 + sin({e}))**{n}", "sign({n})*({e})", "min({e}, {e}, 0.5)", "max({e}, {e})", "atan2({e}, 3 + cos({e}))",
    "({e} if {c} else {e})",
)  # fmt: skip
_TAME_CONDITIONS = (
    "{n} < {n}", "{n} >= 1/2", "0 < {n} <= 0.9", "not {n} > 0.1", "({c} and {c})", "({c} or {n} == 3)",
)  # fmt: skip
_LEAVES = ("{n}", "{n}", "7", "0.25", "12.5", "pi", "1e-5", "2.5E3", ".5", "3.")
_TAME_LEAVES = ("{n}", "{n}", "0.123456", "(1/3)", "pi/4", "1")


def _texts(
    leaves: tuple[str, ...], forms: tuple[str, ...], conditions: tuple[str, ...]
) -> st.SearchStrategy[str]:
    """Texts grown from templates: a form at every level but the deepest, where the leaves are."""

    @st.composite
    def grown(draw: st.DrawFn) -> str:
        def fill(kind: str, depth: int) -> str:
            if kind == "n":
                return draw(st.sampled_from(NAMES))
            if kind == "c":
                chosen = conditions[: -2 if depth == 0 else None]
            else:
                chosen = leaves if depth == 0 else leaves + forms
            template = draw(st.sampled_from(chosen))
            return re.sub(r"\{(\w)\}", lambda mark: fill(mark[1], max(depth - 1, 0)), template)

        return fill("e", draw(st.integers(0, 5)))

    return grown()


expressions = _texts(_LEAVES, _FORMS, _CONDITIONS)
tame = _texts(_TAME_LEAVES, _TAME, _TAME_CONDITIONS)

FRAGMENTS = (
    "a", "x", "1", "2.5", "1e999", "9**9", "**", "*", "+", "-", "/", "(", ")", ",", " ", ".", "=", "==",
    "<", "!=", "!", "sin", "min(", "atan2(", "if", "else", "and", "or", "not", "lambda", "in", "is", "None",
    "True", "__class__", "__import__", "'", '"', "[", "]", "{", "}", ":", ":=", ";", "@", "^", "&", "|",
    "~", "%", "#", "\\", "\n", "\t", "\0", "0x1F", "1_000", "1j", "0b1", "007", "...", "*args", "**kw",
    "await", "yield", "f''", "é", "ﬁ", "\u202e",
)  # fmt: skip
scraps = st.lists(st.sampled_from(FRAGMENTS), max_size=25).map("".join)
