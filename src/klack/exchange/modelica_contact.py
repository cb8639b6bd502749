"""Contacts and squeeze films of a pair as Modelica: continuous equations of the same laws.

Without a film the contact force is a function of the gap: in series with a compliance ``D`` it
solves ``F = f(-gap - D F)`` inside a function.  A film in series with a compliance has its
compression ``e`` as a state, see :func:`contact_text`.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from klack.contact.step_constants import MODELICA_POWER_TURNS, MODELICA_TABLE_TURNS
from klack.exchange.modal_model import ModalModel, ModelContact
from klack.exchange.modelica_words import array, number, table
from klack.exchange.state_space import ContactKind, contact_kind, law_table

__all__ = ["ContactText", "contact_text", "law_functions"]


@dataclass(frozen=True, kw_only=True)
class ContactText:
    """Lines of one contact.

    Parameters
    ----------
    suffix : str
        Ending of the names of its variables.
    declarations, equations : list of str
    """

    suffix: str
    declarations: list[str]
    equations: list[str]


def contact_text(model: ModalModel, index: int) -> ContactText:
    r"""Variables and equations of a contact.

    A film in series with a compliance ``D`` has the state ``e``, the compression.  With the gap
    ``z = gap + e`` between the surfaces and ``e_c = max(e, -D F_s)``, where the film cavitates,

    .. math:: \dot e = -\frac{e_c + D c(z)\,\dot g}{\max(D\,c(z), \tau)} + \frac{e_c - e}{\tau},
              \qquad F = e_c / D .

    This is ``F = -c \dot z`` wherever ``D c`` is above the relaxation time ``tau``; far apart,
    where the force is small, it is late by ``tau`` and not stiff.  The contact is closed while
    neither ``z`` nor the gap of the bodies is above zero; the film is at rest then and ``e``
    decays.
    """
    contact = model.contacts[index]
    name = contact.name
    declared = _parameters(model, contact)
    closed = _force(contact)
    equations = [f"  gap_{name} = {number(contact.gap)} + gap_shape_{name}*q;"]
    film = contact.film
    if film is None:
        equations += [
            f"  contact_force_{name} = if gap_{name} < 0 then {closed} else 0;",
            f"  total_{name} = contact_force_{name};",
        ]
        return ContactText(suffix=name, declarations=declared, equations=equations)
    declared += [
        f'  output Real film_force_{name}(unit="N") "Force of the squeeze film, + apart";',
        f'  Real opening_{name}(unit="m") "Gap between the surfaces";',
        f'  Real clear_{name}(unit="m") "Above 0: no contact";',
        f'  Real damping_{name}(unit="N.s/m") "Of the film";',
    ]
    rate = f"(gap_shape_{name}*v)"
    if contact.series_compliance == 0.0:
        film_force = f"noEvent(max(-damping_{name}*{rate}, -suction_{name}))"
        equations += [
            f"  opening_{name} = gap_{name};",
            f"  clear_{name} = gap_{name};",
        ]
    else:
        film_force = f"held_{name}/series_{name}"
        declared += [
            f'  Real compression_{name}(unit="m", start=0, fixed=true) "Of the series compliance";',
            f'  Real held_{name}(unit="m") "Compression, where the film does not cavitate";',
        ]
        equations += [
            f"  held_{name} = noEvent(max(compression_{name}, -series_{name}*suction_{name}));",
            f"  opening_{name} = gap_{name} + held_{name};",
            f"  clear_{name} = noEvent(max(opening_{name}, gap_{name}));",
            f"  der(compression_{name}) = if clear_{name} > 0 then",
            f"    -(held_{name} + series_{name}*damping_{name}*{rate})",
            f"    /noEvent(max(series_{name}*damping_{name}, relaxation))",
            f"    + (held_{name} - compression_{name})/relaxation",
            f"    else -compression_{name}/relaxation;",
        ]
    equations.append(f"  film_force_{name} = if clear_{name} > 0 then {film_force} else 0;")
    equations += [
        f"  damping_{name} = squeeze_damping(opening_{name}, film_{name}[1], film_{name}[2], "
        f"film_{name}[3]);",
        f"  contact_force_{name} = if clear_{name} > 0 then 0 else {closed};",
        f"  total_{name} = contact_force_{name} + film_force_{name};",
    ]
    return ContactText(suffix=name, declarations=declared, equations=equations)


def _parameters(model: ModalModel, contact: ModelContact) -> list[str]:
    name = contact.name
    lines = [
        f'  output Real gap_{name}(unit="m") "Gap between the bodies at {name}";',
        f'  output Real contact_force_{name}(unit="N") "Contact force at {name}";',
        f'  Real total_{name}(unit="N") "Contact and film, + apart";',
        array(
            f"parameter Real gap_shape_{name}[{model.mode_count}]",
            contact.shape,
            f"Change of gap_{name} by unit modes [1/sqrt(kg)]",
        ),
    ]
    kind = contact_kind(contact)
    if contact.series_compliance or kind in ("linear", "power", "table"):
        lines.append(
            f'  parameter Real series_{name}(unit="m/N") = {number(contact.series_compliance)} '
            '"Massless compliance in series";'
        )
    if kind == "table":
        lines.append(
            table(
                f"parameter Real law_{name}[{len(law_table(contact))}, 5]",
                law_table(contact),
                "Indentation [m], force [N], factors of s, s^2, s^3 up to the next row",
            )
        )
    elif kind in ("linear", "power"):
        words = "Stiffness [N/m]" if kind == "linear" else "Coefficient [N/m^n], exponent n"
        flat = contact.law.flat().parameters  # type: ignore[union-attr]
        lines.append(array(f"parameter Real law_{name}[{len(flat)}]", flat, words))
    film = contact.film
    if film is not None:
        lines.append(
            array(
                f"parameter Real film_{name}[3]",
                [film.cubic, film.linear, film.cut_off],
                "F = (cubic/h^3 + linear/h)*V over h = gap + cut-off [N.s.m2], [N.s], [m]",
            )
        )
        lines.append(
            f'  parameter Real suction_{name}(unit="N") = {number(film.suction)} '
            '"Largest pull of the film";'
        )
    return lines


def _force(contact: ModelContact) -> str:
    name = contact.name
    if contact_kind(contact) == "none":
        return "0"
    return f"law_force_{name}(-gap_{name}, series_{name}, law_{name})"


def law_functions(contacts: Sequence[ModelContact]) -> Iterable[str]:
    """Functions of the laws of these contacts, and of films where there are any.

    Sizes and loop bounds are plain numbers: not every tool takes others in a function.
    """
    for contact in contacts:
        kind = contact_kind(contact)
        if kind != "none":
            rows = len(law_table(contact)) if kind == "table" else 0
            soft = contact.series_compliance > 0.0
            yield from _law_function(f"law_force_{contact.name}", kind, rows, soft)
    if any(contact.film is not None for contact in contacts):
        yield _FILM.strip("\n")


def _law_function(name: str, kind: ContactKind, rows: int, soft: bool) -> Iterable[str]:
    size = {"linear": "1", "power": "2"}.get(kind, f"{rows}, 5")
    yield from (
        f'  function {name} "Contact force over the overlap of the bodies"',
        '    input Real closing(unit="m") "Overlap: indentation + series*force";',
        '    input Real series(unit="m/N");',
        f"    input Real law[{size}];",
        '    output Real force(unit="N");',
    )
    if kind == "linear":
        yield from (
            "  algorithm",
            "    force := max(closing, 0.0)*law[1]/(1 + series*law[1]);",
        )
    elif kind == "power":
        yield _POWER.strip("\n").replace("SEARCH", "    Real f;\n" if soft else "")
        if soft:
            yield _SOFT_POWER.strip("\n").replace("TURNS", str(MODELICA_POWER_TURNS))
        yield "    force := law[1]*d^law[2];"
    else:
        search = "    Real low;\n    Real high;\n    Real excess;\n" if soft else ""
        yield from (
            _TABLE.strip("\n").replace("ROWS", str(rows)).replace("SEARCH", search),
            _SOFT_TABLE.strip("\n").replace("TURNS", str(MODELICA_TABLE_TURNS))
            if soft
            else "    s := rest;",
            "    force := law[row, 2] + s*(law[row, 3] + s*(law[row, 4] + s*law[row, 5]));",
        )
    yield f"  end {name};"


_POWER = """
  protected
    Real d "Indentation";
