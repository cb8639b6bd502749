"""Command ``klack linearise``."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from klack.analyses.ending import Ending
from klack.errors import refuse_if
from klack.terminal.options import WANTED_RESULT, CaseArgument, Components, WantedResult, imported
from klack.terminal.progress import show_progress

__all__ = ["linearise"]

_Text = str | None
_Texts = list[str] | None

_Variant = Annotated[
    _Text, Parameter(name="--variant", help="wet, dry, ... [default: the first one of the case]")
]
_Current = Annotated[
    _Texts,
    Parameter(
        name="--current",
        allow_leading_hyphen=True,
        negative="",
        help='Steady current of all coils, "3 A", or of one, "coil=3 A". [default: as at the '
        "start of a run]",
    ),
]
_Voltage = Annotated[
    _Texts,
    Parameter(
        name="--voltage",
        allow_leading_hyphen=True,
        negative="",
        help="Steady voltage, instead of a current.",
    ),
]
_Lift = Annotated[
    _Text,
    Parameter(
        name="--lift",
        allow_leading_hyphen=True,
        help='Hold the needle at this displacement, "40 um".',
    ),
]
_Begin = Annotated[
    Literal["start", "far"],
    Parameter(
        name="--begin",
        help="Where the search for the operating point begins: bodies where they are drawn, or at "
        "the stops far from there.",
    ),
]
_Band = Annotated[
    _Text,
    Parameter(
        name="--band",
        help='With lines: frequency up to which matrices and eigenvalues hold, "5 kHz". '
        "[default: 20 kHz, less for long lines]",
    ),
]
_From = Annotated[
    _Texts,
    Parameter(
        name="--from",
        negative="",
        help="Input of a frequency response, coil.voltage; repeatable. An unknown name lists all.",
    ),
]
_To = Annotated[
    _Texts,
    Parameter(
        name="--to",
        negative="",
        help="Output of a frequency response, needle.velocity; repeatable.",
    ),
]
_Frequencies = Annotated[
    tuple[str, str] | None,
    Parameter(
        name="--frequencies",
        help='Range of the frequency response, "1 Hz" "20 kHz". [default: about all oscillations]',
    ),
]
_Sweep = Annotated[
    tuple[str, str, str, int] | None,
    Parameter(
        name="--sweep",
        allow_leading_hyphen=True,
        help="Stability over a key of the case, or lift, current or voltage, then from, to and the "
        'number of values: --sweep network.components.pipe.length "0.2 m" "2 m" 10.',
    ),
]
_Loop = Annotated[
    _Texts,
    Parameter(
        name="--loop",
        negative="",
        help="Output at which a loop is opened for gain and phase margin, spring.end.force; "
        "repeatable.",
    ),
]


def linearise(
    case: CaseArgument,
    /,
    *,
    variant: _Variant = None,
    current: _Current = None,
    voltage: _Voltage = None,
    lift: _Lift = None,
    begin: _Begin = "start",
    band: _Band = None,
    sources: _From = None,
    targets: _To = None,
    frequencies: _Frequencies = None,
    loop: _Loop = None,
    sweep: _Sweep = None,
    component: Components = None,
    asked: WantedResult = WANTED_RESULT,
) -> int:
    """Linear state space about the operating point: eigenvalues, response, margins, stability."""
    with show_progress(asked.quiet):
        from klack.case.any_case import read_case_tree

        tree = read_case_tree(case, imported(component))
        checked = tree.case()

        from klack.analyses.linearisation.analysis import LINEARISATION
        from klack.analyses.linearisation.content import linear_charts, write_files
        from klack.analyses.linearisation.run import run_linearisation
        from klack.analyses.operating_point.conditions import (
            Conditions,
            asked_sweeps,
            stated_drive,
        )
        from klack.units import CURRENT, FREQUENCY, LENGTH, VOLTAGE, parse_quantity

    def hertz(text: str, option: str) -> float:
        value = parse_quantity(text, FREQUENCY, option)
        refuse_if(
            not 0.0 < value < 1e9,
            option,
            got=text,
            expected="more than 0 Hz, and less than 1 GHz",
            hint='write e.g. "5 kHz".',
        )
        return value

    ends = None
    if frequencies is not None:
        low, high = (hertz(text, "--frequencies") for text in frequencies)
        refuse_if(
            low >= high,
            "--frequencies",
            got=f"from {frequencies[0]} to {frequencies[1]}",
            expected="a lower, then a higher frequency",
            hint="exchange them.",
        )
        ends = low, high
    base = Conditions(
        current=stated_drive(current or (), "--current", CURRENT),
        voltage=stated_drive(voltage or (), "--voltage", VOLTAGE),
        lift=None if lift is None else parse_quantity(lift, LENGTH, "--lift"),
    )
    ending = Ending.of(asked, f"{checked.name}-linear")
    with show_progress(asked.quiet) as progress:
        record = run_linearisation(
            checked,
            variant=variant,
            base=base,
            origin=begin,
            band=None if band is None else hertz(band, "--band"),
            sources=sources or (),
            targets=targets or (),
            frequencies=ends,
            loops=loop or (),
            tree=tree,
            sweep=next(iter(asked_sweeps(checked, tree, () if sweep is None else (sweep,))), None),
            threads=asked.threads,
            progress=progress,
        )

    def beside(folder: Path) -> tuple[str, ...]:
        from klack.report.printed import write_charts

        return (*write_files(record, folder), *write_charts(linear_charts(record), folder))

    return ending.end(LINEARISATION, record, beside=beside)
