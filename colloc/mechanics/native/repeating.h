/* Momenta that repeat every period: `CollocatedStates.solve` of colloc/dynamics/states.py, step by step, with the rates of
   momenta.h. On an interval the stages are `own + response begin`, and its end is `through begin + gain own`. */

#pragma once

#include "momenta.h"

enum { MOMENTA = 3, NEWTON_STEPS = 200 };
static const double CLOSED = 1e-12, ROUNDED = 1e-11, LEAST_SHARE = 1.0 / 16;

typedef struct {
    Played *played;
    const double *spin;
    double froude;
    ptrdiff_t intervals;
    int s;
    const double *A, *b; /* (intervals, s, s), (intervals, s), times the lengths of the intervals */
    const double *image; /* (3, 3): where a period sends its start */
    double *values, *slopes; /* what momenta_instants gives */
    /* of all intervals, with m = 3 s in order of stage, state: (m, m), (m, 3), (3, m), (3, 3), (m) */
    double *matrix, *response, *gain, *through, *own;
    int *pivot;
    double *edge; /* (intervals + 1, 3) */
    double *x, *residual, *step, *next, *trial; /* (3, n_time), and then of the start, (3) */
} Periods;

static inline bool new_periods(Periods *q)
{
    const size_t n = (size_t)q->intervals, m = (size_t)(MOMENTA * q->s), all = MOMENTA * ((size_t)q->played->n_time + 1);
    q->values = malloc((size_t)MOMENTA_ROWS * n * (size_t)q->s * (1 + MOMENTA) * sizeof(double));
    q->matrix = malloc((n * (m * m + 2 * m * MOMENTA + MOMENTA * MOMENTA + m + MOMENTA) + MOMENTA) * sizeof(double));
    q->residual = malloc(5 * all * sizeof(double));
    q->pivot = malloc(n * m * sizeof(int));
    if (!(q->values && q->matrix && q->residual && q->pivot))
        return false;
    q->slopes = q->values + (size_t)MOMENTA_ROWS * n * (size_t)q->s;
    q->response = q->matrix + n * m * m;
    q->gain = q->response + n * m * MOMENTA;
    q->through = q->gain + n * m * MOMENTA;
    q->own = q->through + n * MOMENTA * MOMENTA;
    q->edge = q->own + n * m;
    q->step = q->residual + all, q->next = q->step + all, q->trial = q->next + all, q->x = q->trial + all;
    return true;
}

static inline void free_periods(Periods *q)
{
    free(q->values);
    free(q->matrix);
    free(q->residual);
    free(q->pivot);
}

/* Row `state` of x, (3, n_time), at the stages of an interval; x[3 n_time + state] is the start. */
static inline ptrdiff_t at_stage(const Periods *q, int state, ptrdiff_t interval, int stage)
{
    return state * q->played->n_time + interval * q->s + stage;
}

/* LU with the largest pivot of each column, in place; false where it has none. */
static inline bool factorised(int m, double *a, int *pivot)
{
    for (int j = 0; j < m; ++j) {
        int best = j;
        for (int i = j + 1; i < m; ++i)
            if (fabs(a[i * m + j]) > fabs(a[best * m + j]))
                best = i;
        pivot[j] = best;
        if (!(fabs(a[best * m + j]) > 0.0))
            return false;
        for (int k = 0; k < m && best != j; ++k) {
            const double held = a[j * m + k];
            a[j * m + k] = a[best * m + k], a[best * m + k] = held;
        }
        for (int i = j + 1; i < m; ++i) {
            const double share = a[i * m + j] /= a[j * m + j];
            for (int k = j + 1; k < m; ++k)
                a[i * m + k] -= share * a[j * m + k];
        }
    }
    return true;
}

/* Of a factorised matrix, x for the right side x, whose numbers are `stride` apart. */
static inline void back_substitute(int m, const double *a, const int *pivot, double *x, int stride)
{
    for (int j = 0; j < m; ++j) {
        const double held = x[pivot[j] * stride];
        x[pivot[j] * stride] = x[j * stride], x[j * stride] = held;
    }
    for (int i = 1; i < m; ++i)
        for (int j = 0; j < i; ++j)
            x[i * stride] -= a[i * m + j] * x[j * stride];
    for (int i = m - 1; i >= 0; --i) {
        for (int j = i + 1; j < m; ++j)
            x[i * stride] -= a[i * m + j] * x[j * stride];
        x[i * stride] /= a[i * m + i];
    }
}

/* d rate a / d state b at a stage. */
static inline double slope_at(const Periods *q, int a, int b, ptrdiff_t point)
{
    return q->slopes[((RATES_ROW + a) * MOMENTA + b) * q->played->n_time + point];
}

