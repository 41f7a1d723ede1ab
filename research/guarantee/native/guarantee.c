/* Chains in balance under loads, instant by instant: choices, of which proofs.cpp says what they prove.
   Made with the headers of colloc/mechanics/native. Arrays and `first`, `last` are as in kernel.c there. */

#include <stdlib.h>

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "chain.h"
#include "loaded.h"

/* Chains under unit friction and loads (3, n_time) on the middle link, whose velocity is given to start from and found;
   velocities and loads in the middle link's axes. Then potential and power (n_time), minus the friction on each link in its own
   axes (n, 3, n_time), force and torque left over (2, n_time), and what power these have (n_time). */
int colloc_loaded(
    int n, const double *length, const double *mass, const double law_numbers[6], ptrdiff_t n_time,
    ptrdiff_t first, ptrdiff_t last, const double *angles, const double *rates, double delta, const double *load, const double *start, int steps, double *velocity, double *potential,
    double *power, double *forces, double *residual, double *leftover_power)
{
    Link *link = malloc((size_t)n * sizeof *link);
    const Law law = law_of(law_numbers);
    Sliding *sliding = new_slidings(n, 2, &law);
    Matrix3 *slopes = malloc((size_t)n * sizeof *slopes);
    const int middle = n / 2;
    if (link && sliding && slopes) {
        State s = {.law = law, .link = link, .now = sliding, .trial = sliding + n, .K = slopes, .anchor = middle};
        for (ptrdiff_t t = first; t < last; ++t) {
            Vector3 own = {load[t], load[n_time + t], load[2 * n_time + t]};
            find_directions(n, link, length, mass, angles + t, rates + t, 1.0, n_time);
            find_midpoints(n, link, middle);
            const double c = link[middle].cos, q = link[middle].sin;
            const Vector3 body_load = {c * own[0] - q * own[1], q * own[0] + c * own[1], own[2]};
            s.velocity[0] = c * start[t] - q * start[n_time + t];
            s.velocity[1] = q * start[t] + c * start[n_time + t];
            s.velocity[2] = start[2 * n_time + t];
            const Total at = loaded_solve(n, &s, body_load, delta, steps);
            velocity[t] = c * s.velocity[0] + q * s.velocity[1];
            velocity[n_time + t] = c * s.velocity[1] - q * s.velocity[0];
            velocity[2 * n_time + t] = s.velocity[2];
            potential[t] = at.merit;
            power[t] = leftover_power[t] = 0.0;
            for (int i = 0; i < 3; ++i) {
                potential[t] += body_load[i] * s.velocity[i];
                leftover_power[t] += at.force[i] * s.velocity[i];
            }
            for (int i = 0; i < n; ++i) {
                const Sliding *k = &s.now[i];
                power[t] -= k->fs * k->vs + k->fn * k->vn + k->couple * k->w;
                forces[(3 * i) * n_time + t] = -k->fs;
                forces[(3 * i + 1) * n_time + t] = -k->fn;
                forces[(3 * i + 2) * n_time + t] = -k->couple;
            }
            residual[t] = hypot(at.force[0], at.force[1]);
            residual[n_time + t] = fabs(at.force[2]);
        }
    }
    free(link);
    free(sliding);
    free(slopes);
    return link && sliding && slopes ? 0 : 1;
}
