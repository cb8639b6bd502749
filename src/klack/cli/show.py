"""``klack show``: bodies, contacts and network as a picture, without any solution."""

from collections.abc import Sequence
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
    from klack.network.component import Component
    from klack.viewer.view import View

__all__ = ["show"]

_PAGE, _SCHEMATIC = ".html", ".svg"
_ENDINGS = (_PAGE, _SCHEMATIC)

_Out = Annotated[
    Path | None,
    Parameter(
        name="--out",
        help="File to write; its ending says what: .html, the page; .svg, the schematic of a "
        "valve. [default: NAME.html in the current folder]",
    ),
]
_Unit = Annotated[
    str | None,
    Parameter(name="--unit", help='Unit of the coordinates of a mesh, "mm", if it names none.'),
]


def show(
    source: Annotated[
        Path | None,
        Parameter(
            name="SOURCE",
            help="Case file (YAML) or the name of a shipped case; mesh or STEP file; folder of a "
            "result of klack impact or klack stroke.",
        ),
    ] = None,
    /,
    *,
    out: _Out = None,
    unit: _Unit = None,
    components: Annotated[
        bool,
        Parameter(
            name="--components",
            negative="",
            help="Instead of a picture: list all component types with ports, keys, equations and "
            "sources.",
        ),
    ] = False,
    component: Components = None,
    wanted: Shown = SHOWN,
) -> int:
    """Draw bodies, contacts and network of a case, a mesh or a result as one page of HTML.

    Nothing is solved; bodies of a case are meshed. The page needs no server and no network.
    """
    if components:
        return _list(source, out, component, wanted)
    if source is None:
        raise InputError(
            "SOURCE",
            got="nothing",
            expected="a case, a mesh or the folder of a result, or --components",
            hint="klack show demo-valve",
        )
    ending = _ending(out)
    require_file_target("--out", out)
    own = imported(component)
    if ending == _SCHEMATIC:
        return _draw_schematic(source, out, own, wanted)
    return _draw_page(source, out, own, unit, wanted)


def _draw_schematic(
    source: Path, out: Path | None, own: "Sequence[type[Component]]", wanted: Shown
) -> int:
    from klack.analyses.ending import is_result
    from klack.case.any_case import load_valve_case
    from klack.case.reader import find_case

    if is_result(source):
        return _draw_stored(source, out, wanted)
    case = load_valve_case(find_case(source), own)
    file = out if out is not None else Path(f"{case.name}.svg")
    require_file_target("--out", file)
    _write(file, _schematic(case))
    network = case.network.network()
    wanted.say(
        f"{len(network.components)} components, {len(network.nodes)} connections.\nPicture: {file}"
    )
    wanted.write(lambda: _numbers(case.name, file, network=case))
    return 0


def _draw_stored(source: Path, out: Path | None, wanted: Shown) -> int:
    """The schematic that a result of a stroke holds."""
    from klack.analyses.catalogue import load_result

    study = load_result(source)
    picture = getattr(study, "schematic", "")
    if not picture:
        raise InputError(
            str(source),
            got=f"a stored {type(study).__name__}, which holds no schematic",
            expected="the result of klack stroke",
            hint="klack show takes the case itself, and other results as .html.",
        )
    file = out if out is not None else Path(f"{source.absolute().name}.svg")
    require_file_target("--out", file)
    _write(file, picture)
    wanted.say(f"The network of {source}.\nPicture: {file}")
    wanted.write(lambda: _numbers(source.absolute().name, file, network=None))
    return 0


def _draw_page(
    source: Path,
    out: Path | None,
    own: "Sequence[type[Component]]",
    unit: str | None,
    wanted: Shown,
) -> int:
    from klack.terminal.progress import show_progress
    from klack.units import LENGTH, parse_quantity
    from klack.viewer.source import named_case, view_of_source

    network = named_case(source, own)
    length = None if unit is None else parse_quantity(f"1 {unit}", LENGTH, "--unit")
    with show_progress(wanted.quiet) as progress:
        view = view_of_source(source, own, unit_length=length, progress=progress)
    file = out if out is not None else Path(f"{view.name}.html")
    require_file_target("--out", file)
    from klack.viewer.page import page_of

    page = page_of(view)
    _write(file, page)
    wanted.say(f"{_content(view)}\nPage: {file} ({len(page) / 1e6:.2g} MB); open it in a browser.")
    wanted.write(lambda: _numbers(view.name, file, network=network, view=view))
    return 0


def _content(view: "View") -> str:
    parts = [f"{len(view.bodies)} {'body' if len(view.bodies) == 1 else 'bodies'}"]
    if view.contacts:
        parts.append(f"{len(view.contacts)} contact{'s' if len(view.contacts) > 1 else ''}")
    modes = sum(int((body.motion.frequency > 0).sum()) for body in view.bodies if body.motion)
    if modes:
        parts.append(f"{modes} modes")
    if view.time.size:
        parts.append(f"{view.time.size} instants")
    if view.schematic:
        parts.append("the network")
    return ", ".join(parts) + "."


def _list(source: Path | None, out: Path | None, component: list[str] | None, wanted: Shown) -> int:
    """List component types, those of the user last."""
    for option, given in (("SOURCE", source), ("--out", out)):
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
    ending = _PAGE if out is None else out.suffix.lower()
    if ending not in _ENDINGS:
        raise InputError(
            f"--out {out}",
            got=f"the ending '{ending}'" if ending else "a name without an ending",
            expected=" or ".join(_ENDINGS),
            hint=f"--out {Path(str(out)).with_suffix(_PAGE).name}",
        )
    return ending


def _schematic(case: "ValveCase") -> str:
    from klack.schematic.picture import schematic_svg

    return schematic_svg(case.network.network(), f"{case.name}: {case.title}".rstrip(": "))


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


def _numbers(
    name: str, file: Path, *, network: "ValveCase | None", view: "View | None" = None
) -> "ShowJson":
    drawn = None if network is None else network.network.network()
    return {
        "schema": "klack-show/1",
        "case": name,
        "file": str(file),
        "bodies": {}
        if view is None
        else {body.name: list(body.skin.faces) for body in view.bodies},
        "components": {}
        if drawn is None
        else {part_name: part.type for part_name, part in drawn.components.items()},
        "nodes": []
        if drawn is None
        else [
            {
                "domain": node.domain,
                "ports": [str(joint) for joint in node.joints],
                "fixed": node.word or None,
            }
            for node in drawn.nodes
        ],
    }
