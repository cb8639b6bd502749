"""Interface of every analysis: storage, summary and report of its record."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, TypeVar

from klack.analyses.measures import Measure
from klack.analyses.named import named
from klack.analyses.store import RecordFormat, load_record, save_record
from klack.report.page import Content
from klack.terminal.tables import Notes, TextTable

__all__ = ["Analysis", "Measured", "StoredAnalysis"]

Kept = TypeVar("Kept")


Measured = tuple[str, Any, Sequence[Measure[Any]]]
"""Name of a part of a record, the part, and its measures."""


def _nothing(record: Any) -> tuple[Measured, ...]:
    return ()


def _unchanged(record: Any) -> Any:
    return record


@dataclass(frozen=True, kw_only=True)
class Analysis(Generic[Kept]):
    """One kind of question with one answer, the record.

    Parameters
    ----------
    json
        Typed dictionary that ``to_json`` returns; its ``schema`` names it.
    to_json
        Numbers in SI, the unit in the key.
    told
        What a terminal shows, in order.
    measures, measured
        Its catalogue, and what it is of: levels, variants, impacts, shots, by name.
    """

    json: Any
    to_json: Callable[[Kept], Mapping[str, Any]]
    told: Callable[[Kept], Iterable[TextTable | Notes | str]]
    measures: Mapping[str, tuple[Measure[Any], ...]] = field(default_factory=dict)
    measured: Callable[[Kept], Iterable[Measured]] = _nothing


@dataclass(frozen=True, kw_only=True)
class StoredAnalysis(Analysis[Kept]):
    """An analysis whose record is stored and reported.

    ``page``, ``"noise.content:noise_content"``, makes the report and is loaded for it alone;
    ``renewed`` brings results of earlier versions up to date.
    """

    form: RecordFormat
    page: str
    renewed: Callable[[Kept], Kept] = _unchanged

    def content(self, record: Kept, *, result: str = "", case: str = "") -> Content:
        """Report of a record, in words, tables and figures.

        ``result`` and ``case`` stand in its commands, as typed at a terminal.
        """
        content: Content = named(self.page)(record)
        return content.placed(result=result, case=case)

    def save(self, record: Kept, folder: Path) -> Path:
        """Write ``folder/result.zarr`` and return it.

        An earlier result stays whole until this one is complete.
        """
        return save_record(record, folder, self.form)

    def load(self, folder: Path) -> Kept:
        """Read what :meth:`save` wrote, from its folder or the store itself.

        InputError if there is no result, it is another kind, or a part of it is missing.
        """
        return self.renewed(load_record(folder, self.form))
