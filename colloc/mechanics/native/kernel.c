/* What the library offers: chains in balance, instant by instant, as colloc/mechanics/fixed_point.py and colloc/mechanics/chain_motion.py
   find them for batches in NumPy.

   Arrays are (rows, n_time), row by row; a call treats the instants from `first` to `last`, so that threads share a batch.
   An instant's answer depends on nothing but its own data. */

#include <stdlib.h>

#include "repeating.h"

#ifdef COLLOC_SOURCES
#define TEXT_OF(name) #name
#define TEXT(name) TEXT_OF(name)
/* What these sources were when they were built: whoever has changed them since does not use the library. */
const char colloc_sources[] = TEXT(COLLOC_SOURCES);
#endif

/* Or `least`, if it is larger: under a load the body creeps at the speed delta, though its joints rest. */
static inline double largest_rate_of(const int n, const double *rate, ptrdiff_t stride, double least)
{
    double speed = least;
    for (int j = 0; j < n - 1; ++j)
        speed = fmax(speed, fabs(rate[j * stride]));
    return speed > 0 ? speed : 1.0;
}

static inline double scaled_delta_of(double delta, double speed)
{
    return fmin(fmax(delta / speed, DRY), VISCOUS);
}

static inline void balance_instants(
    const int n, State *s, const double *length, const double *pressure, const double *mass, ptrdiff_t n_time, ptrdiff_t first,
    ptrdiff_t last, const double *angles, const double *rates, double delta, const double *load, const double *start, double tolerance, long long budget, int method, double *z,
    double *residual, long long *iterations, long long *anchor, double *anchor_velocity)
{
    for (ptrdiff_t t = first; t < last; ++t) {
        const double speed = largest_rate_of(n, rates + t, n_time, load ? delta : 0.0);
        Vector3 tail;
        find_directions(n, s->link, length, pressure, mass, angles + t, rates + t, speed, n_time);
        if (load)
            find_loads(n, s->link, load + t, n_time);
        s->anchor = n / 2;
        s->iterations = 0;
        if (start) {
            for (int i = 0; i < 3; ++i)
                tail[i] = start[i * n_time + t] / speed;
            find_velocities_from_tail(n, s->link, s->now, tail);
            link_velocity(&s->link[s->anchor], &s->now[s->anchor], s->velocity);
        } else
            memset(s->velocity, 0, sizeof s->velocity);
        solve(n, s, scaled_delta_of(delta, speed), tolerance, budget, method);
        find_velocities(n, s->link, s->now, s->anchor, s->velocity);
        tail_velocity(s->link, s->now, tail);
        for (int i = 0; i < 3; ++i) {
            z[i * n_time + t] = tail[i] * speed;
            anchor_velocity[i * n_time + t] = s->velocity[i] * speed;
        }
        residual[t] = s->residual;
        iterations[t] = s->iterations;
        anchor[t] = s->anchor;
    }
}

/* `load` (2, n_time), in the body's axes, or NULL. Returns 0, or 1 without memory. */
int colloc_balance(
    int n, const double *length, const double *pressure, const double *mass, const double *law_numbers, ptrdiff_t n_time,
    ptrdiff_t first, ptrdiff_t last, const double *angles, const double *rates, double delta, const double *load, const double *start, double tolerance, long long budget,
    int method, double *z, double *residual, long long *iterations, long long *anchor, double *anchor_velocity)
{
    Link *link = malloc((size_t)n * sizeof *link);
    const Law law = law_of(law_numbers);
    Sliding *sliding = new_slidings(n, 2, &law);
    if (link && sliding) {
        State s = {.law = law, .link = link, .now = sliding, .trial = sliding + n};
        balance_instants(
            n, &s, length, pressure, mass, n_time, first, last, angles, rates, delta, load, start, tolerance, budget, method, z,
            residual, iterations, anchor, anchor_velocity);
    }
    free(link);
    free(sliding);
    return link && sliding ? 0 : 1;
}

/* 0 if there was memory for all of these, which is given back; else 1. */
static int freed(Link *link, Sliding *k, Matrix3 *K, Change *d)
{
    const bool all = link && k && K && d;
    free(link);
    free(k);
    free(K);
    free(d);
    return all ? 0 : 1;
}

/* Rows of `find_values`, (ROWS, n_time), for chains whose anchors move as given; and, unless `slopes` is NULL, the
   derivatives of the first of them with respect to joint angles and rates, and to the load if there is one,
   (DIFFERENTIATED_ROWS, 2 (n - 1) (+ 2), n_time). */
