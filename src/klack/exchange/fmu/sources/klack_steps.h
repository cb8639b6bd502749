/* Co-simulation: exact propagation of all modes, contact forces by discrete gradients, as in
   klack.simulation.single_contact and klack.simulation.kernel.

   One step is one pass over the modes (free motion, with the forces of the step before folded in)
   and a scalar equation for each contact.  Under forces from outside, held over a communication
   step, elastic modes are counted from their rest position, and the motion of the others runs
   beside the pass (superposition).                                                            */
#ifndef KLACK_STEPS_H
#define KLACK_STEPS_H

#include "klack_state.h"

#define SOFT 100.0 /* [rad/s] slower modes are not counted from their rest position */
#define ROUND_OFF 1e-16  /* of a gap: no film force is known better */
#define MOST_STEPS 1e12

/* versions of the pass for several processors, chosen when the library is loaded */
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__GLIBC__)
#define FOR_PROCESSORS __attribute__((target_clones("avx2", "default")))
#else
#define FOR_PROCESSORS
#endif
#if defined(__GNUC__)
#define ALIGNED __attribute__((aligned(64)))
#else
#define ALIGNED
#endif

typedef struct {
    double q[P], v[P];            /* elastic modes from their rest position */
    double extra_q[P], extra_v[P]; /* of soft modes by the forces from outside */
    double rest[P], push[P];
    int soft[P], soft_count;
} motion;

/* free motion over a step; y becomes rows . q */
FOR_PROCESSORS
static void pass_free(double *restrict q, double *restrict v, const matrices *restrict A,
                      double *restrict y) {
    double sum[C + 1][KLACK_LANES] = {{0.0}};
    int i, j, c;
    for (i = 0; i < P; i += KLACK_LANES) {
        for (j = 0; j < KLACK_LANES; j++) {
            double q1 = A->A11[i + j] * q[i + j] + A->A12[i + j] * v[i + j];
            v[i + j] = A->A21[i + j] * q[i + j] + A->A22[i + j] * v[i + j];
            q[i + j] = q1;
        }
        for (c = 0; c < C; c++) {
            for (j = 0; j < KLACK_LANES; j++) sum[c][j] += klack_gap_row[c][i + j] * q[i + j];
        }
    }
    for (c = 0; c < C; c++) {
        y[c] = 0.0;
        for (j = 0; j < KLACK_LANES; j++) y[c] += sum[c][j];
    }
}

/* the same after the forces F of the step before */
FOR_PROCESSORS
static void pass_forced(double *restrict q, double *restrict v, const matrices *restrict A,
                        const double *restrict F, double *restrict y) {
    double sum[C + 1][KLACK_LANES] = {{0.0}};
    int i, j, c;
    for (i = 0; i < P; i += KLACK_LANES) {
        double f[KLACK_LANES] = {0.0};
        for (c = 0; c < C; c++) {
            for (j = 0; j < KLACK_LANES; j++) f[j] += klack_gap_row[c][i + j] * F[c];
        }
        for (j = 0; j < KLACK_LANES; j++) {
            double q1 = A->A11[i + j] * q[i + j] + A->A12[i + j] * v[i + j] + A->P1[i + j] * f[j];
            v[i + j] = A->A21[i + j] * q[i + j] + A->A22[i + j] * v[i + j] + A->P2[i + j] * f[j];
            q[i + j] = q1;
        }
        for (c = 0; c < C; c++) {
            for (j = 0; j < KLACK_LANES; j++) sum[c][j] += klack_gap_row[c][i + j] * q[i + j];
        }
    }
    for (c = 0; c < C; c++) {
        y[c] = 0.0;
        for (j = 0; j < KLACK_LANES; j++) y[c] += sum[c][j];
    }
}

/* bodies without contacts need no internal steps: their motion is exact */
static double internal_steps(const klack_model *m, double span) {
    return C > 0 ? klack_largest(ceil(span / m->internal_step * (1.0 - 1e-9)), 1.0) : 1.0;
}

/* Matrices for a communication step.  One that differs from the last only by the round-off of the
   time counts as the same.                                                                     */
