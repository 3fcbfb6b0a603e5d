"""hybridsim simulates piecewise-smooth (hybrid) systems and compares the integrators that can run them.

The public names are the ones listed here and no others. Each is imported when it is first used, so that
`import hybridsim` is fast and loads only the parts that a program uses.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import Any
from warnings import warn

__version__ = "0.1.0.dev0"

# The module that defines each public name. `__init__.pyi` repeats them for type checkers; a test compares both.
_HOME = {
    # model declarations
    "Choice": "hybridsim.model",
    "Component": "hybridsim.model",
    "Contact": "hybridsim.model",
    "Discrete": "hybridsim.model",
    "Element": "hybridsim.model",
    "FrictionLaw": "hybridsim.model",
    "LawTable": "hybridsim.model",
    "Guard": "hybridsim.model",
    "Impact": "hybridsim.model",
    "Input": "hybridsim.model",
    "Mode": "hybridsim.model",
    "Model": "hybridsim.model",
    "Monitor": "hybridsim.model",
    "Output": "hybridsim.model",
    "Parameter": "hybridsim.model",
    "Schedule": "hybridsim.model",
    "Shape": "hybridsim.model",
    "State": "hybridsim.model",
    "Surface": "hybridsim.model",
    "SwitchingSurface": "hybridsim.model",
    "Use": "hybridsim.model",
    "list_models": "hybridsim.model",
    "load": "hybridsim.model",
    "load_law": "hybridsim.model",
    "Harmonic": "hybridsim.mechanics.declaration.system",
    "MechanicalContact": "hybridsim.mechanics.declaration.system",
    "MechanicalImpact": "hybridsim.mechanics.declaration.impact",
    "MechanicalSystem": "hybridsim.mechanics.declaration.system",
    "chain_on_belt": "hybridsim.mechanics.declaration.scenes",
    "three_coupled_blocks": "hybridsim.mechanics.declaration.scenes",
    "two_blocks_on_belt": "hybridsim.mechanics.declaration.scenes",
    # simulation
    "Event": "hybridsim.solution",
    "Explanation": "hybridsim.solution",
    "Solution": "hybridsim.solution",
    "list_integrators": "hybridsim.integrators",
    "load_solution": "hybridsim.solution",
    "SavedState": "hybridsim.simulator",
    "Simulator": "hybridsim.simulator",
    "simulate": "hybridsim.simulate",
    "to_ivp": "hybridsim.ivp",
    # analysis
    "Branch": "hybridsim.analysis",
    "Advice": "hybridsim.analysis",
    "Comparison": "hybridsim.analysis",
    "Equilibrium": "hybridsim.analysis",
    "Fit": "hybridsim.analysis",
    "LawComparison": "hybridsim.analysis",
    "LawFits": "hybridsim.analysis",
    "Linearization": "hybridsim.analysis",
    "LyapunovExponents": "hybridsim.analysis",
    "Record": "hybridsim.analysis",
    "Sensitivities": "hybridsim.analysis",
    "SteadyState": "hybridsim.analysis",
    "SuiteComparison": "hybridsim.analysis",
    "Sweep": "hybridsim.analysis",
    "Unknown": "hybridsim.analysis",
    "bifurcation": "hybridsim.analysis",
    "advise": "hybridsim.analysis",
    "compare": "hybridsim.analysis",
    "compare_laws": "hybridsim.analysis",
    "compare_suite": "hybridsim.analysis",
    "continuation": "hybridsim.analysis",
    "equilibria": "hybridsim.analysis",
    "fit": "hybridsim.analysis",
    "fit_laws": "hybridsim.analysis",
    "frequency_response": "hybridsim.analysis",
    "linearize": "hybridsim.analysis",
    "lyapunov_exponents": "hybridsim.analysis",
    "sensitivities": "hybridsim.analysis",
    "steady_state": "hybridsim.analysis",
    "sweep": "hybridsim.analysis",
    # errors
    "ExpressionError": "hybridsim.errors",
    "HybridsimError": "hybridsim.errors",
    "ModelError": "hybridsim.errors",
    "Place": "hybridsim.errors",
    "SimulationError": "hybridsim.errors",
    "UsageError": "hybridsim.errors",
}

# Former names of `Solution`, which give a warning.
_FORMER = dict.fromkeys(("MechanicalSolution", "SteppedSolution"), "hybridsim.mechanics.deprecated")

# Packages that are used by their name, as in `hs.plot.save(...)`; each loads its libraries when it is first used.
_PACKAGES = ("plot",)

__all__ = ["__version__", *_HOME]


class _Package(ModuleType):
    """A module type in which a public function is not replaced by the submodule of the same name.

    The import system binds every submodule to its package on first import, so that after
    `import hybridsim.simulate` anywhere, `hs.simulate` would be the module and not the function.
    """

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in _HOME and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


def __getattr__(name: str) -> Any:
    if name in _FORMER:
        what = f"hybridsim.{name} is deprecated; version 0.2 removes it. Use hybridsim.Solution"
        warn(what, DeprecationWarning, stacklevel=2)
        return getattr(import_module(_FORMER[name]), name)
    if name in _PACKAGES:
        return import_module(f"hybridsim.{name}")
    if name not in _HOME:
        raise AttributeError(f"module 'hybridsim' has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_HOME[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted([*__all__, *_PACKAGES])


sys.modules[__name__].__class__ = _Package