int colloc_motion(
    int n, const double *length, const double *pressure, const double *mass, const double *law_numbers, ptrdiff_t n_time,
    ptrdiff_t first, ptrdiff_t last, const double *angles, const double *rates, double delta, const double *load, const long long *anchor, const double *anchor_velocity,
    double *values, double *slopes)
{
    const Law law = law_of(law_numbers);
    const int n_joint = n - 1, columns = 2 * n_joint + (load ? 2 : 0);
    Link *link = malloc((size_t)n * sizeof *link);
    Sliding *k = new_slidings(n, 1, &law);
    Matrix3 *K = malloc((size_t)n * sizeof *K);
    Change *d = malloc((size_t)n * sizeof *d);
    for (ptrdiff_t t = first; t < last && link && k && K && d; ++t) {
        const double speed = largest_rate_of(n, rates + t, n_time, load ? delta : 0.0), own_delta = scaled_delta_of(delta, speed);
        const int a = (int)anchor[t];
        double value[ROWS], change[DIFFERENTIATED_ROWS];
        Vector3 z, net, dz;
        for (int i = 0; i < 3; ++i)
            z[i] = anchor_velocity[i * n_time + t] / speed;
        find_directions(n, link, length, pressure, mass, angles + t, rates + t, speed, n_time);
        if (load)
            find_loads(n, link, load + t, n_time);
        find_midpoints(n, link, a);
        evaluate(n, link, k, a, z, &law, own_delta);
        find_values(n, link, k, value);
        for (int row = 0; row < ROWS; ++row)
            values[row * n_time + t] = value[row] * speed;
        if (!slopes)
            continue;
        Matrix3 left;
        pull_back(n, link, k, &law, own_delta, true, left);
        for (int i = 0; i < n; ++i)
            find_slopes(&k[i], &law, &link[i], own_delta, K[i]);
        for (int column = 0; column < columns; ++column) {
            const bool of_load = column >= 2 * n_joint, of_rate = column >= n_joint && !of_load;
            if (of_load)
                load_change(n, link, column - 2 * n_joint, d, net);
            else {
                find_changes(n, link, k, a, of_rate ? column - n_joint : column, of_rate, d);
                net_change(n, link, k, K, d, net);
            }
            solve3(left, net, 0.0, dz);
            follow(n, link, d, dz);
            value_changes(n, link, k, K, d, change);
            for (int row = 0; row < DIFFERENTIATED_ROWS; ++row)
                slopes[(row * columns + column) * n_time + t] = of_rate ? change[row] : change[row] * speed;
        }
    }
    return freed(link, k, K, d);
}

/* Of chains with momenta `states` (3, n_time) and moments of inertia `spin` of the links: rows (MOMENTA_ROWS, n_time), and their
   derivatives (MOMENTA_ROWS, columns, n_time) with respect to the states alone, 3 columns, or to joint angles, rates and states,
   2 (n - 1) + 3. */
int colloc_momenta(
    int n, const double *length, const double *pressure, const double *mass, const double *law_numbers, ptrdiff_t n_time,
    ptrdiff_t first, ptrdiff_t last, const double *angles, const double *rates, double delta, const double *spin, double froude,
    const double *states, int columns, double *values, double *slopes)
{
    Played played = {n, length, pressure, mass, spin, law_of(law_numbers), n_time, angles, rates, delta, froude};
    const bool ready = new_room(&played);
    if (ready)
        momenta_instants(&played, first, last, states, columns, values, slopes);
    free_room(&played);
    return ready ? 0 : 1;
}

/* Momenta that repeat (repeating.h), on `intervals` of s stages each, in order of the stages: from `states` (3, n_time) and
   their start (3), which become those that are found, with their rows (MOMENTA_ROWS, n_time). `held` says whether there are
   any. */
int colloc_repeating(
    int n, const double *length, const double *pressure, const double *mass, const double *law_numbers, ptrdiff_t n_time,
    ptrdiff_t first, ptrdiff_t last, const double *angles, const double *rates, double delta, const double *spin, double froude,
    ptrdiff_t intervals, int s, const double *A, const double *b, const double *image, double *states, double *start,
    double *values, int *held)
{
    Played played = {n, length, pressure, mass, spin, law_of(law_numbers), n_time, angles, rates, delta, froude};
    Periods q = {.played = &played, .intervals = intervals, .s = s, .A = A, .b = b, .image = image};
    const bool ready = new_room(&played) && new_periods(&q);
    (void)first, (void)last;
    if (ready)
        *held = find_repeating(&q, states, start, values);
    free_periods(&q);
    free_room(&played);
    return ready ? 0 : 1;
}
