/* Contact laws and the scalar contact equation of one step, as klack.simulation.contact_step.

   A law is a kind and plain numbers p: linear {k}; Hertz {K, n}; table {n} and six numbers for each
   interval: start, force, factors of s, s^2, s^3, potential.  Indentations d are above zero when
   closed.  The force of a step is the mean of the law between both indentations, so that its work
   is the stored energy.                                                                        */
#ifndef KLACK_LAW_H
#define KLACK_LAW_H

#include <math.h>

#include "klack_constants.h"

typedef struct {
    double force, slope;
} klack_force;

static double klack_largest(double a, double b) { return a > b ? a : b; }
static double klack_least(double a, double b) { return a < b ? a : b; }

static double klack_power(double d, double n) { return n == 1.5 ? d * sqrt(d) : pow(d, n); }

/* interval of a table that holds d, searched from where it was last */
static int klack_interval(const double *p, double d, int hint) {
    int last = (int)p[0] - 1, i = hint;
    while (i > 0 && d < p[1 + 6 * i]) i--;
    while (i < last && d >= p[7 + 6 * i]) i++;
    return i;
}

/* force at an indentation above zero, and its slope */
static klack_force klack_law_at(int kind, const double *p, double d, int *hint) {
    klack_force f;
    if (kind == KLACK_LAW_LINEAR) {
        f.force = p[0] * d;
        f.slope = p[0];
    } else if (kind == KLACK_LAW_HERTZ) {
        f.force = p[0] * klack_power(d, p[1]);
        f.slope = d > 0.0 ? p[1] * f.force / d : 0.0;
    } else {
        const double *c;
        double s;
        *hint = klack_interval(p, d, *hint);
        c = p + 1 + 6 * *hint;
        s = d - c[0];
        f.force = c[1] + s * (c[2] + s * (c[3] + s * c[4]));
        f.slope = c[2] + s * (2.0 * c[3] + s * 3.0 * c[4]);
    }
    return f;
}

/* mean of K d^n between two indentations above zero */
static double klack_hertz_mean(double K, double n, double low, double high) {
    double middle = 0.5 * (low + high), r = 0.5 * (high - low) / middle;
    if (r < KLACK_HERTZ_SERIES_BELOW) {
        double r2 = r * r, tail = 1.0 + (n - 2.0) * (n - 3.0) / 20.0 * r2;
        return K * klack_power(middle, n) * (1.0 + n * (n - 1.0) / 6.0 * r2 * tail);
    }
    return K / (n + 1.0) * (klack_power(high, n) * high - klack_power(low, n) * low) /
           (high - low);
}

/* mean between two places of one table interval, and its slope over the second */
static klack_force klack_cubic_mean(const double *c, double s0, double s1) {
    double sum1 = s0 + s1, sum2 = s0 * s0 + s1 * s1;
    klack_force f;
    f.force = c[1] + c[2] / 2 * sum1 + c[3] / 3 * (sum2 + s0 * s1) + c[4] / 4 * sum1 * sum2;
    f.slope = c[2] / 2 + c[3] / 3 * (s0 + 2.0 * s1) + c[4] / 4 * (sum2 + 2.0 * s1 * sum1);
    return f;
}

static int klack_within(const double *p, int i, double d0, double d1) {
    return klack_least(d0, d1) >= p[1 + 6 * i] &&
           (i >= (int)p[0] - 1 || klack_largest(d0, d1) < p[7 + 6 * i]);
}

static klack_force klack_table_mean(const double *p, double d0, double d1, int *hint) {
    int first, last, piece, i = klack_interval(p, klack_largest(d1, 0.0), *hint);
    double low = klack_largest(klack_least(d0, d1), 0.0), high = klack_largest(d0, d1);
    double work = 0.0, left = low, f1 = 0.0;
    klack_force f;
    *hint = i;
    if (klack_within(p, i, d0, d1)) {
        return klack_cubic_mean(p + 1 + 6 * i, d0 - p[1 + 6 * i], d1 - p[1 + 6 * i]);
    }
    first = klack_interval(p, low, i);
    last = klack_interval(p, high, i);
    for (piece = first; piece <= last; piece++) {
        const double *c = p + 1 + 6 * piece;
        double right = piece == last ? high : c[6];
        work += (right - left) * klack_cubic_mean(c, left - c[0], right - c[0]).force;
        left = right;
    }
    f.force = work / fabs(d1 - d0);
    if (d1 > 0.0) {
        const double *c = p + 1 + 6 * (d1 >= d0 ? last : first);
        f1 = klack_cubic_mean(c, d1 - c[0], d1 - c[0]).force;
    }
    f.slope = (f1 - f.force) / (d1 - d0);
    return f;
}

