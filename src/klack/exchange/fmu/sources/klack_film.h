/* Contact and squeeze film, parallel, in series with a compliance D, over one step; the same
   equations as klack.simulation.interface_step.  z = g + e is the gap between the faces, e the
   compression of the compliance.  Film: F = (cubic/x^3 + linear/x) speed, x = max(z, 0) + cut_off,
   never below -suction.                                                                        */
#ifndef KLACK_FILM_H
#define KLACK_FILM_H

#include "klack_law.h"

typedef struct {
    int kind;
    const double *law;
    double chi; /* dissipation over speed and step */
    double cubic, linear, cut_off, suction;
    double h, G, series;
} klack_interface;

typedef struct {
    double contact, film, e;
} klack_forces;

/* film impulse between two gaps, closed = x0 - x1 */
static double klack_film_mean(const klack_interface *i, double x0, double x1, double inverse0,
                              double inverse1, double closed) {
    double total = x0 + x1, inverses = inverse0 * inverse1;
    double damping = 0.5 * i->cubic * total * inverses * inverses;
    if (i->linear != 0.0) {
        double r = closed / total, r2 = r * r;
        if (fabs(r) > KLACK_LOG_SERIES_BELOW) return closed * damping + i->linear * log(x0 * inverse1);
        return closed * damping +
               i->linear * r *
                   (2.0 +
                    r2 * (2.0 / 3 + r2 * (2.0 / 5 + r2 * (2.0 / 7 + r2 * (2.0 / 9 + r2 * 2.0 / 11)))));
    }
    return closed * damping;
}

/* theta of a step that starts open in a film; 1/2 where the step closes the gap */
static double klack_relaxing(const klack_interface *i, double z0, double reach) {
    double inverse = 1.0 / (z0 + i->cut_off);
    double damping = (i->cubic * inverse * inverse + i->linear) * inverse;
    double most = 0.5 - i->series * damping / i->h;
    if (most <= 0.0) return 0.5;
    if (reach >= 0.5 * z0) return 0.5 + most;
    return 0.5 + most * klack_largest(2.0 * reach / z0, 0.0);
}

/* S and base of the gap between the faces, z1 = base + S F */
static void klack_line(const klack_interface *i, double theta, double g_free, double e0, double *S,
                       double *base) {
    double inverse = 1.0 / theta;
    *S = i->G + i->series * inverse;
    *base = g_free - (inverse - 1.0) * e0;
}

static double klack_compressed(const klack_interface *i, double theta, double force, double e0) {
    if (i->series == 0.0) return 0.0;
    if (theta == 0.5) return 2.0 * i->series * force - e0;
    return (i->series * force - (1.0 - theta) * e0) / theta;
}

/* film force of a step that starts open; 1 if it also ends open.  The equation is concave over
   z > 0: Newton's method overshoots at most once, to smaller z.                                */
static int klack_film_alone(const klack_interface *i, double S, double z0, double base,
                            double guess, double *force) {
    double rate = 1.0 / i->h, x0 = z0 + i->cut_off, inverse0 = 1.0 / x0;
    double z = klack_largest(base + S * guess, 0.0);
    int turn;
    for (turn = 0; turn < KLACK_FILM_NEWTON_LIMIT; turn++) {
        double x = z + i->cut_off, inverse = 1.0 / x, slope = 0.0, curvature = 0.0, excess, step;
        double film = rate * klack_film_mean(i, x0, x, inverse0, inverse, z0 - z);
        int pulled = film <= -i->suction;
        if (pulled) film = -i->suction;
        excess = z - base - S * film;
        if (!pulled) {
            double damper = i->cubic * inverse * inverse;
            slope = (damper + i->linear) * inverse * rate;
            curvature = (3.0 * damper + i->linear) * inverse * inverse * rate;
        }
        step = excess / (1.0 + S * slope);
        if (fabs(excess) <= KLACK_ROUND_OFF * (z + fabs(base)) ||
            (curvature * step * step <= KLACK_FORCE_LEFT * fabs(film) && step < z &&
             !(pulled && step > 0.0))) {
            film += slope * step;
            *force = film;
            if (pulled || film >= -i->suction) return 1;
        }
        if (z == 0.0 && excess > 0.0) return 0;
        z = klack_largest(z - step, 0.0);
    }
    return 0;
}

/* contact force between two gaps; its slope over the indentation; longest last Newton step */
static klack_force klack_contact(const klack_interface *i, double z0, double z, double *longest,
                                 int *hint) {
    double deep = -klack_least(z0, z);
    if (i->kind == KLACK_LAW_LINEAR && z0 <= 0.0 && z <= 0.0 && i->chi == 0.0) {
        klack_force f = {-0.5 * i->law[0] * (z0 + z), 0.5 * i->law[0]};
        return f;
    }
    if (i->chi * deep > 1.0) deep = 1.0 / i->chi;
    *longest = KLACK_STEP_LEFT * deep;
    return klack_damped_force(i->kind, i->law, i->chi, -z0, -z, hint);
}

