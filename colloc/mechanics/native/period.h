/* A period of a gait in one call: balance at the points of a collocation scheme, several side by side, then orientation, place and
   work; and the adjoint, by which a gradient costs about what a value does, for chains of any number of links: colloc/reduced/motion.py
   and colloc/dynamics/collocated.py. Level ground. */

#pragma once

#include "lanes.h"

#define LANE_ITERATIONS 40
/* Largest residual times delta that is rounding. */
#define LANE_ROUNDING 1e-16

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

/* Inverse by cofactors, after symmetric scaling to a unit diagonal; 0 where that is singular. */
static inline void inverse3(Matrix3 A, Matrix3 B)
{
    Vector3 d;
    Matrix3 m, c;
    for (int i = 0; i < 3; ++i)
        d[i] = 1.0 / sqrt(lane_fmax(fabs(A[i][i]), ZERO + 1e-300));
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            m[i][j] = A[i][j] * d[i] * d[j];
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            const int p = (i + 1) % 3, q = (i + 2) % 3, r = (j + 1) % 3, t = (j + 2) % 3;
            c[j][i] = m[p][r] * m[q][t] - m[p][t] * m[q][r];
        }
    const Lanes determinant = m[0][0] * c[0][0] + m[0][1] * c[1][0] + m[0][2] * c[2][0];
    const Mask regular = fabs(determinant) > 1e-300;
    const Lanes per = SELECT(regular, 1.0 / SELECT(regular, determinant, 1.0), 0.0);
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            B[i][j] = c[i][j] * per * d[i] * d[j];
}

static inline Lanes lane_largest(const Vector3 v)
{
    return lane_fmax(fabs(v[0]), lane_fmax(fabs(v[1]), fabs(v[2])));
}

/* Links and slidings of LANES instants; aligned as vectors have to be. */
typedef struct {
    Link *link;
    Sliding *k, *trial;
    Matrix3 *K;
    void *memory;
} Room;

static bool new_lanes(Room *room, const int n, const Law *law)
{
    const size_t links = (size_t)n, parts = (size_t)law->n_part, align = sizeof(Lanes);
    const size_t sizes[] = {links * sizeof(Link), links * sizeof(Matrix3), 2 * parts * sizeof(PartSliding), 2 * links * sizeof(Sliding)};
    char *at = room->memory = malloc(sizes[0] + sizes[1] + sizes[2] + sizes[3] + align);
    if (!at)
        return false;
    at += align - (size_t)at % align;
    room->link = (Link *)at;
    room->K = (Matrix3 *)(at += sizes[0]);
    PartSliding *part = (PartSliding *)(at += sizes[1]);
    room->k = (Sliding *)(at += sizes[2]), room->trial = room->k + n;
    for (int i = 0; i < n; ++i)
        room->k[i].part = part, room->trial[i].part = part + law->n_part;
    return true;
}

/* By Newton's method, damped and safeguarded as in damped_newton.h, from velocity z of the reference; the lanes that come to rest. */
static inline Mask lane_balance(
    const int n, Room *room, const Law *law, Lanes delta, double tolerance, Vector3 z)
{
    const Link *link = room->link;
    const int reference = n / 2, tries = law->associated ? 13 : 3;
    const Lanes enough = lane_fmax(ZERO + tolerance, LANE_ROUNDING / delta) * law->largest / sqrt(1.0 + delta * delta);
    Total at = evaluate(n, link, room->k, reference, z, law, delta);
    Mask going = ~(lane_largest(at.force) <= enough), due = going & 0; /* fixed-point steps that are due */
    for (int count = 0; count < LANE_ITERATIONS && ANY(going); ++count) {
        const Mask steep = going & (due > 0);
        Matrix3 left, inverse;
        Vector3 step, there;
        pull_back(n, link, room->k, law, delta, true, left);
        if (ANY(steep)) {
            pull_back(n, link, room->k, law, delta, false, inverse);
            for (int i = 0; i < 9; ++i)
                left[i / 3][i % 3] = SELECT(steep, inverse[i / 3][i % 3], left[i / 3][i % 3]);
        }
        inverse3(left, inverse);
        for (int i = 0; i < 3; ++i)
            step[i] = SELECT(going, inverse[i][0] * at.force[0] + inverse[i][1] * at.force[1] + inverse[i][2] * at.force[2], 0.0);
        Lanes slope = -2.0 * at.merit, slack = ZERO, alpha = ZERO + 1.0;
        if (law->associated) {
            slope = -(at.force[0] * step[0] + at.force[1] * step[1] + at.force[2] * step[2]);
            slack = ROUNDING * at.merit;
        }
        Mask open = going;
        Total next;
        for (int t = 0; t < tries && ANY(open); ++t) {
            alpha = t ? SELECT(open, alpha * BACKTRACKING[t - 1], alpha) : alpha;
            for (int i = 0; i < 3; ++i)
                there[i] = z[i] + alpha * step[i];
            next = evaluate(n, link, room->trial, reference, there, law, delta);
            open &= ~steep & ~(next.merit <= at.merit + ARMIJO * alpha * slope + slack);
        }
        due = (open & FIXED_POINT_STEPS_AFTER_FAILURE) | (~open & (due + steep)); /* steep: -1 where it is so */
        for (int i = 0; i < 3; ++i)
            z[i] = SELECT(open, z[i], there[i]);
        if (ANY(open))
            at = evaluate(n, link, room->k, reference, z, law, delta);
        else {
            Sliding *now = room->k;
            room->k = room->trial, room->trial = now, at = next;
        }
        going &= ~(lane_largest(at.force) <= enough);
    }
    return ~going;
}

