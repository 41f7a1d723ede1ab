/* Friction on a pad by quadrature, for laws without closed forms: what colloc/mechanics/line_integrals.py states for arrays,
   and explains. The law itself is in own_law.h, which colloc/laws/c_formula.py writes: `density`, `density_slopes`, `potential`. */

#pragma once

#include <math.h>
#include <stdbool.h>

#include "own_law.h"
#include "vectors.h"

enum { NODES = 20, ALL_NODES = 2 * NODES };

static const double PLACE[NODES] = {
    -0.993128599185095, -0.9639719272779138, -0.912234428251326, -0.8391169718222188, -0.7463319064601508,
    -0.636053680726515, -0.5108670019508271, -0.37370608871541955, -0.22778585114164507, -0.07652652113349734,
    0.07652652113349734, 0.22778585114164507, 0.37370608871541955, 0.5108670019508271, 0.636053680726515,
    0.7463319064601508, 0.8391169718222188, 0.912234428251326, 0.9639719272779138, 0.993128599185095};
static const double WEIGHT[NODES] = {
    0.017614007139150893, 0.040601429800386446, 0.06267204833410879, 0.08327674157670471, 0.1019301198172407,
    0.1181945319615186, 0.1316886384491769, 0.1420961093183824, 0.14917298647260424, 0.15275338713072628,
    0.15275338713072628, 0.14917298647260424, 0.1420961093183824, 0.1316886384491769, 0.1181945319615186,
    0.1019301198172407, 0.08327674157670471, 0.06267204833410879, 0.040601429800386446, 0.017614007139150893};

/* Velocities of a part; of a pad, where its nodes lie, how fast they move across it, and their weights; then the friction. */
typedef struct {
    double vs, vn, w, delta;
    double sigma[ALL_NODES], y[ALL_NODES], weight[ALL_NODES];
    double fs, fn, couple;
} PartSliding;

/* The nodes of the pad. */
static inline void pad_roots(PartSliding *k, const Law *law, const Part *p, double delta)
{
    const double length = p->length;
    (void)law;
    k->delta = delta;
    const double a = sqrt(k->vs * k->vs + delta * delta), half = 0.5 * length * k->w;
    const double y0 = k->vn - half, y1 = k->vn + half, r0 = hypot(a, y0), r1 = hypot(a, y1);
    const double twice = y0 * y1 > 0 ? (y1 - y0) * (y1 + y0) / (y1 * r0 + y0 * r1) : (y1 * r0 - y0 * r1) / (a * a);
    const double h = 0.5 * asinh(twice), m = asinh(y0 / a) + h, square = h * h, tilt = tanh(m), e_m = exp(m);
    const bool small = square < 1e-8, narrow = fabs(h) < 0.5;
    const double per_sinh = small ? 1.0 : 1.0 / sinh(h), cosh_h = cosh(h);
    const double width = 0.5 * length * (small ? 1.0 - square / 6 : h * per_sinh) / cosh(m);
    const double slowest = small ? 0.0 : fmin(fmax(-m / h, -1.0), 1.0);
    for (int i = 0; i < ALL_NODES; ++i) {
        const double side = i < NODES ? -1.0 : 1.0, reach = 0.5 * (1.0 - side * slowest), centre = 0.5 * (slowest + side);
        const double x = centre + reach * PLACE[i % NODES], rest = 1.0 - x * x;
        const double e = exp(h * x), e_tau = e_m * e;
        double share;
        if (small)
            share = x * (1.0 - square * rest / 6) - 0.5 * tilt * h * rest * (1.0 - square * rest / 12);
        else if (narrow)
            share = (sinh(h * x) - 2.0 * tilt * sinh(0.5 * h * (1.0 + x)) * sinh(0.5 * h * (1.0 - x))) * per_sinh;
        else
            share = (0.5 * (e - 1.0 / e) - tilt * (cosh_h - 0.5 * (e + 1.0 / e))) * per_sinh;
        k->sigma[i] = 0.5 * length * share;
        k->y[i] = 0.5 * a * (e_tau - 1.0 / e_tau);
        k->weight[i] = WEIGHT[i % NODES] * reach * width * 0.5 * (e_tau + 1.0 / e_tau);
    }
}

/* Friction on the pad from its nodes; its pressure multiplies it, here and below. */
static inline void pad_force(PartSliding *k, const Law *law, const Part *p)
{
    const double pressure = p->pressure;
    const double s = law->speed_unit;
    k->fs = k->fn = k->couple = 0.0;
    for (int i = 0; i < ALL_NODES; ++i) {
        double f[2];
        density(s * k->vs, s * k->y[i], s * k->delta, f);
        const double weight = pressure * k->weight[i] / law->unit;
        k->fs += weight * f[0];
        k->fn += weight * f[1];
        k->couple += weight * k->sigma[i] * f[1];
    }
}

static inline double pad_dissipation(const PartSliding *k, const Law *law, const Part *p)
{
    const double s = law->speed_unit;
    double total = 0.0;
    for (int i = 0; i < ALL_NODES; ++i)
        total += k->weight[i] * potential(s * k->vs, s * k->y[i], s * k->delta);
    return p->pressure * (total / (s * law->unit));
}

/* Minus the derivative of (fs, fn, couple) with respect to (vs, vn, w); or, where `steep`, a multiple of 1 in its place that
   is no less: the trace in every direction. */
static inline void add_pad_slopes(const PartSliding *k, const Law *law, double pressure, bool steep, Matrix3 total)
{
    const double s = law->speed_unit;
    for (int j = 0; j < 9; ++j)
        total[j / 3][j % 3] = 0.0;
    for (int i = 0; i < ALL_NODES; ++i) {
        double d[2][2];
        density_slopes(s * k->vs, s * k->y[i], s * k->delta, d);
        if (steep) {
            d[0][0] = d[1][1] = -hypot(d[0][0] + d[1][1], 1e-12);
            d[0][1] = d[1][0] = 0.0;
        }
        const double weight = -pressure * s * k->weight[i] / law->unit, sigma = k->sigma[i];
        total[0][0] += weight * d[0][0], total[0][1] += weight * d[0][1], total[0][2] += weight * sigma * d[0][1];
        total[1][0] += weight * d[1][0], total[1][1] += weight * d[1][1], total[1][2] += weight * sigma * d[1][1];
        total[2][0] += weight * sigma * d[1][0], total[2][1] += weight * sigma * d[1][1];
        total[2][2] += weight * sigma * sigma * d[1][1];
    }
}

static inline void pad_slopes(const PartSliding *k, const Law *law, const Part *p, double delta, Matrix3 slopes)
{
    (void)delta;
    add_pad_slopes(k, law, p->pressure, false, slopes);
}

static inline void pad_secants(const PartSliding *k, const Law *law, const Part *p, double delta, Matrix3 secants)
{
    (void)delta;
    add_pad_slopes(k, law, p->pressure, true, secants);
}
