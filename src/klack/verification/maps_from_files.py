r"""Checks of force and flux maps from files, against a coil in closed form.

The coil :math:`\psi = L_0 i + \frac{c}{x + x_0}\tanh\frac{i}{i_s}` has the co-energy
:math:`\tfrac12L_0i^2 + \frac{c\,i_s}{x + x_0}\ln\cosh\frac{i}{i_s}`, whose slopes are its linkage
and its force.
"""

from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.integrate import simpson

from klack.magnetics.flux_map import FluxMap
from klack.magnetics.map_choice import MapFile
from klack.magnetics.map_file import MapTable
from klack.verification import lifting_magnet as published
from klack.verification.check import Check, compare

__all__ = ["force_of", "linkage_of", "maps_from_files", "written"]

_check = partial(compare, "magnetic-parts")
_C, _X0, _IS, _L0 = 3e-8, 60e-6, 8.0, 5e-6  # [Wb m], [m], [A], [H]
_CURRENT = np.linspace(0.0, 12.0, 25)
_GAP = np.linspace(20e-6, 160e-6, 15)
_AT = 7.3, 87e-6  # [A], [m] between the points
_SOURCE = "slope of the co-energy c i_s/(x + x_0) ln cosh(i/i_s)"

Rows = Iterable[tuple[float, float, float, float]]


def linkage_of(i: np.ndarray | float, x: np.ndarray | float) -> np.ndarray:
    """Linkage of the coil [Wb]."""
    return np.asarray(_L0 * i + _C / (x + _X0) * np.tanh(i / _IS))


def force_of(i: np.ndarray | float, x: np.ndarray | float) -> np.ndarray:
    """Force of the coil along the gap [N]."""
    return np.asarray(-_C * _IS / (x + _X0) ** 2 * np.log(np.cosh(i / _IS)))


def _points() -> Rows:
    for x in _GAP:
        for i in _CURRENT:
            yield i, x, float(linkage_of(i, x)), float(force_of(i, x))


def _maxwell(rows: Rows) -> str:
    head = '"Current [A]","gap [mm]","FluxLinkage(Coil) [mWb]","Force1.Force_z [newton]"'
    return "\n".join(
        [head, *(f"{i:.17g},{1e3 * x:.17g},{1e3 * p:.17g},{F:.17g}" for i, x, p, F in rows)]
    )


def _femm(rows: Rows) -> str:
    return "\n".join(f"{1e3 * x:.15g} {i:.15g} {F:.15g} {p:.15g}" for i, x, p, F in rows)


def _jmag(rows: Rows) -> str:
    lines = ["Parametric study;;;", "Current (A);Gap (mm);Force (N);Flux linkage (Wb)"]
    lines += [f"{i:.15g};{1e3 * x:.15g};{-0.5 * F:.15g};{0.5 * p:.15g}" for i, x, p, F in rows]
    return "\n".join(lines).replace(".", ",")


def _families(rows: Rows) -> str:
    del rows
    head = ['"Current [A]"']
    for x in _GAP:
        head += [f"\"FluxLinkage(Coil) [mWb] - gap='{1e3 * x:.12g}mm'\""]
        head += [f"\"Force1.Force_z [newton] - gap='{1e3 * x:.12g}mm'\""]
    lines = [",".join(head)]
    for i in _CURRENT:
        cells = [repr(float(i))]
        for x in _GAP:
            cells += [repr(float(1e3 * linkage_of(i, x))), repr(float(force_of(i, x)))]
        lines.append(",".join(cells))
    return "\n".join(lines)


def _matrix(value: Callable[..., np.ndarray], head: str) -> str:
    lines = [";".join([head, *(f"{i:.15g}" for i in _CURRENT)])]
    lines += [
        ";".join([f"{1e3 * x:.15g}", *(f"{value(i, x):.15g}" for i in _CURRENT)])
        for x in _GAP[::-1]
    ]
    return "\n".join(lines)


def written(folder: Path) -> dict[str, MapFile]:
    """Write the coil in each layout below a folder and read it again."""
    layouts = {
        "Ansys Maxwell, one row per point": (_maxwell(_points()), {}),
        "FEMM, no head": (
            _femm(_points()),
            {
                "columns": {"gap": 1, "current": 2, "force": 3, "linkage": 4},
                "units": {"gap": "mm", "current": "A", "force": "N", "linkage": "Wb"},
            },
        ),
        "JMAG, half a model, decimal comma": (
            _jmag(_points()),
            {"linkage_factor": 2.0, "force_factor": 2.0, "force_closing": "positive"},
        ),
        "Ansys Maxwell, a column per gap": (_families(_points()), {}),
    }
    out = {}
    for k, (name, (text, keys)) in enumerate(layouts.items()):
        file = folder / f"map{k}.csv"
        file.write_text(text, encoding="utf-8")
        out[name] = MapFile.model_validate({"file": file.name, **keys}, context={"folder": folder})
    matrices = {
        "psi.csv": _matrix(linkage_of, "gap [mm] / current [A] / linkage [Wb]"),
        "force.csv": _matrix(force_of, "gap [mm] / current [A] / force [N]"),
    }
    for name, text in matrices.items():
        (folder / name).write_text(text, encoding="utf-8")
    keys = {"file": "psi.csv", "force_file": "force.csv", "layout": "matrix"}
    out["two matrices"] = MapFile.model_validate(keys, context={"folder": folder})
    return out


