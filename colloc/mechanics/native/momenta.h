/* A chain with given momenta: colloc/mechanics/inertia.py. All about the midpoint of link 0, whose velocity is the one that gives
   the body these momenta. */

#pragma once

#include <stdlib.h>

#include "motion.h"

enum { RATES_ROW = 6, MOMENTA_ROWS = 9 };

/* Centre of mass, seen from link 0, and moment of inertia about it. */
typedef struct {
    double x, y, inertia;
} Centre;

static inline Centre find_centre(const int n, const Link *link, const double *spin)
{
    Centre c = {0.0, 0.0, 0.0};
    for (int i = 0; i < n; ++i)
        c.x += link[i].mass * link[i].x, c.y += link[i].mass * link[i].y;
    for (int i = 0; i < n; ++i) {
        const double x = link[i].x - c.x, y = link[i].y - c.y;
        c.inertia += link[i].mass * (x * x + y * y) + spin[i];
    }
    return c;
}

/* Velocity of the centre of mass and angular momentum about it. */
static inline void find_momenta(const int n, const Link *link, const Sliding *k, const Centre *c, const double *spin, Vector3 p)
{
    p[0] = p[1] = p[2] = 0.0;
    for (int i = 0; i < n; ++i) {
        Vector3 v;
        link_velocity(&link[i], &k[i], v);
        p[0] += link[i].mass * v[0];
        p[1] += link[i].mass * v[1];
        p[2] += link[i].mass * ((link[i].x - c->x) * v[1] - (link[i].y - c->y) * v[0]) + spin[i] * v[2];
    }
}

/* What link 0 has to move by for the body to gain momenta. */
static inline void move_by_momenta(const Centre *c, const Vector3 gained, Vector3 dz)
{
    dz[2] = gained[2] / c->inertia;
    dz[0] = gained[0] + c->y * dz[2];
    dz[1] = gained[1] - c->x * dz[2];
}

/* Changes of the centre of mass, in `moved`, and of the momenta, where links change by d. */
static inline void momenta_changes(
    const int n, const Link *link, const Sliding *k, const Centre *c, const double *spin, const Change *d, double moved[2],
    Vector3 dp)
{
    moved[0] = moved[1] = dp[0] = dp[1] = dp[2] = 0.0;
    for (int i = 0; i < n; ++i)
        moved[0] += link[i].mass * d[i].x, moved[1] += link[i].mass * d[i].y;
    for (int i = 0; i < n; ++i) {
        const double x = link[i].x - c->x, y = link[i].y - c->y;
        Vector3 v;
        link_velocity(&link[i], &k[i], v);
        dp[0] += link[i].mass * d[i].vx;
        dp[1] += link[i].mass * d[i].vy;
        dp[2] += link[i].mass * (x * d[i].vy - y * d[i].vx + (d[i].x - moved[0]) * v[1] - (d[i].y - moved[1]) * v[0]);
        dp[2] += spin[i] * d[i].w;
    }
}

/* Everything at momenta p: into k, and tail velocity, velocity of the centre of mass, power, rates of the momenta into `out`;
   the force and the torque about link 0. */
static inline Total find_momentum_rates(
    const int n, const Link *link, Sliding *k, const Centre *c, const double *spin, const Vector3 p, const Law *law,
    double delta, double froude, double out[MOMENTA_ROWS])
{
    Vector3 still = {0.0, 0.0, 0.0}, own, gained, z;
    double value[ROWS];
    find_velocities(n, link, k, 0, still);
    find_momenta(n, link, k, c, spin, own);
    for (int i = 0; i < 3; ++i)
        gained[i] = p[i] - own[i];
    move_by_momenta(c, gained, z);
    const Total total = evaluate(n, link, k, 0, z, law, delta);
    const double *f = total.force;
    find_values(n, link, k, value);
    memcpy(out, value, DIFFERENTIATED_ROWS * sizeof *out);
    out[RATES_ROW] = f[0] / froude + z[2] * p[1];
    out[RATES_ROW + 1] = f[1] / froude - z[2] * p[0];
    out[RATES_ROW + 2] = (f[2] - c->x * f[1] + c->y * f[0]) / froude;
    return total;
}

/* The derivatives of `out` where links change by d at a velocity of link 0 that is what the momenta, changed by dp, ask for. */
static inline void momentum_rate_changes(
    const int n, const Link *link, const Sliding *k, Matrix3 *K, const Centre *c, const double *spin, const Vector3 p,
    const Vector3 force, double froude, Change *d, const Vector3 dp, double change[MOMENTA_ROWS])
{
    Vector3 own, gained, dz, df;
    double moved[2];
    momenta_changes(n, link, k, c, spin, d, moved, own);
    for (int i = 0; i < 3; ++i)
        gained[i] = dp[i] - own[i];
    move_by_momenta(c, gained, dz);
    follow(n, link, d, dz);
    net_change(n, link, k, K, d, df);
    value_changes(n, link, k, K, d, change);
    const double turn = d[0].w, w = k[0].w;
    change[RATES_ROW] = df[0] / froude + turn * p[1] + w * dp[1];
    change[RATES_ROW + 1] = df[1] / froude - turn * p[0] - w * dp[0];
    change[RATES_ROW + 2] = (df[2] - c->x * df[1] + c->y * df[0] - moved[0] * force[1] + moved[1] * force[0]) / froude;
}

/* At momenta `states` (3, n_time): `values` (MOMENTA_ROWS, n_time), and their derivatives (MOMENTA_ROWS, columns, n_time) with
   respect to joint angles and rates, as far as there are columns, and to the states, the last three. */
static inline void momenta_instants(
    Played *b, ptrdiff_t first, ptrdiff_t last, const double *spin, double froude, const double *states, int columns, double *values,
    double *slopes)
{
    const int n = b->n, n_joint = n - 1, n_shape = columns - 3;
    const ptrdiff_t n_time = b->n_time;
    const double delta = fmin(fmax(b->delta, DRY), VISCOUS);
    for (ptrdiff_t t = first; t < last; ++t) {
        const Vector3 p = {states[t], states[n_time + t], states[2 * n_time + t]};
        double value[MOMENTA_ROWS], change[MOMENTA_ROWS];
        find_instant(b, t, 1.0, NULL);
        find_midpoints(n, b->link, 0);
        const Centre centre = find_centre(n, b->link, spin);
        const Total total = find_momentum_rates(n, b->link, b->k, &centre, spin, p, &b->law, delta, froude, value);
        for (int row = 0; row < MOMENTA_ROWS; ++row)
            values[row * n_time + t] = value[row];
        for (int i = 0; i < n; ++i)
            find_slopes(&b->k[i], &b->law, &b->link[i], delta, false, b->K[i]);
        for (int column = 0; column < columns; ++column) {
            Vector3 dp = {0.0, 0.0, 0.0};
            if (column < n_shape)
                find_changes(n, b->link, b->k, 0, column % n_joint, column >= n_joint, b->d);
            else {
                memset(b->d, 0, (size_t)n * sizeof *b->d);
                dp[column - n_shape] = 1.0;
            }
            momentum_rate_changes(n, b->link, b->k, b->K, &centre, spin, p, total.force, froude, b->d, dp, change);
            for (int row = 0; row < MOMENTA_ROWS; ++row)
                slopes[(row * columns + column) * n_time + t] = change[row];
        }
    }
}
