"""How many examples the property-based tests draw: few and always the same, or many and new ones.

``KLACK_PROPERTIES=long`` draws a thousand new examples for each property; ``KLACK_PROPERTIES=500``
any other number.
"""

import os
from math import exp, log

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

_COMMON = {"deadline": None, "suppress_health_check": list(HealthCheck)}
_asked = os.environ.get("KLACK_PROPERTIES", "")


def examples(usual: int) -> settings:
    """Settings of one property: ``usual`` examples, or what the environment asks for."""
    if not _asked:
        return settings(max_examples=usual, derandomize=True, database=None, **_COMMON)
    # a slow property has few examples as usual, and fewer than others in a long run
    most = 1000 if _asked == "long" else int(_asked)
    return settings(max_examples=max(usual, min(most, 40 * usual)), **_COMMON)


def log_range(low: float, high: float) -> st.SearchStrategy[float]:
    """Numbers between two bounds, every decade alike."""
    return st.floats(log(low), log(high)).map(exp)