def _made(table: MapTable) -> FluxMap:
    return FluxMap.of(current=table.current, gap=table.gap, linkage=table.linkage, force=None)


def _layouts() -> list[Check]:
    checks = []
    with TemporaryDirectory() as folder:
        for name, choice in written(Path(folder)).items():
            table = choice.table()
            made = _made(table)
            psi = float(linkage_of(*_AT))
            checks.append(
                _check(
                    f"map from a file ({name}): force between the points [N]",
                    expected=float(force_of(*_AT)),
                    computed=made.force_at(psi, _AT[1]),
                    tolerance=1e-4,
                    source=_SOURCE,
                )
            )
            assert table.force is not None
            checks.append(
                _check(
                    f"map from a file ({name}): force of the file at 12 A, 20 um [N]",
                    expected=float(force_of(12.0, 20e-6)),
                    computed=float(table.force[-1, 0]),
                    tolerance=1e-13,
                    source=_SOURCE,
                )
            )
    return checks


def _virtual_work() -> list[Check]:
    gap = np.linspace(20e-6, 160e-6, 29)
    i, x = _CURRENT[:, None], gap[None, :]
    psi, force = linkage_of(i, x), force_of(i, x)
    made = FluxMap.of(current=_CURRENT, gap=gap, linkage=psi, force=None)
    peak = float(np.max(np.abs(force)))
    wrong = force.copy()
    wrong[14, 8] *= 1.6  # 7 A, 60 um
    planted = made.compare_force(_CURRENT, psi, wrong)
    half = made.compare_force(_CURRENT, psi, 0.5 * force)
    words = "dF/di = dpsi/dx at constant current; a wrong point planted in the exact table"
    return [
        _check(
            "virtual work: exact force against exact linkage, share of the peak [-]",
            expected=0.0,
            computed=made.compare_force(_CURRENT, psi, force).share,
            tolerance=1e-2,
            source=_SOURCE,
            reason="at the narrowest gap and largest current, whose linkage no wider gap reaches",
        ),
        _check(
            "virtual work: one force 60 % too large, share of the peak [-]",
            expected=0.6 * float(-force[14, 8]) / peak,
            computed=planted.share,
            tolerance=1e-4,
            source=words,
        ),
        _check(
            "virtual work: current of that point [A]",
            expected=7.0,
            computed=planted.current,
            tolerance=1e-13,
            source=words,
        ),
        _check(
            "virtual work: gap of that point [um]",
            expected=60.0,
            computed=1e6 * planted.gap,
            tolerance=1e-13,
            source=words,
        ),
        _check(
            "virtual work: ratio of the force of half a model [-]",
            expected=0.5,
            computed=half.ratio,
            tolerance=5e-4,
            source="least squares over the table",
        ),
    ]


def _lifting_magnet() -> list[Check]:
    """Published linkages and forces of finite elements, at one current and wide gaps."""
    made = FluxMap.of(
        current=[0.0, published.CURRENT],
        gap=published.GAP,
        linkage=[0.0 * published.GAP, published.CURRENT * published.INDUCTANCE],
        force=None,
    )
    source = "finite elements; Modelica Standard Library, ComparisonQuasiStatic"
    out = []
    for first, last in ((7, 13), (13, 19)):
        part = slice(first, last + 1)
        x = published.GAP[part]
        psi = published.CURRENT * published.INDUCTANCE[part]
        derived = [made.force_at(float(p), float(g)) for p, g in zip(psi, x, strict=True)]
        out.append(
            _check(
                f"lifting magnet as a map: work from {1e3 * x[0]:.1f} to {1e3 * x[-1]:.1f} mm at "
                "1.2 A, from its inductances [mJ]",
                expected=1e3 * float(simpson(published.FORCE[part], x=x)),
                computed=1e3 * float(simpson(derived, x=x)),
                tolerance=0.05,
                source=source,
                reason="linear between 0 and 1.2 A, though the iron saturates a little",
            )
        )
    return out


def maps_from_files() -> list[Check]:
    """Return the checks."""
    return [*_layouts(), *_virtual_work(), *_lifting_magnet()]
