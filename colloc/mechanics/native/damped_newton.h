/* Damped Newton with a fixed-point safeguard for one instant: the same steps, attempts and constants as
   colloc/mechanics/damped_newton.py, where they are explained. */

#pragma once

#include <float.h>
#include <string.h>

#include "chain.h"

enum { AUTO, NEWTON, FIXED_POINT, DIRECT, NATURAL };

#define ARMIJO 1e-4
#define NATURAL_GAIN 0.25
#define ROUNDING 8e-16
#define FIXED_POINT_STEPS_AFTER_FAILURE 5
#define DIRECT_ITERATIONS 40
#define LADDER_ITERATIONS 240
#define DRY 1e-100
#define VISCOUS 1e8

static const double BACKTRACKING[] = {0.5, 0.5, 0.5, 0.5, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1};
static const double SHORT_BACKTRACKING[] = {0.5, 0.25};

/* An instant under way: its links, their sliding at the present point and at the trial one, and where it stands. */
typedef struct {
    Law law;
    Link *link;
    Sliding *now, *trial;
    Matrix3 *K;
    int anchor;
    Vector3 velocity;
    double residual;
    long long iterations;
} State;

/* Largest magnitude; infinite if any of them is not a number. */
static inline double largest_of(const Vector3 v)
{
    const double largest = fmax(fabs(v[0]), fmax(fabs(v[1]), fabs(v[2])));
    return isfinite(v[0] + v[1] + v[2]) ? largest : INFINITY;
}

/* x with A x = b after symmetric scaling to a unit diagonal, to which `shift` is added; zero where that is singular. */
static inline void solve3(Matrix3 A, const Vector3 b, double shift, Vector3 x)
{
    Vector3 d;
    double m[3][4];
    for (int i = 0; i < 3; ++i)
        d[i] = sqrt(fmin(fmax(fabs(A[i][i]), DBL_MIN), DBL_MAX));
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j)
            m[i][j] = A[i][j] / (d[i] * d[j]) + (i == j ? shift : 0.0);
        m[i][3] = b[i] / d[i];
    }
    x[0] = x[1] = x[2] = 0.0;
    double determinant = 1.0;
    for (int p = 0; p < 3; ++p) {
        int best = p;
        for (int i = p + 1; i < 3; ++i)
            if (fabs(m[i][p]) > fabs(m[best][p]))
                best = i;
        for (int j = p; j < 4 && best != p; ++j) {
            const double kept = m[p][j];
            m[p][j] = m[best][j], m[best][j] = kept;
        }
        determinant *= m[p][p];
        if (!(fabs(determinant) > DBL_MIN))
            return;
        for (int i = p + 1; i < 3; ++i) {
            const double factor = m[i][p] / m[p][p];
            for (int j = p + 1; j < 4; ++j)
                m[i][j] -= factor * m[p][j];
        }
    }
    const double x2 = m[2][3] / m[2][2];
    const double x1 = (m[1][3] - m[1][2] * x2) / m[1][1];
    const double x0 = (m[0][3] - m[0][1] * x1 - m[0][2] * x2) / m[0][0];
    if (isfinite(x0 + x1 + x2))
        x[0] = x0 / d[0], x[1] = x1 / d[1], x[2] = x2 / d[2];
}

/* By how much the next step would be shorter with the same matrix, once a part alpha of a step is taken; > 0 is progress. */
static inline double natural_gain(Matrix3 left, const Vector3 force, const Vector3 step, double alpha)
{
    Vector3 next;
    solve3(left, force, 0.0, next);
    return (1.0 - NATURAL_GAIN * alpha) * largest_of(step) - largest_of(next);
}

