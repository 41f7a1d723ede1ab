/* Friction on one link at its feet and pads: what colloc/mechanics/floor_contact.py states for arrays, under the law of Coulomb or
   the elliptic one (colloc/mechanics/friction.py), each part's own. */

#pragma once

#include <math.h>
#include <stdbool.h>

/* Where it is, seen from the link's midpoint; the direction it is turned to; its length, 0 of a foot; its weight, of a pad per
   length; and its law. */
typedef struct {
    double along, offset, cos, sin, length, pressure;
    double mu_t, mu_f, mu_b, stretch_f, stretch_b;
} Part;

typedef struct {
    int n_part;
    double largest;
    bool associated;
    const double *first; /* number of the first part of every link, and of all parts */
    const Part *part;
} Law;

#include "link_friction.h"

/* Velocities of the link, then the friction on it; and all parts of the body. */
typedef struct {
    double vs, vn, w, delta;
    double fs, fn, couple;
    PartSliding *part;
} Sliding;

typedef double Matrix2[2][2];

/* Of `FloorContact.kernel_numbers` in colloc/mechanics/floor_contact.py. */
static Law law_of(const double *number)
{
    const int n_link = (int)number[0], n_part = (int)number[1];
    const Part *part = (const Part *)(number + 5 + n_link);
    Law law = {n_part, number[2], number[3] != 0, number + 4, part};
    return law;
}

/* Of a chain of n links, so many times over; or NULL. */
static Sliding *new_slidings(const int n, const int copies, const Law *law)
{
    const size_t links = (size_t)(copies * n), parts = (size_t)(copies * law->n_part);
    Sliding *k = malloc(links * sizeof *k + parts * sizeof *k->part);
    for (size_t i = 0; k && i < links; ++i)
        k[i].part = (PartSliding *)(k + links) + i / (size_t)n * (size_t)law->n_part;
    return k;
}

/* The speed r, in which the velocity along the foot counts as it is stretched. */
static inline double speed(const Part *f, const PartSliding *v, double delta)
{
    const double along = stretch(f, v->vs) * v->vs;
    return sqrt(along * along + v->vn * v->vn + delta * delta);
}

static inline void point_force(const Part *f, const PartSliding *v, double delta, double force[2])
{
    const double r = speed(f, v, delta);
    force[0] = -tangential(f, v->vs) * stretch(f, v->vs) * v->vs / r;
    force[1] = -f->mu_t * v->vn / r;
}

static inline double point_potential(const Part *f, const PartSliding *v, double delta)
{
    return f->mu_t * speed(f, v, delta);
}

/* Minus the derivative of the force; or, where `steep`, force over velocity with r frozen. */
static inline void point_slopes(const Part *f, const PartSliding *v, double delta, bool steep, Matrix2 K)
{
    const double more = stretch(f, v->vs), r = speed(f, v, delta), mu_s = tangential(f, v->vs);
    const double es = steep ? 0.0 : more * v->vs / r, en = steep ? 0.0 : v->vn / r, ed = steep ? 1.0 : delta / r;
    K[0][0] = more * mu_s * (en * en + ed * ed) / r, K[0][1] = -mu_s * es * en / r;
    K[1][0] = -more * f->mu_t * es * en / r, K[1][1] = f->mu_t * (es * es + ed * ed) / r;
}

static inline int first_part(const Law *law, const Link *link)
{
    return (int)law->first[link->number];
}

static inline int last_part(const Law *law, const Link *link)
{
    return (int)law->first[link->number + 1];
}

/* Velocities of the link's parts, and what the friction on its pads is expressed through. */
static inline void find_roots(Sliding *k, const Law *law, const Link *link, double delta)
{
    k->delta = delta;
    for (int i = first_part(law, link); i < last_part(law, link); ++i) {
        const Part *f = &law->part[i];
        PartSliding *own = &k->part[i];
        const double vs = k->vs - f->offset * k->w, vn = k->vn + f->along * k->w;
        own->vs = f->cos * vs + f->sin * vn, own->vn = f->cos * vn - f->sin * vs, own->w = k->w;
        if (f->length > 0)
            pad_roots(own, f, delta);
    }
}

static inline void find_force(Sliding *k, const Law *law, const Link *link)
{
    k->fs = k->fn = k->couple = 0.0;
    for (int i = first_part(law, link); i < last_part(law, link); ++i) {
        const Part *f = &law->part[i];
        PartSliding *own = &k->part[i];
        if (f->length > 0)
            pad_force(own, f);
        else {
            double force[2];
            point_force(f, own, k->delta, force);
            own->fs = f->pressure * force[0], own->fn = f->pressure * force[1], own->couple = 0.0;
        }
        const double fs = f->cos * own->fs - f->sin * own->fn, fn = f->sin * own->fs + f->cos * own->fn;
        k->fs += fs;
        k->fn += fn;
        k->couple += own->couple + f->along * fn - f->offset * fs;
    }
}

/* How fast the slowest part of the link moves at most, up to a factor: the anchor is where that is least. */
static inline double slowest_speed(const Sliding *k, const Law *law, const Link *link)
{
    double least = INFINITY;
    for (int i = first_part(law, link); i < last_part(law, link); ++i) {
        const PartSliding *own = &k->part[i];
        least = fmin(least, fabs(own->vs) + fabs(own->vn) + 0.5 * law->part[i].length * fabs(own->w));
    }
    return least;
}

static inline double dissipation(const Sliding *k, const Law *law, const Link *link)
{
    double total = 0.0;
    for (int i = first_part(law, link); i < last_part(law, link); ++i) {
        const Part *f = &law->part[i];
        const PartSliding *own = &k->part[i];
        total += f->length > 0 ? pad_dissipation(own, f) : f->pressure * point_potential(f, own, k->delta);
    }
    return total;
}

/* Sum over the parts of turn' K turn, turn being the velocity of a part in its own directions per (vs, vn, w). */
static inline void add_slopes(const Sliding *k, const Law *law, const Link *link, double delta, bool steep, Matrix3 total)
{
    for (int j = 0; j < 9; ++j)
        total[j / 3][j % 3] = 0.0;
    for (int i = first_part(law, link); i < last_part(law, link); ++i) {
        const Part *f = &law->part[i];
        const PartSliding *own = &k->part[i];
        const Matrix3 turn = {
            {f->cos, f->sin, f->along * f->sin - f->offset * f->cos},
            {-f->sin, f->cos, f->along * f->cos + f->offset * f->sin},
            {0.0, 0.0, 1.0}};
        Matrix3 K = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
        if (f->length > 0 && steep)
            pad_secants(own, f, K);
        else if (f->length > 0)
            pad_slopes(own, f, delta, K);
        else {
            Matrix2 point;
            point_slopes(f, own, delta, steep, point);
            for (int j = 0; j < 4; ++j)
                K[j / 2][j % 2] = f->pressure * point[j / 2][j % 2];
        }
        for (int p = 0; p < 3; ++p)
            for (int j = 0; j < 3; ++j) {
                const double moved = K[p][0] * turn[0][j] + K[p][1] * turn[1][j] + K[p][2] * turn[2][j];
                for (int row = 0; row < 3; ++row)
                    total[row][j] += turn[p][row] * moved;
            }
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
