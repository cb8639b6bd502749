"""Truth: what holds for every impact of two bodies (energy, momentum, unilateral contact, scaling).

Materials from rubber to diamond, bodies from 1 um to 1 m, up to 200 modes, steps over four decades.
"""

from dataclasses import dataclass, replace
from math import pi, sqrt

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from property_profiles import examples

from klack.contact.history import ImpactHistory
from klack.contact.laws import ContactLaw, HertzLaw, HuntCrossley, LinearLaw, TableLaw
from klack.contact.restitution import measure_impact
from klack.simulation.bodies import fixed_body, rigid_mass_body, rod_body
from klack.simulation.impact import propose_step, simulate, simulate_impact
from klack.simulation.system import AxialForce, ContactPair, ReducedSystem

MOST_STEPS = 3000


def log_range(low: float, high: float) -> st.SearchStrategy[float]:
    """Numbers between two bounds, every decade alike."""
    return st.floats(np.log(low), np.log(high)).map(lambda x: float(np.exp(x)))


@dataclass(frozen=True, kw_only=True)
class Setup:
    """Two bodies and what is between them, as numbers without a unit system.

    Lengths count in sizes of body a, speeds in its wave speed, forces in ``E A``.
    """

    size: float  # [m] length of a
    slender: float  # diameter over length
    young: float  # [Pa]
    density: float  # [kg/m^3]
    ratio: float  # length of b over length of a
    modes: tuple[int, int]
    damping: float
    support: str  # of b
    kind: str  # of the law
    stiffness: float  # of the law at the depth of the impact, over E A / L
    exponent: float
    dissipation: float
    series: float  # compliance in series over that of the law
    gap: float  # way before the touch over the way in a time of contact
    mach: float  # speed over wave speed
    press: float  # constant force over the impact force
    step: float  # over the proposed step

    @property
    def wave_speed(self) -> float:
        return sqrt(self.young / self.density)

    @property
    def area(self) -> float:
        return pi / 4 * (self.slender * self.size) ** 2

    @property
    def axial_stiffness(self) -> float:
        return self.young * self.area / self.size

    @property
    def speed(self) -> float:
        return self.mach * self.wave_speed

    @property
    def mass(self) -> float:
        return self.density * self.area * self.size

    @property
    def contact_time(self) -> float:
        """Half a period of the mass of a on the law, and two passes of a wave."""
        k = self.stiffness * self.axial_stiffness
        return pi * sqrt(self.mass / k) + 2.0 * self.size / self.wave_speed

    def law(self) -> ContactLaw:
        k = self.stiffness * self.axial_stiffness
        depth = self.speed * sqrt(self.mass / k)
        n = self.exponent
        curved = k * depth ** (1.0 - n)
        if self.kind == "linear":
            law = LinearLaw(k)
        elif self.kind == "hertz":
            law = HertzLaw(curved, n)
        else:
            d = depth * np.linspace(0.0, 1.5, 25)[1:] ** 1.3
            law = TableLaw(d, curved * d**n)
        return HuntCrossley(law, self.dissipation) if self.dissipation else law

    def system(self, *, rigid: bool = False, swapped: bool = False) -> ReducedSystem:
        material = {"young": self.young, "density": self.density, "area": self.area}
        if rigid:
            a, b = rigid_mass_body("a", self.mass), fixed_body("b")
            if self.support == "free":
                b = rigid_mass_body("b", self.ratio * self.mass)
            ports = ("contact", "contact")
        else:
            a = rod_body(
                "a",
                length=self.size,
                elastic_modes=self.modes[0],
                damping=self.damping,
                **material,
            )
            b = rod_body(
                "b",
                length=self.ratio * self.size,
                elastic_modes=self.modes[1],
                damping=self.damping,
                support=self.support,
                **material,
            )
            ports = ("bottom", "top")
        k = self.stiffness * self.axial_stiffness
        pair = ContactPair(
            body_a="a",
            port_a=ports[0],
            body_b="b",
            port_b=ports[1],
            law=self.law(),
            gap=self.gap * self.speed * self.contact_time,
            series_compliance=self.series / k,
        )
        force = -self.press * self.speed * sqrt(self.mass * k)
        forces = (AxialForce(body="a", force=force),) if force else ()
        return ReducedSystem(bodies=(b, a) if swapped else (a, b), contacts=(pair,), forces=forces)

    def times(self, system: ReducedSystem) -> tuple[float, float]:
        """Step and duration: until well after the impact, or as far as the steps allow."""
        step = self.step * propose_step(system, speed=self.speed)
        return step, min((2.0 + self.gap) * self.contact_time, MOST_STEPS * step)