SEARCH  algorithm
    d := max(closing, 0.0);
"""

_SOFT_POWER = """
    for step in 1:TURNS loop
      f := law[1]*d^(law[2] - 1);
      d := max(d - (d + series*f*d - max(closing, 0.0))/(1 + series*law[2]*f), 0.0);
    end for;
"""

_TABLE = """
  protected
    Integer row;
    Real rest "Remaining overlap of the interval";
    Real s "Indentation from the start of the interval";
SEARCH  algorithm
    row := 1;
    for k in 2:ROWS loop
      row := if closing >= law[k, 1] + series*law[k, 2] then k else row;
    end for;
    rest := max(closing, 0.0) - law[row, 1] - series*law[row, 2];
"""

_SOFT_TABLE = """
    low := 0.0;
    high := rest;
    s := rest/(1 + series*law[row, 3]);
    for step in 1:TURNS loop
      excess := s + series*s*(law[row, 3] + s*(law[row, 4] + s*law[row, 5])) - rest;
      low := if excess < 0 then s else low;
      high := if excess < 0 then high else s;
      s := s - excess/(1 + series*(law[row, 3] + s*(2*law[row, 4] + s*3*law[row, 5])));
      s := if s < low or s > high then 0.5*(low + high) else s;
    end for;
"""

_FILM = """
  function squeeze_damping "Force per closing speed of a squeeze film"
    input Real gap(unit="m");
    input Real cubic;
    input Real linear;
    input Real cut_off(unit="m");
    output Real damping(unit="N.s/m");
  protected
    Real h(unit="m");
  algorithm
    h := max(gap, 0.0) + cut_off;
    damping := cubic/h^3 + linear/h;
  end squeeze_damping;
"""
