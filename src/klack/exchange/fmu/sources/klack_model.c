/* The model: variables, model exchange, and co-simulation with klack's own time integration. */
#define KLACK_ARRAYS
#include "klack_state.h"
#include "klack_steps.h"

size_t klack_size(void) { return sizeof(klack_model); }
unsigned klack_variable_count(void) { return KLACK_VARIABLES; }
unsigned klack_state_count(void) { return 2 * M; }
unsigned klack_event_count(void) { return C; }
int klack_has_model_exchange(void) { return KLACK_HAS_MODEL_EXCHANGE; }
const char *klack_message(const klack_model *m) { return m->message; }
double klack_get_time(const klack_model *m) { return m->time; }

void klack_reset(klack_model *m) {
    int i, c;
    memset(m, 0, sizeof *m);
    m->internal_step = klack_default_step;
    m->start_velocity = klack_default_velocity;
    for (i = 0; i < M; i++) {
        m->q[i] = klack_start[i];
        m->v[i] = klack_start_speed[i];
    }
    for (c = 0; c < C; c++) m->contacts[c].approaching = 1;
}

int klack_check(klack_model *m) {
    int c, wrong = !(m->internal_step >= LEAST_STEP);
    m->message[sizeof m->message - 1] = '\0';
    for (c = 0; c < C; c++) {
        const double *law = klack_law + klack_law_first[c];
        int last = klack_law_kind[c] == KLACK_LAW_TABLE ? (int)law[0] - 1 : 0;
        wrong = wrong || m->contacts[c].hint < 0 || m->contacts[c].hint > last;
    }
    return wrong ? failed(m, "the saved state is not one of this model") : 0;
}

/* ------------------------------------------------------------- forces of a state */

/* elastic law in series with a compliance, F = law(-(g + D F)), by safeguarded Newton */
static klack_force series_force(klack_model *m, int c, double g) {
    const double *p = klack_law + klack_law_first[c];
    double D = klack_series[c], low = 0.0, high = -g, d = high;
    klack_force f = {0.0, 0.0};
    int turn;
    if (g >= 0.0 || klack_law_kind[c] == KLACK_NO_LAW) return f;
    f = klack_law_at(klack_law_kind[c], p, d, &m->contacts[c].hint);
    for (turn = 0; turn < 200 && D > 0.0; turn++) {
        double excess = d + g + D * f.force, after = d - excess / (1.0 + D * f.slope);
        if (excess > 0.0) {
            high = d;
        } else {
            low = d;
        }
        if (!(low <= after && after <= high)) after = 0.5 * (low + high);
        if (fabs(after - d) <= 1e-16 * -g) break;
        d = after;
        f = klack_law_at(klack_law_kind[c], p, d, &m->contacts[c].hint);
    }
    f.slope /= 1.0 + D * f.slope;
    return f;
}

/* contact and film forces at this instant, and what they change by with gap and rate */
static void forces_now(klack_model *m) {
    int c;
    for (c = 0; c < C; c++) {
        contact *k = &m->contacts[c];
        double g = gap_now(m, c), rate = dot(klack_gap_row[c], m->v);
        double factor = klack_largest(1.0 - k->rate * rate, 0.0);
        klack_force f = series_force(m, c, g);
        k->gap = g;
        k->of_force.gap = -f.slope * factor;
        k->of_force.rate = factor > 0.0 ? -f.force * k->rate : 0.0;
        k->of_film.gap = k->of_film.rate = k->film = 0.0;
        k->force = k->mean = k->peak = f.force * factor;
        if (klack_has_film[c] && !k->closed && KLACK_HAS_MODEL_EXCHANGE) {
            double x = klack_largest(g, 0.0) + klack_cut_off[c];
            double cubic = klack_cubic[c] / (x * x), damper = (cubic + klack_linear[c]) / x;
            k->film = klack_largest(-damper * rate, -klack_suction[c]);
            if (k->film > -klack_suction[c]) {
                k->of_film.rate = -damper;
                if (g > 0.0) k->of_film.gap = (3.0 * cubic + klack_linear[c]) / (x * x) * rate;
            }
        }
    }
}