static int plan(klack_model *m, double span) {
    double count, h;
    int i, c, o;
    if (m->span > 0.0 && fabs(span - m->span) <= 1e-15 * fabs(m->time) &&
        m->count == internal_steps(m, m->span)) {
        return 0;
    }
    count = internal_steps(m, span);
    if (!(count < MOST_STEPS)) return failed(m, "internal_step is too small for this step");
    h = span / count;
    for (i = 0; i < M; i++) {
        klack_step s = klack_mode_step(klack_omega[i], klack_damping[i], h);
        m->step.A11[i] = s.A11;
        m->step.A12[i] = s.A12;
        m->step.A21[i] = s.A21;
        m->step.A22[i] = s.A22;
        m->step.B1[i] = s.B1;
        m->step.B2[i] = s.B2;
        m->step.P1[i] = s.A11 * s.B1 + s.A12 * s.B2;
        m->step.P2[i] = s.A21 * s.B1 + s.A22 * s.B2;
    }
    for (c = 0; c < C; c++) {
        for (o = 0; o < C; o++) {
            double sum = 0.0;
            for (i = 0; i < M; i++) sum += klack_gap_row[c][i] * m->step.B1[i] * klack_gap_row[o][i];
            m->G[c][o] = sum;
        }
    }
    m->span = span;
    m->count = count;
    m->h = h;
    return 0;
}

/* state of the pass; its gaps start at offset */
static void begin(const klack_model *m, motion *x, double *offset) {
    int i, k, c;
    memset(x, 0, sizeof *x);
    for (c = 0; c < C; c++) offset[c] = klack_gap[c];
    for (i = 0; i < M; i++) {
        double f = klack_constant[i];
        for (k = 0; k < KLACK_INPUTS; k++) f += klack_input[k][i] * m->input[k];
        x->v[i] = m->v[i];
        if (klack_omega[i] >= SOFT) {
            x->rest[i] = f / (klack_omega[i] * klack_omega[i]);
            for (c = 0; c < C; c++) offset[c] += klack_gap_row[c][i] * x->rest[i];
        } else if (f != 0.0) {
            x->push[i] = f;
            x->soft[x->soft_count++] = i;
        }
        x->q[i] = m->q[i] - x->rest[i];
    }
}

static void finish(klack_model *m, const motion *x, const double *F) {
    int i, c;
    for (i = 0; i < M; i++) {
        double f = 0.0;
        for (c = 0; c < C; c++) f += klack_gap_row[c][i] * F[c];
        m->q[i] = x->q[i] + x->rest[i] + x->extra_q[i] + m->step.B1[i] * f;
        m->v[i] = x->v[i] + x->extra_v[i] + m->step.B2[i] * f;
    }
}

static void push_on(const matrices *A, motion *x, double *free) {
    int k, c;
    for (k = 0; k < x->soft_count; k++) {
        int i = x->soft[k];
        double q = x->extra_q[i], v = x->extra_v[i], f = x->push[i];
        x->extra_q[i] = A->A11[i] * q + A->A12[i] * v + A->B1[i] * f;
        x->extra_v[i] = A->A21[i] * q + A->A22[i] * v + A->B2[i] * f;
        for (c = 0; c < C; c++) free[c] += klack_gap_row[c][i] * x->extra_q[i];
    }
}

/* force of contact c when its gap would end at free; its film and compression */
static klack_forces one_force(klack_model *m, int c, double free, double guess) {
    contact *k = &m->contacts[c];
    klack_forces f = {0.0, 0.0, 0.0};
    double chi = k->rate / m->h;
    if (KLACK_FILMS == 0) {
        f.contact = klack_solve_step(klack_law_kind[c], klack_law + klack_law_first[c], chi,
                                     m->G[c][c] + 2.0 * klack_series[c], -k->gap - k->e,
                                     k->e - free, guess, &k->hint);
        if (f.contact > 0.0) f.e = 2.0 * klack_series[c] * f.contact - k->e;
    } else if (klack_has_film[c] || k->gap < 0.0 || free < 0.0 || k->e != 0.0) {
        klack_interface i = {klack_law_kind[c], klack_law + klack_law_first[c], chi, klack_cubic[c],
                             klack_linear[c], klack_cut_off[c], klack_suction[c], m->h, m->G[c][c],
                             klack_series[c]};
        f = klack_solve_interface(&i, k->gap, free, k->e, guess, k->film_before, &k->hint);
    }
    return f;
}

