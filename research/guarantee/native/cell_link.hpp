/* A link of three over a cell of (angle 1, angle 2, rate of angle 2), rate 1 of angle 1: what its velocity field does there.
   research/guarantee/README.md, has the derivation and the names: V the trial velocity, f its direction, a a change of V. Tangential
   velocities are stretched by sigma, so that the dissipation of a point is |V|. Plain numbers are choices: whatever they are, what is
   said of them holds. */

#pragma once

#include <float.h>
#include <stddef.h>
#include <string.h>

#include "interval.hpp"

enum { CORNERS = 8, EDGES = 4, PIECES = 16 };
/* How a piece of a link is treated: its forces interpolated; those of the trial motion; interpolated, within a cone. */
enum { LOOSE, SLIDING, SLOW };

#define LITTLE_SPREAD 0.3 /* of |V - V at the centre| / |V at the centre|, for a piece to count as sliding */
#define MOST_SPREAD 0.6   /* the same where directions do not keep to a cone */
#define STRAIGHT 0.12     /* the same with what the motion may add, for its curvature to be taken along the way */
#define LEAST_TAU 0.3
#define MOST_TAU 0.6
#define NARROWEST 0.6     /* cosine of the widest cone of a slow piece */
#define SLOWEST 0.3       /* ratio of speeds at the corners below which the pieces follow the pattern of motion */
#define ROOM 1.2
#define AT_REST 1e3       /* of delta: what is slower may be at rest */
#define SHORT_ARC 3e-3
#define ROUNDED 1e-14     /* of a number: more than twenty roundings */

static const Interval TWO_OVER_ROOT_3 = Interval(2.0) / root(3.0);

/* Changes of the velocity along the edges of one axis, in floating point: its part along the link, that across at the hinge, and what the
   spin adds; and more than these, and what else is made of them for a unit vector that is as near to one, can be off. */
struct Edges {
    double along[EDGES], normal[EDGES], spin[EDGES], off;
};

struct CellLink {
    double length, sign, offset; /* of the rate along the link; of the hinge from the middle link's midpoint */
    int axis;                    /* of the cell that turns the link, or -1 */
    Interval turned;             /* the cell's size along it */
    Interval most;               /* |V| of a stretched velocity is at most so many times that of the velocity */
    bool directed;               /* sigma depends on the sense of sliding */
    bool both_ways;              /* where it does, and both senses may occur in the cell */
    Interval uneven;             /* ratio of both sigma */
    Interval hinge[CORNERS][2], spin[CORNERS];
    Edges edges[3];
    double mean_hinge[2], mean_spin;       /* nearly; everything is seen from there */
    Interval off;                          /* how far the hinge's velocity may be from the interpolated one */
    Interval end_spread[2], along_spread, spin_spread, fastest;
    double node[PIECES + 1];
    Interval spread[PIECES + 1];
    int kind[PIECES];
    Interval error[PIECES];                /* of the interpolated directions of force */
    Interval cone[PIECES][2], cone_sine[PIECES], cone_speed[PIECES];
    Interval force_error, gap, power_error; /* over the link */
    TwoRows hinge_row;                     /* the hinge's velocity in the link's axes for a change of the middle link's motion */
    TwoRows plain_row;                     /* the same, not stretched */
    double allowed;                        /* largest |a| that `growth` holds for */
};

static inline bool high(int corner, int axis)
{
    return corner >> (2 - axis) & 1;
}

static inline int across(int corner, int axis)
{
    return corner | 1 << (2 - axis);
}

static inline Interval normal_at(const CellLink *k, int corner, double s)
{
    return k->hinge[corner][1] + k->spin[corner] * s;
}

static inline Interval normal_of_mean(const CellLink *k, double s)
{
    return Interval(k->mean_hinge[1]) + Interval(s) * k->mean_spin;
}

/* Largest distance of the corners' velocities from their mean, at a point of the link. */
static inline Interval spread_at(const CellLink *k, double s)
{
    const Interval mean = normal_of_mean(k, s);
    Interval most;
    for (int i = 0; i < CORNERS; ++i)
        most = most_of(most, square(k->hinge[i][0] - k->mean_hinge[0]) + square(normal_at(k, i, s) - mean));
    return root(most) + k->off;
}

/* The least |y| between two ends of a piece. */
static inline Interval nearest_of(Interval ya, Interval yb)
{
    return ya * yb > 0.0 ? least_of(size_of(ya), size_of(yb)) : Interval();
}

