"""Copies of the package that have one mended fault again."""

from __future__ import annotations

import shutil
import tomllib
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[3]


@dataclass(frozen=True)
class Edit:
    """Lines of one file of the package, and what stands there in their place."""

    file: str
    old: str
    new: str


@dataclass(frozen=True)
class Fault:
    """A mended fault: what goes wrong in words, the edits that bring it back, and which test and trial find it."""

    name: str
    words: str
    test: str
    edits: tuple[Edit, ...]
    trial: str = "whole models"


class DoesNotApply(Exception):
    """The lines that an edit is to change are not in the package, or not once."""


def faults() -> list[Fault]:
    """All faults of the table."""
    text = (Path(__file__).parent / "faults.toml").read_text(encoding="utf-8")
    return [
        Fault(
            name,
            one["words"],
            one.get("test", ""),
            tuple(Edit(**e) for e in one["edit"]),
            one.get("trial", "whole models"),
        )
        for name, one in tomllib.loads(text).items()
    ]


def put_back(fault: Fault, package: Path) -> None:
    """Bring a fault back into the package in a folder."""
    for edit in fault.edits:
        path = package / edit.file
        text = path.read_text(encoding="utf-8") if path.exists() else ""
        if text.count(edit.old) != 1:
            raise DoesNotApply(
                f"{fault.name} cannot be put back: {edit.file} has {text.count(edit.old)} times {edit.old!r}"
            )
        path.write_text(text.replace(edit.old, edit.new), encoding="utf-8")


def copied(folder: Path, fault: Fault | None = None) -> Path:
    """Copy the package, with its models, into a folder, with a fault if there is one; the folder to import from."""
    skipped = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "hybridsim", folder / "hybridsim", ignore=skipped)
    shutil.copytree(ROOT / "models", folder / "models", ignore=skipped)
    if fault is not None:
        put_back(fault, folder / "hybridsim")
    return folder
