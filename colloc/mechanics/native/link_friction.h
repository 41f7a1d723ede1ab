/* Friction on a pad in closed form: what colloc/mechanics/link_friction.py states for arrays, for one at one instant.
   The names are those of that module; the formulas are derived and explained there. */

#pragma once

#include <math.h>
#include <stdbool.h>

#include "vectors.h"

/* Velocities of a part and, of a pad, everything that its friction is expressed through; then the friction itself. */
typedef struct {
    double vs, vn, w;
    double stretched; /* vs, as it counts in the speed */
    double a2, r0r1, S, Q, g, h;
    double fs, fn, couple;
} PartSliding;

static inline double tangential(const Part *p, double vs)
{
    return vs > 0 ? p->mu_f : p->mu_b;
}

static inline double stretch(const Part *p, double vs)
{
    return vs > 0 ? p->stretch_f : p->stretch_b;
}

/* (g - 1)/q: sum of q^j / (2 j + 3) below the limit of 0.1, where the closed form would cancel. */
static inline double h_series(double q)
{
    const double q2 = q * q;
    double even = 1.0 / 31, odd = 1.0 / 33; /* two sums, each half as long a chain of operations */
    even = even * q2 + 1.0 / 27, odd = odd * q2 + 1.0 / 29;
    even = even * q2 + 1.0 / 23, odd = odd * q2 + 1.0 / 25;
    even = even * q2 + 1.0 / 19, odd = odd * q2 + 1.0 / 21;
    even = even * q2 + 1.0 / 15, odd = odd * q2 + 1.0 / 17;
    even = even * q2 + 1.0 / 11, odd = odd * q2 + 1.0 / 13;
    even = even * q2 + 1.0 / 7, odd = odd * q2 + 1.0 / 9;
    even = even * q2 + 1.0 / 3, odd = odd * q2 + 1.0 / 5;
    return even + odd * q;
}

/* Fill in a2 to h from vs, vn, w. */
static inline void pad_roots(PartSliding *k, const Part *p, double delta)
{
    const double length = p->length;
    const double vs = k->stretched = stretch(p, k->vs) * k->vs;
    const double a2 = vs * vs + delta * delta, half = 0.5 * length * k->w;
    const double y0 = k->vn - half, y1 = k->vn + half;
    const double r0 = sqrt(a2 + y0 * y0), r1 = sqrt(a2 + y1 * y1);
    const double S = r0 + r1, r0r1 = r0 * r1, T = a2 + y0 * y1;
    k->a2 = a2, k->r0r1 = r0r1, k->S = S;
    /* a^2 / P; P = T + r0 r1 cancels where T < 0 */
    k->Q = T < 0 ? (r0r1 - T) / (4.0 * half * half) : a2 / (r0r1 + T);
    const double root_q = 2.0 * fabs(half) / S, q = root_q * root_q;
    if (q < 0.1)
        k->h = h_series(q);
    else {
        const double one = 1.0 + root_q;
        k->h = (0.5 * log(one * one * k->Q * S * S / (2.0 * a2)) / root_q - 1.0) / q;
    }
    k->g = 1.0 + q * k->h;
}

/* Friction on the pad from a2 to h; its pressure multiplies it, here and below. */
static inline void pad_force(PartSliding *k, const Part *p)
{
    const double length = p->length, pressure = p->pressure;
    const double per_S = 1.0 / k->S, l3 = length * length * length, mu_t = pressure * p->mu_t;
    k->fs = -pressure * tangential(p, k->vs) * k->stretched * 2.0 * length * k->g * per_S;
    k->fn = -mu_t * 2.0 * k->vn * length * per_S;
    k->couple = -mu_t * k->w * l3 * per_S * (0.5 * k->Q - k->a2 * k->h * per_S * per_S);
}

/* Dissipation potential of the pad: mu times the integral of r. */
static inline double pad_dissipation(const PartSliding *k, const Part *p)
{
    return p->pressure * (p->mu_t * p->length / k->S * (k->vn * k->vn + 0.25 * k->S * k->S + k->a2 * k->g));
}

/* Minus the derivative of (fs, fn, couple) with respect to (vs, vn, w). */
static inline void pad_slopes(const PartSliding *k, const Part *p, double delta, Matrix3 slopes)
{
    const double vs = k->stretched, vn = k->vn, w = k->w, length = p->length, pressure = p->pressure;
    const double mu_s = pressure * tangential(p, k->vs), mu_t = pressure * p->mu_t, more = stretch(p, k->vs);
    const double l3 = length * length * length, per_S = 1.0 / k->S, per_r = 1.0 / k->r0r1;
    const double a2J0 = length * k->S * k->Q * per_r;
    const double a2J1 = -vn * w * l3 * k->Q * per_r * per_S;
    const double E = k->a2 + vn * vn;
    const double a2J2 = 2.0 * l3 * k->a2 * k->h * per_S * per_S * per_S + l3 * (E * k->Q - 0.5 * k->a2) * per_S * per_r;
    const double y_r3 = 2.0 * vn * length * per_S * per_r;
    const double sy_r3 = w * l3 * per_S * (2.0 * k->h * per_S * per_S + (k->Q - 0.5) * per_r);
    const double along = a2J0 * (delta * delta / k->a2) + vn * y_r3 + w * sy_r3;
    slopes[0][0] = more * mu_s * along, slopes[0][1] = -mu_s * vs * y_r3, slopes[0][2] = -mu_s * vs * sy_r3;
    slopes[1][0] = -more * mu_t * vs * y_r3, slopes[1][1] = mu_t * a2J0, slopes[1][2] = mu_t * a2J1;
    slopes[2][0] = -more * mu_t * vs * sy_r3, slopes[2][1] = mu_t * a2J1, slopes[2][2] = mu_t * a2J2;
}

/* Minus force over velocity with r frozen: the law of the paper's fixed point. */
static inline void pad_secants(const PartSliding *k, const Part *p, Matrix3 secants)
{
    const double length = p->length, pressure = p->pressure;
    const double mu_s = pressure * tangential(p, k->vs), mu_t = pressure * p->mu_t, S = k->S, l3 = length * length * length;
    const double I0 = 2.0 * length * k->g / S, I1 = -2.0 * k->vn * k->w * l3 * k->h / (S * S * S);
    const double I2 = l3 / S * (0.5 * k->Q + (2.0 * k->vn * k->vn - k->a2) * k->h / (S * S));
    secants[0][0] = stretch(p, k->vs) * mu_s * I0, secants[0][1] = 0.0, secants[0][2] = 0.0;
    secants[1][0] = 0.0, secants[1][1] = mu_t * I0, secants[1][2] = mu_t * I1;
    secants[2][0] = 0.0, secants[2][1] = mu_t * I1, secants[2][2] = mu_t * I2;
}
