/* What a model remembers: plain numbers in one block. */
#ifndef KLACK_STATE_H
#define KLACK_STATE_H

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "klack_film.h"
#include "klack_law.h"
#include "klack_model.h"
#include "klack_propagator.h"

#define M KLACK_MODES
#define P KLACK_PADDED
#define C KLACK_CONTACTS

#define FIRST_STATE (KLACK_INTERNAL_STEP + 1 + 2 * KLACK_PAIR)
#define FIRST_RATE (FIRST_STATE + 2 * M)

#define LEAST_STEP 1e-12 /* [s] */

typedef struct {
    double gap, rate; /* derivatives of a force over the gap and over its rate */
} klack_slope;

typedef struct {
    double gap, e;              /* between the bodies; compression of the series compliance */
    double force, force_before; /* of the contact in the last steps */
    double film, film_before;   /* of the film; as solve_interface wants it */
    double rate;                /* dissipation over approach speed, 0 before first touch */
    double deepest;             /* indentation since a damped contact was touched */
    double mean, peak;          /* over the communication step */
    klack_slope of_force, of_film;
    int hint, closed, approaching, unused;
} contact;

typedef struct {
    double A11[P], A12[P], A21[P], A22[P], P1[P], P2[P], B1[P], B2[P];
} matrices;

struct klack_model {
    double time, internal_step, start_velocity, start_rise;
    double input[KLACK_INPUTS + 1];
    double q[P], v[P];
    contact contacts[C + 1];
    matrices step;
    double G[C + 1][C + 1]; /* gaps at the end of a step from unit forces during it */
    double span, h, count;  /* the communication step that the matrices belong to */
    int started, held, sloped, unused;
    char message[160];
};

static int failed(klack_model *m, const char *text) {
    snprintf(m->message, sizeof m->message, "%s", text);
    return 1;
}

static double dot(const double *a, const double *b) {
    double sum = 0.0;
    int i;
    for (i = 0; i < M; i++) sum += a[i] * b[i];
    return sum;
}

static double gap_now(const klack_model *m, int c) {
    return klack_gap[c] + dot(klack_gap_row[c], m->q);
}

#endif