static inline void place_nodes(CellLink *k, double vn, double w, double width)
{
    const double l = k->length;
    const bool turns = fabs(w) * l > 1e-3 * width;
    const double t0 = turns ? asinh(vn / width) : 0.0, t1 = turns ? asinh((vn + w * l) / width) : 0.0;
    for (int j = 0; j <= PIECES; ++j) {
        const double share = (double)j / PIECES;
        k->node[j] = turns ? fmin(fmax((width * sinh(t0 + (t1 - t0) * share) - vn) / w, 0.0), l) : l * share;
    }
    k->node[0] = 0.0, k->node[PIECES] = l;
}

static inline double pivot_of(double vn, double w, double l)
{
    return w == 0.0 ? 0.0 : fmin(fmax(-vn / w, 0.0), l);
}

/* Pieces are short where the velocity turns: about the pivot of the mean motion, or of the mean pattern of slow ones. */
static inline void find_pieces(CellLink *k)
{
    const double l = k->length;
    double speed[CORNERS], slowest = INFINITY;
    k->fastest = 0.0;
    for (int i = 0; i < CORNERS; ++i) {
        const Interval own = most_of(norm_of(k->hinge[i][0], k->hinge[i][1]), norm_of(k->hinge[i][0], normal_at(k, i, l)));
        k->fastest = most_of(k->fastest, own);
        speed[i] = own.middle(), slowest = fmin(slowest, speed[i]);
    }
    if (slowest < SLOWEST * k->fastest.middle()) {
        double pattern[3] = {0.0}, width = 0.0;
        for (int i = 0; i < CORNERS; ++i) {
            const double per = 1.0 / (CORNERS * (speed[i] + DBL_MIN));
            pattern[0] += per * k->hinge[i][0].middle(), pattern[1] += per * k->hinge[i][1].middle();
            pattern[2] += per * k->spin[i].middle();
        }
        const double s = pivot_of(pattern[1], pattern[2], l);
        for (int i = 0; i < CORNERS; ++i) {
            const double per = 1.0 / (speed[i] + DBL_MIN), normal = per * normal_at(k, i, s).middle();
            width = fmax(width, hypot(per * k->hinge[i][0].middle() - pattern[0], normal - pattern[1] - s * pattern[2]));
        }
        place_nodes(k, pattern[1], pattern[2], fmax(fmax(fabs(pattern[0]), width), 1e-3));
    } else {
        const double *v = k->mean_hinge, width = spread_at(k, pivot_of(v[1], k->mean_spin, l)).middle();
        place_nodes(k, v[1], k->mean_spin, fmax(fmax(fabs(v[0]), width), 1e-9));
    }
}

/* Make two numbers, nearly of length 1, a vector of that length. */
static inline void find_direction(double x, double y, Interval u[2])
{
    const double length = hypot(x, y);
    u[0] = length > 0.0 ? x / length : 1.0, u[1] = length > 0.0 ? y / length : 0.0;
    const Interval norm = norm_of(u[0], u[1]);
    u[0] = u[0] / norm, u[1] = u[1] / norm;
}

