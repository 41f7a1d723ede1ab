/* Tail velocities that balance a chain, instant by instant: what colloc/fixed_point.py does for batches in NumPy.

   Arrays are (rows, n_time), row by row; a call treats the instants from `first` to `last`, so that threads share a batch.
   An instant's answer depends on nothing but its own data. */

#include <stdlib.h>

#include "damped_newton.h"

static inline void balance_instants(
    const int n, State *s, const double *length, ptrdiff_t n_time, ptrdiff_t first, ptrdiff_t last, const double *angles,
    const double *rates, double delta, const double *start, double tolerance, long long budget, int method, double *z,
    double *residual, long long *iterations, long long *anchor, double *anchor_velocity)
{
    for (ptrdiff_t t = first; t < last; ++t) {
        /* in units of the largest rate: the law is homogeneous once delta scales along */
        double speed = 0.0, tail[3];
        for (int j = 0; j < n - 1; ++j)
            speed = fmax(speed, fabs(rates[j * n_time + t]));
        if (speed == 0)
            speed = 1.0;
        const double scaled_delta = fmin(fmax(delta / speed, DRY), VISCOUS);
        find_directions(n, s->link, length, angles + t, rates + t, speed, n_time);
        s->anchor = n / 2;
        s->iterations = 0;
        if (start) {
            for (int i = 0; i < 3; ++i)
                tail[i] = start[i * n_time + t] / speed;
            find_velocities_from_tail(n, s->link, s->now, tail);
            link_velocity(&s->link[s->anchor], &s->now[s->anchor], s->velocity);
        } else
            memset(s->velocity, 0, sizeof s->velocity);
        solve(n, s, scaled_delta, tolerance, budget, method);
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

/* Returns 0, or 1 without memory. */
int colloc_balance(
    int n, const double *length, const double mu[3], ptrdiff_t n_time, ptrdiff_t first, ptrdiff_t last, const double *angles,
    const double *rates, double delta, const double *start, double tolerance, long long budget, int method, double *z,
    double *residual, long long *iterations, long long *anchor, double *anchor_velocity)
{
    Link *link = malloc((size_t)n * sizeof *link);
    Sliding *sliding = malloc(2 * (size_t)n * sizeof *sliding);
    if (link && sliding) {
        State s = {.law = law_of(mu), .link = link, .now = sliding, .trial = sliding + n};
#define FOR(count)                                                                                                        \
    balance_instants(                                                                                                     \
        count, &s, length, n_time, first, last, angles, rates, delta, start, tolerance, budget, method, z, residual,      \
        iterations, anchor, anchor_velocity)
        FOR(n);
    }
    free(link);
    free(sliding);
    return link && sliding ? 0 : 1;
}
