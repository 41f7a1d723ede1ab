/* Small dense quadratic programs by the dual method of Goldfarb and Idnani (Math. Program. 27, 1983): from the minimum without
   constraints, one violated constraint after the other becomes active. */

#pragma once

#include <math.h>
#include <stdbool.h>
#include <string.h>

#define PRIMAL_TOLERANCE 1e-10 /* what may be left of a limit, in units of its row */
#define DEPENDENT 1e-16 /* square of the part of a normal that is independent of the active ones, over its own */
#define UNMET 1e3 /* price of half the squared share of the violations that stays */

/* ``d.B d / 2 + g.d`` with ``low <= d <= high``, ``row_low <= A d <= row_high``; B (n, n) positive definite, A (m, n). */
typedef struct {
    int n, m;
    const double *B, *g, *A, *row_low, *row_high, *low, *high;
} Quadratic;

/* J with J J' = B^-1, whose first columns are turned to the normals of the active constraints, R their triangle. A constraint is the
   number of a row, or m and that of a variable; sign: -1 at an upper limit. */
typedef struct {
    int count, *constraint, *sign;
    double *J, *R, *multiplier, *normal, *along, *r;
} ActiveSet;

static size_t active_set_size(int n)
{
    return 2 * (size_t)(n * n) + 6 * (size_t)n + 6;
}

static void new_active_set(ActiveSet *a, int n, double *memory)
{
    a->count = 0;
    a->J = memory, a->R = a->J + n * n, a->multiplier = a->R + n * n, a->normal = a->multiplier + n + 1, a->along = a->normal + n;
    a->r = a->along + n, a->constraint = (int *)(a->r + n), a->sign = a->constraint + n + 1;
}

static double dot(int n, const double *a, const double *b)
{
    double sum = 0.0;
    for (int i = 0; i < n; ++i)
        sum += a[i] * b[i];
    return sum;
}

/* L with L L' = B in the lower triangle of L; false unless B is positive definite. */
static bool cholesky(int n, const double *B, double *L)
{
    for (int i = 0; i < n; ++i)
        for (int j = 0; j <= i; ++j) {
            const double left = B[i * n + j] - dot(j, L + i * n, L + j * n);
            if (i == j && !(left > 0.0))
                return false;
            L[i * n + j] = i == j ? sqrt(left) : left / L[j * n + j];
        }
    return true;
}

/* J = L^-T, upper triangular; R has L. */
static void invert_transposed(int n, const double *L, double *J)
{
    memset(J, 0, (size_t)(n * n) * sizeof *J);
    for (int k = 0; k < n; ++k) {
        J[k * n + k] = 1.0 / L[k * n + k];
        for (int i = k + 1; i < n; ++i) {
            double sum = 0.0;
            for (int j = k; j < i; ++j)
                sum += L[i * n + j] * J[k * n + j];
            J[k * n + i] = -sum / L[i * n + i];
        }
    }
}

/* Turn a pair by the rotation that takes (c, s) to (1, 0). */
static inline void turn_pair(double *first, double *second, double c, double s)
{
    const double a = *first, b = *second;
    *first = c * a + s * b, *second = c * b - s * a;
}

/* Put the normal with components `along` = J' normal last among the active ones. */
static void activate(int n, ActiveSet *a, int constraint, int sign, double multiplier)
{
    const int q = a->count++;
    for (int j = n - 2; j >= q; --j) {
        const double h = hypot(a->along[j], a->along[j + 1]);
        if (a->along[j + 1] == 0.0)
            continue;
        const double c = a->along[j] / h, s = a->along[j + 1] / h;
        a->along[j] = h, a->along[j + 1] = 0.0;
        for (int k = 0; k < n; ++k)
            turn_pair(&a->J[k * n + j], &a->J[k * n + j + 1], c, s);
    }
    for (int i = 0; i <= q; ++i)
        a->R[i * n + q] = a->along[i];
    a->constraint[q] = constraint, a->sign[q] = sign, a->multiplier[q] = multiplier;
}

static void deactivate(int n, ActiveSet *a, int which)
{
    const int q = --a->count;
    for (int j = which; j < q; ++j) {
        a->constraint[j] = a->constraint[j + 1], a->sign[j] = a->sign[j + 1], a->multiplier[j] = a->multiplier[j + 1];
        for (int i = 0; i <= j + 1; ++i)
            a->R[i * n + j] = a->R[i * n + j + 1];
    }
    for (int j = which; j < q; ++j) {
        const double h = hypot(a->R[j * n + j], a->R[(j + 1) * n + j]);
        if (h == 0.0)
            continue;
        const double c = a->R[j * n + j] / h, s = a->R[(j + 1) * n + j] / h;
        for (int k = j; k < q; ++k)
            turn_pair(&a->R[j * n + k], &a->R[(j + 1) * n + k], c, s);
        for (int k = 0; k < n; ++k)
            turn_pair(&a->J[k * n + j], &a->J[k * n + j + 1], c, s);
    }
}

