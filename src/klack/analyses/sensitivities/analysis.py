"""Derivatives of a stroke: tables and JSON; nothing is stored."""

from klack.analyses.analysis import Analysis
from klack.analyses.sensitivities.summary import (
    SensitivitiesJson,
    sensitivities_to_json,
    sensitivities_told,
)

__all__ = ["SENSITIVITIES"]

SENSITIVITIES = Analysis(
    json=SensitivitiesJson, to_json=sensitivities_to_json, told=sensitivities_told
)
"""``klack sensitivities``."""
