"""End stop of a needle: contact, squeeze film, and the compliance behind them."""

from typing import ClassVar, Self

from pydantic import Field, PrivateAttr, model_validator

from klack.contact.laws import ContactLaw, HuntCrossley, LinearLaw, gonthier_coefficient
from klack.contact.rubbing_law import RubbingLaw
from klack.contact.yielding_law import YieldingLaw
from klack.errors import InputError
from klack.hydraulics.film import FilmShape, SphereFilm
from klack.input.problem import CaseProblem, refuse_key_if
from klack.mechanics.stop_law import ConsistentStopLaw, LinearStopLaw, StopLaw
from klack.network.component import Component
from klack.network.port import ELEMENT
from klack.network.rows import Rows
from klack.units import Compliance, Length, Ratio, format_si

__all__ = ["EndStop"]


class EndStop(Component):
    r"""Where two bodies meet: a contact law and a squeeze film side by side, then a compliance.

    .. math:: z = g + e, \qquad g = g_0 + y_\text{upper} - y_\text{lower}, \qquad e = D F, \qquad
              F = F_\text{contact}(-z) + F_\text{film}(z, \dot z)

    ``upper`` is the part that lies in +z: the stop at the opening end, the needle at the seat.  A
    force above zero presses the parts apart; only the film can pull.

    Film and asperities press on the bulk of the bodies, so the compliance ``D`` is in series.  With
    a film parallel to the whole spring, as in simpler models, the fluid would be squeezed out of a
    gap that the elastic faces do not have.

    ``restitution`` adds the dashpot of Hunt and Crossley with the factor of Gonthier et al. (2004),
    for rigid bodies only: in modal bodies the waves take that energy.

    Faces with friction (:class:`klack.contact.rubbing_law.RubbingLaw`) or that yield
    (:class:`klack.contact.yielding_law.YieldingLaw`) have a law with memory; the gap of the latter
    is larger by the set of earlier impacts.

    Limits: parallel, centred faces.
    """

    type: ClassVar[str] = "end-stop"
    ports: ClassVar = {"upper": ELEMENT, "lower": ELEMENT}

    gap: Length = Field(
        ge=0, description="Gap between the parts at the start: the lift to the stop."
    )
    law: StopLaw | None = Field(
        default=None, description="Contact law; without it only a film acts."
    )
    restitution: Ratio | None = Field(
        default=None,
        gt=0,
        le=1,
        description="Restitution of rigid bodies; leave it out for modal bodies.",
    )
    series_compliance: Compliance = Field(
        default=0.0, ge=0, description="Residual compliance of the bulk behind the faces."
    )
    film: FilmShape | None = Field(default=None, description="Squeeze film between the faces.")

    _computed: ContactLaw | RubbingLaw | YieldingLaw | None = PrivateAttr(default=None)

    @model_validator(mode="after")
    def _something_acts(self) -> Self:
        refuse_key_if(
            self.law is None and self.film is None,
            (),
            got="neither law nor film",
            expected="at least one of them",
            hint="add law: {kind: consistent} or {kind: linear, stiffness: 1e9 N/m}.",
        )
        refuse_key_if(
            self.law is None and self.restitution is not None,
            ("restitution",),
            got="restitution without a law",
            expected="a contact law that it applies to",
            hint="remove it: a film has its own loss.",
            on_key=True,
        )
        return self

    @model_validator(mode="after")
    def _within_the_sphere(self) -> Self:
        film = self.film
        if isinstance(film, SphereFilm) and self.gap > film.rise * (1.0 + 1e-9):
            raise CaseProblem(
                ("film", "radius" if film.edge_radius is None else "edge_radius"),
                got=f"a face that rises by {format_si(film.rise, 'm')} to its edge",
                expected=f"a rise of the gap, {format_si(self.gap, 'm')}, or more",
                hint="farther away the film is not spherical; use shape: disc for a flat crown, "
                "or leave edge_radius out for a whole sphere.",
            )
        return self

    def with_law(
        self, law: ContactLaw | RubbingLaw | YieldingLaw, series_compliance: float = 0.0
    ) -> Self:
        """Same end stop with a law that was computed, e.g. the consistent one.

        Parameters
        ----------
        series_compliance [m/N]
        """
        stop = self.model_copy(update={"series_compliance": series_compliance})
        stop._computed = law
        return stop

    def contact_law(self) -> ContactLaw | RubbingLaw | YieldingLaw | None:
        """Law that acts; InputError if a consistent law was not filled in."""
        if self._computed is not None:
            law: ContactLaw | RubbingLaw | YieldingLaw = self._computed
        elif self.law is None:
            return None
        elif isinstance(self.law, ConsistentStopLaw):
            raise InputError(
                "EndStop.law",
                got="a consistent law that has not been computed",
                expected="a law from the static contact of the two bodies",
                hint="a case names the surfaces under 'stops'; in Python call with_law(...).",
            )
        else:
            law = self.law.contact_law()
        if self.restitution is None or isinstance(law, HuntCrossley):
            return law
        if isinstance(law, RubbingLaw | YieldingLaw):
            what = "friction between the faces" if isinstance(law, RubbingLaw) else "yield"
            raise InputError(
                "EndStop.restitution",
                got=f"{self.restitution:g} together with {what}",
                expected="only one of them: a restitution represents all losses of an impact",
                hint=f"leave the restitution out; {what} and modes absorb the energy.",
            )
        return HuntCrossley(law, gonthier_coefficient(self.restitution))

    def lumped(self, stiffness: float, restitution: float | None) -> Self:
        """Same end stop with one spring [N/m] and one dashpot; a film stays."""
        law = LinearStopLaw(kind="linear", stiffness=LinearLaw(stiffness).stiffness)
        stop = self.model_copy(
            update={"law": law, "restitution": restitution, "series_compliance": 0.0}
        )
        stop._computed = None
        return stop

    def dry(self) -> Self | None:
        """Same end stop without its film; None if it had nothing else."""
        if self.law is None:
            return None
        return self.model_copy(update={"film": None})

    def add_rows(self, rows: Rows) -> None:
        """Add one interface."""
        rows.interface(
            upper=rows.port("upper"),
            lower=rows.port("lower"),
            gap=self.gap,
            law=self.contact_law(),
            series_compliance=self.series_compliance,
            film=self.film.row(rows) if self.film else None,
        )
