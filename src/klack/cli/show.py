"""``klack show``: bodies, contacts and network as a picture, without any solution."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from klack.errors import InputError, refuse_if
from klack.terminal.options import SHOWN, Components, Shown, imported
from klack.terminal.output import require_file_target
from klack.terminal.tables import TextTable, plain_math

if TYPE_CHECKING:
    from klack.case.valve import ValveCase
    from klack.network.component import Component
    from klack.network.described import DescribedKey, DescribedType
    from klack.viewer.view import View

__all__ = ["show"]


_PAGE, _SCHEMATIC = ".html", ".svg"
_ENDINGS = (_PAGE, _SCHEMATIC)

_Out = Annotated[
    Path | None,
    Parameter(
        name="--out",
        help="File to write; its extension selects the content: .html, the page; .svg, the "
        "schematic of a valve. [default: NAME.html in the current folder]",
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
    from klack.schematic.picture import schematic_svg

    if is_result(source):
        return _draw_stored(source, out, wanted)
    case = load_valve_case(source, own)
    network = case.network.network()
    picture = schematic_svg(network, f"{case.name}: {case.title}".rstrip(": "))
    words = f"{len(network.components)} components, {len(network.nodes)} connections.\nPicture: "
    return _end(case.name, out or Path(f"{case.name}.svg"), picture, words, wanted, network=case)


def _draw_stored(source: Path, out: Path | None, wanted: Shown) -> int:
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
    name = source.absolute().name
    words = f"The network of {source}.\nPicture: "
    return _end(name, out or Path(f"{name}.svg"), picture, words, wanted)


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
    from klack.viewer.view import page_of

    page = page_of(view)
    more = f" ({len(page) / 1e6:.2g} MB); open it in a browser."
    file = out or Path(f"{view.name}.html")
    words = f"{_content(view)}\nPage: "
    return _end(view.name, file, page, words, wanted, more=more, network=network, view=view)


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
        refuse_if(
            given is not None,
            f"{option} {given}",
            got="it beside --components",
            expected="one of the two",
            hint="klack show --components",
        )

    from klack.analyses.json_results import command_json
    from klack.network.catalogue import component_classes
    from klack.network.described import described_type

    types = [described_type(kind) for kind in component_classes()]
    types += [described_type(kind, own=True) for kind in imported(component)]
    wanted.show(_component_tables(types))
    wanted.write(lambda: command_json("show-components", types=types))
    return 0


def _ending(out: Path | None) -> str:
    """Ending of the file, which says what is drawn."""
    ending = _PAGE if out is None else out.suffix.lower()
    refuse_if(
        ending not in _ENDINGS,
        f"--out {out}",
        got=f"the extension '{ending}'" if ending else "a name without an extension",
        expected=" or ".join(_ENDINGS),
        hint=f"--out {Path(str(out)).with_suffix(_PAGE).name}",
    )
    return ending


def _end(
    name: str,
    file: Path,
    picture: str,
    words: str,
    wanted: Shown,
    *,
    more: str = "",
    network: "ValveCase | None" = None,
    view: "View | None" = None,
) -> int:
    """Write a picture and say so."""
    from klack.analyses.json_results import command_json
    from klack.files.whole import whole_file

    require_file_target("--out", file)

    def refuse(place: Path, error: OSError) -> InputError:
        return InputError(
            f"--out {place}",
            got=f"an error: {error.strerror or error}",
            expected="a writable file",
            hint="check the path and the free space.",
        )

    with whole_file(file, refuse) as new:
        new.write_text(picture, encoding="utf-8")
    wanted.say(f"{words}{file}{more}")
    drawn = None if network is None else network.network.network()
    wanted.write(
        lambda: command_json(
            "show",
            case=name,
            file=str(file),
            bodies={body.name: list(body.skin.faces) for body in (view.bodies if view else ())},
            components={key: part.type for key, part in drawn.components.items()} if drawn else {},
            nodes=drawn.nodes if drawn else (),
        )
    )
    return 0


_NONE = "-"


def _component_tables(types: "Sequence[DescribedType]") -> Iterator[TextTable]:
    """Ports and keys of every type, then equations and sources; what is optional in brackets."""
    yield TextTable(
        title="Component types; optional ports and keys are in brackets",
        columns=("type", "what it is", "ports", "keys"),
        rows=[(item.word, _summary(item), _ports(item), _keys(item.keys)) for item in types],
        left=4,
    )
    yield TextTable(
        title="Equations and sources",
        columns=("type", "equation", "source"),
        rows=[
            (item.word, plain_math(item.equation) or _NONE, item.source or _NONE)
            for item in types
            if item.equation or item.source
        ],
        left=3,
    )


def _summary(item: "DescribedType") -> str:
    return plain_math(item.summary) if "\\" in item.summary else item.summary


def _ports(item: "DescribedType") -> str:
    """``a, b: hydraulic; needle, (body): mechanical``."""
    if not item.ports:
        return "its points: mechanical" if "points" in item.keys else _NONE
    domains = dict.fromkeys(port.domain for port in item.ports.values())
    return "; ".join(
        ", ".join(
            f"({name})" if port.optional else name
            for name, port in item.ports.items()
            if port.domain == domain
        )
        + f": {domain}"
        for domain in domains
    )


def _keys(keys: "Mapping[str, DescribedKey]") -> str:
    """Required keys first, with their units."""
    order = sorted(keys, key=lambda name: not keys[name].required)
    return ", ".join(
        _key(name, keys[name]) if keys[name].required else f"({_key(name, keys[name])})"
        for name in order
    )


def _key(name: str, key: "DescribedKey") -> str:
    return f"{name} [{key.unit}]" if key.unit not in ("", "-") else name
