/* Friction on one link at its feet: what colloc/mechanics/floor_contact.py states for arrays, under the law of Coulomb or the
   elliptic one (colloc/mechanics/friction.py), each foot's own, or all under one that is stated as formulas (own_law.h). */

#pragma once

#include <math.h>
#include <stdbool.h>

#ifdef OWN_LAW
#include "own_law.h"
#endif

/* Where it is, seen from the link's midpoint; the direction it is turned to; its weight, and its own law if that is Coulomb's. */
typedef struct {
    double along, offset, cos, sin, weight;
    double mu_t, mu_f, mu_b, stretch_f, stretch_b;
} Foot;

typedef struct {
    double largest, degree, unit, speed_unit; /* the last three as in link_quadrature.h */
    bool associated;
    const double *first; /* number of the first foot of every link, and of all feet */
    const Foot *foot;
} Law;

/* Velocities of the link, then the friction on it. */
typedef struct {
    double vs, vn, w, delta;
    double fs, fn, couple;
} Sliding;

/* Velocity of a foot along and across its direction. */
typedef struct {
    double along, across;
} Step;

typedef double Matrix2[2][2];

/* Of `PointContact.kernel_law` in colloc/mechanics/floor_contact.py. */
static Law law_of(const double *number)
{
    const int n_link = (int)number[0];
    Law law = {number[1], number[3], number[4], number[5], number[2] != 0, number + 6, (const Foot *)(number + 7 + n_link)};
    return law;
}

#ifdef OWN_LAW
#include "own_units.h"

static inline void point_force(const Law *law, const Foot *f, Step v, double delta, double force[2])
{
    const double s = law->speed_unit;
    (void)f;
    density(s * v.along, s * v.across, s * delta, force);
    force[0] /= law->unit, force[1] /= law->unit;
}

static inline double point_potential(const Law *law, const Foot *f, Step v, double delta)
{
    const double s = law->speed_unit;
    (void)f;
    return potential(s * v.along, s * v.across, s * delta) / (s * law->unit);
}

/* Minus the derivative of the force; or, where `steep`, a multiple of 1 in its place that is no less: the trace. */
static inline void point_slopes(const Law *law, const Foot *f, Step v, double delta, bool steep, Matrix2 K)
{
    const double s = law->speed_unit;
    double d[2][2];
    (void)f;
    density_slopes(s * v.along, s * v.across, s * delta, d);
    if (steep) {
        d[0][0] = d[1][1] = -hypot(d[0][0] + d[1][1], 1e-12);
        d[0][1] = d[1][0] = 0.0;
    }
    for (int j = 0; j < 4; ++j)
        K[j / 2][j % 2] = -s * d[j / 2][j % 2] / law->unit;
}
#else
static inline double speed_unit_of(double largest_rate)
{
    return largest_rate;
}

static inline double unit_of_force(const Law *law, double delta, double largest_rate)
{
    (void)largest_rate;
    return law->largest / hypot(1.0, delta);
}

static inline double coefficient(const Foot *f, Step v)
{
    return v.along > 0 ? f->mu_f : f->mu_b;
}

static inline double stretch(const Foot *f, Step v)
{
    return v.along > 0 ? f->stretch_f : f->stretch_b;
}

/* The speed r, in which the velocity along the foot counts as it is stretched. */
static inline double speed(const Foot *f, Step v, double delta)
{
    const double along = stretch(f, v) * v.along;
    return sqrt(along * along + v.across * v.across + delta * delta);
}

static inline void point_force(const Law *law, const Foot *f, Step v, double delta, double force[2])
{
    const double r = speed(f, v, delta);
    (void)law;
    force[0] = -coefficient(f, v) * stretch(f, v) * v.along / r;
    force[1] = -f->mu_t * v.across / r;
}

static inline double point_potential(const Law *law, const Foot *f, Step v, double delta)
{
    (void)law;
    return f->mu_t * speed(f, v, delta);
}

