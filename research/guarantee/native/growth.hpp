/* How convex the dissipation of a link is over a cell, from below: research/guarantee/README.md, "Strong convexity". */

#pragma once

#include "cell_link.hpp"

/* Symmetric matrices: only what is on the diagonal and below it is kept. */
static inline void add_square(Matrix3 H, Interval factor, const Vector3 a)
{
    for (int i = 0; i < 3; ++i) {
        const Interval scaled = factor * a[i];
        for (int j = 0; j <= i; ++j)
            H[i][j] += scaled * a[j];
    }
}

/* factor (a b' + b a') */
static inline void add_both(Matrix3 H, Interval factor, const Vector3 a, const Vector3 b)
{
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j <= i; ++j)
            H[i][j] += factor * (a[i] * b[j] + b[i] * a[j]);
}

static inline void add_gram(Matrix3 G, Interval factor, const TwoRows row)
{
    add_square(G, factor, row[0]);
    add_square(G, factor, row[1]);
}

/* Rows of the velocity of a point in the link's axes, for a change of the middle link's motion. */
static inline void rows_at(const CellLink *k, Interval s, TwoRows row)
{
    memcpy(row, k->hinge_row, sizeof k->hinge_row);
    row[1][2] += s * k->sign;
}

/* Sums of weights w of points of a link, of w s and of w s^2. */
struct Moments {
    Interval zeroth, first, second;
};

static inline void add_point(Moments *sum, Interval w, double s)
{
    const Interval ws = w * s;
    sum->zeroth += w, sum->first += ws, sum->second += ws * s;
}

/* The sum of w |rows at s|^2: these are affine in s. */
static inline void add_grams(const CellLink *k, Matrix3 G, const Moments *sum)
{
    add_gram(G, sum->zeroth, k->hinge_row);
    for (int i = 0; i < 3; ++i)
        G[2][i] += k->hinge_row[1][i] * sum->first * (i == 2 ? 2.0 * k->sign : k->sign);
    G[2][2] += sum->second;
}

static inline Interval kept_within(Interval x, double least, double most)
{
    return fmin(fmax(x.middle(), least), most);
}

/* The integral of (a.n)^2 / |V| over |y| <= reach, y the normal velocity, for every affine V near the mean one. */
static inline void add_pivot(const CellLink *k, Matrix3 H, Interval reach, Interval spin, const Vector3 along, const Vector3 normal,
                             const TwoRows hinge)
{
    const double allowed = k->allowed;
    const Interval vs = size_of(k->mean_hinge[0]), w = size_of(k->mean_spin), h = k->turned;
    const Interval change = k->spin_spread + Interval(2.0 * allowed) / k->length, wide = spin + change * 2.0;
    const Interval beside = vs + k->along_spread + allowed, tanh_T = reach / norm_of(reach, beside);
    const Interval stiff_along = (arc_of(reach, beside) - tanh_T) * 2.0 / wide, stiff_normal = tanh_T * 2.0 / wide;
    Interval moved; /* y at a corner where that of the mean vanishes */
    for (int i = 0; i < CORNERS; ++i)
        moved = most_of(moved, size_of(k->hinge[i][1] - k->spin[i] * (Interval(k->mean_hinge[1]) / k->mean_spin)));
    moved = (moved + k->off + allowed) / spin;
    const Interval tilted = (k->along_spread + allowed) / spin + vs / w * change / spin;
    const Interval tau_along = kept_within(tilted * 3.0 + h * 0.7, LEAST_TAU, MOST_TAU);
    const Interval tau_normal = kept_within(moved * 5.0 + h * 0.7, LEAST_TAU, MOST_TAU), one = 1.0;
    const Interval lost_along = stiff_along * 2.0 * (one / tau_along - one), lost_normal = stiff_normal * 2.0 * (one / tau_normal - one);
    add_square(H, stiff_along * (one - tau_along), along);
    add_square(H, stiff_normal * (one - tau_normal), normal);
    H[2][2] -= lost_along * square(tilted) + lost_normal * square(moved);
    add_gram(H, -(lost_along + lost_normal) * 0.25 * square(h), hinge);
}

/* Of (a.n)^2 over the pieces of a link: its terms in along, normal and both. */
struct Arcs {
    Interval along, normal, both;
};