/* forces of all contacts over a step, Gauss-Seidel; 1 if they do not settle */
static int settle(klack_model *m, const double *free, klack_forces *f, double *F) {
    int sweep, c, o;
    for (c = 0; c < C; c++) {
        contact *k = &m->contacts[c];
        if (klack_dissipation[c] > 0.0 && k->approaching && free[c] < 0.0) {
            /* mean rate of the gap over the step of onset: no force has acted yet */
            double way = k->gap - free[c], least = KLACK_FILMS ? KLACK_SLOWEST * m->h : KLACK_LEAST_WAY;
            k->rate = klack_dissipation[c] * m->h / klack_largest(way, least);
            k->approaching = 0;
        }
    }
    for (sweep = 0; sweep < KLACK_SWEEPS; sweep++) {
        double change = 0.0, largest = 0.0, unseen = 0.0;
        for (c = 0; c < C; c++) {
            double own = free[c], before = F[c], guess = before;
            double way = m->G[c][c] + 2.0 * klack_series[c] * !KLACK_FILMS;
            for (o = 0; o < C; o++) {
                if (o != c) own += m->G[c][o] * F[o];
            }
            if (sweep == 0 && !KLACK_FILMS) guess = 2.0 * before - m->contacts[c].force_before;
            f[c] = one_force(m, c, own, guess);
            F[c] = f[c].contact + f[c].film;
            change = klack_largest(change, fabs(F[c] - before) * way);
            largest = klack_largest(largest, fabs(F[c]) * way);
            if (KLACK_FILMS) unseen = klack_largest(unseen, ROUND_OFF * fabs(m->contacts[c].gap));
        }
        if (C == 1 || change <= klack_largest(KLACK_SETTLED * largest, unseen)) return 0;
    }
    return 1;
}

/* take over a step that ends with these forces */
static void commit(klack_model *m, const double *free, const klack_forces *f, const double *F) {
    int c, o;
    for (c = 0; c < C; c++) {
        contact *k = &m->contacts[c];
        double gap = free[c];
        for (o = 0; o < C; o++) gap += m->G[c][o] * F[o];
        k->gap = gap;
        k->e = f[c].e;
        k->force_before = k->force;
        k->force = f[c].contact;
        k->film = f[c].film;
        k->film_before = !k->closed && k->force > 0.0 ? k->film : 0.0;
        k->closed = k->force > 0.0;
        k->mean += k->force;
        k->peak = klack_largest(k->peak, k->force);
        if (!k->approaching) {
            k->deepest = klack_largest(k->deepest, -gap);
            if (gap > KLACK_SEPARATED * k->deepest) {
                k->approaching = 1;
                k->rate = k->deepest = 0.0;
            }
        }
    }
}

int klack_do_step(klack_model *m, double time, double step) {
    ALIGNED motion x;
    ALIGNED matrices A;
    double offset[C + 1], free[C + 1], F[C + 1] = {0.0};
    klack_forces f[C + 1];
    double n;
    int c, pending = 0;
    if (!(step >= 0.0 && step < 1e300)) return failed(m, "the communication step is below zero");
    if (!(fabs(time - m->time) <= 1e-6 * step + 1e-14 * fabs(time))) {
        return failed(m, "the communication point is not where the last step ended");
    }
    if (step == 0.0) return 0;
    if (plan(m, step)) return 1;
    A = m->step;
    begin(m, &x, offset);
    for (c = 0; c < C; c++) {
        contact *k = &m->contacts[c];
        if (!m->held) {
            k->gap = gap_now(m, c);
            k->closed = 0;
            k->approaching = 1;
            k->rate = k->deepest = 0.0;
            k->force = k->force_before = k->film = k->film_before = k->e = 0.0;
        }
        k->mean = k->peak = 0.0;
        f[c].contact = f[c].film = f[c].e = 0.0;
    }
    for (n = 0.0; n < m->count; n += 1.0) {
        int near = KLACK_FILMS > 0;
        if (pending) {
            pass_forced(x.q, x.v, &A, F, free);
        } else {
            pass_free(x.q, x.v, &A, free);
        }
        for (c = 0; c < C; c++) free[c] += offset[c];
        push_on(&A, &x, free);
        for (c = 0; c < C; c++) {
            const contact *k = &m->contacts[c];
            F[c] = k->force + k->film;
            near = near || free[c] < k->e || k->gap + k->e < 0.0;
        }
        pending = 0;
        if (near) {
            if (settle(m, free, f, F)) {
                failed(m, "the contact forces do not settle; try a smaller internal_step");
                return 2;
            }
        } else {
            for (c = 0; c < C; c++) f[c].contact = f[c].film = f[c].e = F[c] = 0.0;
        }
        for (c = 0; c < C; c++) pending = pending || F[c] != 0.0;
        commit(m, free, f, F);
    }
    finish(m, &x, F);
    for (c = 0; c < C; c++) {
        contact *k = &m->contacts[c];
        k->mean /= m->count;
        k->of_force.gap = k->of_force.rate = k->of_film.gap = k->of_film.rate = 0.0;
    }
    m->time = time + step;
    m->held = 1;
    for (c = 0; c < M; c++) {
        if (!(fabs(m->v[c]) <= 1.7e308)) {
            failed(m, "the motion is not finite");
            return 2;
        }
    }
    return 0;
}

#endif
