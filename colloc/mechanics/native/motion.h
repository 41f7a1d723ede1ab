/* What follows from a balance: velocities of the tail and of the centre of mass, power, and how they change with joint
   angles and rates, by the implicit function theorem: colloc/mechanics/fixed_point.py. All about the anchor, whose velocity is known
   to full relative precision. */

#pragma once

#include "damped_newton.h"

enum { TAIL_ROW = 0, CENTRE_ROW = 3, POWER_ROW = 5, DIFFERENTIATED_ROWS = 6, ACTUATOR_ROW = 6, ROWS = 7 };

/* Derivatives of a link's motion in one direction: velocity in body axes, then in its own, turning, midpoint, direction. */
typedef struct {
    double vx, vy, vs, vn, w, x, y, phi;
} Change;

/* Power of the joints' moments, which balance friction and load on all links ahead of them. */
static inline double actuator_power(const int n, const Link *link, const Sliding *k)
{
    double fx = 0.0, fy = 0.0, torque = 0.0, power = 0.0;
    for (int i = n - 1; i > 0; --i) {
        double own[2];
        outer_force(&link[i], &k[i], own);
        fx += own[0], fy += own[1], torque += link[i].x * own[1] - link[i].y * own[0] + k[i].couple;
        const double x = link[i].x - 0.5 * link[i].length * link[i].cos, y = link[i].y - 0.5 * link[i].length * link[i].sin;
        power -= (torque - x * fy + y * fx) * link[i].rate;
    }
    return power;
}

static inline void find_values(const int n, const Link *link, const Sliding *k, double value[ROWS])
{
    Vector3 v;
    tail_velocity(link, k, value + TAIL_ROW);
    value[CENTRE_ROW] = value[CENTRE_ROW + 1] = value[POWER_ROW] = 0.0;
    for (int i = 0; i < n; ++i) {
        link_velocity(&link[i], &k[i], v);
        value[CENTRE_ROW] += link[i].mass * v[0];
        value[CENTRE_ROW + 1] += link[i].mass * v[1];
        value[POWER_ROW] -= k[i].fs * k[i].vs + k[i].fn * k[i].vn + k[i].couple * k[i].w;
    }
    value[ACTUATOR_ROW] = actuator_power(n, link, k);
}

/* Half a link's contribution to the change of its neighbours' midpoint and velocity. */
static inline void add_half(Change *d, const Change *of, const Link *link, double w, double side)
{
    const double half = 0.5 * side * link->length, c = link->cos, s = link->sin;
    d->vx -= half * (of->w * s + w * c * of->phi);
    d->vy += half * (of->w * c - w * s * of->phi);
    d->x -= half * s * of->phi;
    d->y += half * c * of->phi;
}

/* Changes of all links with joint angle (or with joint rate) `joint` while the anchor keeps its velocity. */
static inline void find_changes(
    const int n, const Link *link, const Sliding *k, const int anchor, const int joint, const bool of_rate, Change *d)
{
    for (int i = 0; i < n; ++i) {
        d[i].phi = !of_rate && i > joint;
        d[i].w = of_rate * ((i > joint) - (anchor > joint));
    }
    d[anchor].vx = d[anchor].vy = d[anchor].x = d[anchor].y = 0.0;
    for (int side = -1; side <= 1; side += 2)
        for (int i = anchor + side; i >= 0 && i < n; i += side) {
            const Change *before = &d[i - side];
            d[i].vx = before->vx, d[i].vy = before->vy, d[i].x = before->x, d[i].y = before->y;
            add_half(&d[i], before, &link[i - side], k[i - side].w, side);
            add_half(&d[i], &d[i], &link[i], k[i].w, side);
        }
    for (int i = 0; i < n; ++i) {
        d[i].vs = d[i].vx * link[i].cos + d[i].vy * link[i].sin + k[i].vn * d[i].phi;
        d[i].vn = d[i].vy * link[i].cos - d[i].vx * link[i].sin - k[i].vs * d[i].phi;
    }
}

static inline void force_change(Matrix3 K, const Change *d, Vector3 df)
{
    for (int row = 0; row < 3; ++row)
        df[row] = -(K[row][0] * d->vs + K[row][1] * d->vn + K[row][2] * d->w);
}

