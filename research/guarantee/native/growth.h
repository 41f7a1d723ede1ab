/* How convex the dissipation of a link is over a cell, from below: research/guarantee/README.md, "Strong convexity". */

#pragma once

#include "cell_link.h"

static inline void add_product(Matrix3 H, double factor, const Vector3 a, const Vector3 b)
{
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            H[i][j] += factor * a[i] * b[j];
}

/* Rows of the velocity of a point in the link's axes, for a change of the middle link's motion. */
static inline void rows_at(const CellLink *k, double s, TwoRows row)
{
    memcpy(row, k->hinge_row, sizeof k->hinge_row);
    row[1][2] += k->sign * s;
}

/* Rows of the hinge's velocity, not stretched: its length is the same at every angle. */
static inline void plain_rows(const CellLink *k, TwoRows row)
{
    memcpy(row, k->plain_row, sizeof k->plain_row);
}

static inline void add_gram(Matrix3 G, double factor, TwoRows row)
{
    add_product(G, factor, row[0], row[0]);
    add_product(G, factor, row[1], row[1]);
}

/* The integral of (a.n)^2 / |V| over |y| <= reach, y the normal velocity, for every affine V near the mean one. */
static inline void add_pivot(const CellLink *k, Matrix3 H, double reach, double spin, const Vector3 along, const Vector3 normal,
                             TwoRows hinge)
{
    const double vs = k->mean_hinge[0], vn = k->mean_hinge[1], w = k->mean_spin, allowed = k->allowed, h = k->turned;
    const double change = k->spin_spread + 2.0 * allowed / k->length;
    const double T = asinh(reach / (fabs(vs) + k->along_spread + allowed)), pivot = -vn / w;
    const double stiff_along = 2.0 * (T - tanh(T)) / (spin + 2.0 * change), stiff_normal = 2.0 * tanh(T) / (spin + 2.0 * change);
    double moved = 0.0;
    for (int i = 0; i < CORNERS; ++i)
        moved = fmax(moved, fabs(normal_at(k, i, pivot) - vn - pivot * w));
    moved = (moved + k->off + allowed) / spin;
    const double tilted = (k->along_spread + allowed) / spin + fabs(vs) / fabs(w) * change / spin;
    const double tau_along = fmin(fmax(3.0 * tilted + 0.7 * h, LEAST_TAU), MOST_TAU);
    const double tau_normal = fmin(fmax(5.0 * moved + 0.7 * h, LEAST_TAU), MOST_TAU);
    const double lost_along = 2.0 * stiff_along * (1.0 / tau_along - 1.0), lost_normal = 2.0 * stiff_normal * (1.0 / tau_normal - 1.0);
    add_product(H, stiff_along * (1.0 - tau_along), along, along);
    add_product(H, stiff_normal * (1.0 - tau_normal), normal, normal);
    H[2][2] -= lost_along * tilted * tilted + lost_normal * moved * moved;
    add_gram(H, -0.25 * (lost_along + lost_normal) * h * h, hinge);
}

/* The integral of (a.n)^2 / |V| over a piece, V the mean velocity: y = |vs| sinh t, ds = |V| dt / w. */
static inline void add_piece(const CellLink *k, Matrix3 H, double factor, double sa, double sb, Vector3 along, Vector3 normal)
{
    const double vs = k->mean_hinge[0], vn = k->mean_hinge[1], w = k->mean_spin, v = fmax(fabs(vs), 1e-13);
    const double t0 = asinh((vn + w * sa) / v), t1 = asinh((vn + w * sb) / v);
    if (fabs(t1 - t0) < SHORT_ARC) { /* Gauss's rule of two points, exact to 1e-7 of |a|^2 here */
        for (int e = -1; e <= 1; e += 2) {
            const double s = 0.5 * (sa + sb) + e * 0.28867513459481287 * (sb - sa), y = vn + w * s, V = norm_of(vs, y);
            TwoRows row;
            Vector3 across_V;
            rows_at(k, s, row);
            for (int i = 0; i < 3; ++i)
                across_V[i] = (vs * row[1][i] - y * row[0][i]) / V;
            add_product(H, 0.5 * factor * (sb - sa) / V, across_V, across_V);
            add_gram(H, -1e-6 * factor * (sb - sa) / V, row);
        }
        return;
    }
    const double dt = t1 - t0, dtanh = tanh(t1) - tanh(t0), dsech = (1.0 / cosh(t1) - 1.0 / cosh(t0)) * (vs < 0 ? -1.0 : 1.0);
    add_product(H, factor * (dt - dtanh) / w, along, along);
    add_product(H, factor * dtanh / w, normal, normal);
    add_product(H, -factor * dsech / w, along, normal);
    add_product(H, -factor * dsech / w, normal, along);
}

