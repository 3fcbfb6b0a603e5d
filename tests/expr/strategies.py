"""Random expressions: well-formed ones as text, and texts that are nearly expressions."""

from __future__ import annotations

from hypothesis import strategies as st

NAMES = ("a", "b", "x", "omega", "t")

numbers = st.one_of(
    st.integers(0, 99).map(str),
    st.floats(1e-3, 1e3).map(lambda value: repr(round(value, 4))),
    st.sampled_from(["pi", "1e-5", "2.5E3", ".5", "3."]),
)
leaves = st.one_of(numbers, st.sampled_from(NAMES))
UNARY = (
    "sin",
    "cos",
    "tan",
    "asin",
    "acos",
    "atan",
    "sinh",
    "cosh",
    "tanh",
    "exp",
    "log",
    "sqrt",
    "abs",
    "sign",
)


def _grown(parts: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    conditions = st.one_of(
        st.builds("{} {} {}".format, parts, st.sampled_from(["<", "<=", ">", ">="]), parts),
        st.builds("{} < {} <= {}".format, parts, parts, parts),
        st.builds("not ({} > {})".format, parts, parts),
    )
    joined = st.builds("({} {} {})".format, conditions, st.sampled_from(["and", "or"]), conditions)
    return st.one_of(
        st.builds("({} {} {})".format, parts, st.sampled_from("+-*/"), parts),
        st.builds("{} {} {}".format, parts, st.sampled_from("+-*"), parts).map(lambda text: f"({text})"),
        st.builds("({})**{}".format, parts, st.sampled_from(["2", "3", "0.5", "-1", "(1/3)"])),
        st.builds("-{}".format, parts).map(lambda text: f"({text})"),
        st.builds("{}({})".format, st.sampled_from(UNARY), parts),
        st.builds("{}({}, {})".format, st.sampled_from(["min", "max", "atan2"]), parts, parts),
        st.builds("({} if {} else {})".format, parts, st.one_of(conditions, joined), parts),
    )


expressions = st.recursive(leaves, _grown, max_leaves=12)

FRAGMENTS = (
    "a", "x", "1", "2.5", "1e999", "9**9", "**", "*", "+", "-", "/", "(", ")", ",", " ", ".", "=", "==",
    "<", "!=", "!", "sin", "min(", "atan2(", "if", "else", "and", "or", "not", "lambda", "in", "is", "None",
    "True", "__class__", "__import__", "'", '"', "[", "]", "{", "}", ":", ":=", ";", "@", "^", "&", "|",
    "~", "%", "#", "\\", "\n", "\t", "\0", "0x1F", "1_000", "1j", "0b1", "007", "...", "*args", "**kw",
    "await", "yield", "f''", "é", "ﬁ", "\u202e",
)  # fmt: skip
scraps = st.lists(st.sampled_from(FRAGMENTS), max_size=25).map("".join)
