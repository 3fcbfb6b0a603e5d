"""Values, names and expressions that a program should meet with a message and nothing else."""

from __future__ import annotations

import random

CANARY = "fuzz_canary"  # a builtin function and a module of this name; both tell when they are reached

NUMBERS = (
    "nan", "inf", "-inf", "-1", "0", "-0.0", "1e308", "1e-308", "5e-324", "1e999", "-1e999", "1e17", "1_000",
    "0x10", "0b1", "1e", ".5", "5.", "--3", "+-3", "1,5", "1e+", "00", "9" * 400, "9" * 5000, "1e-999", "true",
    "3j", "1e5T", "0T", "infT", "nanT", "2**31", "2**63", "1000000000", "1000000000000000000000",
)  # fmt: skip

TYPES = (
    "true", "[]", "{}", "[[]]", "[1, 2]", "{ a = 1 }", "2026-01-01", "07:30:00", '""', "''", '"""\n\n"""',
    "[[[[[[]]]]]]", '["x", 1]', "{ value = 1, unit = 3 }", '{ value = "x" }', '{ start = "t" }', "{ expr = 0 }",
)  # fmt: skip

CODE = (
    f"{CANARY}()",
    f"__import__('{CANARY}')",
    f"().__class__.__bases__[0].__subclasses__() or {CANARY}()",
    f"(lambda: {CANARY}())()",
    f"(y := {CANARY}())",
    f"[{CANARY}() for _ in (1,)]",
    f"{{{CANARY}(): 1}}",
    f"f'{{{CANARY}()}}'",
    f"eval('{CANARY}()')",
    f"exec('import {CANARY}')",
    f"open('{CANARY}', 'w')",
    f"x if {CANARY}() else x",
    f"sin(*[{CANARY}()])",
    f"sin(x={CANARY}())",
    f"x; import {CANARY}",
    f"x\nimport {CANARY}",
    f"x\\\n+{CANARY}()",
    f"1 #\n{CANARY}()",
    f"'{{0.__class__}}'.format({CANARY}())",
    f"await {CANARY}()",
    f"(yield {CANARY}())",
    f"x[{CANARY}()]",
    f"{CANARY}.{CANARY}",
    f"@{CANARY}",
    f"$({CANARY})",
    f"`{CANARY}`",
    f"'); {CANARY}(); ('",
    f"x), {CANARY}(), (x",
    "__builtins__", "__name__", "self", "x.__class__", "x.real", "t.__init__", "None", "True", "...", "...+x",
    "'x'", "b'x'", "x = 1", "x == x", "x < x < x", "x and x", "not x", "x @ x", "x // x", "x % x", "x << 3", "~x",
    "x is x", "x in x", "*x", "**x", "x,", "x, x", "x:", "x ? 1 : 0", "x^2", "2x", "3 x", "x(", "x)", "(x", "()",
)  # fmt: skip

HARD = (
    "9**9**9", "9**9**9**9", "(9**9)**(9**9)", "2**-2**99", "10**10**10", "x**x**x**x**x", "0**0", "0**-1", "1/0",
    "x/0", "0/0", "x/(x - x)", "1e308*1e308", "exp(1e9)", "exp(exp(exp(exp(x))))", "log(0)", "log(-1)", "sqrt(-1)",
    "sqrt(-x)", "x**0.5", "x**(1/3)", "x**-1.5", "(-1)**0.5", "(-8)**(1/3)", "asin(2)", "acos(x*9)", "tan(pi/2)",
    "atan2(0, 0)", "abs(x)", "sign(x)", "max(x)", "max()", "min(x, 0, 1)", "x if x > 0 else -x", "sin(1/x)",
    "1/sin(t)", "exp(-1/x**2)", "t**99", "x*1e308", "x**2*1e3", "-x*1e12", "sin(1e9*t)", "1e400*x", "nan*x", "inf",
    "sin()", "sin(x, x)", "foo(x)", "pi", "e", "tanh(x/1e-300)", "factorial(9)", "gamma(x)", "Abs(x)", "I*x", "zoo",
)  # fmt: skip

UNICODE = (
    "\u03c9", "\u00e9", "\u0435", "\u200b", "\u202e", "\u2212", "\ud7ff", "\U0001f600", "\ufeff", "\u0000", "\x1b[31m",
    "\x7f", "\u00b2", "\u00bd", "\u0661", "e\u0301", "\u2028",
)  # fmt: skip

PLACES = (
    "/dev/zero", "/dev/full", "/dev/null", "/etc/passwd", "../../../../etc/passwd", "/", ".", "..", "", "~", "nowhere",
    "nowhere/x.csv", "x" * 300, "x\u0000y", "case.toml", "records/ground-motion.csv", "file:///etc/passwd", "|ls",
    "http://localhost/x", "../outside.csv", "out.csv", "out.npz", "out.png", "out.svg", "out.pdf", "out.hsol", "-",
)  # fmt: skip


def long_expression(pick: random.Random, name: str) -> str:
    """An expression that is deep or long, in one of many ways."""
    n = pick.choice((20, 90, 300, 1000, 3000, 20000))
    small = min(n, 1000)
    return pick.choice(
        (
            "(" * n + name + ")" * n,
            "-" * n + name,
            "sin(" * small + name + ")" * small,
            "exp(" * small + name + ")" * small,
            "+".join([name] * n),
            "*".join([name] * n),
            "**".join([name] * small),
            f"({name} + 1)**{n}",
            f"({name} + t + 1)**{n}",
            "*".join(f"({name} + {k})" for k in range(small)),
            "/".join([name] * n),
            f"sin({name})*" * small + "1",
            f"({name} if {name} > 0 else " * small + "1" + ")" * small,
            f"abs({name} - " * min(n, 40) + "1" + ")" * min(n, 40),
            f"max({name}, " + ", ".join(f"{k}*{name}" for k in range(small)) + ")",
            name * n,
            " " * n + name,
            f"{name}.{name}" * n,
        )
    )


def nasty_expression(pick: random.Random, names: list[str]) -> str:
    """An expression that is code, or hard, or long, over names of the model itself."""
    name = pick.choice(names) if names else "x"
    kind = pick.random()
    if kind < 0.35:
        text = pick.choice(CODE)
    elif kind < 0.8:
        text = pick.choice(HARD)
    else:
        return long_expression(pick, name)
    for old in ("x", "y"):
        text = text if CANARY in text else replaced_name(text, old, name)
    return f"{name} + {text}" if pick.random() < 0.3 else text


def replaced_name(text: str, old: str, new: str) -> str:
    """A name by another where it stands alone."""
    import re

    return re.sub(rf"(?<![\w.]){old}(?!\w)", lambda _: new, text)


def misspelt(pick: random.Random, word: str) -> str:
    """A slip of the pen."""
    if not word:
        return "x"
    k = pick.randrange(len(word))
    other = pick.choice((*"abcxyz_019.-:= ", *UNICODE))
    return pick.choice(
        (
            word[:k] + word[k + 1 :],
            word[:k] + other + word[k:],
            word[:k] + other + word[k + 1 :],
            word[:k] + word[k : k + 2][::-1] + word[k + 2 :],
            word.upper(),
            word + word,
            word[:k],
        )
    )
