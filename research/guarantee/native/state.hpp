/* The friction on three links that move in a given way, and what it proves: one corner of a cell, or one under a load. Arguments that
   are plain numbers are exact. */

#pragma once

#include <stddef.h>
#include <string.h>

#include "interval.hpp"

#define KAPPA (root(2.0) - 1.0) /* the integral of |a| over a link is at least KAPPA times its length times |a| at either end */

/* Where a link is joined to the middle one, or the middle one begins: in the axes of the middle link and in its own. */
struct Hinge {
    Interval cos, sin, joint[2], velocity[2], spin;
};

/* Of the regularised friction: dissipation; forces of the links (along, across, moment about the hinge), paired with velocities that are
   not stretched; the sum of phi_i . B_i r; what is left of force and torque with the load. */
struct State {
    Interval dissipation, force[3][3], proved, left_force, left_torque;
};

/* Eight corners: (angle 1, angle 2, s) and the motion (x, y, spin) of the middle link. */
struct Cell {
    const double *point[8], *motion[8];
    const State *state[8];
};

static inline void find_hinge(Hinge *at, int i, const double length[3], const double *point, const double *motion)
{
    const double angle = i == 0 ? point[0] : i == 1 ? 0.0 : -point[1];
    at->cos = cosine_of(angle), at->sin = sine_of(angle);
    at->joint[0] = motion[0], at->joint[1] = Interval(motion[1]) + Interval((i > 1 ? 0.5 : -0.5) * length[1]) * motion[2];
    at->velocity[0] = at->cos * at->joint[0] - at->sin * at->joint[1], at->velocity[1] = at->sin * at->joint[0] + at->cos * at->joint[1];
    at->spin = i == 0 ? Interval(1.0) - motion[2] : i == 1 ? Interval(motion[2]) : Interval(motion[2]) + point[2];
}

/* (g - 1)/q: sum of q^j / (2 j + 3). */
static inline Interval h_of(Interval root_q, Interval q, Interval T, Interval r0r1, Interval half, Interval a2, Interval S)
{
    if (q < 0.1) {
        Interval sum(0.0, 1e-17); /* what is left beyond q^15 */
        for (int j = 15; j >= 0; --j)
            sum = sum * q + Interval(1.0) / (2.0 * j + 3.0);
        return sum;
    }
    /* (1 + root q)^2 Q S^2 / (2 a^2), with Q as below */
    const Interval grown = square((root_q + 1.0) * S) * 0.5;
    const Interval argument = T < 0.0 ? grown * (r0r1 - T) / (square(half) * 4.0 * a2) : grown / (r0r1 + T);
    return (log_of(argument) * 0.5 / root_q - 1.0) / q;
}

/* Dissipation and forces of one link: the closed forms of colloc/mechanics/friction.py. */
static inline void find_force(State *state, int i, double l, const double sigma[2], const Hinge *at, double delta)
{
    const Interval vs = at->velocity[0], half = at->spin * 0.5 * l, vn = at->velocity[1] + half;
    const Interval by = sigma[0] == sigma[1] || vs.lo > 0.0 ? Interval(sigma[0])
        : vs.hi < 0.0 ? Interval(sigma[1]) : Interval(fmin(sigma[0], sigma[1]), fmax(sigma[0], sigma[1]));
    const Interval x = by * vs, a2 = square(x) + square(delta), y0 = vn - half, y1 = vn + half;
    const Interval r0 = root(a2 + square(y0)), r1 = root(a2 + square(y1)), S = r0 + r1, r0r1 = r0 * r1, T = a2 + y0 * y1;
    /* a^2/(T + r0 r1), which would cancel where T < 0 */
    const Interval Q = T < 0.0 ? (r0r1 - T) / (square(half) * 4.0) : a2 / (r0r1 + T);
    const Interval root_q = size_of(half) * 2.0 / S, q = square(root_q), h = h_of(root_q, q, T, r0r1, half, a2, S), g = q * h + 1.0;
    const Interval per_S = Interval(l) / S;
    state->dissipation += per_S * (square(vn) + square(S) * 0.25 + a2 * g);
    Interval *force = state->force[i];
    force[0] = by * x * 2.0 * g * per_S;
    force[1] = vn * 2.0 * per_S;
    force[2] = half * 2.0 * l * per_S * (Q * 0.5 - a2 * h / square(S)) + force[1] * 0.5 * l;
}

static inline State state_of(const double length[3], const double sigma[2], const double *point, const double *motion, const double *load, double delta)
{
    State state;
    Interval left[3] = {load[0], load[1], load[2]};
    for (int i = 0; i < 3; ++i) {
        Hinge at;
        find_hinge(&at, i, length, point, motion);
        find_force(&state, i, length[i], sigma, &at, delta);
        const Interval *f = state.force[i], across = at.cos * f[1] - at.sin * f[0];
        left[0] -= at.cos * f[0] + at.sin * f[1], left[1] -= across;
        left[2] -= across * ((i > 1 ? 0.5 : -0.5) * length[1]) + (i ? f[2] : -f[2]);
    }
    state.proved = state.force[0][2] + state.force[2][2] * point[2];
    state.left_force = norm_of(left[0], left[1]), state.left_torque = size_of(left[2]);
    return state;
}

/* Largest change of vectors at the corners along one axis of the cell. */
static inline Interval edge_change(const Interval vector[8][2], int axis)
{
    Interval most;
    for (int j = 0; j < 8; ++j) {
        const int o = j | 1 << (2 - axis);
        if (o != j)
            most = most_of(most, square(vector[o][0] - vector[j][0]) + square(vector[o][1] - vector[j][1]));
    }
    return root(most);
}

/* What a turn by h and interpolation lose of vectors at the corners, over h/4. */
static inline Interval turned_by(Interval h, const Interval vector[8][2], int axis)
{
    Interval most;
    for (int j = 0; j < 8; ++j)
        most = most_of(most, square(vector[j][0]) + square(vector[j][1]));
    return h * 0.5 * root(most) + edge_change(vector, axis);
}

/* The same of the force of an outer link. */
static inline Interval force_turned(const Cell *cell, int i, Interval h)
{
    Interval force[8][2];
    for (int j = 0; j < 8; ++j)
        memcpy(force[j], cell->state[j]->force[i], sizeof force[j]);
    return turned_by(h, force, i / 2);
}