/* up to date for what is asked next; after a communication step its mean forces stay */
static void look(klack_model *m) {
    if (m->held || m->sloped) return;
    forces_now(m);
    m->sloped = 1;
}

static void moved(klack_model *m) {
    m->held = 0;
    m->sloped = 0;
}

/* ------------------------------------------------------------- variables */

static int parameter(klack_model *m, unsigned which, double value) {
    double *state = which == 1 ? m->v : m->q;
    double *known = which == 1 ? &m->start_velocity : &m->start_rise;
    int i;
    if (which == 0) {
        if (!(value >= LEAST_STEP)) return failed(m, "internal_step has to be 1e-12 s or more");
        m->internal_step = value;
        return 0;
    }
    for (i = 0; i < M; i++) state[i] += klack_rise[i] * (value - *known);
    *known = value;
    moved(m);
    return 0;
}

int klack_set_real(klack_model *m, unsigned reference, double value) {
    if (!(fabs(value) <= 1.7e308)) return failed(m, "a value is not a finite number");
    if (reference < KLACK_INPUTS) {
        m->input[reference] = value;
        return 0;
    }
    if (reference < KLACK_INTERNAL_STEP || reference >= FIRST_RATE) {
        return failed(m, "only inputs, parameters and states at the start can be set");
    }
    if (m->started) return failed(m, "parameters and states can be set before the start only");
    if (reference < FIRST_STATE) return parameter(m, reference - KLACK_INTERNAL_STEP, value);
    reference -= FIRST_STATE;
    if (reference < M) {
        m->q[reference] = value;
    } else {
        m->v[reference - M] = value;
    }
    moved(m);
    return 0;
}

static double acceleration(const klack_model *m, int i) {
    double w = klack_omega[i], a = klack_constant[i] - w * (2.0 * klack_damping[i] * m->v[i] + w * m->q[i]);
    int k;
    for (k = 0; k < KLACK_INPUTS; k++) a += klack_input[k][i] * m->input[k];
    for (k = 0; k < C; k++) {
        a += klack_gap_row[k][i] * (m->contacts[k].force + m->contacts[k].film);
    }
    return a;
}

static double of_contact(const klack_model *m, unsigned reference) {
    int c = 0, which;
    const contact *k;
    while ((int)reference >= klack_contact_first[c + 1]) c++;
    k = &m->contacts[c];
    which = (int)reference - klack_contact_first[c];
    return which == 0   ? k->gap
           : which == 1 ? k->force
           : which == 2 ? k->mean
           : which == 3 ? k->peak
                        : k->film;
}

int klack_get_real(klack_model *m, unsigned reference, double *value) {
    unsigned i = reference - KLACK_INPUTS;
    if (reference < KLACK_INPUTS) {
        *value = m->input[reference];
    } else if (i < KLACK_OUTPUTS) {
        *value = klack_output_offset[i] + dot(klack_output[i], klack_output_moves[i] ? m->v : m->q);
    } else if (reference < KLACK_INTERNAL_STEP) {
        look(m);
        *value = of_contact(m, reference);
    } else if (reference < FIRST_STATE) {
        i = reference - KLACK_INTERNAL_STEP;
        *value = i == 0 ? m->internal_step : i == 1 ? m->start_velocity : m->start_rise;
    } else if (reference < FIRST_RATE) {
        i = reference - FIRST_STATE;
        *value = i < M ? m->q[i] : m->v[i - M];
    } else if (reference < KLACK_VARIABLES) {
        i = reference - FIRST_RATE;
        look(m);
        *value = i < M ? m->v[i] : acceleration(m, (int)i - M);
    } else {
        return failed(m, "no variable has this value reference");
    }
    return 0;
}

int klack_initialize(klack_model *m, double start_time) {
    m->time = start_time;
    m->started = 1;
    return klack_update_events(m);
}

/* ------------------------------------------------------------- model exchange */

int klack_set_time(klack_model *m, double time) {
    m->time = time;
    return 0;
}

int klack_set_states(klack_model *m, const double *x) {
    memcpy(m->q, x, M * sizeof *x);
    memcpy(m->v, x + M, M * sizeof *x);
    moved(m);
    return 0;
}

