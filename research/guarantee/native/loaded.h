/* The balance under unit isotropic friction and an outside load, for one instant: research/guarantee/loaded_balance.py. */

#pragma once

#include "damped_newton.h"

#define LOADED_TOLERANCE 1e-10
#define STALLED 1e-7
#define SOFTEST 1e-2
#define RUNAWAY 1e6 /* speed beyond which a load is more than friction can hold: nothing balances it, and the search ends */
#define REGULAR 1e-13

static const double LOADED_SHRINK[] = {0.5, 0.5, 0.5, 0.1, 0.1, 0.1, 0.1, 0.1};

/* Net force with the load, and potential less the load's power. */
static inline Total evaluate_loaded(
    const int n, const Link *link, Sliding *k, int middle, const Vector3 z, const Vector3 load, const Law *law, double delta)
{
    Total total = evaluate(n, link, k, middle, z, law, delta);
    for (int i = 0; i < 3; ++i) {
        total.force[i] += load[i];
        total.merit -= load[i] * z[i];
    }
    return total;
}

/* Minimise from the state's velocity; what is left over there. */
static inline Total loaded_newton(const int n, State *s, const Vector3 load, double delta, int steps)
{
    double *z = s->velocity;
    Total at = evaluate_loaded(n, s->link, s->now, s->anchor, z, load, &s->law, delta);
    for (int count = 0; count < steps && largest_of(at.force) > LOADED_TOLERANCE; ++count) {
        Matrix3 left;
        Vector3 step, trial;
        double alpha = 1.0;
        pull_back(n, s->link, s->now, &s->law, delta, true, s->K, left);
        solve3(left, at.force, REGULAR, step);
        const double slope = at.force[0] * step[0] + at.force[1] * step[1] + at.force[2] * step[2];
        bool failed = true;
        Total next = at;
        for (size_t t = 0; failed && t <= sizeof LOADED_SHRINK / sizeof *LOADED_SHRINK; ++t) {
            alpha *= t == 0 ? 1.0 : LOADED_SHRINK[t - 1];
            for (int i = 0; i < 3; ++i)
                trial[i] = z[i] + alpha * step[i];
            next = evaluate_loaded(n, s->link, s->trial, s->anchor, trial, load, &s->law, delta);
            failed = !(next.merit <= at.merit - ARMIJO * alpha * slope + 1e-15);
        }
        if (failed)
            break;
        Sliding *kept = s->now;
        s->now = s->trial, s->trial = kept;
        memcpy(z, trial, sizeof trial);
        at = next;
        if (!(largest_of(z) < RUNAWAY))
            break;
    }
    return at;
}

static inline double left_over(const Total *at)
{
    return fmax(hypot(at->force[0], at->force[1]), fabs(at->force[2]));
}

/* The same, through falling delta where it stalls. */
static inline Total loaded_solve(const int n, State *s, const Vector3 load, double delta, int steps)
{
    Total at = loaded_newton(n, s, load, delta, steps);
    if (left_over(&at) <= STALLED)
        return at;
    const int count = (int)ceil(log10(SOFTEST / delta));
    for (int k = 0; k <= count; ++k)
        at = loaded_newton(n, s, load, k == count ? delta : SOFTEST * pow(delta / SOFTEST, (double)k / count), steps);
    return at;
}
