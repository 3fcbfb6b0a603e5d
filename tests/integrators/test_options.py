"""The options of every integrator are listed with what they do; a docstring that forgets one is a fault."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, ClassVar, Literal

import pytest

import hybridsim as hs
from hybridsim.integrators.options import options_of


@pytest.mark.parametrize("cls", hs.list_integrators(), ids=lambda cls: cls.name)
def test_every_option_says_what_it_does(cls: type[Any]) -> None:
    options = options_of(cls)
    assert [option.name for option in options] == [field.name for field in fields(cls)]
    for option in options:
        assert len(option.text) > 3 and option.kind
        assert option.default == getattr(cls(), option.name)


@dataclass(frozen=True)
class Base:
    """A method.

    Parameters
    ----------
    speed, size : how fast and
        how large.

    When to choose it: never : ever.
    """

    kind: ClassVar[str] = "none"
    speed: float = 1.0
    size: int | None = None


@dataclass(frozen=True)
class Derived(Base):
    """A method of that kind.

    Parameters
    ----------
    size : how large, here.
    """

    form: Literal["round", "square"] = "round"


def test_texts_come_from_the_nearest_docstring() -> None:
    found = {option.name: (option.kind, option.default, option.text) for option in options_of(Derived)}
    assert found == {
        "speed": ("a number", 1.0, "how fast and how large."),
        "size": ("a whole number or None", None, "how large, here."),
        "form": ("one of round, square", "round", ""),
    }
