"""Squeeze films, which stop a needle before metal touches metal."""

from abc import abstractmethod
from functools import cache
from math import cos, exp, pi, sin, sinh
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from klack.errors import InputError
from klack.hydraulics.network_fluid import network_fluid
from klack.input.problem import CaseProblem, refuse_key_if
from klack.input.section import Section
from klack.network.ranges import value_text
from klack.network.rows import FilmRow, Rows
from klack.units import Angle, Length, Pressure, format_si

__all__ = [
    "ConeFilm",
    "DiscFilm",
    "Film",
    "FilmShape",
    "RingFilm",
    "SphereFilm",
    "flow_factor",
    "mean_flow_factor",
]

SMOOTH_CUT_OFF = 0.3e-6  # [m]
_CUT_OFF_HEIGHTS = 3.0  # asperities begin to touch at three times the roughness
_LOWEST_HEIGHTS = 0.5  # the flow factor is a fit above it
_LEAST_RISE = 20.0  # of a spherical face over its cut-off: below that it is nearly a disc


def flow_factor(height: float) -> float:
    """Pressure flow factor of an isotropic rough gap, ``phi = 1 - 0.9 exp(-0.56 h/sigma)``.

    Relative to a smooth gap of the same mean height (Patir and Cheng 1978).

    Parameters
    ----------
    height [-]
        Gap over composite roughness, ``h/sigma``; a fit for about 0.5 and above.
    """
    return 1.0 - 0.9 * exp(-0.56 * height)


def mean_flow_factor(lowest: float) -> float:
    r"""Flow factor of a whole approach: the one number that gives the same film impulse.

    .. math:: \frac{1}{\bar\phi} = \frac{\int_{h_r}^\infty h^{-3}/\phi\,\mathrm dh}
              {\int_{h_r}^\infty h^{-3}\,\mathrm dh}
              = 2 \int_0^1 \frac{u\,\mathrm du}{\phi(h_r/(u\,\sigma))}

    Parameters
    ----------
    lowest [-]
        Cut-off over composite roughness, ``h_r/sigma``.

    Examples
    --------
    >>> round(mean_flow_factor(3.0), 4), round(mean_flow_factor(1e6), 4)
    (0.9158, 1.0)
    """
    x, weight = _gauss_points()
    u = 0.5 * (x + 1.0)
    return float(1.0 / np.sum(weight * u / np.array([flow_factor(lowest / v) for v in u])))


@cache
def _gauss_points() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return np.polynomial.legendre.leggauss(40)


class Film(Section):
    r"""Incompressible viscous film between two faces that approach with ``V`` (Reynolds 1886).

    .. math:: F = \Bigl(\frac{B}{h^3} + \frac{C}{h}\Bigr) V, \qquad h = \max(g, 0) + h_r

    ``g`` is the gap of the law, ``h_r`` a cut-off that stands for the roughness: asperities leave
    some height for the fluid.  It bounds the impulse of the film, ``B/(2 h_r^2)``; without it a
    viscous film would never let the faces touch.

    With ``roughness`` asperities resist the flow (:func:`mean_flow_factor`).  While the faces part
    the film pulls, at most with ``(p - p_cav) A``: then it cavitates.

    Limits: both edges at one constant pressure; no inertia of the fluid (``rho h V / mu`` up to
    about 1); rigid faces in parallel (the bodies' own compliance is in series, see
    :class:`klack.mechanics.end_stop.EndStop`); a thin, gas-free film can carry a tension of some
    MPa for less than a millisecond, for which a lower ``cavitation_pressure`` can stand.
    """

    roughness: Length | None = Field(
        default=None, gt=0, description="Composite rms roughness sigma of both faces."
    )
    cut_off: Length | None = Field(
        default=None,
        gt=0,
        description="Film height h_r left at first touch; default: 3 roughness, or 0.3 um "
        "without a "
        "roughness.",
    )
    pressure: Pressure | None = Field(
        default=None, gt=0, description="Around the film, absolute; default: the ambient pressure."
    )
    cavitation_pressure: Pressure | None = Field(
        default=None, description="Absolute; default: the vapour pressure; negative for tension."
    )

    sectors: int = Field(
        default=36,
        ge=8,
        le=360,
        description="Sectors round the circumference of a land that can tilt.",
    )

    @model_validator(mode="after")
    def _cut_off_above_roughness(self) -> Self:
        if self.roughness and self.cut_off and self.cut_off < _LOWEST_HEIGHTS * self.roughness:
            raise CaseProblem(
                ("cut_off",),
                got=format_si(self.cut_off, "m"),
                expected=f"half the roughness ({format_si(self.roughness, 'm')}) or more",
                hint="1 to 3 times the roughness is usual; the default is 3 times.",
            )
        return self

    @property
    @abstractmethod
    def area(self) -> float:
        """Area [m^2] of the film, seen along the axis."""

    @abstractmethod
    def coefficients(self) -> tuple[float, float]:
        """``B/mu`` [m^4] and ``C/mu`` [m^2] of smooth faces; the axial gap counts."""

    @property
    def lowest_height(self) -> float:
        """Cut-off ``h_r`` [m] that acts."""
        if self.cut_off is not None:
            return self.cut_off
        return _CUT_OFF_HEIGHTS * self.roughness if self.roughness else SMOOTH_CUT_OFF

    def film_row(self, viscosity: float, tension: float) -> FilmRow:
        """Row of the film in a fluid of this ``viscosity`` [Pa s].

        ``tension`` [Pa] is the pressure around it less that at which it cavitates.
        """
        cubic, linear = self.coefficients()
        factor = 1.0
        if self.roughness:
            factor = mean_flow_factor(self.normal(self.lowest_height) / self.roughness)
        return FilmRow(
            cubic=viscosity * cubic / factor,
            linear=viscosity * linear,
            cut_off=self.lowest_height,
            suction=tension * self.area,
        )

    def normal(self, axial: float) -> float:
        """Gap [m] normal to the faces."""
        return axial

    def row(self, rows: Rows) -> FilmRow:
        """Row of the film in the fluid of a network."""
        fluid = network_fluid(rows)
        around = rows.ambient.pressure if self.pressure is None else self.pressure
        cavitation = self.cavitation_pressure
        if cavitation is None:
            cavitation = fluid.vapour_pressure
        if cavitation > around:
            raise self._all_vapour(rows.component, fluid.name, cavitation, around)
        return self.film_row(float(fluid.viscosity(around)), around - cavitation)

    def _all_vapour(
        self, component: str, fluid: str, cavitation: float, around: float
    ) -> InputError:
        limit, words = value_text(cavitation, "Pa"), value_text(around, "Pa")
        film = f"the film of '{component}'"
        if self.cavitation_pressure is not None:
            return InputError(
                f"network.components.{component}.film.cavitation_pressure",
                got=f"{limit} absolute",
                expected=f"less than the pressure around the film, {words}",
                hint="pressures are absolute; the default is the vapour pressure.",
            )
        key, hint = (
            "network.ambient.pressure",
            f"give {film} its own 'pressure', the one in the valve; ambient pressure is about 1 "
            "bar absolute, at which a hot fluid may boil.",
        )
        if self.pressure is not None:
            key = f"network.components.{component}.film.pressure"
            hint = "pressures are absolute; a hot fluid boils at a higher pressure."
        return InputError(
            key,
            got=f"{words} absolute around {film}",
            expected=f"more than the vapour pressure of {fluid}, {limit}",
            hint=hint,
        )