SETUPS = st.builds(
    Setup,
    size=log_range(1e-6, 1.0),
    slender=st.floats(0.02, 0.5),
    young=log_range(1e6, 1e12),
    density=log_range(100.0, 20000.0),
    ratio=log_range(0.1, 10.0),
    modes=st.tuples(st.integers(0, 200), st.integers(1, 200)),
    damping=st.sampled_from([0.0, 0.0, 1e-4, 0.02, 0.3, 1.0]),
    support=st.sampled_from(["free", "bottom"]),
    kind=st.sampled_from(["linear", "hertz", "table"]),
    stiffness=log_range(1e-3, 1e3),
    exponent=st.sampled_from([1.0, 1.1, 1.5, 2.0, 3.0]),
    dissipation=st.sampled_from([0.0, 0.0, 0.1, 1.0, 10.0]),
    series=st.sampled_from([0.0, 0.0, 0.1, 3.0]),
    gap=st.sampled_from([0.0, 1e-6, 0.1, 3.0]),
    mach=log_range(1e-9, 0.02),
    press=st.sampled_from([0.0, 0.0, 1e-3, 0.3]),
    step=log_range(0.1, 1000.0),
)


def run(setup: Setup, system: ReducedSystem, **more: int) -> ImpactHistory:
    step, duration = setup.times(system)
    return simulate_impact(system, speed=setup.speed, step=step, duration=duration, **more)


@pytest.mark.slow
@examples(40)
@given(SETUPS)
def test_energy_and_momentum_balance_and_the_contact_never_pulls(setup):
    """The ledger itself is asserted in every run, see ``energy_ledger``."""
    history = run(setup, setup.system())
    ledger, m = history.ledger, setup.mass

    assert abs(ledger.residual) < 1e-9
    assert np.all(history.force >= 0.0)
    assert np.all(history.peak_force >= history.force * (1.0 - 1e-12))
    if setup.step <= 1.0:
        # no force without touch: a step with force is closed at one of its ends at least
        deepest = max(-2.0 * float(history.gap.min()), 0.0)
        way = 2.0 * float(np.abs(np.diff(history.gap)).max())
        assert np.all(history.force[history.gap > deepest + way] == 0.0)
    # energy is never created: what is left is never more than what came
    held = sum(body.total for body in ledger.bodies) + ledger.contact
    assert held <= (ledger.initial + ledger.work) * (1.0 + 1e-9) + 1e-300
    # each body gains what was pushed
    push = history.external_force
    gained = m * (history.velocity_a - history.velocity_a[0])[1:]
    given_to_a = np.cumsum(history.force + push) * history.step
    scale = m * setup.speed + np.abs(np.cumsum(push)).max() * history.step
    np.testing.assert_allclose(gained, given_to_a, rtol=0.0, atol=1e-9 * scale)
    if setup.support == "free":
        gained = history.mass_b * history.velocity_b[1:]
        np.testing.assert_allclose(
            gained, -np.cumsum(history.force) * history.step, rtol=0.0, atol=1e-9 * scale
        )


@examples(40)
@given(SETUPS)
def test_rigid_bodies_rebound_with_a_restitution_between_0_and_1(setup):
    setup = replace(setup, press=0.0, series=0.0, step=min(setup.step, 1.0))
    history = run(setup, setup.system(rigid=True))
    assume(history.force.max() > 0.0)
    assume(history.force[-1] == 0.0)  # a lossy contact may take longer to open
    m = measure_impact(history)

    assert -1e-9 <= m.restitution <= 1.0 + 1e-9
    assert m.dissipated_share == pytest.approx(1.0 - m.restitution**2, abs=1e-9)
    assert m.restitution_from_impulse == pytest.approx(m.restitution, abs=1e-9)
    if not setup.dissipation:
        assert m.restitution == pytest.approx(1.0, abs=1e-9)