static inline double limited_value(const Quadratic *p, int c, const double *d)
{
    return c < p->m ? dot(p->n, p->A + c * p->n, d) : d[c - p->m];
}

static inline double limit(const Quadratic *p, int c, int sign)
{
    return c < p->m ? (sign < 0 ? p->row_high : p->row_low)[c] : (sign < 0 ? p->high : p->low)[c - p->m];
}

static bool all_finite(int n, const double *a)
{
    double sum = 0.0;
    for (int i = 0; i < n; ++i)
        sum += a[i] - a[i];
    return sum == 0.0;
}

/* The constraint that d violates most, and its side; -1: none. */
static int most_violated(const Quadratic *p, const double *d, double tolerance, int *sign)
{
    int worst = -1;
    for (int c = 0; c < p->m + p->n; ++c) {
        const double value = limited_value(p, c, d);
        const double below = limit(p, c, 1) - value, above = value - limit(p, c, -1);
        if (fmax(below, above) > tolerance)
            worst = c, *sign = above > below ? -1 : 1, tolerance = fmax(below, above);
    }
    return worst;
}

/* The minimum d (n) and multipliers of the rows (m), positive at upper limits; false: the rows contradict each other, or rounding
   does not let them be met. */
static bool quadratic_minimum(const Quadratic *p, ActiveSet *a, double *d, double *on_rows)
{
    const int n = p->n, m = p->m;
    int sign = 1;
    a->count = 0;
    if (!cholesky(n, p->B, a->R))
        return false;
    invert_transposed(n, a->R, a->J);
    for (int i = 0; i < n; ++i) {
        a->along[i] = 0.0;
        for (int k = 0; k <= i; ++k)
            a->along[i] -= a->J[k * n + i] * p->g[k];
    }
    for (int k = 0; k < n; ++k)
        d[k] = dot(n - k, a->J + k * n + k, a->along + k);
    for (int steps = 0, worst; (worst = most_violated(p, d, PRIMAL_TOLERANCE, &sign)) >= 0;) {
        double multiplier = 0.0;
        for (int k = 0; k < n; ++k)
            a->normal[k] = worst < m ? sign * p->A[worst * n + k] : sign * (k == worst - m);
        for (bool active = false; !active;) {
            if (++steps > 50 * (n + 10))
                return false;
            const int q = a->count;
            memset(a->along, 0, (size_t)n * sizeof *a->along);
            for (int k = 0; k < n; ++k)
                for (int i = 0; i < n && a->normal[k] != 0.0; ++i)
                    a->along[i] += a->J[k * n + i] * a->normal[k];
            double whole = dot(n, a->along, a->along), independent = dot(n - q, a->along + q, a->along + q), full = INFINITY, part = INFINITY;
            int blocking = -1;
            for (int i = q - 1; i >= 0; --i) {
                a->r[i] = a->along[i];
                for (int j = i + 1; j < q; ++j)
                    a->r[i] -= a->R[i * n + j] * a->r[j];
                a->r[i] /= a->R[i * n + i];
                const int c = a->constraint[i];
                if (a->r[i] > 0.0 && limit(p, c, 1) < limit(p, c, -1) && a->multiplier[i] < part * a->r[i])
                    part = a->multiplier[i] / a->r[i], blocking = i;
            }
            if (q < n && independent > DEPENDENT * whole)
                full = fmax(sign * (limit(p, worst, sign) - limited_value(p, worst, d)), 0.0) / independent;
            const double t = fmin(part, full);
            if (!isfinite(t))
                return false;
            for (int k = 0; k < n && isfinite(full); ++k)
                d[k] += t * dot(n - q, a->J + k * n + q, a->along + q);
            for (int i = 0; i < q; ++i)
                a->multiplier[i] -= t * a->r[i];
            multiplier += t;
            active = full <= part;
            if (active)
                activate(n, a, worst, sign, multiplier);
            else
                deactivate(n, a, blocking);
        }
    }
    memset(on_rows, 0, (size_t)m * sizeof *on_rows);
    for (int i = 0; i < a->count; ++i)
        if (a->constraint[i] < m)
            on_rows[a->constraint[i]] -= a->sign[i] * a->multiplier[i];
    return all_finite(n, d);
}
