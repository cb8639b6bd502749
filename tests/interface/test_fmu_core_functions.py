"""The C functions of FMI 2.0, one by one, and the building of FMUs."""

import threading
from contextlib import suppress

import numpy as np
import pytest
from c_compiler import needs_compiler

from klack.contact.laws import TableLaw
from klack.exchange.fmu.build import build_fmu
from klack.exchange.fmu.variables import fmu_variables
from klack.exchange.modal_model import Provenance, body_model, pair_model
from klack.network.rows import FilmRow
from klack.simulation.bodies import rod_body
from klack.simulation.propagator import modal_propagator
from klack.verification.one_dimension import one_contact

fmpy = pytest.importorskip("fmpy")
pytestmark = [pytest.mark.slow, needs_compiler]

STEEL = {"young": 2.1e11, "density": 7850.0}
TABLE = TableLaw(np.array([0.2, 0.5, 1.0, 2.0]) * 1e-6, [20.0, 70.0, 190.0, 520.0])
FILM = FilmRow(cubic=5e-17, linear=4e-12, cut_off=0.3e-6, suction=2.0)
MADE = Provenance(case="rods", title="Rods", version="1", created="2026-01-01T00:00:00")
NEEDLE = rod_body("needle", length=0.03, area=1.2e-5, elastic_modes=6, damping=0.01, **STEEL)
SEAT = rod_body("seat", length=0.05, area=6e-5, elastic_modes=7, support="bottom", **STEEL)
H = 1e-6  # [s]


def pair(law=TABLE, film=None, series=0.0, name="rods"):
    return pair_model(
        name,
        one_contact(NEEDLE, SEAT, law, gap=0.3e-6, series=series),
        moving="needle",
        contact_names=["seat"],
        films=(film,),
        speed=-0.4,
        step=20e-9,
        duration=6e-5,
        provenance=MADE,
    )


MODELS = {
    "dry": pair(),
    "film": pair(film=FILM),
    "film in series": pair(film=FILM, series=2e-9),
    "body": body_model(NEEDLE, provenance=MADE, step=20e-9),
}
NAMES = ["contact_force", "mean_contact_force", "gap", "lift", "velocity"]


class Unit:
    """An unpacked FMU and what its instances said."""

    def __init__(self, model, folder):
        self.model = model
        path = build_fmu(model, folder / f"{model.name}.fmu", fmi=2)
        self.folder = fmpy.extract(str(path), str(folder / "unpacked"))
        self.guid = fmpy.read_model_description(self.folder).guid
        self.references = {v.name: i for i, v in enumerate(fmu_variables(model))}
        self.said: list[str] = []

    def instance(self, kind="stepping"):
        from ctypes import CFUNCTYPE, c_char_p, c_int, c_void_p

        from fmpy.fmi2 import FMU2Model, FMU2Slave, fmi2CallbackFunctions

        def log(_environment, _name, _status, _category, message, function, text):
            self.said.append((message % (function, text)).decode())

        # the messages of this FMU have two words to fill in
        self.log = CFUNCTYPE(
            None, c_void_p, c_char_p, c_int, c_char_p, c_char_p, c_char_p, c_char_p
        )(log)
        callbacks = fmi2CallbackFunctions()
        callbacks.logger = type(callbacks.logger)(ctypes_address(self.log))
        factory = {"exchange": FMU2Model, "stepping": FMU2Slave}[kind]
        fmu = factory(guid=self.guid, unzipDirectory=self.folder, modelIdentifier=self.model.name)
        self.callbacks = callbacks
        fmu.instantiate(callbacks=callbacks)
        return fmu

    def started(self, kind="stepping", **values):
        fmu = self.instance(kind)
        fmu.setupExperiment()
        self.set(fmu, **values)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        return fmu

    def set(self, fmu, **values):
        fmu.setReal([self.references[name] for name in values], list(values.values()))

    def get(self, fmu, *names):
        return np.array(fmu.getReal([self.references[name] for name in names]))


def ctypes_address(function):
    from ctypes import c_void_p, cast

    return cast(function, c_void_p).value


@pytest.fixture(scope="module")
def units(tmp_path_factory):
    return {name: Unit(model, tmp_path_factory.mktemp("unit")) for name, model in MODELS.items()}