class DiscFilm(Film):
    r"""Film under a round flat face, ``B = 3 pi mu R^4 / 2`` (Reynolds 1886; Stefan 1874)."""

    shape: Literal["disc"] = Field(description="Which shape: disc.")
    radius: Length = Field(gt=0, description="Radius R.")

    @property
    def area(self) -> float:
        """Area [m^2]."""
        return pi * self.radius**2

    def coefficients(self) -> tuple[float, float]:
        """``B/mu`` [m^4]; no shear."""
        return 1.5 * pi * self.radius**4, 0.0


class RingFilm(Film):
    r"""Film under a flat ring, both edges at the same pressure.

    .. math:: B = \frac{3\pi\mu}{2}\Bigl[R_2^4 - R_1^4
              - \frac{(R_2^2 - R_1^2)^2}{\ln(R_2/R_1)}\Bigr]

    (Reynolds' equation in polar coordinates), here as ``3 pi mu (R_1 R_2)^2 2 sinh t [cosh t -
    sinh(t)/t]`` with ``t = ln(R_2/R_1)``, which keeps its digits for narrow rings.  An unvented
    pocket inside is a chamber of its own.
    """

    shape: Literal["ring"] = Field(description="Which shape: ring.")
    inner_radius: Length = Field(gt=0, description="Inner radius R1.")
    outer_radius: Length = Field(gt=0, description="Outer radius R2.")

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        refuse_key_if(
            self.outer_radius <= self.inner_radius,
            ("outer_radius",),
            got=format_si(self.outer_radius, "m"),
            expected=f"more than the inner radius, {format_si(self.inner_radius, 'm')}",
            hint="swap them, or check their units.",
        )
        return self

    @property
    def area(self) -> float:
        """Area [m^2]."""
        return (
            pi * (self.outer_radius - self.inner_radius) * (self.outer_radius + self.inner_radius)
        )

    def coefficients(self) -> tuple[float, float]:
        """``B/mu`` [m^4]; no shear."""
        t = np.log1p((self.outer_radius - self.inner_radius) / self.inner_radius)
        product = self.inner_radius * self.outer_radius
        return float(6.0 * pi * product**2 * sinh(t) * _cosh_less_sinc(t)), 0.0


