"""This module gives each friction law of a comparison a label of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike, fspath
from typing import Any

from hybridsim.errors import UsageError
from hybridsim.model import FrictionLaw


def details_of(law: str | PathLike[str] | FrictionLaw, values: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the words that tell a law from another law of the same name: its file, and its parameters."""
    path = "" if isinstance(law, FrictionLaw) else fspath(law)
    return (*((path,) if "." in path else ()), *(f"{name}={value}" for name, value in values.items()))


def distinct_labels(names: Sequence[str], details: Sequence[tuple[str, ...]]) -> tuple[str, ...]:
    """Return one label per law; laws of the same name have labels with details, and numbers if these are equal."""
    labels = [
        f"{name} ({', '.join(detail)})" if names.count(name) > 1 and detail else name
        for name, detail in zip(names, details, strict=True)
    ]
    return tuple(
        f"{label} #{labels[: k + 1].count(label)}" if labels.count(label) > 1 else label
        for k, label in enumerate(labels)
    )


def refuse_equal(laws: Sequence[Any], names: Sequence[str]) -> None:
    """Raise an error if two laws of a comparison have equal formulas and parameters."""
    for k, law in enumerate(laws):
        if law in laws[:k]:
            raise UsageError(
                f"`laws` contains '{names[k]}' twice", remedy="pass the law with different parameters"
            )
