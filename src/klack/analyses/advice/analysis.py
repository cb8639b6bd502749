"""The advice on the settings of a case: table and JSON; nothing is stored."""

from klack.analyses.advice.summary import AdviceJson, advice_to_json, advice_told
from klack.analyses.analysis import Analysis

__all__ = ["ADVICE"]

ADVICE = Analysis(json=AdviceJson, to_json=advice_to_json, told=advice_told)