/* Forces of the corners are interpolated, and what that loses is the gap: for a piece whose velocity is small or turns far. */
static inline void interpolate_forces(CellLink *k, int j, Interval spread, Interval least, double delta)
{
    const double ends[2] = {k->node[j], k->node[j + 1]};
    const Interval length = Interval(ends[1]) - ends[0];
    Interval *u = k->cone[j], largest, slowest(INFINITY), cosine(1.0), normal[CORNERS][2], speed[CORNERS][2];
    double sum[2] = {0.0, 0.0};
    bool apart = true; /* every corner is at rest or slides, all along the piece */
    for (int i = 0; i < CORNERS; ++i)
        for (int e = 0; e < 2; ++e) {
            normal[i][e] = normal_at(k, i, ends[e]), speed[i][e] = norm_of(k->hinge[i][0], normal[i][e]);
            const double v = speed[i][e].middle() + DBL_MIN;
            sum[0] += k->hinge[i][0].middle() / v, sum[1] += normal[i][e].middle() / v;
            largest = most_of(largest, speed[i][e]), slowest = least_of(slowest, speed[i][e]);
        }
    find_direction(sum[0], sum[1], u);
    for (int i = 0; i < CORNERS; ++i)
        for (int e = 0; e < 2; ++e) {
            const Interval along = k->hinge[i][0] * u[0] + normal[i][e] * u[1];
            cosine = speed[i][e] > 1e-30 ? least_of(cosine, along / speed[i][e]) : Interval(-1.0);
        }
    k->kind[j] = LOOSE;
    k->error[j] = 0.0;
    /* |V'| less the power of a corner's force on it is at most 2 d, d the distance of the velocities; for |V'| > d, d^2/|V'| */
    const Interval left = least - spread, twice = spread * 2.0;
    Interval gap = twice, power = twice;
    if (left > spread)
        gap = least_of(gap, square(spread) / left * (left > twice ? 1.0 : 2.0));
    gap += delta;
    if (cosine > NARROWEST) {
        const Interval sine = root(Interval(1.0) - square(cosine)), slow = slowest * cosine, held = slow / norm_of(slow, delta);
        const Interval at_rest = Interval(AT_REST) * delta;
        for (int i = 0; i < CORNERS; ++i) {
            const Interval fast = most_of(speed[i][0], speed[i][1]), slowly = least_of(speed[i][0], speed[i][1]) * cosine;
            apart &= fast < at_rest || slowly > at_rest;
        }
        const Interval side = largest * 2.0 * sine * cosine + k->off, speediest = largest + k->off, lost = Interval(1.0) - held;
        Interval narrow = largest * 2.0 * square(sine) + k->off * 2.0 + square(side) * 1.5 / speediest;
        narrow += apart ? (lost * 0.25 + Interval(0.5) / (AT_REST * AT_REST)) * largest + at_rest : lost * largest;
        if (narrow < gap) {
            gap = narrow;
            power = least_of(power, largest * (Interval(1.0) - cosine) + k->off);
            k->kind[j] = SLOW;
            k->cone_sine[j] = sine, k->cone_speed[j] = speediest;
        }
    }
    k->gap += gap * length;
    k->power_error += power * length;
}

/* A link that slides forwards and backwards within the cell, stretched by the larger sigma: the dissipation's second derivative
   along a is at most `uneven` |a|^2/|V|, so forces of the corners lose so much, and its slope at most 1. */
static inline void interpolate_uneven(CellLink *k, int j, Interval spread, Interval least, double delta)
{
    const Interval length = Interval(k->node[j + 1]) - k->node[j], left = least - spread, twice = spread * 2.0;
    Interval gap = twice, power = twice;
    if (left > twice * 2.0 && left > 4.0 * delta) {
        const Interval bent = k->uneven * square(spread) / left;
        gap = least_of(gap, bent), power = least_of(power, k->off + bent);
    }
    k->kind[j] = LOOSE;
    k->error[j] = 0.0;
    k->gap += (gap + delta) * length;
    k->power_error += power * length;
}

static inline void find_edges(CellLink *k)
{
    for (int axis = 0; axis < 3; ++axis) {
        Edges *edges = &k->edges[axis];
        int n = 0;
        edges->off = 0.0;
        for (int i = 0; i < CORNERS; ++i)
            if (!high(i, axis)) {
                const int o = across(i, axis);
                const Interval d0 = k->hinge[o][0] - k->hinge[i][0], d1 = k->hinge[o][1] - k->hinge[i][1], w = k->spin[o] - k->spin[i];
                const Interval whole = size_of(d0) + size_of(d1) + size_of(w) * k->length;
                const double held = (Interval(d0.hi) - d0.lo + (Interval(d1.hi) - d1.lo) + (Interval(w.hi) - w.lo) * k->length).hi;
                edges->along[n] = d0.middle(), edges->normal[n] = d1.middle(), edges->spin[n++] = w.middle();
                edges->off = larger(edges->off, (Interval(held) + whole * ROUNDED).hi);
            }
    }
}