# ------------------------------------------------------------------------- saved states


@pytest.mark.parametrize("name", ["dry", "film", "film in series"])
@pytest.mark.parametrize("by_bytes", [False, True], ids=["in memory", "by bytes"])
def test_saved_state_goes_on_bit_by_bit(units, name, by_bytes):
    unit = units[name]
    names = ["contact_force", "mean_contact_force", "gap", "lift", "velocity"]
    fmu = unit.started(force=-30.0)
    for i in range(4):
        fmu.doStep(i * H, H)
    assert unit.get(fmu, "contact_force")[0] > 10.0
    state = fmu.getFMUState()
    if by_bytes:
        held = fmu.serializeFMUState(state)
        state = fmu.deserializeFMUState(held)

    def rest(instance):
        out = []
        for i in range(4, 30):
            instance.doStep(i * H, H)
            out.append(unit.get(instance, *names))
        return np.array(out)

    first = rest(fmu)
    fmu.setFMUState(state)
    assert np.array_equal(first, rest(fmu))
    if by_bytes:
        other = unit.started()
        other.setFMUState(other.deserializeFMUState(held))
        assert np.array_equal(first, rest(other))


def test_bytes_that_are_no_state_are_refused(units):
    from fmpy.fmi1 import FMICallException

    unit = units["dry"]
    fmu = unit.started()
    good = fmu.serializeFMUState(fmu.getFMUState())
    for bad in (good[:-1], b"", good + b"x", b"x" + good[1:], bytes(len(good))):
        with pytest.raises(Exception, match="fmi2DeSerializeFMUstate"):
            fmu.deserializeFMUState(bad)
    rng = np.random.default_rng(1)
    for _ in range(200):  # any other bytes: refused, or a state that can be stepped
        bad = bytearray(good)
        bad[int(rng.integers(96, len(good)))] ^= int(rng.integers(1, 256))
        with suppress(FMICallException):
            fmu.setFMUState(fmu.deserializeFMUState(bytes(bad)))
            unit.get(fmu, "gap")


# ------------------------------------------------------------------------- instances


def test_two_instances_at_once_do_not_know_of_each_other(units):
    unit = units["dry"]
    speeds = (-0.4, -0.2)
    alone = [history(unit, speed) for speed in speeds]
    found = [None, None]

    def work(k):
        found[k] = history(unit, speeds[k])

    threads = [threading.Thread(target=work, args=(k,)) for k in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for a, b in zip(alone, found, strict=True):
        assert np.array_equal(a, b)
    assert not np.array_equal(*alone)


def history(unit, speed):
    fmu = unit.started(start_velocity=speed)
    out = []
    for i in range(40):
        fmu.doStep(i * H, H)
        out.append(unit.get(fmu, *NAMES))
    return np.array(out)


def test_reset_starts_anew(units):
    unit = units["dry"]
    first = history(unit, -0.3)
    fmu = unit.started(start_velocity=-0.1)
    fmu.doStep(0.0, 20 * H)
    fmu.reset()
    fmu.setupExperiment()
    unit.set(fmu, start_velocity=-0.3)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    fmu.doStep(0.0, H)
    assert np.array_equal(unit.get(fmu, *NAMES), first[0])


def test_start_parameters_move_the_needle(units):
    unit = units["dry"]
    fmu = unit.started(start_velocity=0.25, start_rise=2e-6)
    assert unit.get(fmu, "velocity")[0] == pytest.approx(0.25, rel=1e-14)
    assert unit.get(fmu, "gap")[0] == pytest.approx(2.3e-6, rel=1e-14)
    assert unit.get(fmu, "contact_force")[0] == 0.0


# ------------------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("action", "words"),
    [
        (lambda u, f: f.doStep(1e-3, H), "not where the last step ended"),
        (lambda u, f: f.doStep(0.0, -H), "below zero"),
        (lambda u, f: f.doStep(0.0, float("nan")), "below zero"),
        (lambda u, f: u.set(f, start_rise=1e-6), "before the start only"),
        (lambda u, f: u.set(f, gap=1e-6), "only inputs"),
        (lambda u, f: u.set(f, force=float("nan")), "finite"),
        (lambda u, f: f.getReal([9999]), "no variable"),
        (lambda u, f: f.setInteger([0], [1]), "no variable has this type"),
        (lambda u, f: f.enterInitializationMode(), "at this stage"),
        (lambda u, f: f.setupExperiment(), "at this stage"),
    ],
)
def test_what_cannot_be_done_is_refused_with_a_reason(units, action, words):
    unit = units["dry"]
    fmu = unit.started()
    unit.said.clear()
    with pytest.raises(Exception, match="fmi2"):
        action(unit, fmu)
    assert words in " ".join(unit.said)
    fmu.doStep(0.0, H)  # and nothing is broken


