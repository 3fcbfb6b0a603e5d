"""Title, cause and description of the packaged test cases, in one TOML file for each class of trouble."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

from hybridsim.testing.scene import TROUBLES, Scene

HERE = Path(__file__).parent


def read() -> dict[str, dict[str, Any]]:
    """Read the TOML files, and return the class, the title, the cause and the description of each test case."""
    found: dict[str, dict[str, Any]] = {}
    for trouble in TROUBLES:
        for name, fields in tomllib.loads((HERE / f"{trouble}.toml").read_text("utf-8")).items():
            if name in found:
                raise ValueError(
                    f"test case {name} is in both {trouble}.toml and {found[name]['trouble']}.toml"
                )
            found[name] = {"trouble": trouble, **fields}
    return found


def with_stories(scenes: tuple[Scene, ...]) -> tuple[Scene, ...]:
    """Return the test cases with their titles, causes and descriptions, in the order of the classes."""
    stories = read()
    known = [replace(scene, **stories[scene.name]) if scene.name in stories else scene for scene in scenes]
    return tuple(sorted(known, key=lambda scene: list(TROUBLES).index(scene.trouble or "events")))