/* Forces are those of the trial motion: the error of the interpolated ones. */
static inline void slide(CellLink *k, int j, Interval spread, Interval least, double delta)
{
    const double ends[2] = {k->node[j], k->node[j + 1]};
    const Interval m = least - spread, sine = spread / least, cosine = root(Interval(1.0) - square(sine)), vs = k->mean_hinge[0];
    const Interval ya = normal_of_mean(k, ends[0]), yb = normal_of_mean(k, ends[1]), va = norm_of(vs, ya), vb = norm_of(vs, yb);
    const Interval first[2] = {vs / va, ya / va}, length = Interval(ends[1]) - ends[0], per = Interval(1.0) / (square(m) * 8.0);
    Interval u[2];
    find_direction(first[0].middle() + (vs / vb).middle(), first[1].middle() + (yb / vb).middle(), u);
    /* from u to V is at most the larger turn to an end of the piece, and the arc sine of `sine` */
    const Interval last[2] = {vs / vb, yb / vb};
    const Interval turn = most_of(size_of(first[0] * u[1] - first[1] * u[0]), size_of(last[0] * u[1] - last[1] * u[0]));
    const Interval straight = least_of(first[0] * u[0] + first[1] * u[1], last[0] * u[0] + last[1] * u[1]);
    const Interval lean = straight * cosine > turn * sine ? turn * cosine + straight * sine : Interval(1.0);
    Interval error = k->off / m + square(delta) * 4.0 * per, power = k->off;
    for (int axis = 0; axis < 3; ++axis) {
        const Edges *edges = &k->edges[axis];
        const double x = u[0].middle(), y = u[1].middle();
        double along_most = 0.0, side_most = 0.0, longest = 0.0;
        for (int i = 0; i < EDGES; ++i)
            for (int e = 0; e < 2; ++e) {
                const double d0 = edges->along[i], d1 = edges->normal[i] + edges->spin[i] * ends[e];
                along_most = larger(along_most, fabs(d0 * x + d1 * y)), side_most = larger(side_most, fabs(d1 * x - d0 * y));
                longest = larger(longest, d0 * d0 + d1 * d1);
            }
        const Interval D = root(longest) + edges->off + k->off * 4.0, side = Interval(side_most) + edges->off;
        const Interval across_V = least_of(side + (Interval(along_most) + edges->off) * lean + k->off * 4.0, D);
        const Interval c2 = square(across_V), D2 = square(D);
        /* second derivative of V/|V|: c sqrt(4 D^2 - 3 c^2) / |V|^2 with c across V, at most 2/sqrt(3) D^2 / |V|^2 */
        error += (c2 * 3.0 < D2 * 2.0 ? across_V * root(D2 * 4.0 - c2 * 3.0) : D2 * TWO_OVER_ROOT_3) * per;
        power += c2 / (m * 8.0);
    }
    k->kind[j] = SLIDING;
    k->error[j] = least_of(error, sine * 2.0 + 1.0 - cosine);
    k->force_error += k->error[j] * length;
    k->power_error += power * length;
}

/* Fill in what the trial motion says: the error of interpolated forces, or the gap they leave, and the error of the power. */
static inline void find_errors(CellLink *k, double delta)
{
    const double l = k->length;
    k->mean_hinge[0] = k->mean_hinge[1] = k->mean_spin = 0.0;
    for (int i = 0; i < CORNERS; ++i) {
        k->mean_hinge[0] += k->hinge[i][0].middle() / CORNERS, k->mean_hinge[1] += k->hinge[i][1].middle() / CORNERS;
        k->mean_spin += k->spin[i].middle() / CORNERS;
    }
    if (fabs(k->mean_hinge[0]) < 1e-13)
        k->mean_hinge[0] = 1e-13;
    k->along_spread = k->spin_spread = Interval();
    for (int i = 0; i < CORNERS; ++i) {
        k->along_spread = most_of(k->along_spread, size_of(k->hinge[i][0] - k->mean_hinge[0]));
        k->spin_spread = most_of(k->spin_spread, size_of(k->spin[i] - k->mean_spin));
    }
    k->along_spread += k->off;
    find_pieces(k), find_edges(k);
    for (int j = 0; j <= PIECES; ++j)
        k->spread[j] = spread_at(k, k->node[j]);
    k->end_spread[0] = k->spread[0], k->end_spread[1] = spread_at(k, l);
    k->force_error = k->gap = k->power_error = Interval();
    for (int j = 0; j < PIECES; ++j) {
        const Interval spread = most_of(k->spread[j], k->spread[j + 1]);
        const Interval ya = normal_of_mean(k, k->node[j]), yb = normal_of_mean(k, k->node[j + 1]);
        const Interval least = norm_of(k->mean_hinge[0], nearest_of(ya, yb));
        if (k->both_ways)
            interpolate_uneven(k, j, spread, least, delta);
        else if (spread < least * LITTLE_SPREAD)
            slide(k, j, spread, least, delta);
        else {
            const Interval gap = k->gap, power = k->power_error;
            interpolate_forces(k, j, spread, least, delta);
            if (k->kind[j] == SLOW || !(spread < least * MOST_SPREAD))
                continue;
            k->gap = gap, k->power_error = power;
            slide(k, j, spread, least, delta);
        }
    }
}
