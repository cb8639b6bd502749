"""From a study, computed or loaded, to its table."""

from klack.analyses.impact.record import ImpactStudy
from klack.analyses.stroke.record import StrokeStudy
from klack.exchange.results.impact_table import impact_table
from klack.exchange.results.stroke_table import stroke_table
from klack.exchange.results.table import ResultTable

__all__ = ["result_table"]


def result_table(study: ImpactStudy | StrokeStudy) -> ResultTable:
    """Every curve and every number of a study, with units and with what made them.

    Parameters
    ----------
    study : ImpactStudy or StrokeStudy
        Computed, or read by :func:`klack.analyses.catalogue.load_result`.
    """
    if isinstance(study, ImpactStudy):
        return impact_table(study)
    return stroke_table(study)
