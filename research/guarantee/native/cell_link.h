/* A link of three over a cell of (angle 1, angle 2, rate of angle 2), rate 1 of angle 1: what its velocity field does there.
   research/guarantee/README.md, has the derivation and the names: V the trial velocity, f its direction, a a change of V. Tangential
   velocities are stretched by sigma, so that the dissipation of a point is |V|. */

#pragma once

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#include "chain.h"

enum { CORNERS = 8, PIECES = 16 };
/* How a piece of a link is treated: its forces interpolated; those of the trial motion; interpolated, within a cone. */
enum { LOOSE, SLIDING, SLOW };

#define HALF_PI 1.5707963267948966
#define LITTLE_SPREAD 0.3 /* of |V - V at the centre| / |V at the centre|, for a piece to count as sliding */
#define MOST_SPREAD 0.6   /* the same where directions do not keep to a cone */
#define STRAIGHT 0.12     /* the same with what the motion may add, for its curvature to be taken along the way */
#define LEAST_TAU 0.3
#define MOST_TAU 0.6
#define NARROWEST 0.6     /* cosine of the widest cone of a slow piece */
#define SLOWEST 0.3       /* ratio of speeds at the corners below which the pieces follow the pattern of motion */
#define ROOM 1.2
#define AT_REST 1e3       /* of delta: what is slower may be at rest */
#define SHORT_ARC 0.05

typedef struct {
    double length, sign, offset; /* of the rate along the link; of the hinge from the middle link's midpoint */
    int axis;                    /* of the cell that turns the link, or -1 */
    double turned;               /* the cell's size along it */
    double most;                 /* |V| of a stretched velocity is at most so many times that of the velocity */
    bool directed;               /* sigma depends on the sense of sliding */
    double uneven;               /* ratio of both sigma where both senses occur in the cell, else 1 */
    double hinge[CORNERS][2], spin[CORNERS];
    double mean_hinge[2], mean_spin;
    double off;                            /* how far the hinge's velocity may be from the interpolated one */
    double end_spread[2], along_spread, spin_spread, fastest;
    double node[PIECES + 1], spread[PIECES + 1];
    int kind[PIECES];
    double error[PIECES];                  /* of the interpolated directions of force */
    double cone[PIECES][2], cone_sine[PIECES], cone_speed[PIECES];
    double force_error, gap, power_error;  /* over the link */
    TwoRows hinge_row;                     /* the hinge's velocity in the link's axes for a change of the middle link's motion */
    TwoRows plain_row;                     /* the same, not stretched */
    double allowed;                        /* largest |a| that `growth` holds for */
} CellLink;

/* Not hypot, which takes five times as long: no velocity here overflows or underflows. */
static inline double norm_of(double x, double y)
{
    return sqrt(x * x + y * y);
}

static inline bool high(int corner, int axis)
{
    return corner >> (2 - axis) & 1;
}

static inline int across(int corner, int axis)
{
    return corner | 1 << (2 - axis);
}

static inline double normal_at(const CellLink *k, int corner, double s)
{
    return k->hinge[corner][1] + s * k->spin[corner];
}

/* Largest distance of the corners' velocities from their mean, at a point of the link. */
static inline double spread_at(const CellLink *k, double s)
{
    double most = 0.0;
    for (int i = 0; i < CORNERS; ++i)
        most = fmax(most, norm_of(k->hinge[i][0] - k->mean_hinge[0], normal_at(k, i, s) - k->mean_hinge[1] - s * k->mean_spin));
    return most + k->off;
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
        speed[i] = fmax(norm_of(k->hinge[i][0], k->hinge[i][1]), norm_of(k->hinge[i][0], normal_at(k, i, l)));
        slowest = fmin(slowest, speed[i]), k->fastest = fmax(k->fastest, speed[i]);
    }
    if (slowest < SLOWEST * k->fastest) {
        Vector3 pattern = {0.0};
        double width = 0.0;
        for (int i = 0; i < CORNERS; ++i) {
            const double per = 1.0 / (CORNERS * (speed[i] + DBL_MIN));
            pattern[0] += per * k->hinge[i][0], pattern[1] += per * k->hinge[i][1], pattern[2] += per * k->spin[i];
        }
        const double s = pivot_of(pattern[1], pattern[2], l);
        for (int i = 0; i < CORNERS; ++i) {
            const double per = 1.0 / (speed[i] + DBL_MIN);
            width = fmax(width, norm_of(per * k->hinge[i][0] - pattern[0], per * normal_at(k, i, s) - pattern[1] - s * pattern[2]));
        }
        place_nodes(k, pattern[1], pattern[2], fmax(fmax(fabs(pattern[0]), width), 1e-3));
    } else {
        const double *v = k->mean_hinge, width = spread_at(k, pivot_of(v[1], k->mean_spin, l));
        place_nodes(k, v[1], k->mean_spin, fmax(fmax(fabs(v[0]), width), 1e-9));
    }
}