/* Minus the derivative of the force; or, where `steep`, force over velocity with r frozen. */
static inline void point_slopes(const Law *law, const Foot *f, Step v, double delta, bool steep, Matrix2 K)
{
    const double more = stretch(f, v), r = speed(f, v, delta), mu_s = coefficient(f, v);
    const double es = steep ? 0.0 : more * v.along / r, en = steep ? 0.0 : v.across / r, ed = steep ? 1.0 : delta / r;
    (void)law;
    K[0][0] = more * mu_s * (en * en + ed * ed) / r, K[0][1] = -mu_s * es * en / r;
    K[1][0] = -more * f->mu_t * es * en / r, K[1][1] = f->mu_t * (es * es + ed * ed) / r;
}
#endif

static inline int first_foot(const Law *law, const Link *link)
{
    return (int)law->first[link->number];
}

static inline int last_foot(const Law *law, const Link *link)
{
    return (int)law->first[link->number + 1];
}

static inline Step step_of(const Foot *f, const Sliding *k)
{
    const double vs = k->vs - f->offset * k->w, vn = k->vn + f->along * k->w;
    const Step v = {f->cos * vs + f->sin * vn, f->cos * vn - f->sin * vs};
    return v;
}

static inline void find_roots(Sliding *k, const Law *law, const Link *link, double delta)
{
    (void)law, (void)link;
    k->delta = delta;
}

static inline void find_force(Sliding *k, const Law *law, const Link *link)
{
    k->fs = k->fn = k->couple = 0.0;
    for (int i = first_foot(law, link); i < last_foot(law, link); ++i) {
        const Foot *f = &law->foot[i];
        double own[2];
        point_force(law, f, step_of(f, k), k->delta, own);
        const double fs = f->weight * (f->cos * own[0] - f->sin * own[1]), fn = f->weight * (f->sin * own[0] + f->cos * own[1]);
        k->fs += fs;
        k->fn += fn;
        k->couple += f->along * fn - f->offset * fs;
    }
}

static inline double slowest_speed(const Sliding *k, const Law *law, const Link *link)
{
    double least = INFINITY;
    for (int i = first_foot(law, link); i < last_foot(law, link); ++i) {
        const Step v = step_of(&law->foot[i], k);
        least = fmin(least, fabs(v.along) + fabs(v.across));
    }
    return least;
}

static inline double dissipation(const Sliding *k, const Law *law, const Link *link)
{
    double total = 0.0;
    for (int i = first_foot(law, link); i < last_foot(law, link); ++i)
        total += law->foot[i].weight * point_potential(law, &law->foot[i], step_of(&law->foot[i], k), k->delta);
    return total;
}

/* Sum over the feet of turn' K turn, turn being the velocity of a foot in its own directions per (vs, vn, w). */
static inline void add_slopes(const Sliding *k, const Law *law, const Link *link, double delta, bool steep, Matrix3 total)
{
    for (int j = 0; j < 9; ++j)
        total[j / 3][j % 3] = 0.0;
    for (int i = first_foot(law, link); i < last_foot(law, link); ++i) {
        const Foot *f = &law->foot[i];
        const double turn[2][3] = {
            {f->cos, f->sin, f->along * f->sin - f->offset * f->cos}, {-f->sin, f->cos, f->along * f->cos + f->offset * f->sin}};
        Matrix2 K;
        point_slopes(law, f, step_of(f, k), delta, steep, K);
        for (int j = 0; j < 9; ++j)
            for (int p = 0; p < 2; ++p)
                total[j / 3][j % 3] += f->weight * turn[p][j / 3] * (K[p][0] * turn[0][j % 3] + K[p][1] * turn[1][j % 3]);
    }
}

/* Minus the derivative of (fs, fn, couple) with respect to (vs, vn, w). */
static inline void find_slopes(const Sliding *k, const Law *law, const Link *link, double delta, Matrix3 slopes)
{
    add_slopes(k, law, link, delta, false, slopes);
}

/* The law of the paper's fixed point. */
static inline void find_secants(const Sliding *k, const Law *law, const Link *link, double delta, Matrix3 secants)
{
    add_slopes(k, law, link, delta, true, secants);
}
