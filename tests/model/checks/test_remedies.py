"""Faults that readers of the README made: each message names the part, and says what to write instead."""

from __future__ import annotations

import pytest

import hybridsim as hs
from hybridsim.model.checks.doubtful import warnings_of
from hybridsim.model.checks.starting_facts import starting_facts

BLOCK = '[states]\nv = { start = 1, der = "-f" }\n[contacts.f]\nvelocity = "v"\nnormal = 1\n'
# name -> (a file, what the message holds, what the remedy holds)
FAULTS = {
    "no header": (
        f'k = 1\nm = 2.0\n{BLOCK}law = "coulomb"\n',
        "unknown 'k', 'm'",
        "the line [parameters] above them",
    ),
    "argument beside the law": (
        f'{BLOCK}law = "coulomb"\nmu = 0.3\n',
        "contact f: unknown 'mu'",
        '{ name = "coulomb", ',
    ),
    "0/0 in a law": (
        f'{BLOCK}law = {{ name = "stribeck", mu_s = 0.3, mu_k = 0.2, v_s = 0 }}\n',
        "contact f, law stribeck: the constant has no finite real value: division by zero",
        "correct the numbers",
    ),
    "an open table": ("[states\n", "invalid TOML", "[states]"),
    "a name twice": ('[states]\nx = { start = 1, der = "0" }\nx = 2\n', "invalid TOML", "a second time"),
    "a table twice": ("[states]\n[states]\n", "invalid TOML", "a second time"),
    "an open list": ("x = [1, 2", "invalid TOML", "close a list with ]"),
    "an open text": ('x = "abc\n', "invalid TOML", "close the text"),
    "two in a line": ("x = 1 y = 2", "invalid TOML", "one key = value in a line"),
    "no quotes": ("x = -k", "invalid TOML", "double quotes"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_has_its_own_remedy(name: str) -> None:
    text, message, remedy = FAULTS[name]
    with pytest.raises(hs.ModelError) as caught:
        hs.Model.from_toml(text)
    assert message in str(caught.value) and remedy in str(caught.value)


@pytest.mark.parametrize(("rate", "names"), [("-f/2", ["v2"]), ("f/2", [])])
def test_a_reaction_that_drives_the_slip_is_doubtful(rate: str, names: list[str]) -> None:
    """The force on the second body is opposite to the one on the first."""
    model = hs.Model(
        "two",
        states=[hs.State("v1", 1, "-f"), hs.State("v2", 0, rate)],
        contacts=[hs.Contact("f", velocity="v1 - v2", normal=1, law="coulomb", arguments={"mu": 0.3})],
    )
    assert [
        word for one in warnings_of(model) for word in ("v1", "v2") if f"'{word}'" in one.message
    ] == names


@pytest.mark.parametrize(
    ("start", "said"), [(0.5, ["-0.5 at the start: the body begins beyond its stop"]), (1.5, [])]
)
def test_a_start_beyond_a_stop_is_named(start: float, said: list[str]) -> None:
    model = hs.Model(
        "stop",
        states=[hs.State("x", start, "v"), hs.State("v", 0, "p - 1")],
        impacts=[hs.Impact("p", gap="x - 1", restitution=0.5)],
    )
    facts = starting_facts(model)
    assert len(facts) == len(said) and all(word in fact for word, fact in zip(said, facts, strict=True))
