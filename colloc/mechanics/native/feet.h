/* Friction on one link at its feet: what colloc/mechanics/floor_contact.py states for arrays, under the law of Coulomb or the
   elliptic one (colloc/mechanics/friction.py). */

#pragma once

#include <math.h>
#include <stdbool.h>

/* Where it is, seen from the link's midpoint; the direction it is turned to; its weight and its own law. */
typedef struct {
    double along, offset, cos, sin, weight;
    double mu_t, mu_f, mu_b, stretch_f, stretch_b;
} Foot;

typedef struct {
    double largest;
    bool associated;
    const double *first; /* number of the first foot of every link, and of all feet */
    const Foot *foot;
} Law;

typedef struct {
    double vs, vn, w, delta;
    double fs, fn, couple;
} Sliding;

/* What a foot does: its velocity along and across its direction, as the first counts in the speed r, and the coefficient. */
typedef struct {
    double along, across, stretched, stretch, r, mu_s;
} Step;

/* Of `PointContact.kernel` in colloc/mechanics/floor_contact.py. */
static Law law_of(const double *number)
{
    const int n_link = (int)number[0];
    Law law = {number[1], number[2] != 0, number + 3, (const Foot *)(number + 4 + n_link)};
    return law;
}

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
    Step s = {.along = f->cos * vs + f->sin * vn, .across = f->cos * vn - f->sin * vs};
    const bool ahead = s.along > 0;
    s.mu_s = ahead ? f->mu_f : f->mu_b;
    s.stretch = ahead ? f->stretch_f : f->stretch_b;
    s.stretched = s.stretch * s.along;
    s.r = sqrt(s.stretched * s.stretched + s.across * s.across + k->delta * k->delta);
    return s;
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
        const Step s = step_of(f, k);
        const double along = -f->weight * s.mu_s * s.stretched / s.r, across = -f->weight * f->mu_t * s.across / s.r;
        const double fs = f->cos * along - f->sin * across, fn = f->sin * along + f->cos * across;
        k->fs += fs;
        k->fn += fn;
        k->couple += f->along * fn - f->offset * fs;
    }
}

static inline double slowest_speed(const Sliding *k, const Law *law, const Link *link)
{
    double least = INFINITY;
    for (int i = first_foot(law, link); i < last_foot(law, link); ++i) {
        const Step s = step_of(&law->foot[i], k);
        least = fmin(least, fabs(s.along) + fabs(s.across));
    }
    return least;
}

static inline double dissipation(const Sliding *k, const Law *law, const Link *link)
{
    double total = 0.0;
    for (int i = first_foot(law, link); i < last_foot(law, link); ++i)
        total += law->foot[i].weight * law->foot[i].mu_t * step_of(&law->foot[i], k).r;
    return total;
}

static inline double speed_unit_of(double largest_rate)
{
    return largest_rate;
}

static inline double unit_of_force(const Law *law, double delta, double largest_rate)
{
    (void)largest_rate;
    return law->largest / hypot(1.0, delta);
}

/* Adds turn' K turn of a foot, K being 2 x 2 in its own directions. */
static inline void add_foot(const Foot *f, const double K[2][2], Matrix3 total)
{
    const double turn[2][3] = {
        {f->cos, f->sin, f->along * f->sin - f->offset * f->cos}, {-f->sin, f->cos, f->along * f->cos + f->offset * f->sin}};
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            for (int p = 0; p < 2; ++p)
                total[i][j] += f->weight * turn[p][i] * (K[p][0] * turn[0][j] + K[p][1] * turn[1][j]);
}

/* Minus the derivative of (fs, fn, couple) with respect to (vs, vn, w). */
static inline void find_slopes(const Sliding *k, const Law *law, const Link *link, double delta, Matrix3 slopes)
{
    for (int j = 0; j < 9; ++j)
        slopes[j / 3][j % 3] = 0.0;
    for (int i = first_foot(law, link); i < last_foot(law, link); ++i) {
        const Foot *f = &law->foot[i];
        const Step s = step_of(f, k);
        const double es = s.stretched / s.r, en = s.across / s.r, ed = delta / s.r;
        const double K[2][2] = {
            {s.stretch * s.mu_s * (en * en + ed * ed) / s.r, -s.mu_s * es * en / s.r},
            {-s.stretch * f->mu_t * es * en / s.r, f->mu_t * (es * es + ed * ed) / s.r}};
        add_foot(f, K, slopes);
    }
}

/* Minus force over velocity with r frozen: the law of the paper's fixed point. */
static inline void find_secants(const Sliding *k, const Law *law, const Link *link, double delta, Matrix3 secants)
{
    (void)delta;
    for (int j = 0; j < 9; ++j)
        secants[j / 3][j % 3] = 0.0;
    for (int i = first_foot(law, link); i < last_foot(law, link); ++i) {
        const Foot *f = &law->foot[i];
        const Step s = step_of(f, k);
        const double K[2][2] = {{s.stretch * s.mu_s / s.r, 0.0}, {0.0, f->mu_t / s.r}};
        add_foot(f, K, secants);
    }
}