/* Forces of the corners are interpolated, and what that loses is the gap: for a piece whose velocity is small or turns far. */
static inline void interpolate_forces(CellLink *k, int j, double spread, double least, double delta)
{
    const double ends[2] = {k->node[j], k->node[j + 1]}, length = ends[1] - ends[0];
    double *u = k->cone[j], largest = 0.0, slowest = INFINITY, cosine = 1.0;
    u[0] = u[1] = 0.0;
    for (int i = 0; i < CORNERS; ++i)
        for (int e = 0; e < 2; ++e) {
            const double x = k->hinge[i][0], y = normal_at(k, i, ends[e]), v = norm_of(x, y) + DBL_MIN;
            u[0] += x / v, u[1] += y / v;
            largest = fmax(largest, v), slowest = fmin(slowest, v);
        }
    const double norm = norm_of(u[0], u[1]) + DBL_MIN;
    u[0] /= norm, u[1] /= norm;
    for (int i = 0; i < CORNERS; ++i)
        for (int e = 0; e < 2; ++e) {
            const double x = k->hinge[i][0], y = normal_at(k, i, ends[e]);
            cosine = fmin(cosine, (x * u[0] + y * u[1]) / (norm_of(x, y) + DBL_MIN));
        }
    k->kind[j] = LOOSE;
    k->error[j] = 0.0;
    /* |V'| less the power of a corner's force on it is at most 2 d, d the distance of the velocities; for |V'| > d, d^2/|V'| */
    const double left = least - spread, more = left >= 2.0 * spread ? 1.0 : 2.0;
    double gap = fmin(2.0 * spread, left > spread ? more * spread * spread / left : INFINITY) + delta, power = 2.0 * spread;
    if (cosine > NARROWEST) {
        const double sine = sqrt(fmax(1.0 - cosine * cosine, 0.0)), held = slowest * cosine / norm_of(slowest * cosine, delta);
        bool apart = true; /* every corner is at rest or slides, all along the piece */
        for (int i = 0; i < CORNERS; ++i) {
            const double v0 = norm_of(k->hinge[i][0], normal_at(k, i, ends[0])), v1 = norm_of(k->hinge[i][0], normal_at(k, i, ends[1]));
            apart &= fmax(v0, v1) <= AT_REST * delta || fmin(v0, v1) * cosine >= AT_REST * delta;
        }
        const double side = 2.0 * largest * sine * cosine + k->off;
        double narrow = 2.0 * largest * sine * sine + 2.0 * k->off + 1.5 * side * side / (largest + k->off + DBL_MIN);
        narrow += apart ? (0.25 * (1.0 - held) + 0.5 / (AT_REST * AT_REST)) * largest + AT_REST * delta : (1.0 - held) * largest;
        if (narrow < gap) {
            gap = narrow;
            power = fmin(power, largest * (1.0 - cosine) + k->off);
            k->kind[j] = SLOW;
            k->cone_sine[j] = sine, k->cone_speed[j] = largest + k->off;
        }
    }
    k->gap += gap * length;
    k->power_error += power * length;
}

/* A link that slides forwards and backwards within the cell, stretched by the larger sigma: the dissipation's second derivative
   along a is at most `uneven` |a|^2/|V|, so forces of the corners lose so much, and its slope at most 1. */
static inline void interpolate_uneven(CellLink *k, int j, double spread, double least, double delta)
{
    const double length = k->node[j + 1] - k->node[j], left = least - spread;
    const bool known = left >= 4.0 * spread && left > 4.0 * delta;
    const double bent = known ? k->uneven * spread * spread / left : INFINITY;
    k->kind[j] = LOOSE;
    k->error[j] = 0.0;
    k->gap += (fmin(2.0 * spread, bent) + delta) * length;
    k->power_error += fmin(2.0 * spread, k->off + bent) * length;
}

