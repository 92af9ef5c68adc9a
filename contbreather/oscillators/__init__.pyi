from .breather_constructors import CodedBreather as CodedBreather
from .breather_constructors import breather as breather
from .breather_constructors import breathers as breathers
from .breather_problem import Breather as Breather
from .breather_problem import BreatherProblem as BreatherProblem
from .oscillator_lattice import Oscillators as Oscillators