class ConeFilm(Film):
    r"""Film on the land of a conical seat, narrow against its radius.

    .. math:: F = \Bigl[\frac{\mu L w^3}{x^3 \sin\alpha}
              + \frac{\mu L w \cos^2\alpha}{x \sin\alpha}\Bigr] V, \qquad L = 2\pi r_m

    ``x`` is the *axial* gap, the film is ``x sin(alpha)`` high: squeeze normal to the land, and
    shear along it.  The narrow land is 0.2 % off at ``R_1/R_2 = 0.7``.
    """

    shape: Literal["cone"] = Field(description="Which shape: cone.")
    mean_radius: Length = Field(gt=0, description="Radius r_m of the middle of the land.")
    width: Length = Field(gt=0, description="Width w of the land, along the slant.")
    half_angle: Angle = Field(
        gt=0, le=pi / 2, description="Between the axis and the cone surface; 90 deg is flat."
    )

    @model_validator(mode="after")
    def _narrow(self) -> Self:
        refuse_key_if(
            0.5 * self.width * sin(self.half_angle) >= self.mean_radius,
            ("width",),
            got=format_si(self.width, "m"),
            expected=f"less than the cone at a mean radius {format_si(self.mean_radius, 'm')}",
            hint="the land must not reach the axis; check radius (not diameter) and width.",
        )
        return self

    @property
    def area(self) -> float:
        """Area of the land, seen along the axis [m^2]."""
        return 2.0 * pi * self.mean_radius * self.width * sin(self.half_angle)

    def normal(self, axial: float) -> float:
        """Film height [m] at an axial gap [m]."""
        return axial * sin(self.half_angle)

    def coefficients(self) -> tuple[float, float]:
        """``B/mu`` [m^4] and ``C/mu`` [m^2] over the axial gap."""
        land = 2.0 * pi * self.mean_radius * self.width / sin(self.half_angle)
        return land * self.width**2, land * cos(self.half_angle) ** 2


class SphereFilm(Film):
    r"""Film between a spherical face and a flat one.

    .. math:: h = z + h_r + \frac{r^2}{2R}, \qquad F = \frac{6\pi\mu R^2}{z + h_r}\, V

    Reynolds' equation with the parabola for the sphere (Cox and Brenner 1967).  Two spheres: ``R``
    with ``1/R = 1/R_1 + 1/R_2``.  The momentum lost between two heights is ``6 pi mu R^2`` times
    the logarithm of their ratio, so roughness and the first distance matter little.

    The face ends at ``edge_radius`` ``a``, where the sphere has risen by ``s = a^2/2R``.  Its exact
    force is the above times ``(s/(h + s))^2``: the film is too strong by ``2h/s`` at small ``h``,
    its impulse by a factor of ``1/(1 - 1/ln(s/h_r))`` from ``h = s`` on.  So an end stop takes a
    travel up to ``s``, and ``s`` must be 20 cut-offs or more: below that the face is nearly a disc.

    ``roughness`` sets the cut-off only: the flow factor would add to the logarithm 0.007 at a
    cut-off of 3 roughnesses, 0.12 at one.
    """

    shape: Literal["sphere"] = Field(description="Which shape: sphere.")
    radius: Length = Field(gt=0, description="Radius R of the sphere, of curvature of a crown.")
    edge_radius: Length | None = Field(
        default=None,
        gt=0,
        description="Radius at which the spherical face ends; default: the radius R.",
    )

    @model_validator(mode="after")
    def _curved(self) -> Self:
        refuse_key_if(
            self.face_radius > self.radius,
            ("edge_radius",),
            got=format_si(self.face_radius, "m"),
            expected=f"at most the radius of the sphere, {format_si(self.radius, 'm')}",
            hint="'radius' is the radius of the sphere, 'edge_radius' the radius of the face "
            "seen from above.",
        )
        refuse_key_if(
            self.rise < _LEAST_RISE * self.lowest_height,
            ("radius",),
            got=f"a face that rises by {format_si(self.rise, 'm')} to its edge",
            expected=f"a rise above {_LEAST_RISE:g} cut-offs, "
            f"{format_si(_LEAST_RISE * self.lowest_height, 'm')}",
            hint="such a flat face is nearly a disc: use shape: disc.",
        )
        return self

    @property
    def face_radius(self) -> float:
        """Radius [m] of the face, seen along the axis."""
        return self.radius if self.edge_radius is None else self.edge_radius

    @property
    def rise(self) -> float:
        """Height [m] of the edge over the middle of the face, of the parabola."""
        return self.face_radius**2 / (2.0 * self.radius)

    @property
    def area(self) -> float:
        """Area [m^2], seen along the axis."""
        return pi * self.face_radius**2

    def coefficients(self) -> tuple[float, float]:
        """``C/mu`` [m^2]; no cubic part."""
        return 0.0, 6.0 * pi * self.radius**2


FilmShape = Annotated[DiscFilm | RingFilm | ConeFilm | SphereFilm, Field(discriminator="shape")]


def _cosh_less_sinc(t: float) -> float:
    """``cosh t - sinh(t)/t``, also for small ``t``."""
    if t > 1.0:
        return float(np.cosh(t) - sinh(t) / t)
    total, power = 0.0, 1.0
    for n in range(1, 12):
        power *= t * t / ((2 * n) * (2 * n + 1))  # t^2n / (2n + 1)!
        total += 2 * n * power
    return total
