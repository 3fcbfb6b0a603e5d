"""A repeated option of any command is an error or adds to a list: no value is lost silently."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator

import pytest

from hybridsim.cli.entry import build_parser
from hybridsim.errors import UsageError

POSITIONALS = {
    "advise": ["m"], "check": ["m"], "compare": ["m"], "fit": ["m", "d.csv"], "report": ["m"], "resume": ["r.hsol"],
    "run": ["m"], "steady": ["m"], "study": ["he2026"], "sweep": ["m", "a=1,2"], "cache": ["path"],
    "explain-status": ["finished"],
}  # fmt: skip
REQUIRED = {"advise": ["--quantity", "x"], "fit": ["--unknown", "q=0:1"]}
PAIRS = (("a=1", "b=2"), ("3", "4"), ("0.5", "0.25"), ("one", "two"))


def commands() -> dict[str, argparse.ArgumentParser]:
    (found,) = (a for a in build_parser()._actions if isinstance(a, argparse._SubParsersAction))
    return dict(found.choices)


def options_with_values() -> Iterator[tuple[str, str]]:
    for command, parser in commands().items():
        for action in parser._actions:
            if action.option_strings and action.nargs != 0:
                yield command, action.option_strings[-1]


def parsed(command: str, option: str, *values: str) -> object:
    """Return the value of an option that occurs once with each of some values."""
    line = [command, *POSITIONALS.get(command, [])]
    if option not in REQUIRED.get(command, []):
        line += REQUIRED.get(command, [])
    args = build_parser().parse_args([*line, *(f"{option}={value}" for value in values)])
    action = commands()[command]._option_string_actions[option]
    return getattr(args, action.dest)


def readable_pair(command: str, option: str) -> tuple[str, str]:
    action = commands()[command]._option_string_actions[option]
    if action.choices:
        first, second, *_ = action.choices
        return first, second
    for pair in PAIRS:
        try:
            for value in pair:
                parsed(command, option, value)
        except UsageError:
            continue
        return pair
    raise AssertionError(f"no test value for {command} {option}")


@pytest.mark.parametrize(("command", "option"), list(options_with_values()))
def test_no_value_of_a_repeated_option_is_lost(command: str, option: str) -> None:
    first, second = readable_pair(command, option)
    apart = parsed(command, option, first), parsed(command, option, second)
    assert apart[0] != apart[1]
    try:
        both = parsed(command, option, first, second)
    except UsageError as error:
        assert str(error).startswith(f"{option} occurs twice"), error
        assert not isinstance(apart[0], list | tuple), "a list could be continued"
    else:
        assert list(both) == [*apart[0], *apart[1]]


def test_the_measures_of_a_sweep_add_up(hybridsim: Callable) -> None:
    code, out, err = hybridsim(
        "sweep", "dfcs", "N=40,41", "--measure", "amplitude.x", "--measure", "period", "--json"
    )
    assert code == 0, err
    assert '"amplitude.x"' in out and '"period"' in out


@pytest.mark.parametrize(
    ("command", "option", "value"),
    [
        ("run", "--param", "m=1"),
        ("run", "--x0", "x=1"),
        ("run", "--limit", "steps=9"),
        ("run", "--option", "steps_per_period=9"),
        ("fit", "--unknown", "m=1:2"),
        ("fit", "--column", "F=x"),
        ("fit", "--noise", "x=1"),
        ("advise", "--uncertain", "m=1:2"),
    ],
)
def test_a_name_has_one_value(command: str, option: str, value: str) -> None:
    name = value.split("=")[0]
    with pytest.raises(UsageError, match=f"^{option} {name} occurs twice"):
        parsed(command, option, value, f"{name}=3:4")