/* What x is off by, and the largest of it; infinity where rates are not known. */
static inline double find_residual(Periods *q, const double *x)
{
    const ptrdiff_t n_time = q->played->n_time;
    const double *start = x + MOMENTA * n_time;
    double off = 0.0;
    momenta_instants(q->played, 0, n_time, q->spin, q->froude, x, MOMENTA, q->values, q->slopes);
    for (int state = 0; state < MOMENTA; ++state) {
        double gained = 0.0;
        for (ptrdiff_t i = 0; i < q->intervals; ++i) {
            const double *rate = q->values + (RATES_ROW + state) * n_time + i * q->s;
            double more = 0.0;
            for (int stage = 0; stage < q->s; ++stage) {
                const double *A = q->A + (i * q->s + stage) * q->s;
                double within = 0.0;
                for (int j = 0; j < q->s; ++j)
                    within += A[j] * rate[j];
                const ptrdiff_t at = at_stage(q, state, i, stage);
                q->residual[at] = x[at] - start[state] - gained - within;
                off = fmax(off, fabs(q->residual[at]));
                more += q->b[i * q->s + stage] * rate[stage];
            }
            gained += more;
        }
        double *end = q->residual + MOMENTA * n_time + state;
        *end = gained + start[state];
        for (int other = 0; other < MOMENTA; ++other)
            *end -= q->image[state * MOMENTA + other] * start[other];
        off = fmax(off, fabs(*end));
    }
    for (ptrdiff_t k = 0; k < MOMENTA_ROWS * n_time; ++k)
        if (!isfinite(q->values[k]))
            return INFINITY;
    return off;
}

/* The derivatives of the residual, ready for steps: of what rates are derived from at the states that it was found for. */
static inline bool find_derivatives(Periods *q)
{
    const int s = q->s, m = MOMENTA * s;
    for (ptrdiff_t i = 0; i < q->intervals; ++i) {
        double *matrix = q->matrix + i * m * m, *response = q->response + i * m * MOMENTA;
        double *gain = q->gain + i * m * MOMENTA, *through = q->through + i * MOMENTA * MOMENTA;
        for (int row = 0; row < m; ++row)
            for (int column = 0; column < m; ++column) {
                const double weight = q->A[(i * s + row / MOMENTA) * s + column / MOMENTA];
                matrix[row * m + column] = (row == column) - weight * slope_at(q, row % MOMENTA, column % MOMENTA, i * s + column / MOMENTA);
            }
        if (!factorised(m, matrix, q->pivot + i * m))
            return false;
        for (int k = 0; k < m * MOMENTA; ++k)
            response[k] = k / MOMENTA % MOMENTA == k % MOMENTA;
        for (int column = 0; column < MOMENTA; ++column)
            back_substitute(m, matrix, q->pivot + i * m, response + column, MOMENTA);
        for (int a = 0; a < MOMENTA; ++a)
            for (int k = 0; k < m; ++k)
                gain[a * m + k] = q->b[i * s + k / MOMENTA] * slope_at(q, a, k % MOMENTA, i * s + k / MOMENTA);
        for (int a = 0; a < MOMENTA; ++a)
            for (int column = 0; column < MOMENTA; ++column) {
                through[a * MOMENTA + column] = a == column;
                for (int k = 0; k < m; ++k)
                    through[a * MOMENTA + column] += gain[a * m + k] * response[k * MOMENTA + column];
            }
    }
    return true;
}