/* Change of net force and torque. */
static inline void net_change(
    const int n, const Link *link, const Sliding *k, Matrix3 *K, const Change *d, Vector3 net)
{
    net[0] = net[1] = net[2] = 0.0;
    for (int i = 0; i < n; ++i) {
        const double c = link[i].cos, s = link[i].sin, x = link[i].x, y = link[i].y;
        const double fx = k[i].fs * c - k[i].fn * s, fy = k[i].fs * s + k[i].fn * c;
        Vector3 df;
        force_change(K[i], &d[i], df);
        const double dfx = df[0] * c - df[1] * s - d[i].phi * fy, dfy = df[0] * s + df[1] * c + d[i].phi * fx;
        net[0] += dfx;
        net[1] += dfy;
        net[2] += d[i].x * (fy + link[i].load_y) - d[i].y * (fx + link[i].load_x) + x * dfy - y * dfx + df[2];
    }
}

/* The same with the load's component along x (side 0) or y (side 1), while the anchor keeps its velocity. */
static inline void load_change(const int n, const Link *link, const int side, Change *d, Vector3 net)
{
    memset(d, 0, (size_t)n * sizeof *d);
    net[0] = side == 0, net[1] = side == 1, net[2] = 0.0;
    for (int i = 0; i < n; ++i)
        net[2] += link[i].mass * (side ? link[i].x : -link[i].y);
}

/* Let the anchor follow with dz, so that the body stays in balance. */
static inline void follow(const int n, const Link *link, Change *d, const Vector3 dz)
{
    for (int i = 0; i < n; ++i) {
        const double c = link[i].cos, s = link[i].sin, x = link[i].x, y = link[i].y;
        d[i].vx += dz[0] - y * dz[2];
        d[i].vy += dz[1] + x * dz[2];
        d[i].vs += c * dz[0] + s * dz[1] + (x * s - y * c) * dz[2];
        d[i].vn += c * dz[1] - s * dz[0] + (x * c + y * s) * dz[2];
        d[i].w += dz[2];
    }
}

/* Derivatives of the first rows of `find_values` in the direction d. */
static inline void value_changes(
    const int n, const Link *link, const Sliding *k, Matrix3 *K, const Change *d, double change[DIFFERENTIATED_ROWS])
{
    change[0] = d[0].vs;
    change[1] = d[0].vn - 0.5 * link[0].length * d[0].w;
    change[2] = d[0].w;
    change[3] = change[4] = change[5] = 0.0;
    for (int i = 0; i < n; ++i) {
        Vector3 df;
        force_change(K[i], &d[i], df);
        change[3] += link[i].mass * d[i].vx;
        change[4] += link[i].mass * d[i].vy;
        change[5] -= df[0] * k[i].vs + df[1] * k[i].vn + df[2] * k[i].w;
        change[5] -= k[i].fs * d[i].vs + k[i].fn * d[i].vn + k[i].couple * d[i].w;
    }
}

/* A chain at many instants, (n - 1, n_time), and room for its links at one. */
typedef struct {
    int n;
    const double *length, *mass;
    Law law;
    ptrdiff_t n_time;
    const double *angles, *rates;
    double delta;
    Link *link;
    Sliding *k; /* twice */
    Matrix3 *K;
    Change *d;
} Played;

static inline bool new_room(Played *b)
{
    b->link = malloc((size_t)b->n * sizeof *b->link);
    b->k = new_slidings(b->n, 2, &b->law);
    b->K = malloc((size_t)b->n * sizeof *b->K);
    b->d = malloc((size_t)b->n * sizeof *b->d);
    return b->link && b->k && b->K && b->d;
}

static inline void free_room(Played *b)
{
    free(b->link);
    free(b->k);
    free(b->K);
    free(b->d);
}

/* The links at an instant, their rates in units of `speed`; under `load` (2, n_time), in the body's axes, or NULL. */
static inline void find_instant(const Played *b, ptrdiff_t t, double speed, const double *load)
{
    find_directions(b->n, b->link, b->length, b->mass, b->angles + t, b->rates + t, speed, b->n_time);
    for (int i = 0; load && i < b->n; ++i) { /* which they share as they share the mass */
        b->link[i].load_x = b->link[i].mass * load[t];
        b->link[i].load_y = b->link[i].mass * load[b->n_time + t];
    }
}