/* The links at times from t on, moving as the tail does, with rates, velocities and delta in units of `speed`, which is returned. */
static inline Lanes lane_instants(const Played *b, Room *room, ptrdiff_t t, const double *tail, Vector3 z, Lanes *delta)
{
    const int n = b->n, reference = n / 2;
    Lanes angle[b->n], rate[b->n], speed = ZERO;
    Vector3 start;
    for (int j = 0; j < n - 1; ++j) {
        angle[j] = lane_load(b->angles + j * b->n_time, t, b->n_time);
        rate[j] = lane_load(b->rates + j * b->n_time, t, b->n_time);
        speed = lane_fmax(speed, fabs(rate[j]));
    }
    speed = SELECT(speed > 0, speed, 1.0);
    *delta = b->delta / speed;
    find_directions(n, room->link, b->length, b->mass, angle, rate, speed, 1);
    find_midpoints(n, room->link, reference);
    for (int i = 0; i < 3; ++i)
        start[i] = lane_load(tail + i * b->n_time, t, b->n_time) / speed;
    find_velocities_from_tail(n, room->link, room->k, start);
    link_velocity(&room->link[reference], &room->k[reference], z);
    return speed;
}

/* Tail velocities (3, n_time), at times from t on, moved along their derivatives from where b states them, `tail`, to other angles and
   rates: where several velocities balance a body, those of one branch. */
static inline void predict_tail(const Played *b, Room *room, ptrdiff_t t, const double *tail, const double *angles, const double *rates, double *to)
{
    const int n = b->n, reference = n / 2;
    Vector3 z, net = {ZERO, ZERO, ZERO}, dz;
    Matrix3 left, inverse;
    Lanes delta, phi[n], w[n], x[n], y[n], vx[n], vy[n];
    const Lanes speed = lane_instants(b, room, t, tail, z, &delta);
    const Link *link = room->link;
    const Sliding *k = room->k;
    evaluate(n, link, room->k, reference, z, &b->law, delta);
    pull_back(n, link, k, &b->law, delta, true, left);
    inverse3(left, inverse);
    phi[0] = w[0] = ZERO;
    for (int i = 1; i < n; ++i) {
        const ptrdiff_t row = (i - 1) * b->n_time;
        phi[i] = phi[i - 1] + lane_load(angles + row, t, b->n_time) - lane_load(b->angles + row, t, b->n_time);
        w[i] = w[i - 1] + (lane_load(rates + row, t, b->n_time) - lane_load(b->rates + row, t, b->n_time)) / speed;
    }
    const Lanes turning = w[reference];
    for (int i = 0; i < n; ++i)
        w[i] -= turning;
    x[reference] = y[reference] = vx[reference] = vy[reference] = ZERO;
    for (int side = 1; side >= -1; side -= 2)
        for (int i = reference + side; i >= 0 && i < n; i += side) {
            x[i] = x[i - side], y[i] = y[i - side], vx[i] = vx[i - side], vy[i] = vy[i - side];
            for (int q = i - side; q != i + side; q += side) {
                const Lanes half = ZERO + 0.5 * side * link[q].length, c = half * link[q].cos, s = half * link[q].sin;
                x[i] -= s * phi[q], y[i] += c * phi[q];
                vx[i] -= s * w[q] + c * k[q].w * phi[q], vy[i] += c * w[q] - s * k[q].w * phi[q];
            }
        }
    for (int i = 0; i < n; ++i) {
        const Lanes c = link[i].cos, s = link[i].sin, fx = k[i].fs * c - k[i].fn * s, fy = k[i].fs * s + k[i].fn * c;
        const Vector3 d = {vx[i] * c + vy[i] * s + k[i].vn * phi[i], vy[i] * c - vx[i] * s - k[i].vs * phi[i], w[i]};
        Vector3 df;
        Matrix3 K;
        find_slopes(&k[i], &b->law, &link[i], delta, false, K);
        for (int row = 0; row < 3; ++row)
            df[row] = -(K[row][0] * d[0] + K[row][1] * d[1] + K[row][2] * d[2]);
        const Lanes dfx = df[0] * c - df[1] * s - phi[i] * fy, dfy = df[0] * s + df[1] * c + phi[i] * fx;
        net[0] += dfx, net[1] += dfy;
        net[2] += x[i] * fy - y[i] * fx + link[i].x * dfy - link[i].y * dfx + df[2];
    }
    for (int i = 0; i < 3; ++i)
        dz[i] = inverse[i][0] * net[0] + inverse[i][1] * net[1] + inverse[i][2] * net[2];
    const Lanes rate = w[0] + dz[2];
    const Vector3 change = {vx[0] + dz[0] - link[0].y * dz[2], vy[0] + dz[1] + link[0].x * dz[2] - 0.5 * link[0].length * rate, rate};
    for (int i = 0; i < 3; ++i)
        lane_store(to + i * b->n_time, t, b->n_time, lane_load(tail + i * b->n_time, t, b->n_time) + change[i] * speed);
}

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
            const double c = (cos)(angle), s = (sin)(angle);
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