/* Up to `most` steps with the present anchor. */
static inline void iterate(const int n, State *s, double delta, double tolerance, long long most, int method)
{
    const Law *law = &s->law;
    const bool far = law->associated || method == NATURAL;
    const double *shrink = far ? BACKTRACKING : SHORT_BACKTRACKING;
    const size_t tries = far ? sizeof BACKTRACKING / sizeof *shrink : sizeof SHORT_BACKTRACKING / sizeof *shrink;
    const double unit = law->largest / hypot(1.0, delta);
    long long iterations = 0, fixed_point_due = method == FIXED_POINT ? -1 : 0;
    double *z = s->velocity;
    find_midpoints(n, s->link, s->anchor);
    Total at = evaluate(n, s->link, s->now, s->anchor, z, law, delta);
    for (;;) {
        s->residual = largest_of(at.force) / unit;
        if (!(s->residual > tolerance) || iterations >= most)
            break;
        const bool newton = fixed_point_due == 0;
        Matrix3 left;
        Vector3 step, trial;
        double alpha = 1.0;
        pull_back(n, s->link, s->now, law, delta, newton, s->K, left);
        solve3(left, at.force, 0.0, step);
        double slope = -2.0 * at.merit, slack = 0.0;
        if (law->associated) {
            slope = -(at.force[0] * step[0] + at.force[1] * step[1] + at.force[2] * step[2]);
            slack = ROUNDING * at.merit;
        }
        Total next;
        bool failed = true;
        for (size_t t = 0; failed && t <= tries; ++t) {
            alpha *= t > 0 ? shrink[t - 1] : 1.0;
            for (int i = 0; i < 3; ++i)
                trial[i] = z[i] + alpha * step[i];
            next = evaluate(n, s->link, s->trial, s->anchor, trial, law, delta);
            if (!newton)
                failed = false;
            else if (method == NATURAL)
                failed = !(natural_gain(left, next.force, step, alpha) >= 0);
            else
                failed = !(next.merit <= at.merit + ARMIJO * alpha * slope + slack);
        }
        iterations += 1;
        if (!newton && fixed_point_due > 0)
            fixed_point_due -= 1;
        if (failed) {
            fixed_point_due = FIXED_POINT_STEPS_AFTER_FAILURE;
            if (method == NEWTON)
                iterations = most;
        } else {
            Sliding *kept = s->now;
            s->now = s->trial, s->trial = kept;
            memcpy(z, trial, sizeof trial);
            at = next;
        }
    }
    s->iterations += iterations;
}

/* How fast the slowest part of the link moves at most, up to a factor: the anchor is where that is least. */
static inline double slowest_speed(const Sliding *k, const Law *law, const Link *link)
{
    double least = INFINITY;
    for (int i = first_part(law, link->number); i < last_part(law, link->number); ++i) {
        const PartSliding *own = &k->part[i];
        least = fmin(least, fabs(own->vs) + fabs(own->vn) + 0.5 * law->part[i].length * fabs(own->w));
    }
    return least;
}

/* Move the anchor to the slowest link; whether that is another one. */
static inline bool moved_anchor(const int n, State *s)
{
    int slowest = 0;
    double least = INFINITY;
    for (int i = 0; i < n; ++i) {
        const double speed = slowest_speed(&s->now[i], &s->law, &s->link[i]);
        if (speed < least)
            least = speed, slowest = i;
    }
    if (slowest == s->anchor)
        return false;
    s->anchor = slowest;
    link_velocity(&s->link[slowest], &s->now[slowest], s->velocity);
    return true;
}

/* Iterate, with the slowest link as the anchor as long as that still helps. */
static inline void advance(const int n, State *s, double delta, double tolerance, long long most, int method)
{
    for (int k = 0; k < n; ++k) {
        iterate(n, s, delta, tolerance, most, method);
        if (!(s->residual > tolerance) || !moved_anchor(n, s))
            return;
    }
}

/* Up to four attempts: from where the state is (DIRECT and NATURAL end there), from rest, down a ladder of delta, by fixed-point steps
   only. */
static inline void solve(const int n, State *s, double delta, double tolerance, long long budget, int method)
{
    const int first_anchor = s->anchor;
    const bool at_rest = s->velocity[0] == 0 && s->velocity[1] == 0 && s->velocity[2] == 0;
    const bool briefly = (method == AUTO || method == DIRECT || method == NATURAL) && budget > DIRECT_ITERATIONS;
    const long long direct = briefly ? DIRECT_ITERATIONS : budget;
    const long long each = budget > LADDER_ITERATIONS ? LADDER_ITERATIONS : budget;
    advance(n, s, delta, tolerance, direct, method);
    if (method != AUTO || s->residual <= tolerance)
        return;
    if (!at_rest) {
        memset(s->velocity, 0, sizeof s->velocity);
        s->anchor = first_anchor;
        advance(n, s, delta, tolerance, direct, method);
        if (s->residual <= tolerance)
            return;
    }
    memset(s->velocity, 0, sizeof s->velocity);
    const double steps = fmax(1.0, ceil(-log10(delta) / 0.5));
    for (int k = 0; k <= steps; ++k)
        advance(n, s, fmax(delta, k == steps ? delta : pow(delta, k / steps)), tolerance, each, method);
    if (!(s->residual <= tolerance))
        advance(n, s, delta, tolerance, budget, FIXED_POINT);
}