/* The change of x that the residual stands for, to first order. */
static inline bool find_step(Periods *q, double *step)
{
    const int s = q->s, m = MOMENTA * s;
    const ptrdiff_t n_time = q->played->n_time;
    double open[MOMENTA * MOMENTA], start[MOMENTA];
    int pivot[MOMENTA];
    memset(q->edge, 0, MOMENTA * sizeof *q->edge);
    for (int k = 0; k < MOMENTA * MOMENTA; ++k)
        open[k] = k / MOMENTA == k % MOMENTA;
    for (ptrdiff_t i = 0; i < q->intervals; ++i) {
        const double *through = q->through + i * MOMENTA * MOMENTA, *gain = q->gain + i * m * MOMENTA;
        double *edge = q->edge + i * MOMENTA, *own = q->own + i * m, before[MOMENTA * MOMENTA];
        for (int k = 0; k < m; ++k)
            own[k] = q->residual[at_stage(q, k % MOMENTA, i, k / MOMENTA)];
        back_substitute(m, q->matrix + i * m * m, q->pivot + i * m, own, 1);
        memcpy(before, open, sizeof before);
        for (int a = 0; a < MOMENTA; ++a) {
            edge[MOMENTA + a] = 0.0;
            for (int k = 0; k < m; ++k)
                edge[MOMENTA + a] += gain[a * m + k] * own[k];
            for (int c = 0; c < MOMENTA; ++c)
                edge[MOMENTA + a] += through[a * MOMENTA + c] * edge[c];
            for (int column = 0; column < MOMENTA; ++column) {
                open[a * MOMENTA + column] = 0.0;
                for (int c = 0; c < MOMENTA; ++c)
                    open[a * MOMENTA + column] += through[a * MOMENTA + c] * before[c * MOMENTA + column];
            }
        }
    }
    for (int k = 0; k < MOMENTA * MOMENTA; ++k)
        open[k] -= q->image[k];
    for (int a = 0; a < MOMENTA; ++a)
        start[a] = q->residual[MOMENTA * n_time + a] - q->edge[q->intervals * MOMENTA + a];
    if (!factorised(MOMENTA, open, pivot))
        return false;
    back_substitute(MOMENTA, open, pivot, start, 1);
    memcpy(step + MOMENTA * n_time, start, sizeof start);
    for (ptrdiff_t i = 0; i < q->intervals; ++i) {
        const double *through = q->through + i * MOMENTA * MOMENTA, *response = q->response + i * m * MOMENTA;
        const double *edge = q->edge + i * MOMENTA, *own = q->own + i * m;
        double now[MOMENTA];
        memcpy(now, start, sizeof now);
        for (int k = 0; k < m; ++k) {
            double change = own[k];
            for (int c = 0; c < MOMENTA; ++c)
                change += response[k * MOMENTA + c] * (edge[c] + now[c]);
            step[at_stage(q, k % MOMENTA, i, k / MOMENTA)] = change;
        }
        for (int a = 0; a < MOMENTA; ++a) { /* what the start comes to at the next edge */
            start[a] = 0.0;
            for (int c = 0; c < MOMENTA; ++c)
                start[a] += through[a * MOMENTA + c] * now[c];
        }
    }
    return true;
}

/* Of x - share y. */
static inline double length_apart(ptrdiff_t n, const double *x, const double *y, double share)
{
    double sum = 0.0;
    for (ptrdiff_t k = 0; k < n; ++k)
        sum += (x[k] - share * y[k]) * (x[k] - share * y[k]);
    return sqrt(sum);
}

static inline double largest_size(ptrdiff_t n, const double *x)
{
    double largest = 0.0;
    for (ptrdiff_t k = 0; k < n; ++k)
        largest = fmax(largest, fabs(x[k]));
    return largest;
}

/* From x = (states, start) to one that repeats, in place, with its rows; whether there is one. A share of a step is taken if the
   next step, of the same derivatives, is a shorter one. */
static inline bool repeats(Periods *q, double *x)
{
    const ptrdiff_t all = MOMENTA * (q->played->n_time + 1);
    double off = find_residual(q, x), trusted = INFINITY;
    memset(q->next, 0, (size_t)all * sizeof *q->next);
    for (int steps = 0; steps < NEWTON_STEPS && isfinite(off) && off >= CLOSED; ++steps) {
        if (!find_derivatives(q) || !find_step(q, q->step))
            return false;
        const double size = length_apart(all, q->step, q->step, 0.0);
        if (!isfinite(size))
            return false;
        if (largest_size(all, q->step) < ROUNDED) {
            for (ptrdiff_t k = 0; k < all; ++k)
                x[k] -= q->step[k];
            return isfinite(find_residual(q, x));
        }
        /* derivatives are good for steps in proportion to how well they told this one */
        const double missed = length_apart(all, q->next, q->step, 1.0) * size;
        double share = missed <= trusted ? 1.0 : fmax(LEAST_SHARE, trusted / missed);
        for (;;) {
            for (ptrdiff_t k = 0; k < all; ++k)
                q->trial[k] = x[k] - share * q->step[k];
            off = find_residual(q, q->trial);
            if (off < CLOSED)
                break;
            double closer = 0.25 * share;
            if (isfinite(off) && find_step(q, q->next)) {
                const double next = length_apart(all, q->next, q->next, 0.0);
                trusted = share * size * next;
                if (next < size)
                    break;
                closer = 0.5 * share * share * size / length_apart(all, q->next, q->step, 1.0 - share);
            }
            if (share <= LEAST_SHARE) {
                memcpy(x, q->trial, (size_t)all * sizeof *x);
                return false;
            }
            share = fmax(LEAST_SHARE, fmin(closer, 0.5 * share));
        }
        memcpy(x, q->trial, (size_t)all * sizeof *x);
    }
    return isfinite(off) && off < CLOSED;
}