/* Film and contact.  excess = z - base - S F rises with a slope of 1 or more, so its root lies
   within its value of any z.  A Newton step that would cross z = 0, where the film ends with a
   kink, stops there.                                                                           */
static klack_forces klack_both(const klack_interface *i, double theta, double z0, double g_free,
                               double e0, double guess, int *hint) {
    double S, base, z, open0 = klack_largest(z0, 0.0), rate = 1.0 / i->h;
    double x0 = open0 + i->cut_off, inverse0 = 1.0 / x0, low = -INFINITY, high = INFINITY;
    klack_forces f = {0.0, 0.0, 0.0};
    int turn;
    klack_line(i, theta, g_free, e0, &S, &base);
    z = base + S * guess;
    for (turn = 0; turn < KLACK_FILM_NEWTON_LIMIT; turn++) {
        klack_force contact = {0.0, 0.0};
        double curvature = 0.0, film_slope = 0.0, open1 = klack_largest(z, 0.0);
        double longest = INFINITY;
        double x = open1 + i->cut_off, inverse = 1.0 / x, film, excess, step, after;
        int pulled, kinked;
        if ((z0 < 0.0 || z < 0.0) && i->kind != KLACK_NO_LAW) {
            contact = klack_contact(i, z0, z, &longest, hint);
        }
        film = rate * klack_film_mean(i, x0, x, inverse0, inverse, open0 - open1);
        pulled = film <= -i->suction;
        if (pulled) film = -i->suction;
        excess = z - base - S * (contact.force + film);
        if (!pulled && (z > 0.0 || (z == 0.0 && excess < 0.0))) {
            double damper = i->cubic * inverse * inverse;
            film_slope = (damper + i->linear) * inverse * rate;
            curvature = (3.0 * damper + i->linear) * inverse * inverse * rate;
        }
        step = excess / (1.0 + S * (contact.slope + film_slope));
        after = z - step;
        kinked = z == 0.0 || (z > 0.0) != (after > 0.0) || (pulled && step > 0.0);
        f.contact = contact.force;
        f.film = film;
        if (fabs(excess) <= KLACK_ROUND_OFF * (fabs(z) + fabs(base)) ||
            (!kinked && fabs(step) <= longest &&
             curvature * step * step <= KLACK_FORCE_LEFT * (contact.force + fabs(film)))) {
            f.contact = klack_largest(contact.force + contact.slope * step, 0.0);
            if (pulled || film + film_slope * step >= -i->suction) {
                f.film = film + film_slope * step;
                break;
            }
        }
        if (excess > 0.0) {
            low = klack_largest(low, z - excess);
            high = z;
        } else {
            low = z;
            high = klack_least(high, z - excess);
        }
        if (z != 0.0 && (z > 0.0) != (after > 0.0) && low < 0.0 && 0.0 < high) after = 0.0;
        if (!(low <= after && after <= high)) after = 0.5 * (low + high);
        z = after;
    }
    f.e = klack_compressed(i, theta, f.contact + f.film, e0);
    return f;
}

static double klack_contact_alone(const klack_interface *i, double S, double z0, double base,
                                  double guess, int *hint) {
    if (z0 >= 0.0 && base >= 0.0) return 0.0;
    return klack_solve_step(i->kind, i->law, i->chi, S, -z0, -base, guess, hint);
}

/* Forces of one interface over a step that starts at g0 and would end at g_free without them.
   film_before: film force of the last step if the contact closed in it; else 0.               */
static klack_forces klack_solve_interface(const klack_interface *i, double g0, double g_free,
                                          double e0, double guess, double film_before,
                                          int *hint) {
    double z0 = g0 + e0, theta = 0.5, S, base;
    klack_forces f = {0.0, 0.0, 0.0};
    if (i->cubic == 0.0 && i->linear == 0.0) {
        if (i->kind == KLACK_NO_LAW || (z0 >= 0.0 && g_free >= 0.0 && g_free >= e0)) return f;
        klack_line(i, theta, g_free, e0, &S, &base);
        f.contact = klack_contact_alone(i, S, z0, base, guess, hint);
        if (f.contact == 0.0 && e0 != 0.0) { /* released */
            theta = 1.0;
            f.contact = klack_contact_alone(i, i->G + i->series, z0, g_free, 0.0, hint);
        }
        f.e = klack_compressed(i, theta, f.contact, e0);
        return f;
    }
    if (i->series > 0.0 && z0 > 0.0) {
        theta = klack_relaxing(i, z0, g_free - e0);
    } else if (z0 < 0.0 && fabs(film_before) * i->series > KLACK_LEFT_BY_FILM * fabs(e0)) {
        theta = 1.0;
    }
    if (z0 >= 0.0) {
        klack_line(i, theta, g_free, e0, &S, &base);
        if (klack_film_alone(i, S, z0, base, guess, &f.film)) {
            f.e = klack_compressed(i, theta, f.film, e0);
            return f;
        }
    }
    return klack_both(i, theta, z0, g_free, e0, guess, hint);
}

#endif
