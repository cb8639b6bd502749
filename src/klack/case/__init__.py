"""The case file: what a user writes, checked and in SI."""

from klack.case.bodies import SurfaceName
from klack.case.levels import LEVELS
from klack.case.reader import find_case, load_case, read_case, shipped_cases
from klack.case.schema import Case
from klack.input.problem import CaseProblem

__all__ = [
    "LEVELS",
    "Case",
    "CaseProblem",
    "SurfaceName",
    "find_case",
    "load_case",
    "read_case",
    "shipped_cases",
]