int klack_get_states(klack_model *m, double *x) {
    memcpy(x, m->q, M * sizeof *x);
    memcpy(x + M, m->v, M * sizeof *x);
    return 0;
}

int klack_get_derivatives(klack_model *m, double *dx) {
    int i;
    look(m);
    for (i = 0; i < M; i++) {
        dx[i] = m->v[i];
        dx[M + i] = acceleration(m, i);
        if (!(fabs(dx[M + i]) <= 1.7e308)) return failed(m, "the motion is not finite");
    }
    return 0;
}

int klack_get_nominals(klack_model *m, double *nominal) {
    (void)m;
    memcpy(nominal, klack_nominal, 2 * M * sizeof *nominal);
    return 0;
}

int klack_get_events(klack_model *m, double *indicator) {
    int c;
    look(m);
    for (c = 0; c < C; c++) indicator[c] = m->contacts[c].gap;
    return 0;
}

/* A film ends where the contact closes; a damped law takes the speed of its first touch. */
int klack_update_events(klack_model *m) {
    int c;
    for (c = 0; c < C; c++) {
        contact *k = &m->contacts[c];
        double g = gap_now(m, c), rate = dot(klack_gap_row[c], m->v);
        k->closed = fabs(g) > 1e-12 ? g < 0.0 : rate < 0.0;
        if (k->closed && k->approaching && klack_dissipation[c] > 0.0) {
            k->rate = klack_dissipation[c] / klack_largest(-rate, KLACK_FILMS ? KLACK_SLOWEST : KLACK_LEAST_WAY);
            k->approaching = 0;
        } else if (!k->closed) { /* events are located: each touch has its own speed */
            k->approaching = 1;
            k->rate = 0.0;
        }
    }
    m->sloped = 0;
    return 0;
}

int klack_complete_step(klack_model *m) {
    (void)m;
    return 0;
}

int klack_directional(klack_model *m, unsigned unknown, unsigned known, double *value) {
    int velocity, j, c;
    *value = 0.0;
    if (unknown < KLACK_INPUTS || unknown >= KLACK_VARIABLES ||
        (unknown >= KLACK_INTERNAL_STEP && unknown < FIRST_RATE)) {
        return failed(m, "only outputs and rates have derivatives");
    }
    if (known < KLACK_INPUTS) {
        if (unknown >= FIRST_RATE + M) *value = klack_input[known][unknown - FIRST_RATE - M];
        return 0;
    }
    if (known < FIRST_STATE || known >= FIRST_RATE) {
        return failed(m, "derivatives are known for inputs and states only");
    }
    look(m);
    velocity = known >= FIRST_STATE + M;
    j = (int)known - FIRST_STATE - velocity * M;
    if (unknown < KLACK_INPUTS + KLACK_OUTPUTS) {
        unknown -= KLACK_INPUTS;
        if (klack_output_moves[unknown] == velocity) *value = klack_output[unknown][j];
    } else if (unknown < KLACK_INTERNAL_STEP) {
        const klack_slope gap = {1.0, 0.0}, *slope = &gap;
        int which;
        for (c = 0; (int)unknown >= klack_contact_first[c + 1];) c++;
        which = (int)unknown - klack_contact_first[c];
        if (which > 0) slope = which < 4 ? &m->contacts[c].of_force : &m->contacts[c].of_film;
        *value = (velocity ? slope->rate : slope->gap) * klack_gap_row[c][j];
    } else if (unknown < FIRST_RATE + M) {
        *value = velocity && j == (int)unknown - FIRST_RATE;
    } else {
        int i = (int)unknown - FIRST_RATE - M;
        double w = klack_omega[i];
        if (i == j) *value = velocity ? -2.0 * klack_damping[i] * w : -w * w;
        for (c = 0; c < C; c++) {
            const klack_slope *f = &m->contacts[c].of_force, *s = &m->contacts[c].of_film;
            double factor = velocity ? f->rate + s->rate : f->gap + s->gap;
            *value += klack_gap_row[c][i] * factor * klack_gap_row[c][j];
        }
    }
    return 0;
}
