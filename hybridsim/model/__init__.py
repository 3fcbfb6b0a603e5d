"""This package declares, reads, checks and writes models; it contains no numerical methods.

Start with `parts` (what one declares), then `toml`, `checks`, `laws` and `smoothing`.
"""

from hybridsim.model.elements.element import Element
from hybridsim.model.laws.law import FrictionLaw
from hybridsim.model.laws.law_table import LawTable
from hybridsim.model.library import ModelInfo, list_laws, list_models, load, load_law
from hybridsim.model.parts.component import Choice, Component, Guard, Mode, Surface
from hybridsim.model.parts.contact import Contact
from hybridsim.model.parts.frozen_map import FrozenMap
from hybridsim.model.parts.impact import Impact
from hybridsim.model.parts.inputs import Input
from hybridsim.model.parts.model import Model
from hybridsim.model.parts.monitor import Monitor
from hybridsim.model.parts.quantities import Discrete, Output, Parameter, State
from hybridsim.model.parts.schedule import Schedule
from hybridsim.model.parts.shape import Shape
from hybridsim.model.parts.switching import SwitchingSurface
from hybridsim.model.parts.use import Use

__all__ = [
    "Choice",
    "Component",
    "Contact",
    "Discrete",
    "Element",
    "FrictionLaw",
    "FrozenMap",
    "Guard",
    "Impact",
    "Input",
    "LawTable",
    "Mode",
    "Model",
    "ModelInfo",
    "Monitor",
    "Output",
    "Parameter",
    "Schedule",
    "Shape",
    "State",
    "Surface",
    "SwitchingSurface",
    "Use",
    "list_laws",
    "list_models",
    "load",
    "load_law",
]
