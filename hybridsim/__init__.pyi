"""What type checkers see of the package: the same names, imported at once."""

from hybridsim.analysis import Comparison as Comparison
from hybridsim.analysis import Sensitivities as Sensitivities
from hybridsim.analysis import SteadyState as SteadyState
from hybridsim.analysis import SuiteComparison as SuiteComparison
from hybridsim.analysis import Sweep as Sweep
from hybridsim.analysis import compare as compare
from hybridsim.analysis import compare_suite as compare_suite
from hybridsim.analysis import sensitivities as sensitivities
from hybridsim.analysis import steady_state as steady_state
from hybridsim.analysis import sweep as sweep
from hybridsim.errors import ExpressionError as ExpressionError
from hybridsim.errors import HybridsimError as HybridsimError
from hybridsim.errors import ModelError as ModelError
from hybridsim.errors import Place as Place
from hybridsim.errors import SimulationError as SimulationError
from hybridsim.errors import UsageError as UsageError
from hybridsim.integrators import list_integrators as list_integrators
from hybridsim.ivp import to_ivp as to_ivp
from hybridsim.model import Choice as Choice
from hybridsim.model import Component as Component
from hybridsim.model import Contact as Contact
from hybridsim.model import Discrete as Discrete
from hybridsim.model import FrictionLaw as FrictionLaw
from hybridsim.model import Guard as Guard
from hybridsim.model import Input as Input
from hybridsim.model import Mode as Mode
from hybridsim.model import Model as Model
from hybridsim.model import Monitor as Monitor
from hybridsim.model import Output as Output
from hybridsim.model import Parameter as Parameter
from hybridsim.model import Schedule as Schedule
from hybridsim.model import State as State
from hybridsim.model import Surface as Surface
from hybridsim.model import list_models as list_models
from hybridsim.model import load as load
from hybridsim.model import load_law as load_law
from hybridsim.simulate import simulate as simulate
from hybridsim.solution import Event as Event
from hybridsim.solution import Solution as Solution

__version__: str