/* Derivatives of a number along angles and rates, (2 (n - 1)), from those along out, by the adjoint of the balance and of the
   chain. K: slopes of friction; inverse: of their sum. */
static inline void pull_to_shape(
    const int n, const Link *link, const Sliding *k, Matrix3 *K, Matrix3 inverse, const Lanes on_out[OUTPUTS], Lanes *on_shape)
{
    const int reference = n / 2;
    const Lanes on_turning = on_out[TURNING], on_x = on_out[ALONG], on_y = on_out[ACROSS], on_power = on_out[POWER];
    Lanes on_phi[n], on_rate[n], gx[n], gy[n], on_px[n], on_py[n];
    Vector3 on_z = {ZERO, ZERO, on_turning}, multiplier;
    for (int i = 0; i < n; ++i) {
        const Lanes c = link[i].cos, s = link[i].sin;
        const Lanes hs = on_power * (K[i][0][0] * k[i].vs + K[i][1][0] * k[i].vn + K[i][2][0] * k[i].w - k[i].fs);
        const Lanes hn = on_power * (K[i][0][1] * k[i].vs + K[i][1][1] * k[i].vn + K[i][2][1] * k[i].w - k[i].fn);
        const Lanes hw = on_power * (K[i][0][2] * k[i].vs + K[i][1][2] * k[i].vn + K[i][2][2] * k[i].w - k[i].couple);
        const Lanes x = hs * c - hn * s + link[i].mass * on_x, y = hs * s + hn * c + link[i].mass * on_y;
        on_z[0] += x, on_z[1] += y, on_z[2] += link[i].x * y - link[i].y * x + hw;
    }
    for (int i = 0; i < 3; ++i)
        multiplier[i] = inverse[0][i] * on_z[0] + inverse[1][i] * on_z[1] + inverse[2][i] * on_z[2];
    for (int i = 0; i < n; ++i) {
        const Lanes c = link[i].cos, s = link[i].sin;
        const Lanes ux = multiplier[0] - multiplier[2] * link[i].y, uy = multiplier[1] + multiplier[2] * link[i].x;
        const Lanes us = ux * c + uy * s, un = uy * c - ux * s;
        const Lanes gs = us - on_power * k[i].vs, gn = un - on_power * k[i].vn, gw = multiplier[2] - on_power * k[i].w;
        const Lanes hs = -(K[i][0][0] * gs + K[i][1][0] * gn + K[i][2][0] * gw) - on_power * k[i].fs;
        const Lanes hn = -(K[i][0][1] * gs + K[i][1][1] * gn + K[i][2][1] * gw) - on_power * k[i].fn;
        const Lanes hw = -(K[i][0][2] * gs + K[i][1][2] * gn + K[i][2][2] * gw) - on_power * k[i].couple;
        on_px[i] = multiplier[2] * (k[i].fs * s + k[i].fn * c), on_py[i] = -multiplier[2] * (k[i].fs * c - k[i].fn * s);
        gx[i] = hs * c - hn * s + link[i].mass * on_x, gy[i] = hs * s + hn * c + link[i].mass * on_y;
        on_phi[i] = hs * k[i].vn - hn * k[i].vs + k[i].fs * un - k[i].fn * us;
        on_rate[i] = i ? hw : hw + on_turning;
    }
    for (int side = 1; side >= -1; side -= 2) { /* from either end to the reference */
        Lanes px = ZERO, py = ZERO, vx = ZERO, vy = ZERO;
        for (int i = side > 0 ? n - 1 : 0; i != reference; i -= side) {
            px += on_px[i], py += on_py[i], vx += gx[i], vy += gy[i];
            for (int two = 0; two < 2; ++two) {
                const int q = i - two * side;
                const Lanes c = link[q].cos, s = link[q].sin, half = ZERO + 0.5 * side * link[q].length;
                on_phi[q] += half * (py * c - px * s - k[q].w * (vx * c + vy * s));
                on_rate[q] += half * (vy * c - vx * s);
            }
        }
    }
    Lanes phi = ZERO, rate = ZERO;
    for (int j = n - 2; j >= 0; --j) { /* a joint turns all links ahead; turning all of them changes nothing, by the balance */
        phi += on_phi[j + 1], rate += on_rate[j + 1];
        on_shape[j] = phi, on_shape[n - 1 + j] = rate;
    }
}