def test_after_a_motion_without_end_only_a_reset_helps(units):
    unit = units["dry"]
    fmu = unit.started(force=1e308)
    for words in ("not finite", "at this stage"):
        with pytest.raises(Exception, match="fmi2DoStep"):
            fmu.doStep(0.0, 1e-3)
        assert words in unit.said[-1]
    fmu.reset()
    fmu.setupExperiment()
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    fmu.doStep(0.0, H)
    assert np.all(np.isfinite(unit.get(fmu, *NAMES)))


def test_wrong_guid_and_missing_model_exchange(units):
    unit = units["film in series"]
    with pytest.raises(Exception, match="nstantiate"):
        unit.instance("exchange")
    assert "no model exchange" in unit.said[-1]
    unit.guid, right = "{0}", unit.guid
    try:
        with pytest.raises(Exception, match="nstantiate"):
            unit.instance()
    finally:
        unit.guid = right
    assert "GUID" in unit.said[-1]


def test_step_of_no_length_changes_nothing(units):
    unit = units["dry"]
    fmu = unit.started()
    fmu.doStep(0.0, 4 * H)
    before = unit.get(fmu, *NAMES)
    fmu.doStep(4 * H, 0.0)
    assert np.array_equal(unit.get(fmu, *NAMES), before)


# ------------------------------------------------------------------------- equations


def test_body_takes_any_step_exactly(units):
    """One step of 1 ms under 3 N is the exact propagator of that length."""
    unit, model = units["body"], MODELS["body"]
    fmu = unit.started(force_top=3.0)
    fmu.doStep(0.0, 1e-3)
    P = modal_propagator(model.omega, model.damping, 1e-3)
    y = NEEDLE.port_shapes.T @ (P.B1 * 3.0 * NEEDLE.port_shapes[:, NEEDLE.port_index("top")])
    assert unit.get(fmu, "displacement_bottom", "displacement_top") == pytest.approx(y, rel=1e-13)


@pytest.mark.parametrize("name", ["dry", "film", "body"])
def test_directional_derivatives_are_differences(units, name):
    unit, model = units[name], MODELS[name]
    fmu = unit.started("exchange")
    fmu.enterContinuousTimeMode()
    m = model.mode_count
    names = list(unit.references)
    states = [unit.references[f"{kind}_{mode}"] for kind in "qv" for mode in model.mode_names]
    unknown = [r for r, n in enumerate(names) if n.startswith("der(") or r in _outputs(model)]
    rng = np.random.default_rng(3)
    x = np.concatenate([1e-7 * rng.uniform(-1, 1, m), 1e-2 * rng.uniform(-1, 1, m)])
    x[:m] += model.start - model.rise * (0.8e-6 if name == "dry" else -1e-6)

    def values(at):
        import ctypes

        fmu.setContinuousStates((ctypes.c_double * (2 * m))(*at), 2 * m)
        return np.array(fmu.getReal(unknown))

    if name == "dry":
        values(x)
        assert unit.get(fmu, "contact_force")[0] > 1.0
    for j in rng.choice(2 * m, 8, replace=False):
        step = 1e-12 if j < m else 1e-6
        up, down = x.copy(), x.copy()
        up[j] += step
        down[j] -= step
        difference = (values(up) - values(down)) / (up[j] - down[j])
        values(x)
        own = np.array(fmu.getDirectionalDerivative(unknown, [states[j]], [1.0]))
        scale = np.max(np.abs(difference))
        assert np.max(np.abs(own - difference)) < 1e-4 * scale
        large = np.abs(difference) > 1e-6 * scale
        assert own[large] == pytest.approx(difference[large], rel=2e-3)


def _outputs(model):
    return {r for r, v in enumerate(fmu_variables(model)) if v.causality == "output"}
