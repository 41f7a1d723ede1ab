/* What small loads prove of a cell: research/guarantee/README.md, "Small loads". */

#pragma once

#include "state.hpp"

enum { LOADS = 6 };

static inline Interval size_along(const Cell *cell, int axis)
{
    return Interval(cell->point[7][axis]) - cell->point[0][axis];
}

/* What interpolated forces leave unbalanced, as a share of the dissipation; and the error of their power. */
static inline void find_unbalanced(const Cell *cell, const double length[3], const double sigma[2], Interval *share, Interval *bilinear)
{
    /* the dissipation of a velocity V is at least `least` |V|, and a force at most `most` */
    const double least = fmin(fmin(sigma[0], sigma[1]), 1.0), most = fmax(fmax(sigma[0], sigma[1]), 1.0);
    const Interval l2 = length[1];
    Interval force, torque, moment[8][2];
    for (int j = 0; j < 8; ++j) {
        force = most_of(force, cell->state[j]->left_force), torque = most_of(torque, cell->state[j]->left_torque);
        moment[j][0] = cell->state[j]->force[2][2];
    }
    *share = (force / l2 + torque * 4.0 / square(l2)) / least;
    for (int i = 0; i < 3; i += 2) {
        const Interval h = size_along(cell, i / 2), l = length[i];
        Interval vector[8][2];
        for (int j = 0; j < 8; ++j)
            memcpy(vector[j], cell->state[j]->force[i], sizeof vector[j]);
        *share += h * 0.25 * (h * 0.5 * most * l + edge_change(vector, i / 2)) / (KAPPA * least * (l + l2));
    }
    *bilinear = size_along(cell, 2) * 0.25 * edge_change(moment, 2);
}

/* From balances under loads of the size 1/multiplier: a minimiser cannot be changed much by a small force. The cell without load, and
   under six loads: a force forwards, back, left and right at the reference point, a torque either way; times the multiplier, which is a
   power of 2, and in the order of `loads` (corner, load, 3). beside: what the reference point may be off, and else counts; change: of it. */
static inline Allowance allowance_by_loads(const double length[3], const double sigma[2], const Cell *cell, const Cell loaded[LOADS],
                                           const double *load[8], double beside, double change, double multiplier, double torque)
{
    const double most = fmax(fmax(sigma[0], sigma[1]), 1.0), M = multiplier;
    const Interval none;
    Interval rise, above_all, lost, spins, excess[LOADS], share, bilinear, J[8];
    for (int i = 0; i < 3; i += 2) {
        const Interval h = size_along(cell, i / 2);
        Interval joint[8][2];
        for (int j = 0; j < 8; ++j) {
            joint[j][0] = cell->motion[j][0];
            joint[j][1] = Interval(cell->motion[j][1]) + Interval((i > 1 ? 0.5 : -0.5) * length[1]) * cell->motion[j][2];
        }
        rise += h * 0.25 * turned_by(h, joint, i / 2) * most * length[i];
    }
    double slowest = INFINITY, fastest = -INFINITY;
    for (int j = 0; j < 8; ++j) {
        J[j] = cell->state[j]->dissipation + rise;
        above_all = most_of(above_all, J[j]);
        lost = most_of(lost, cell->state[j]->dissipation - cell->state[j]->proved);
        slowest = fmin(slowest, cell->motion[j][2]), fastest = fmax(fastest, cell->motion[j][2]);
    }
    spins = Interval(fastest) - slowest;
    for (int n = 0; n < LOADS; ++n) {
        Interval worst(-INFINITY);
        find_unbalanced(&loaded[n], length, sigma, &share, &bilinear);
        for (int j = 0; j < 8; ++j) {
            const double *l = load[j] + 3 * n, *z = cell->motion[j];
            const Interval trial = Interval(l[0]) * z[0] + Interval(l[1]) * z[1] + Interval(l[2]) * z[2];
            worst = most_of(worst, (J[j] + share * J[j] - loaded[n].state[j]->proved) * M - trial);
        }
        /* the interpolated load times the interpolated motion */
        excess[n] = most_of(worst + bilinear * M + (n < 4 ? spins * 0.25 * change : none), none);
    }
    const Interval along = most_of(excess[0], excess[1]), side = most_of(excess[2], excess[3]), turned = most_of(excess[4], excess[5]) / torque;
    find_unbalanced(cell, length, sigma, &share, &bilinear);
    return {norm_of(along, side) + turned * beside, share * above_all + bilinear + lost};
}