/* mean force between two indentations, and its slope over the second */
static klack_force klack_mean_force(int kind, const double *p, double d0, double d1, int *hint) {
    klack_force f = {0.0, 0.0};
    if (d0 <= KLACK_TOUCH && d1 <= KLACK_TOUCH) return f;
    if (kind == KLACK_LAW_LINEAR) {
        double k = p[0], high = klack_largest(d0, d1);
        if (d0 >= 0.0 && d1 >= 0.0) {
            f.force = 0.5 * k * (d0 + d1);
            f.slope = 0.5 * k;
            return f;
        }
        f.force = 0.5 * k * high * high / fabs(d1 - d0);
        f.slope = (k * klack_largest(d1, 0.0) - f.force) / (d1 - d0);
        return f;
    }
    if (kind == KLACK_LAW_HERTZ) {
        double low = klack_least(d0, d1), high = klack_largest(d0, d1);
        f.force = klack_hertz_mean(p[0], p[1], klack_largest(low, 0.0), high);
        if (high - low < KLACK_HERTZ_EQUAL * high) {
            f.slope = 0.5 * p[1] * f.force / high;
            return f;
        }
        f.force *= (high - klack_largest(low, 0.0)) / (high - low);
        f.slope = (p[0] * klack_power(klack_largest(d1, 0.0), p[1]) - f.force) / (d1 - d0);
        return f;
    }
    return klack_table_mean(p, d0, d1, hint);
}

/* closed form of the elastic step for F = k d: both closed, release, onset */
static double klack_solve_linear(double k, double G, double d0, double df) {
    double a = 1.0 + 0.5 * G * k, b = df + d0, c, root, d1;
    if (d0 <= KLACK_TOUCH && df <= KLACK_TOUCH) return 0.0;
    if (d0 >= 0.0) {
        if (df >= 0.5 * G * k * d0) return 0.5 * k * (d0 + df) / a;
        c = d0 * (df - 0.5 * G * k * d0);
        root = sqrt(klack_largest(b * b - 4.0 * c, 0.0));
        d1 = b > 0.0 ? 2.0 * c / (b + root) : 0.5 * (b - root);
        return 0.5 * k * d0 * d0 / (d0 - d1);
    }
    c = df * d0;
    root = sqrt(klack_largest(b * b - 4.0 * a * c, 0.0));
    d1 = b > 0.0 ? 0.5 * (b + root) / a : 2.0 * c / (b - root);
    return 0.5 * k * d1 * d1 / (d1 - d0);
}

static klack_force klack_damped_force(int kind, const double *p, double chi, double d0, double d1,
                                      int *hint) {
    klack_force f = klack_mean_force(kind, p, d0, d1, hint);
    double factor = 1.0 + chi * (d1 - d0);
    if (chi == 0.0) return f;
    if (factor <= 0.0) { /* the law would pull */
        f.force = f.slope = 0.0;
        return f;
    }
    f.slope = f.slope * factor + f.force * chi;
    f.force *= factor;
    return f;
}

/* Force F of one step: d1 - df + G F(d0, d1) = 0, whose left side rises with a slope of 1 or more,
   so that its root lies within its value of any d1.  chi is the dissipation over speed and step. */
static double klack_solve_step(int kind, const double *p, double chi, double G, double d0,
                               double df, double guess, int *hint) {
    double low = -INFINITY, high = df, d1 = df - G * guess;
    klack_force f = {0.0, 0.0};
    int turn;
    if (d0 <= KLACK_TOUCH && df <= KLACK_TOUCH) return 0.0;
    if (kind == KLACK_LAW_LINEAR && chi == 0.0) return klack_solve_linear(p[0], G, d0, df);
    for (turn = 0; turn < KLACK_NEWTON_LIMIT; turn++) {
        double excess, step;
        int last;
        if (kind == KLACK_LAW_TABLE && chi == 0.0 && klack_within(p, *hint, d0, d1)) {
            const double *c = p + 1 + 6 * *hint;
            f = klack_cubic_mean(c, d0 - c[0], d1 - c[0]);
            excess = d1 - df + G * f.force;
            step = excess / (1.0 + G * f.slope);
            last = (fabs(c[3]) + fabs(c[4]) * (d0 + 3.0 * d1 - 4.0 * c[0])) * step * step <=
                   KLACK_FORCE_LEFT * f.force;
            last = last && klack_within(p, *hint, d0, d1 - step); /* another cubic beyond */
        } else {
            double deep = klack_largest(d0, d1);
            f = klack_damped_force(kind, p, chi, d0, d1, hint);
            excess = d1 - df + G * f.force;
            step = excess / (1.0 + G * f.slope);
            if (chi * deep > 1.0) deep = 1.0 / chi;
            last = fabs(step) <= KLACK_STEP_LEFT * deep;
        }
        if (last) return klack_largest(f.force - f.slope * step, 0.0);
        if (excess > 0.0) {
            low = klack_largest(low, d1 - excess);
            high = d1;
        } else {
            low = d1;
            high = klack_least(high, d1 - excess);
        }
        d1 -= step;
        if (!(low <= d1 && d1 <= high)) d1 = 0.5 * (low + high);
    }
    return f.force;
}

#endif
