/* Orientation, place and work along a period, and what they add to the adjoint: colloc/reduced/motion.py and
   colloc/dynamics/collocated.py. Level ground. */

#pragma once

#include "chain.h"

enum { TURNING, ALONG, ACROSS, POWER, OUTPUTS }; /* rotation rate less that of the axes, velocity of the centre, power */
enum { SIDE_X, SIDE_Y, ROTATION, WORK, TOTALS };

/* Points ``(n_interval, s)`` of the scheme (A, b) on intervals of lengths h, and the rotation over all of them of axes that turn
   evenly, from which motion is seen. */
typedef struct {
    ptrdiff_t n_interval, n_time;
    int s;
    const double *A, *b, *h, *pace;
    const long long *points;
    double turn;
} Mesh;

#define MESH ptrdiff_t n_interval, int s, const double *A, const double *b, const double *h, const long long *points, double turn, const double *pace
#define MESHED {.n_interval = n_interval, .n_time = n_time, .s = s, .A = A, .b = b, .h = h, .points = points, .turn = turn, .pace = pace}

/* Length of the path, and the rate at which axes turn evenly, over the pace. */
static double even_rate(const Mesh *m, double *length)
{
    *length = 0.0;
    for (ptrdiff_t i = 0; i < m->n_interval * m->s; ++i)
        *length += m->h[i / m->s] * m->b[i % m->s] * m->pace[m->points[i]];
    return m->turn / *length;
}

/* Orientations at the points, as their cosines and sines ``(2, n_interval, s)``, and the totals. */
static void find_pose(const Mesh *m, const double *out, double *turned, double totals[TOTALS])
{
    const ptrdiff_t n_stage = m->n_interval * m->s;
    double theta = 0.0;
    memset(totals, 0, TOTALS * sizeof *totals);
    for (ptrdiff_t q = 0; q < m->n_interval; ++q) {
        const long long *point = m->points + q * m->s;
        double gained = 0.0;
        for (int i = 0; i < m->s; ++i) {
            const ptrdiff_t t = point[i];
            const double weight = m->h[q] * m->b[i] * m->pace[t];
            double angle = theta;
            for (int j = 0; j < m->s; ++j)
                angle += m->h[q] * m->A[i * m->s + j] * out[TURNING * m->n_time + point[j]] * m->pace[point[j]];
            double c, s;
            find_direction(angle, &c, &s);
            turned[q * m->s + i] = c, turned[n_stage + q * m->s + i] = s;
            totals[SIDE_X] += weight * (c * out[ALONG * m->n_time + t] - s * out[ACROSS * m->n_time + t]);
            totals[SIDE_Y] += weight * (s * out[ALONG * m->n_time + t] + c * out[ACROSS * m->n_time + t]);
            totals[WORK] += weight * out[POWER * m->n_time + t];
            gained += weight * out[TURNING * m->n_time + t];
        }
        theta += gained;
    }
    totals[ROTATION] = theta;
}

/* Derivatives of a number along out times the pace at the points, (OUTPUTS, n_time), and along the pace (n_time), from those along
   the totals. */
static void find_weights(const Mesh *m, const double *out, const double *turned, const double on[TOTALS], double *weights, double *on_pace)
{
    const ptrdiff_t n_stage = m->n_interval * m->s, n_time = m->n_time;
    double later = on[ROTATION], along = 0.0, length;
    const double even = even_rate(m, &length);
    memset(weights, 0, (size_t)(OUTPUTS * n_time) * sizeof *weights);
    for (ptrdiff_t q = m->n_interval - 1; q >= 0; --q) {
        const long long *point = m->points + q * m->s;
        double on_theta[m->s], sum = 0.0;
        for (int i = 0; i < m->s; ++i) {
            const ptrdiff_t t = point[i];
            const double weight = m->h[q] * m->b[i], c = turned[q * m->s + i], s = turned[n_stage + q * m->s + i];
            const double vx = c * out[ALONG * n_time + t] - s * out[ACROSS * n_time + t];
            const double vy = s * out[ALONG * n_time + t] + c * out[ACROSS * n_time + t];
            on_theta[i] = weight * m->pace[t] * (on[SIDE_Y] * vx - on[SIDE_X] * vy), sum += on_theta[i];
            weights[ALONG * n_time + t] += weight * (on[SIDE_X] * c + on[SIDE_Y] * s);
            weights[ACROSS * n_time + t] += weight * (on[SIDE_Y] * c - on[SIDE_X] * s);
            weights[POWER * n_time + t] += weight * on[WORK];
        }
        for (int j = 0; j < m->s; ++j) {
            double at = m->b[j] * later;
            for (int i = 0; i < m->s; ++i)
                at += on_theta[i] * m->A[i * m->s + j];
            weights[TURNING * n_time + point[j]] += m->h[q] * at;
        }
        later += sum;
    }
    for (ptrdiff_t t = 0; t < n_time; ++t) {
        along += weights[TURNING * n_time + t] * m->pace[t];
        on_pace[t] = 0.0;
        for (int row = 0; row < OUTPUTS; ++row)
            on_pace[t] += weights[row * n_time + t] * out[row * n_time + t];
    }
    for (ptrdiff_t i = 0; i < n_stage; ++i) /* a longer path turns the axes less on each of its parts */
        on_pace[m->points[i]] += along * even / length * m->h[i / m->s] * m->b[i % m->s];
}
