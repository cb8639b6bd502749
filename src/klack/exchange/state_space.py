r"""State space of a modal model: first order A, B, C, D and sparse second order M, D, K, B, C.

With the state ``x = (q, v)`` of modal displacements and velocities and the forces ``u``,

.. math::
    \dot x = A x + B u + x_c, \qquad y = C x + D u + y_0 .

Inputs of a body are the forces on its ports; of a pair the outside forces, then each contact
force; its outputs end with the gaps, to be fed back to contact forces
(:mod:`klack.exchange.modal_model`). ``x_c`` and ``y_0`` (constant forces, gaps at ``q = 0``) are
zero for a body.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, diags_array

from klack.contact.laws import HertzLaw, HuntCrossley, LinearLaw, TableLaw
from klack.contact.step_constants import RELAXATION
from klack.errors import InputError, optional_package, refuse_if
from klack.exchange.modal_model import ModalModel, ModelContact

if TYPE_CHECKING:
    import control

__all__ = [
    "ContactKind",
    "FirstOrder",
    "SecondOrder",
    "contact_kind",
    "law_table",
    "relaxation_time",
    "second_order",
    "start_speed",
    "state_space",
    "to_control",
]

ContactKind = Literal["none", "linear", "power", "table"]
"""Squeeze film alone, ``F = k d``, ``F = K d^n``, piecewise cubic."""


_LARGEST = 2**31 - 2**20
"""Bytes of A: MATLAB 5 holds less than 2 GiB in a structure."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FirstOrder:
    """First-order form, ``n = 2 m`` states.

    Parameters
    ----------
    A, B, C, D (n, n), (n, n_inputs), (n_outputs, n), (n_outputs, n_inputs)
        D is zero.
    residual_feedthrough (n_outputs, n_inputs) [m/N]
        D with the residual compliance of a body; zero for a pair.
    constant_rate (n,)
        ``x_c``.
    output_offset (n_outputs,)
        ``y_0``.
    start (n,)
    state_names, state_units, input_names, input_units, output_names, output_units
        Modal displacements are in m sqrt(kg).
    """

    A: NDArray[np.float64]
    B: NDArray[np.float64]
    C: NDArray[np.float64]
    D: NDArray[np.float64]
    residual_feedthrough: NDArray[np.float64]
    constant_rate: NDArray[np.float64]
    output_offset: NDArray[np.float64]
    start: NDArray[np.float64]
    state_names: tuple[str, ...]
    state_units: tuple[str, ...]
    input_names: tuple[str, ...]
    input_units: tuple[str, ...]
    output_names: tuple[str, ...]
    output_units: tuple[str, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class SecondOrder:
    """Second-order form ``M q'' + D q' + K q = B u``, ``y = C q + G q'``, sparse.

    Parameters
    ----------
    M, D, K (m, m)
        Identity, ``2 zeta omega``, ``omega^2``.
    B (m, n_inputs)
    C, G (n_outputs, m)
        Of modal displacements and velocities.
    """

    M: csc_array
    D: csc_array
    K: csc_array
    B: csc_array
    C: csc_array
    G: csc_array


def state_space(model: ModalModel) -> FirstOrder:
    """First-order form, inputs, outputs and contacts in the order of the model.

    Rejects more modes than fit into 2 GB, and none.
    """
    m = model.mode_count
    _require_size(model)
    push, moved, speed = _matrices(model)
    A = np.zeros((2 * m, 2 * m))
    i = np.arange(m)
    A[i, m + i] = 1.0
    A[m + i, i] = -(model.omega**2)
    A[m + i, m + i] = -2.0 * model.damping * model.omega
    offsets = [output.offset for output in model.outputs]
    contacts = [contact.name for contact in model.contacts]
    D = np.zeros((len(moved), push.shape[1]))
    return FirstOrder(
        A=A,
        B=np.vstack([np.zeros_like(push), push]),
        C=np.hstack([moved, speed]),
        D=D,
        residual_feedthrough=_with_residual(model, D),
        constant_rate=np.concatenate([np.zeros(m), model.constant]),
        output_offset=np.array([*offsets, *(contact.gap for contact in model.contacts)]),
        start=np.concatenate([model.start, model.start_velocity]),
        state_names=tuple(f"{kind}_{name}" for kind in "qv" for name in model.mode_names),
        state_units=("m.kg^(1/2)",) * m + ("m/s.kg^(1/2)",) * m,
        input_names=(
            *(item.name for item in model.inputs),
            *(f"total_force_{name}" for name in contacts),
        ),
        input_units=("N",) * push.shape[1],
        output_names=(
            *(output.name for output in model.outputs),
            *(f"gap_{name}" for name in contacts),
        ),
        output_units=(
            *("m" if output.quantity == "displacement" else "m/s" for output in model.outputs),
            *("m" for _ in contacts),
        ),
    )


def second_order(model: ModalModel) -> SecondOrder:
    """Second-order form, inputs and outputs of :func:`state_space`."""
    push, moved, speed = _matrices(model)
    return SecondOrder(
        M=csc_array(diags_array(np.ones(model.mode_count))),
        D=csc_array(diags_array(2.0 * model.damping * model.omega)),
        K=csc_array(diags_array(model.omega**2)),
        B=csc_array(push),
        C=csc_array(moved),
        G=csc_array(speed),
    )


def to_control(model: ModalModel, *, residual_compliance: bool = False) -> "control.StateSpace":
    """Linear part as an object of python-control, with all names.

    Without constant forces, gaps at ``q = 0`` and start: see :func:`state_space`.

    Parameters
    ----------
    residual_compliance
        Of a body, to be put into D.

    Raises
    ------
    MissingExtraError
        Without the package ``control``.
    """
    control = optional_package("control", "A model for python-control", None)
    form = state_space(model)
    return control.StateSpace(
        form.A,
        form.B,
        form.C,
        form.residual_feedthrough if residual_compliance else form.D,
        name=model.name,
        states=list(form.state_names),
        inputs=list(form.input_names),
        outputs=list(form.output_names),
        remove_useless_states=False,
    )


def start_speed(model: ModalModel) -> float:
    """Initial velocity [m/s] of the moving body of a pair, + opening; 0 for a body."""
    square = float(model.rise @ model.rise)
    return float(model.rise @ model.start_velocity) / square if square else 0.0


def relaxation_time(model: ModalModel) -> float:
    """Time constant [s] of a series compliance whose film is weak: a fifth of klack's step.

    With the usual 20 ns it moves the peak force by less than 1e-6 and the rebound speed by 2e-5
    (two rods with a strong film); a shorter one is stiffer.
    """
    return RELAXATION * model.step


def contact_kind(contact: ModelContact) -> ContactKind:
    """Form of the elastic law of a contact.

    Rejects dissipation, which needs the speed of each first touch, and would count the wave losses
    of bodies with modes twice.
    """
    law = contact.law
    if law is None:
        return "none"
    if isinstance(law, LinearLaw):
        return "linear"
    if isinstance(law, HertzLaw):
        return "power"
    if isinstance(law, TableLaw):
        return "table"
    assert isinstance(law, HuntCrossley)
    raise InputError(
        f"contact '{contact.name}'",
        got="a law with dissipation (Hunt and Crossley)",
        expected="an elastic law: consistent, linear, Hertz or table",
        hint="bodies with modes lose energy by vibration; use the consistent law of klack.",
    )


def law_table(contact: ModelContact) -> NDArray[np.float64]:
    """Rows of a table law: start [m], force there [N], factors of s, s^2, s^3; shape (k, 5).

    The last row is the endless linear continuation.
    """
    law = contact.law
    assert isinstance(law, TableLaw)
    return np.column_stack([law.indentation, law.force_points, *law.coefficients])


def _matrices(
    model: ModalModel,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Modal forces of inputs and contacts; factors of q and v in outputs and gaps."""
    gaps = np.array([contact.shape for contact in model.contacts]).reshape(-1, model.mode_count)
    moved, speed = model.output_matrices()
    return (
        np.hstack([model.input_matrix(), gaps.T]),
        np.vstack([moved, gaps]),
        np.vstack([speed, np.zeros_like(gaps)]),
    )


def _with_residual(model: ModalModel, D: NDArray[np.float64]) -> NDArray[np.float64]:
    """D with residual compliance at displacements of ports with input."""
    out = D.copy()
    if model.kind == "body":
        rows = {output.name: i for i, output in enumerate(model.outputs)}
        for k, item in enumerate(model.inputs):
            row = rows.get(f"displacement_{item.name.removeprefix('force_')}")
            if row is not None:
                out[row] = model.residual_compliance[k]
    return out


def _require_size(model: ModalModel) -> None:
    states = 2 * model.mode_count
    refuse_if(
        states**2 * 8 > _LARGEST,
        f"model '{model.name}'",
        got=f"{states} states: a dense A of {states**2 * 8 / 2**30:.1f} GiB",
        expected="less than 2 GiB, the limit of MATLAB files of version 5",
        hint="keep fewer modes: frequencies above 2 MHz are irrelevant for an impact.",
    )