/* Fill in what the trial motion says: the error of interpolated forces, or the gap they leave, and the error of the power. */
static inline void find_errors(CellLink *k, double delta)
{
    const double l = k->length;
    k->mean_hinge[0] = k->mean_hinge[1] = k->mean_spin = 0.0;
    for (int i = 0; i < CORNERS; ++i) {
        k->mean_hinge[0] += k->hinge[i][0] / CORNERS, k->mean_hinge[1] += k->hinge[i][1] / CORNERS;
        k->mean_spin += k->spin[i] / CORNERS;
    }
    k->along_spread = k->off, k->spin_spread = 0.0;
    for (int i = 0; i < CORNERS; ++i) {
        k->along_spread = fmax(k->along_spread, fabs(k->hinge[i][0] - k->mean_hinge[0]) + k->off);
        k->spin_spread = fmax(k->spin_spread, fabs(k->spin[i] - k->mean_spin));
    }
    k->end_spread[0] = spread_at(k, 0.0), k->end_spread[1] = spread_at(k, l);
    find_pieces(k);
    for (int j = 0; j <= PIECES; ++j)
        k->spread[j] = spread_at(k, k->node[j]);
    k->force_error = k->gap = k->power_error = 0.0;
    const double vs = k->mean_hinge[0];
    for (int j = 0; j < PIECES; ++j) {
        const double sa = k->node[j], sb = k->node[j + 1], length = sb - sa, spread = fmax(k->spread[j], k->spread[j + 1]);
        const double ya = k->mean_hinge[1] + sa * k->mean_spin, yb = k->mean_hinge[1] + sb * k->mean_spin;
        const double least = norm_of(vs, ya * yb <= 0 ? 0.0 : fmin(fabs(ya), fabs(yb)));
        if (k->uneven > 1.0) {
            interpolate_uneven(k, j, spread, least, delta);
            continue;
        }
        if (!(spread < LITTLE_SPREAD * least)) {
            const double gap = k->gap, power = k->power_error;
            interpolate_forces(k, j, spread, least, delta);
            if (k->kind[j] == SLOW || !(spread < MOST_SPREAD * least))
                continue;
            k->gap = gap, k->power_error = power;
        }
        k->kind[j] = SLIDING;
        const double m = least - spread, sine = spread / least, from = atan2(ya, fabs(vs)), to = atan2(yb, fabs(vs));
        const double lean = sin(fmin(0.5 * fabs(to - from) + asin(sine), HALF_PI));
        const double u0 = vs < 0 ? -cos(0.5 * (from + to)) : cos(0.5 * (from + to)), u1 = sin(0.5 * (from + to));
        double error = k->off / m + delta * delta / (2.0 * m * m), power = k->off;
        for (int axis = 0; axis < 3; ++axis) {
            double along = 0.0, side = 0.0, square = 0.0;
            for (int i = 0; i < CORNERS; ++i)
                for (int e = 0; e < 2 && !high(i, axis); ++e) {
                    const int o = across(i, axis);
                    const double s = e ? sb : sa, d0 = k->hinge[o][0] - k->hinge[i][0], d1 = normal_at(k, o, s) - normal_at(k, i, s);
                    along = fmax(along, fabs(d0 * u0 + d1 * u1)), side = fmax(side, fabs(d1 * u0 - d0 * u1));
                    square = fmax(square, d0 * d0 + d1 * d1);
                }
            const double D = sqrt(square) + 4.0 * k->off, across_V = fmin(side + along * lean + 4.0 * k->off, D), c2 = across_V * across_V;
            /* second derivative of V/|V|: c sqrt(4 D^2 - 3 c^2) / |V|^2 with c across V, at most 2/sqrt(3) D^2 / |V|^2 */
            error += (c2 > D * D * (2.0 / 3) ? 1.1547005383792517 * D * D : across_V * sqrt(4.0 * D * D - 3.0 * c2)) / (8.0 * m * m);
            power += c2 / (8.0 * m);
        }
        k->error[j] = fmin(error, 2.0 * sine + 1.0 - sqrt(1.0 - sine * sine));
        k->force_error += k->error[j] * length;
        k->power_error += power * length;
    }
}
