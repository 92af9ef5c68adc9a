from .one_impact import ns_points as ns_points
from .saltation import saltation as saltation
from .saltation import saltation_entry as saltation_entry
from .scattering import OverReflection as OverReflection
from .verdict import Verdict as Verdict
from .verdict import stability as stability
from .verdict import verdict as verdict
from .zeros import Count as Count
