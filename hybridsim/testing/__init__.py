"""This package tests integrators on test cases with known answers, and explains their failures."""

from hybridsim.testing.catalogue import SCENES
from hybridsim.testing.scene import END, TOLERANCES, TROUBLES, VOCABULARY, Scene, Truth
from hybridsim.testing.suite import Outcome, conformance_failures, outcome

__all__ = [
    "END",
    "SCENES",
    "TOLERANCES",
    "TROUBLES",
    "VOCABULARY",
    "Outcome",
    "Scene",
    "Truth",
    "conformance_failures",
    "outcome",
]
