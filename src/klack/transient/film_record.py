"""Where the land of a squeeze film is over a step, as the film was solved: for records."""

from klack.arrays import Vector
from klack.compiling.jit import inner
from klack.transient.interface_arrays import Films, State
from klack.transient.tilting_films import contact_resultant, film_state

__all__ = ["tell_land"]


@inner
def tell_land(films: Films, k: int, state: State, q: Vector, out: Vector) -> None:
    """Write lift and tilts of film ``k`` at the start and at the end of a step, shape (6,).

    Called when the film has been found and before the contact is: ``q`` is what the film saw, and
    the contact forces are those of the step before (:mod:`klack.transient.tilting_films`).
    """
    D, held = films.compliance[k], contact_resultant(films, k, state.lam)
    first, last = film_state(films, k, state.q), film_state(films, k, q)
    for c in range(3):
        out[c], out[c + 3] = first[c], last[c]
        for d in range(3):
            out[c] += D[c, d] * (state.films[k, d + 3] + held[d])
            out[c + 3] += D[c, d] * (state.films[k, d] + held[d])
