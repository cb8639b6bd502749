"""Contact points that are left out of the fine steps of a macro step.

Only points that may close within it at their present speed are computed; a bound on what else can
close a gap tells when one of the others might have.  Truth: the same steps with all points, and
the time at which the gap of the other point closes, in closed form.
"""

from dataclasses import dataclass, replace
from math import acos, asin, inf, pi, sqrt

import numpy as np
import pytest
from spatial_needle import ABOVE, BELOW, Needle, move, ring

from klack.network.rows import FilmRow
from klack.transient import spatial_run
from klack.transient.interface_arrays import Films, Guide, Outside, Record, State
from klack.transient.interface_kernel import FINISHED, LEFT_OUT, march, march_near
from klack.transient.interface_model import InterfaceModel
from klack.transient.interface_run import contact_points, modes_of_step, near_points
from klack.transient.tilting_films import film_arrays
from klack.verification.interface_bodies import modal_model
from klack.verification.off_axis import FACE, film_of, needle_on_ring

STEP = 20e-9
ALL = 1.0  # [m] margin with which no point is left out
FEW = 0.2e-6


@dataclass(frozen=True, kw_only=True)
class Motion:
    """Bodies at the start of a macro step, and when the gap of a point that is left out closes."""

    model: InterfaceModel
    rigid: int
    steps: int
    closes: float  # [s]
    q: tuple[float, ...] | np.ndarray
    v: tuple[float, ...] | np.ndarray
    push: tuple[float, ...] | np.ndarray
    films: Films | None = None
    film: float = 0.0  # [N] of the step before

    def run(self, margin: float | None = None) -> tuple[int, State]:
        """Status and end, of points within a margin, or of all of them."""
        model, lands = self.model, 0 if self.films is None else 1
        modes = modes_of_step(model, STEP)._replace(push=np.array(self.push, float))
        room = {"films": lands, "sectors": 36}
        state = State.still(model.mode_count, model.count, 0, **room)
        state.q[:], state.v[:] = self.q, self.v
        state.films[:, 0] = self.film
        record = Record.empty(
            self.steps, len(model.bodies), model.count, keep_points=True, films=lands
        )
        points = contact_points(model, modes.B1, STEP)
        given = modes, Outside(1.0, 0.0), points._replace(gap=model.gap.copy())
        # films stand beside a guide in valves: without its heights the same compiled loop serves
        bore = None if self.films is None else Guide.none(model.mode_count)
        rest = bore, self.films, state, record
        if margin is None:
            return march(self.steps, 0, *given, *rest)[1], state
        near = near_points(model, self.rigid)
        return march_near(self.steps, margin, *given, near, *rest), state


def model_of(omega, traces, gap, compliance=None):
    """Two points, of 1e8 N/m by default, on modes of 1 kg."""
    soft = 1e-8 * np.eye(2) if compliance is None else np.array(compliance)
    return modal_model(
        masses=(1.0, inf),
        omega=np.array(omega),
        traces=np.array(traces),
        compliance=soft,
        gap=np.array(gap),
        points=np.zeros((len(gap), 3)),
    )


def turned():
    """A force turns the needle about one point: the gap of the other is g - a t^2 / 2."""
    gap, pull = 1e-6, 2e6
    return Motion(
        model=model_of((0.0, 0.0), ((1.0, 0.0), (0.0, 1.0)), (0.1e-6, gap)),
        rigid=2,
        steps=64,
        closes=sqrt(2.0 * gap / pull),
        q=(0.0, 0.0),
        v=(0.0, 0.0),
        push=(0.0, -pull),
    )


def swung():
    """An elastic mode turns back: g + A cos(omega t) closes without a speed at the start."""
    gap, amplitude, omega = 1e-6, 2e-6, 2.0 * pi * 500e3
    return Motion(
        model=model_of((0.0, omega), ((1.0, 0.0), (0.0, 1.0)), (0.1e-6, gap)),
        rigid=1,
        steps=48,
        closes=acos(-gap / amplitude) / omega,
        q=(0.0, amplitude),
        v=(0.0, 0.0),
        push=(0.0, 0.0),
    )


def pressed():
    """The force at one point pulls down the face beside it: g - c v sqrt(m / k) sin(omega t)."""
    gap, speed, soft, share = 0.6e-6, 0.5, 1e-8, 0.9
    omega = sqrt(1.0 / soft / 3e-3)
    coupled = soft * np.array([[1.0, -share], [-share, 1.0]])
    return Motion(
        model=model_of((0.0,), ((3e-3**-0.5,), (0.0,)), (0.0, gap), coupled),
        rigid=1,
        steps=100,
        closes=asin(gap * omega / (share * speed)) / omega,
        q=(0.0,),
        v=(-speed * sqrt(3e-3),),
        push=(0.0,),
    )