/* Add what the link contributes: (f* - f).a >= a H a - gap for every motion with |a| <= allowed on the link. */
static inline void add_growth(const CellLink *k, Matrix3 H)
{
    const double vs = k->mean_hinge[0], vn = k->mean_hinge[1], w = k->mean_spin, l = k->length, h = k->turned, allowed = k->allowed;
    const double most = fmax(k->end_spread[0], k->end_spread[1]) + allowed, reach = fmin(fabs(vn), fabs(vn + w * l));
    const double spin = fabs(w) - k->spin_spread - 2.0 * allowed / l;
    const bool pivots = (vn < 0) != (vn + w * l < 0) && reach > ROOM * most && spin > 0.3 * fabs(w);
    TwoRows hinge = {{0.0}}; /* at least what a turn by a unit angle changes */
    Vector3 along, normal;
    if (k->uneven > 1.0 || (k->directed && !(fabs(vs) > k->along_spread + allowed)))
        return; /* the balanced motion may slide in the other sense */
    for (int i = 0; k->axis >= 0 && i < 6; ++i)
        hinge[i / 3][i % 3] = k->most * k->plain_row[i / 3][i % 3];
    for (int i = 0; i < 3; ++i) { /* a.n = along tanh t + normal sech t */
        const double turn = i == 2 ? k->sign : 0.0;
        normal[i] = w == 0 ? 0.0 : k->hinge_row[1][i] - turn * vn / w;
        along[i] = w == 0 ? 0.0 : turn * vs / w - k->hinge_row[0][i];
    }
    if (pivots)
        add_pivot(k, H, reach - most, spin, along, normal, hinge);
    for (int j = 0; j < PIECES; ++j) {
        const double sa = k->node[j], sb = k->node[j + 1], length = sb - sa;
        TwoRows first, last;
        if (length <= 0 || k->kind[j] == LOOSE)
            continue;
        rows_at(k, sa, first), rows_at(k, sb, last);
        if (k->kind[j] == SLOW) {
            const double factor = length / (2.0 * (k->cone_speed[j] + allowed)), s2 = k->cone_sine[j] * k->cone_sine[j];
            Vector3 across_cone;
            for (int i = 0; i < 3; ++i)
                across_cone[i] = 0.5 * (k->cone[j][0] * (first[1][i] + last[1][i]) - k->cone[j][1] * (first[0][i] + last[0][i]));
            add_product(H, 0.5 * (1.0 - s2) * factor, across_cone, across_cone);
            add_gram(H, -1.5 * s2 * factor, first);
            add_gram(H, -1.5 * s2 * factor, last);
            add_gram(H, -0.75 * h * h * factor, hinge);
            continue;
        }
        const double ya = vn + w * sa, yb = vn + w * sb, nearest = ya * yb <= 0 ? 0.0 : fmin(fabs(ya), fabs(yb));
        if (pivots && nearest < reach)
            continue;
        const double least = norm_of(vs, nearest), spread = fmax(k->spread[j], k->spread[j + 1]);
        /* along the way to the balanced motion, or (half as much) about the trial motion alone */
        const double far = (spread + allowed) / least, half = far < STRAIGHT ? 1.0 : 0.5, sine = far < STRAIGHT ? far : spread / least;
        if (!(sine < STRAIGHT))
            continue;
        const double tau = fmin(fmax(1.5 * sine + 0.75 * h, LEAST_TAU), MOST_TAU);
        add_piece(k, H, half * (1.0 - tau) * (1.0 - sine * sine) / (1.0 + far), sa, sb, along, normal);
        const double lost = half * length / (least * (1.0 + far)) * (1.0 / tau - 1.0);
        add_gram(H, -lost * sine * sine, first);
        add_gram(H, -lost * sine * sine, last);
        add_gram(H, -0.5 * lost * h * h, hinge);
    }
}
