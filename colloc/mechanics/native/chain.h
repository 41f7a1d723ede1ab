/* A chain of straight links at one instant, seen from one of its links, the reference: colloc/mechanics/chain.py and
   colloc/mechanics/balance.py. Positions and velocities are added up from the reference outwards, so that links that rest
   beside it keep the relative precision of their speed. */

#ifndef CHAIN_H
#define CHAIN_H

#include "law.h"

typedef struct {
    int number;                        /* from 0 at the tail */
    double length, mass;               /* mass: over the body's */
    Real cos, sin;                     /* direction in the body frame */
    Real x, y;                         /* midpoint, seen from that of the reference */
    Real rate;                         /* of the joint behind the link (0 at the tail) */
    Real load_x, load_y;               /* its share of an outside force on the body */
} Link;

#include "elementary.h"
#include "parts.h"

/* Net force and torque, and what a step has to reduce: the potential less the load's power, or half the squared residual
   without one. */
typedef struct {
    Vector3 force;
    Real merit;
} Total;

/* Directions of the links, from joint angles that lie `stride` apart; and rates in units of `speed`. */
static inline void find_directions(
    const int n, Link *link, const double *length, const double *mass, const Real *angle, const Real *rate, Real speed,
    ptrdiff_t stride)
{
    Real phi = ZERO;
    for (int i = 0; i < n; ++i) {
        if (i > 0)
            phi += angle[(i - 1) * stride];
        link[i].number = i;
        link[i].length = length[i];
        link[i].mass = mass[i];
        find_direction(phi, &link[i].cos, &link[i].sin);
        link[i].rate = i > 0 ? rate[(i - 1) * stride] / speed : ZERO;
        link[i].load_x = link[i].load_y = ZERO;
    }
}

/* Friction and load on a link, in the body's axes. */
static inline void outer_force(const Link *link, const Sliding *k, Real f[2])
{
    f[0] = k->fs * link->cos - k->fn * link->sin + link->load_x;
    f[1] = k->fs * link->sin + k->fn * link->cos + link->load_y;
}

static inline void find_midpoints(const int n, Link *link, const int reference)
{
    link[reference].x = link[reference].y = ZERO;
    for (int i = reference + 1; i < n; ++i) {
        link[i].x = link[i - 1].x + 0.5 * (link[i - 1].length * link[i - 1].cos + link[i].length * link[i].cos);
        link[i].y = link[i - 1].y + 0.5 * (link[i - 1].length * link[i - 1].sin + link[i].length * link[i].sin);
    }
    for (int i = reference - 1; i >= 0; --i) {
        link[i].x = link[i + 1].x - 0.5 * (link[i + 1].length * link[i + 1].cos + link[i].length * link[i].cos);
        link[i].y = link[i + 1].y - 0.5 * (link[i + 1].length * link[i + 1].sin + link[i].length * link[i].sin);
    }
}

/* Velocity of link `to` in body-frame axes from that of its neighbour `from`, one further (side 1) or back (-1). */
static inline void pass_on(Vector3 v, const Link *from, const Link *to, int side)
{
    const Real w = side > 0 ? v[2] + to->rate : v[2] - from->rate;
    const Real a = 0.5 * side * from->length * v[2], b = 0.5 * side * to->length * w;
    v[0] -= a * from->sin + b * to->sin;
    v[1] += a * from->cos + b * to->cos;
    v[2] = w;
}

static inline void set_velocity(Sliding *k, const Link *link, const Vector3 v)
{
    k->vs = v[0] * link->cos + v[1] * link->sin;
    k->vn = v[1] * link->cos - v[0] * link->sin;
    k->w = v[2];
}