def relaxed():
    """A film without viscosity lets go in the first step: g + D F becomes g, below zero."""
    force, series = 20.0, 0.15e-6
    model = needle_on_ring(gap=-0.5e-6)
    row = FilmRow(cubic=1e-9 * FACE.coefficients()[0], linear=0.0, cut_off=1e-6, suction=1.0)
    none = np.zeros(0)
    lean = np.zeros(6)
    lean[3] = 0.3e-6 / np.max(np.abs(model.traces[:, 3]))
    return Motion(
        model=model,
        rigid=6,
        steps=4,
        closes=0.0,
        q=lean,
        v=np.zeros(6),
        push=np.zeros(6),
        films=film_arrays(
            model, [film_of(model)], {"contact": row}, {"contact": series}, none, none
        ),
        film=force,
    )


@pytest.mark.parametrize("motion", [turned, swung, pressed, relaxed])
def test_a_point_that_closes_is_not_left_out(motion):
    """By a force on rigid bodies, by an elastic mode, by contact forces and by a film."""
    case = motion()
    before, after = int(case.closes / STEP), int(case.closes / STEP) + 2
    other = int(np.argmax(case.model.gap + case.model.traces @ case.q))

    assert after <= case.steps
    assert replace(case, steps=before).run()[1].lam[other] == 0.0
    assert replace(case, steps=after).run()[1].lam[other] > 0.0
    assert replace(case, steps=int(0.9 * before)).run(FEW)[0] == FINISHED
    for steps in (after, case.steps):
        assert replace(case, steps=steps).run(FEW)[0] == LEFT_OUT
    assert_same(case.run(ALL), case.run())


def assert_same(some, whole):
    """Both have gone to the end, to the same state but for round-off."""
    (status, some), (finished, whole) = some, whole
    assert status == finished == FINISHED
    for name in ("q", "v", "lam"):
        value, truth = getattr(some, name), getattr(whole, name)
        np.testing.assert_allclose(value, truth, rtol=1e-9, atol=1e-9 * np.max(np.abs(truth)))


def any_motion(seed):
    """Six points on rigid and elastic modes of 1 g, gaps of a micrometre."""
    random = np.random.default_rng(seed)
    rigid, elastic, points = random.integers(1, 4), random.integers(0, 4), 6
    M, scale = rigid + elastic, sqrt(1e-3)
    omega = np.concatenate([np.zeros(rigid), 2.0 * pi * random.uniform(20e3, 600e3, elastic)])
    couples = np.eye(points) + 0.05 * random.normal(size=(points, points))
    traces = random.normal(size=(points, M)) / scale
    gap = random.uniform(0.1e-6, 6e-6, points)
    return Motion(
        model=model_of(omega, traces, gap, 1e-8 * couples @ couples.T),
        rigid=rigid,
        steps=64,
        closes=0.0,
        q=np.where(omega > 0.0, 0.1e-6 * scale * random.normal(size=M), 0.0),
        v=0.5 * scale * random.normal(size=M),
        push=0.1e6 * scale * random.normal(size=M),
    )


def test_what_goes_to_the_end_is_as_with_all_points():
    told = [compared(any_motion(seed)) for seed in range(200)]

    assert 40 < told.count(LEFT_OUT) < 160


def compared(case):
    """Status with few points, after a comparison with all of them."""
    some = case.run(FEW)
    if some[0] == FINISHED:
        assert_same(some, case.run())
    return some[0]


@pytest.mark.slow
def test_a_stroke_is_the_same_with_as_few_points_as_may_be(monkeypatch):
    """In a network: steps with a point that was missed are taken again with more."""
    needle = Needle(seat=ring(8, 0.6e-3, BELOW), stop=ring(8, 2e-3, ABOVE)).with_modes()
    placed = {"placement": np.array([0, 0, 8e-6, 2e-3, 1e-3, 0.0])}
    forces = []
    for margin in (1e-12, ALL):
        monkeypatch.setattr(spatial_run, "_MARGIN", margin)
        run = move(needle.rows({}, speed=-0.5), needle.valve(**placed), 80e-6, start="free")
        forces.append([(event.time, event.peak_force, event.impulse) for event in run.events])

    assert len(forces[0]) == len(forces[1]) > 0
    np.testing.assert_allclose(*forces, rtol=1e-9)
