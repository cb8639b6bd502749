"""All analyses, each loaded when it is asked for."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from klack.analyses.named import named
from klack.errors import refuse_if

if TYPE_CHECKING:
    from klack.analyses.analysis import Analysis, StoredAnalysis

__all__ = ["ANALYSES", "Entry", "analyses", "analysis_in", "commands", "load_result"]


@dataclass(frozen=True, slots=True)
class Entry:
    """One analysis.

    Parameters
    ----------
    place
        Of its :class:`~klack.analyses.analysis.Analysis`, ``"shots.analysis:SHOTS"``.
    form
        Format of its record; empty if none is stored.
    example
        Of its command, ``"klack shots demo-shots"``: the function ``shots`` of the module
        ``command`` in the same folder; empty without one.
    others
        Examples of further commands there.
    """

    place: str
    form: str = ""
    example: str = ""
    others: tuple[str, ...] = ()

    @property
    def commands(self) -> dict[Callable[..., int], str]:
        """Functions of its commands, with an example each."""
        room = self.place.partition(".")[0]
        examples = [text for text in (self.example, *self.others) if text]
        return {named(f"{room}.command:{text.split()[1]}"): text for text in examples}


ANALYSES: tuple[Entry, ...] = (
    Entry(
        "impact.analysis:IMPACT",
        "klack impact study",
        "klack impact demo-valve-axisymmetric --level reduced,interface",
    ),
    Entry(
        "stroke.analysis:STROKE",
        "klack stroke study",
        "klack stroke demo-stroke --variant wet,dry",
    ),
    Entry("operating_point.analysis:OPERATING_POINT", "klack operating points"),
    Entry("heat.summary:HEAT", "klack heat", "klack heat warm-valve"),
    Entry(
        "linearisation.analysis:LINEARISATION",
        "klack linear model",
        "klack linearise demo-stroke --from coil.voltage --to needle.velocity",
    ),
    Entry("shots.analysis:SHOTS", "klack shots study", "klack shots demo-shots --shots 20"),
    Entry("stroke_shots.analysis:STROKE_SHOTS", "klack study of strokes"),
    Entry(
        "study.analysis:STUDY",
        "klack study of points",
        "klack study demo-stroke",
        others=("klack optimise demo-stroke",),
    ),
    Entry(
        "sensitivities.analysis:SENSITIVITIES",
        "klack sensitivities",
        "klack sensitivities demo-stroke --parameter network.components.spring.preload",
    ),
    Entry(
        "magnet.analysis:MAGNET",
        "klack magnet map",
        "klack magnet docs/how-to/lifting_magnet.yaml",
    ),
    Entry("noise.analysis:NOISE", "klack noise study", "klack noise demo-valve-axisymmetric"),
    Entry(
        "reduction.analysis:REDUCTION",
        example="klack reduce demo-valve-axisymmetric --json reduced.json",
    ),
    Entry("advice.analysis:ADVICE", example="klack advise demo-valve-axisymmetric --error '2 %'"),
    Entry("comparison.strokes_summary:MEASURED_STROKES", "klack measured strokes"),
    Entry("comparison.shots_summary:MEASURED_SHOTS", "klack measured shots"),
    Entry("comparison.impacts_summary:MEASURED_IMPACT", "klack measured impact"),
    Entry("comparison.calculix:CALCULIX"),
    Entry(
        "calibration.analysis:CALIBRATION",
        "klack calibration",
        "klack calibrate measured --measurement dry=dry_strokes_synthetic.csv",
    ),
)


def analyses() -> tuple["Analysis[Any]", ...]:
    """All of them, loaded."""
    return tuple(named(entry.place) for entry in ANALYSES)


def commands() -> dict[Callable[..., int], str]:
    """Commands of the analyses, with an example each."""
    return {command: text for entry in ANALYSES for command, text in entry.commands.items()}


def analysis_in(folder: Path) -> "StoredAnalysis[Any]":
    """Analysis of a stored result; InputError if there is none, or of another kind."""
    from klack.analyses.store import stored_format

    name = stored_format(folder)
    places = {entry.form: entry.place for entry in ANALYSES if entry.form}
    refuse_if(
        name not in places,
        f"result {folder}",
        got=f"a Zarr store with format {name!r}",
        expected="a result of klack",
        hint="give the result folder of a klack command; a later version of klack may "
        "support further kinds.",
    )
    found: StoredAnalysis[Any] = named(places[name])
    return found


def load_result(folder: Path) -> Any:
    """Read a stored result of any kind."""
    return analysis_in(folder).load(folder)