/* The integral of (a.n)^2 / |V| over a piece, V the mean velocity: y = |vs| sinh t, ds = |V| dt / w. */
static inline void add_piece(const CellLink *k, Matrix3 H, Arcs *arcs, Interval factor, double sa, double sb)
{
    const double vs = k->mean_hinge[0], w = k->mean_spin;
    const Interval v = fabs(vs), ya = normal_of_mean(k, sa), yb = normal_of_mean(k, sb);
    if (fabs(asinh(yb.middle() / fabs(vs)) - asinh(ya.middle() / fabs(vs))) < SHORT_ARC) {
        /* a.n = g/|V| with g affine, and 1/|V|^3 is above its tangent at the middle by at least -3/2 dy^2/|V|^5: Gauss's rule of two
           points is exact for the product of g^2 and the tangent less that */
        const Interval length = Interval(sb) - sa, half = (yb - ya) * 0.5, y = (ya + yb) * 0.5, V = norm_of(v, y);
        const Interval slope = y * half / square(V) * 3.0, nearest = V - size_of(half);
        const Interval less = square(half) / square(nearest) * 1.5 * (V / nearest) * square(V / nearest);
        for (int e = -1; e <= 1; e += 2) {
            const Interval share = TWO_OVER_ROOT_3 * (0.5 * e), weight = Interval(1.0) - slope * share - less;
            TwoRows row;
            Vector3 across_V;
            rows_at(k, (Interval(sa) + sb) * 0.5 + share * length * 0.5, row);
            for (int i = 0; i < 3; ++i)
                across_V[i] = (row[1][i] * vs - row[0][i] * (y + share * half)) / V;
            add_square(H, factor * 0.5 * length * weight / V, across_V);
        }
        return;
    }
    /* sinh t = y/|vs|, tanh t = y/|V|, sech t = |vs|/|V| */
    const Interval ra = norm_of(v, ya), rb = norm_of(v, yb), per = factor / w, dt = arc_of(yb, v) - arc_of(ya, v);
    const Interval dtanh = yb / rb - ya / ra, dsech = (Interval(1.0) / rb - Interval(1.0) / ra) * vs;
    arcs->along += per * (dt - dtanh), arcs->normal += per * dtanh, arcs->both -= per * dsech;
}

/* Add what the link contributes: (f* - f).a >= a H a - gap for every motion with |a| <= allowed on the link. */
static inline void add_growth(const CellLink *k, Matrix3 H)
{
    const double w = k->mean_spin, l = k->length, allowed = k->allowed;
    const Interval vs = k->mean_hinge[0], vn = k->mean_hinge[1], h = k->turned, ends = normal_of_mean(k, l), none, one = 1.0;
    const Interval most = most_of(k->end_spread[0], k->end_spread[1]) + allowed, reach = least_of(size_of(vn), size_of(ends));
    const Interval spin = Interval(fabs(w)) - k->spin_spread - Interval(2.0 * allowed) / l;
    const bool pivots = vn * ends < none && reach > most * ROOM && spin > 0.3 * fabs(w);
    TwoRows hinge; /* at least what a turn by a unit angle changes */
    Vector3 along, normal;
    Arcs arcs;
    Moments lost; /* of the squares at points of the link */
    Interval turned;
    if (k->both_ways || (k->directed && !(size_of(vs) > k->along_spread + allowed)))
        return; /* the balanced motion may slide in the other sense */
    for (int i = 0; k->axis >= 0 && i < 6; ++i)
        hinge[i / 3][i % 3] = k->most * k->plain_row[i / 3][i % 3];
    for (int i = 0; w != 0.0 && i < 3; ++i) { /* a.n = along tanh t + normal sech t */
        const double turn = i == 2 ? k->sign : 0.0;
        normal[i] = k->hinge_row[1][i] - vn / w * turn;
        along[i] = vs / w * turn - k->hinge_row[0][i];
    }
    if (pivots)
        add_pivot(k, H, reach - most, spin, along, normal, hinge);
    for (int j = 0; j < PIECES; ++j) {
        const double sa = k->node[j], sb = k->node[j + 1];
        const Interval length = Interval(sb) - sa;
        if (sb <= sa || k->kind[j] == LOOSE)
            continue;
        if (k->kind[j] == SLOW) {
            TwoRows first, last;
            rows_at(k, sa, first), rows_at(k, sb, last);
            const Interval factor = length * 0.5 / (k->cone_speed[j] + allowed), s2 = square(k->cone_sine[j]);
            Vector3 across_cone;
            for (int i = 0; i < 3; ++i)
                across_cone[i] = (k->cone[j][0] * (first[1][i] + last[1][i]) - k->cone[j][1] * (first[0][i] + last[0][i])) * 0.5;
            add_square(H, (one - s2) * 0.5 * factor, across_cone);
            add_point(&lost, -s2 * 1.5 * factor, sa), add_point(&lost, -s2 * 1.5 * factor, sb);
            turned -= factor * 1.5;
            continue;
        }
        const Interval nearest = nearest_of(normal_of_mean(k, sa), normal_of_mean(k, sb));
        if (pivots && !(nearest > reach))
            continue;
        const Interval least = norm_of(vs, nearest), spread = most_of(k->spread[j], k->spread[j + 1]);
        /* along the way to the balanced motion, or (half as much) about the trial motion alone */
        const Interval far = (spread + allowed) / least;
        const bool straight = far < STRAIGHT;
        const Interval half = straight ? 1.0 : 0.5, sine = straight ? far : spread / least;
        if (!(sine < STRAIGHT))
            continue;
        const Interval tau = kept_within(sine * 1.5 + h * 0.75, LEAST_TAU, MOST_TAU), near = half / (one + far);
        add_piece(k, H, &arcs, near * (one - tau) * (one - square(sine)), sa, sb);
        const Interval weight = -(near * length / least * (one / tau - one)), within = weight * square(sine);
        add_point(&lost, within, sa), add_point(&lost, within, sb);
        turned += weight;
    }
    add_square(H, arcs.along, along);
    add_square(H, arcs.normal, normal);
    add_both(H, arcs.both, along, normal);
    add_grams(k, H, &lost);
    add_gram(H, turned * 0.5 * square(h), hinge);
}
