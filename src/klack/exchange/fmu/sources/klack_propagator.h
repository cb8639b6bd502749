/* Exact motion of one mode over a step under a constant force, as klack.simulation.propagator. */
#ifndef KLACK_PROPAGATOR_H
#define KLACK_PROPAGATOR_H

#include <math.h>

#include "klack_constants.h"

typedef struct {
    double A11, A12, A21, A22, B1, B2;
} klack_step;

/* B1/h^2 as Taylor series of q'' = 1 - 2 z x q' - x^2 q at unit time, x = omega h */
static double klack_taylor(double x, double z) {
    double before = 0.0, now = 0.5, total = 0.5;
    int n;
    for (n = 1; n < KLACK_TAYLOR_TERMS; n++) {
        double next = -(2.0 * z * x * (n + 1) * now + x * x * before) / ((n + 1.0) * (n + 2.0));
        before = now;
        now = next;
        total += now;
    }
    return total;
}

static klack_step klack_mode_step(double w, double z, double h) {
    klack_step s = {1.0, h, 0.0, 1.0, 0.5 * h * h, h};
    double e, lost;
    if (w == 0.0) return s;
    if (z < 1.0) {
        double wd = w * sqrt((1.0 - z) * (1.0 + z)), half = sin(0.5 * wd * h);
        double part = wd * h == 0.0 ? h : sin(wd * h) / wd;
        e = exp(-z * w * h);
        s.A11 = e * (cos(wd * h) + z * w * part);
        s.A12 = e * part;
        s.A22 = e * (cos(wd * h) - z * w * part);
        lost = -expm1(-z * w * h) + e * (2.0 * half * half - z * w * part);
    } else {
        double root = sqrt((z - 1.0) * (z + 1.0)), slow = -w / (z + root);
        double spread = 2.0 * w * root, x = spread * h;
        e = exp(slow * h);
        s.A12 = e * h * (x > 0.0 ? -expm1(-x) / x : 1.0);
        s.A11 = e - slow * s.A12;
        s.A22 = e + (slow - spread) * s.A12;
        lost = -expm1(slow * h) + slow * s.A12;
    }
    s.A21 = -w * w * s.A12;
    s.B1 = (z > 1.0 ? z : 1.0) * w * h < KLACK_TAYLOR_BELOW ? klack_taylor(w * h, z) * h * h : lost / (w * w);
    s.B2 = s.A12;
    return s;
}

#endif