@pytest.mark.slow
@examples(40)
@given(SETUPS, st.integers(-9, 9), st.integers(-9, 9), st.integers(-9, 9))
def test_scaled_units_give_the_same_impact(setup, length, time, mass):
    """Buckingham's Pi theorem: scaled by powers of four nothing but exponents of two changes.

    Powers of two are exact in floating point, and so are the roots of powers of four: every digit
    must be the same (1e-9 is left for the power function of curved laws).
    """
    L, T, M = 4.0**length, 4.0**time, 4.0**mass
    system = setup.system()
    step, duration = setup.times(system)
    scaled = replace(
        setup,
        size=setup.size * L,
        young=setup.young * M / (L * T**2),
        density=setup.density * M / L**3,
    )
    a = simulate_impact(system, speed=setup.speed, step=step, duration=duration)
    b = simulate_impact(scaled.system(), speed=scaled.speed, step=step * T, duration=duration * T)

    first = slice(0, _first_contact(a))
    for values, factor in (("force", M * L / T**2), ("gap", L), ("velocity_a", L / T)):
        x, y = getattr(a, values)[first] * factor, getattr(b, values)[first]
        np.testing.assert_allclose(y, x, rtol=0.0, atol=1e-9 * np.abs(x).max(), err_msg=values)


def _first_contact(history: ImpactHistory) -> int:
    """Records up to the end of the first contact: chatter after it may be chaotic."""
    closed = history.force > 0.0
    if not np.any(closed):
        return len(closed)
    start = int(np.argmax(closed))
    return start + int(np.argmin(np.append(closed[start:], False)))


@examples(12)
@given(SETUPS)
def test_order_of_bodies_and_of_records_does_not_matter(setup):
    setup = replace(setup, step=min(setup.step, 10.0))
    system = setup.system()
    plain = run(setup, system)
    swapped = run(setup, setup.system(swapped=True))
    sparse = run(setup, system, steps_per_record=5)

    assume(plain.force.max() > 0.0)
    first = _first_contact(plain)
    scale = plain.force.max()
    np.testing.assert_allclose(swapped.force[:first], plain.force[:first], atol=1e-9 * scale)
    whole = first // 5
    mean = plain.force[: 5 * whole].reshape(whole, 5).mean(axis=1)
    np.testing.assert_allclose(sparse.force[:whole], mean, atol=1e-9 * scale)


@examples(25)
@given(SETUPS, st.sampled_from(["bottom", "top"]), st.sampled_from(["bottom", "top"]))
def test_compliance_is_reciprocal_and_passive(setup, here, there):
    """Betti; and what the kept modes miss is never below zero at a port."""
    for body in setup.system().bodies:
        C = body.static_compliance
        R = body.residual_compliance
        assert np.allclose(C, C.T)
        assert np.allclose(R, R.T)
        assert np.all(np.diag(R) >= -1e-12 * np.diag(C))
        i, j = body.port_names.index(here), body.port_names.index(there)
        assert R[i, j] ** 2 <= R[i, i] * R[j, j] * (1 + 1e-9) + (1e-12 * np.max(C)) ** 2


@pytest.mark.slow
@examples(12)
@given(SETUPS, st.integers(2, 6))
def test_two_parallel_contacts_of_every_scale_settle(setup, share):
    """Shares of one linear law side by side are that law, for bodies of every size."""
    setup = replace(setup, kind="linear", dissipation=0.0, series=0.0, press=0.0)
    setup = replace(setup, step=min(setup.step, 1.0), modes=(min(setup.modes[0], 40), 40))
    system = setup.system()
    pair = system.contacts[0]
    k = pair.law.stiffness
    parts = (k / share, k - k / share)
    shared = replace(system, contacts=tuple(replace(pair, law=LinearLaw(x)) for x in parts))
    step, duration = setup.times(system)
    one, two = (
        simulate(x, velocities={"a": -setup.speed}, step=step, duration=duration)
        for x in (system, shared)
    )

    first = _first_contact(one.impact())
    scale = one.force.max()
    total = two.force.sum(axis=1)[:first]
    np.testing.assert_allclose(total, one.force[:first, 0], rtol=0.0, atol=1e-6 * scale)
