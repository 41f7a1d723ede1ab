/* All that enters the bound of a cell, in interval arithmetic. Points (m, 3) and motions (m, 3) of the middle link by rows; `at` (n, 8): the
   corners of each cell among them. sigma: forwards and backwards. */

#include "enclosure.hpp"
#include "loads.hpp"
#include "spline.hpp"

#define FASTEST 1e6 /* what moves faster was not solved */

static Cell cell_at(const ptrdiff_t *at, const double *points, const double *motions, const State *states)
{
    Cell cell;
    for (int j = 0; j < 8; ++j)
        cell.point[j] = points + 3 * at[j], cell.motion[j] = motions + 3 * at[j], cell.state[j] = states + at[j];
    for (int j = 0; j < 8; ++j)
        undefined |= !(cell.state[j]->dissipation.hi < INFINITY);
    return cell;
}

/* Infinite where something is not defined, or no number. */
static void state_upper(Allowance found, double *allowance)
{
    const bool known = !undefined && found.gain.hi < INFINITY && found.power.hi < INFINITY;
    allowance[0] = known ? found.gain.hi : INFINITY, allowance[1] = known ? found.power.hi : INFINITY;
}

/* The middle of an interval, and how far its ends are from there at most. */
static void state_near(const Interval pair[2], double *near)
{
    near[0] = pair[0].middle(), near[1] = pair[1].middle();
    near[2] = undefined ? INFINITY : norm_of(Interval(pair[0]) - near[0], Interval(pair[1]) - near[1]).hi;
}

extern "C" {

void colloc_states(ptrdiff_t m, const double *length, const double *sigma, const double *points, const double *motions, const double *loads, double delta, State *states)
{
    for (ptrdiff_t i = 0; i < m; ++i) {
        const double *z = motions + 3 * i;
        undefined = !(fabs(z[0]) + fabs(z[1]) + fabs(z[2]) < FASTEST);
        states[i] = state_of(length, sigma, points + 3 * i, z, loads + 3 * i, delta);
        if (undefined)
            states[i].dissipation = {-INFINITY, INFINITY};
    }
}

/* point (n, 3): the reference point (x, y) and what the spin counts beside it. What the gain of the interpolated motion may lack and its power
   exceed: (n, 2). */
void colloc_by_convexity(ptrdiff_t n, const double *length, const double *sigma, const double *points, const double *motions, const State *states,
                         const ptrdiff_t *at, const double *point, double delta, double *allowance)
{
    for (ptrdiff_t c = 0; c < n; ++c) {
        undefined = false;
        const Cell cell = cell_at(at + 8 * c, points, motions, states);
        state_upper(allowance_by_convexity(length, sigma, &cell, point + 3 * c, delta), allowance + 2 * c);
    }
}

/* loads (m, 6, 3) and the states (6, m) under these over the multiplier. */
void colloc_by_loads(ptrdiff_t n, ptrdiff_t m, const double *length, const double *sigma, const double *points, const double *motions,
                     const State *states, const ptrdiff_t *at, const State *under, const double *loads, const double *beside,
                     const double *change, double multiplier, double torque, double *allowance)
{
    for (ptrdiff_t c = 0; c < n; ++c) {
        undefined = false;
        const Cell cell = cell_at(at + 8 * c, points, motions, states);
        Cell loaded[LOADS];
        const double *load[8];
        for (int k = 0; k < LOADS; ++k)
            loaded[k] = cell_at(at + 8 * c, points, motions, under + k * m);
        for (int j = 0; j < 8; ++j)
            load[j] = loads + 3 * LOADS * at[8 * c + j];
        state_upper(allowance_by_loads(length, sigma, &cell, loaded, load, beside[c], change[c], multiplier, torque), allowance + 2 * c);
    }
}

/* Value (m, 3) at points of a harmonic k of a potential, and the amplitude (m, 3) of its gain: real and imaginary part, and how far off these
   may be. places (m, 2): the knot intervals that hold the points. */
void colloc_harmonic(ptrdiff_t m, int n, const double *knots, const double *coefficients, int k, const double *points, const ptrdiff_t *places,
                     const double *motions, double *value, double *amplitude)
{
    for (ptrdiff_t i = 0; i < m; ++i) {
        Interval c[2], a[2];
        const double *z = motions + 3 * i;
        undefined = false;
        find_value_and_rate(n, knots, coefficients, points + 3 * i, places + 2 * i, c, a);
        a[0] -= c[1] * (double)k * z[2], a[1] += c[0] * (double)k * z[2];
        if (k == 1)
            a[0] += z[0], a[1] += z[1];
        state_near(c, value + 3 * i), state_near(a, amplitude + 3 * i);
    }
}

}