/* Velocities of all links from that of the reference. */
static inline void find_velocities(const int n, const Link *link, Sliding *k, const int reference, const Vector3 z)
{
    Vector3 v = {z[0], z[1], z[2]};
    set_velocity(&k[reference], &link[reference], v);
    for (int i = reference + 1; i < n; ++i) {
        pass_on(v, &link[i - 1], &link[i], 1);
        set_velocity(&k[i], &link[i], v);
    }
    v[0] = z[0], v[1] = z[1], v[2] = z[2];
    for (int i = reference - 1; i >= 0; --i) {
        pass_on(v, &link[i + 1], &link[i], -1);
        set_velocity(&k[i], &link[i], v);
    }
}

/* Velocity of a link in body-frame axes. */
static inline void link_velocity(const Link *link, const Sliding *k, Vector3 v)
{
    v[0] = k->vs * link->cos - k->vn * link->sin;
    v[1] = k->vs * link->sin + k->vn * link->cos;
    v[2] = k->w;
}

/* Velocity of the tail, the free end of link 0, which points along +x. */
static inline void tail_velocity(const Link *link, const Sliding *k, Vector3 v)
{
    v[0] = k[0].vs;
    v[1] = k[0].vn - 0.5 * link[0].length * k[0].w;
    v[2] = k[0].w;
}

/* The other way round: velocity of the links from that of the tail. */
static inline void find_velocities_from_tail(const int n, const Link *link, Sliding *k, const Vector3 tail)
{
    const Vector3 z = {tail[0], tail[1] + 0.5 * link[0].length * tail[2], tail[2]};
    find_velocities(n, link, k, 0, z);
}

static inline Real load_power(const Link *link, const Sliding *k)
{
    Vector3 v;
    link_velocity(link, k, v);
    return link->load_x * v[0] + link->load_y * v[1];
}

/* Everything at velocity z of the reference. */
static inline Total evaluate(
    const int n, const Link *link, Sliding *k, const int reference, const Vector3 z, const Law *law, Real delta)
{
    Total total = {{ZERO, ZERO, ZERO}, ZERO};
    find_velocities(n, link, k, reference, z);
    for (int i = 0; i < n; ++i) {
        find_roots(&k[i], law, &link[i], delta);
        find_force(&k[i], law, &link[i]);
        Real f[2];
        outer_force(&link[i], &k[i], f);
        total.force[0] += f[0];
        total.force[1] += f[1];
        total.force[2] += link[i].x * f[1] - link[i].y * f[0] + k[i].couple;
        if (law->associated)
            total.merit += dissipation(&k[i], law, &link[i]) - load_power(&link[i], &k[i]);
    }
    if (!law->associated)
        total.merit = 0.5 * (total.force[0] * total.force[0] + total.force[1] * total.force[1] + total.force[2] * total.force[2]);
    return total;
}

/* Sum over links of G^T K G, with G = d(vs, vn, w)/dz and K the slopes or the secants of friction on each. */
static inline void pull_back(
    const int n, const Link *link, const Sliding *k, const Law *law, Real delta, bool newton, Matrix3 *K, Matrix3 total)
{
    memset(total, 0, sizeof(Matrix3));
    for (int i = 0; i < n; ++i) {
        const Real c = link[i].cos, s = link[i].sin;
        const Real arm_s = link[i].x * s - link[i].y * c, arm_n = link[i].x * c + link[i].y * s;
        find_slopes(&k[i], law, &link[i], delta, !newton, K[i]);
        for (int j = 0; j < 3; ++j) {
            Vector3 column;
            for (int row = 0; row < 3; ++row)
                column[row] = j == 0   ? K[i][row][0] * c - K[i][row][1] * s
                              : j == 1 ? K[i][row][0] * s + K[i][row][1] * c
                                       : K[i][row][0] * arm_s + K[i][row][1] * arm_n + K[i][row][2];
            total[0][j] += c * column[0] - s * column[1];
            total[1][j] += s * column[0] + c * column[1];
            total[2][j] += arm_s * column[0] + arm_n * column[1] + column[2];
        }
    }
}

#endif
