"""``klack show``: the network of a valve as a picture, before anything is computed."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from klack.errors import InputError
from klack.terminal.options import Components, imported
from klack.terminal.output import require_file_target
from klack.terminal.wanted import SHOWN, Shown

if TYPE_CHECKING:
    from klack.analyses.json_results import ShowJson
    from klack.case.valve import ValveCase

__all__ = ["show"]

_Out = Annotated[
    Path | None,
    Parameter(
        name="--out",
        help="File to write; its ending says what: .svg, the schematic. "
        "[default: NAME.svg in the current folder]",
    ),
]


def show(
    case: Annotated[
        Path | None,
        Parameter(name="CASE", help="Case file (YAML) of a valve, or the name of a shipped one."),
    ] = None,
    /,
    *,
    out: _Out = None,
    components: Annotated[
        bool,
        Parameter(
            name="--components",
            negative="",
            help="Instead of a case: list all component types with ports, keys, equations and "
            "sources.",
        ),
    ] = False,
    component: Components = None,
    wanted: Shown = SHOWN,
) -> int:
    """Draw the schematic of a valve: components, ports, connections, values at the start.

    Nothing is computed.
    """
    if components:
        return _list(case, out, component, wanted)
    if case is None:
        raise InputError(
            "CASE",
            got="nothing",
            expected="the case of a valve, or --components",
            hint="klack show demo-stroke",
        )
    draw = _PICTURES[_ending(out)]
    require_file_target("--out", out)

    from klack.case.shipped import find_case
    from klack.case.valve_reader import load_valve_case

    checked = load_valve_case(find_case(case), imported(component))
    file = out if out is not None else Path(f"{checked.name}.svg")
    require_file_target("--out", file)
    picture = draw(checked)
    _write(file, picture)
    network = checked.network.network()
    wanted.say(
        f"{len(network.components)} components, {len(network.nodes)} connections.\nPicture: {file}"
    )
    wanted.write(lambda: _numbers(checked, file))
    return 0


def _list(case: Path | None, out: Path | None, component: list[str] | None, wanted: Shown) -> int:
    """List component types, those of the user last."""
    for option, given in (("CASE", case), ("--out", out)):
        if given is not None:
            raise InputError(
                f"{option} {given}",
                got="it beside --components",
                expected="one of the two",
                hint="klack show --components",
            )

    from klack.network.catalogue import component_classes
    from klack.network.described import described_type

    types = [described_type(kind) for kind in component_classes()]
    types += [described_type(kind, own=True) for kind in imported(component)]

    from klack.cli.show_components import component_tables, components_json

    wanted.show(component_tables(types))
    wanted.write(lambda: components_json(types))
    return 0


def _ending(out: Path | None) -> str:
    """Ending of the file, which says what is drawn."""
    ending = ".svg" if out is None else out.suffix.lower()
    if ending not in _PICTURES:
        raise InputError(
            f"--out {out}",
            got=f"the ending '{ending}'" if ending else "a name without an ending",
            expected=" or ".join(_PICTURES),
            hint=f"--out {Path(str(out)).with_suffix('.svg').name}",
        )
    return ending


def _schematic(case: "ValveCase") -> str:
    from klack.schematic.picture import schematic_svg

    return schematic_svg(case.network.network(), f"{case.name}: {case.title}".rstrip(": "))


_PICTURES: Mapping[str, "Callable[[ValveCase], str]"] = {".svg": _schematic}
"""What draws each kind of file."""


def _write(file: Path, picture: str) -> None:
    from klack.whole_file import whole_file

    def refuse(place: Path, error: OSError) -> InputError:
        return InputError(
            f"--out {place}",
            got=f"an error: {error.strerror or error}",
            expected="a writable file",
            hint="check the path and the free space.",
        )

    with whole_file(file, refuse) as new:
        new.write_text(picture, encoding="utf-8")


def _numbers(case: "ValveCase", file: Path) -> "ShowJson":
    network = case.network.network()
    return {
        "schema": "klack-show/1",
        "case": case.name,
        "file": str(file),
        "components": {name: part.type for name, part in network.components.items()},
        "nodes": [
            {
                "domain": node.domain,
                "ports": [str(joint) for joint in node.joints],
                "fixed": node.word or None,
            }
            for node in network.nodes
        ],
    }
