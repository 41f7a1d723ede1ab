/* How far the balanced motion of three links may be from the interpolated one, cell by cell: research/guarantee/README.md. */

#pragma once

#include "growth.h"

#define LEAST_PIVOT 1e-9
#define NEARLY_HELD 1e-6
#define AT_REST_AT_ALL 100.0 /* of delta */
#define KAPPA 0.41421356237309503 /* the integral of |a| over a link is at least KAPPA times its length times |a| at either end */
#define FIRST_ALLOWED 0.2
#define MORE_ALLOWED 1.5
#define ATTEMPTS 5
#define ROUNDING_UP 1.000001

static inline bool cholesky(const Matrix3 H, Matrix3 L)
{
    memset(L, 0, sizeof(Matrix3));
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j <= i; ++j) {
            double sum = 0.5 * (H[i][j] + H[j][i]);
            for (int m = 0; m < j; ++m)
                sum -= L[i][m] * L[j][m];
            if (i == j && !(sum > LEAST_PIVOT))
                return false;
            L[i][j] = i == j ? sqrt(sum) : sum / L[j][j];
        }
    return true;
}

/* L^-1 v */
static inline void forward(const Matrix3 L, const Vector3 v, Vector3 x)
{
    for (int i = 0; i < 3; ++i) {
        x[i] = v[i];
        for (int m = 0; m < i; ++m)
            x[i] -= L[i][m] * x[m];
        x[i] /= L[i][i];
    }
}

/* Largest |rows d| over d.H d <= 1. */
static inline double reach_of(const Matrix3 L, TwoRows row)
{
    Vector3 x, y;
    double a = 0.0, b = 0.0, c = 0.0;
    forward(L, row[0], x), forward(L, row[1], y);
    for (int i = 0; i < 3; ++i)
        a += x[i] * x[i], b += y[i] * y[i], c += x[i] * y[i];
    return sqrt(0.5 * (a + b) + sqrt(0.25 * (a - b) * (a - b) + c * c));
}

static inline double frobenius(const Matrix3 A)
{
    double sum = 0.0;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            sum += A[i][j] * A[i][j];
    return sqrt(sum);
}

/* At least the largest d.G d over d.H d <= 1: the largest eigenvalue of K = L^-1 G L^-T, from its fourth power. */
static inline double largest_ratio(const Matrix3 L, const Matrix3 G)
{
    Matrix3 half, K, power;
    for (int i = 0; i < 3; ++i)
        forward(L, G[i], half[i]); /* rows of G L^-T */
    for (int j = 0; j < 3; ++j) {
        const Vector3 column = {half[0][j], half[1][j], half[2][j]};
        forward(L, column, K[j]);
    }
    const double norm = frobenius(K), scale = norm > 0 ? 1.0 / norm : 0.0;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            K[i][j] *= scale;
    for (int twice = 0; twice < 2; ++twice) {
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j)
                power[i][j] = K[i][0] * K[0][j] + K[i][1] * K[1][j] + K[i][2] * K[2][j];
        memcpy(K, power, sizeof K);
    }
    return norm * sqrt(sqrt(frobenius(K)));
}

/* Stretch the tangential velocities of a link: by the sigma of its sense of sliding, or by the larger if it slides both ways. */
static inline void stretch_link(CellLink *k, const double sigma[2])
{
    double least = INFINITY, largest = -INFINITY;
    for (int j = 0; j < CORNERS; ++j)
        least = fmin(least, k->hinge[j][0]), largest = fmax(largest, k->hinge[j][0]);
    const bool forwards = least > k->off, backwards = largest < -k->off;
    const double high = fmax(sigma[0], sigma[1]), by = forwards ? sigma[0] : backwards ? sigma[1] : high;
    k->directed = sigma[0] != sigma[1];
    k->uneven = k->directed && !forwards && !backwards ? high / fmin(sigma[0], sigma[1]) : 1.0;
    k->most = fmax(by, 1.0);
    k->off *= k->most;
    for (int j = 0; j < CORNERS; ++j)
        k->hinge[j][0] *= by;
    memcpy(k->plain_row, k->hinge_row, sizeof k->plain_row);
    for (int j = 0; j < 3; ++j)
        k->hinge_row[0][j] *= by;
}

/* The links over a cell, from the motions z (x, y, spin of the middle link) at its corners. */
static inline void find_links(CellLink link[3], const Vector3 length, const double sigma[2], const Vector3 low, const Vector3 size,
                              const Vector3 *z, double delta)
{
    for (int i = 0; i < 3; ++i) {
        CellLink *k = &link[i];
        const int side = i - 1;
        k->length = length[i], k->sign = side < 0 ? -1.0 : 1.0, k->offset = (side > 0 ? 0.5 : -0.5) * length[1];
        k->axis = side < 0 ? 0 : side > 0 ? 1 : -1;
        k->turned = side ? size[k->axis] : 0.0;
        double hinge[CORNERS][2], fastest = 0.0, change = 0.0;
        for (int j = 0; j < CORNERS; ++j) {
            const double angle = side ? -side * (low[k->axis] + high(j, k->axis) * size[k->axis]) : 0.0, c = cos(angle), s = sin(angle);
            double *p = hinge[j];
            p[0] = z[j][0], p[1] = z[j][1] + k->offset * z[j][2];
            k->hinge[j][0] = c * p[0] - s * p[1], k->hinge[j][1] = s * p[0] + c * p[1];
            k->spin[j] = side < 0 ? 1.0 - z[j][2] : side > 0 ? z[j][2] + low[2] + high(j, 2) * size[2] : z[j][2];
            fastest = fmax(fastest, norm_of(p[0], p[1]));
        }
        for (int j = 0; side && j < CORNERS; ++j)
            if (!high(j, k->axis)) {
                const double *p = hinge[j], *q = hinge[across(j, k->axis)];
                change = fmax(change, norm_of(q[0] - p[0], q[1] - p[1]));
            }
        k->off = k->turned * k->turned / 8.0 * fastest + k->turned / 4.0 * change;
        const double angle = side ? -side * (low[k->axis] + 0.5 * size[k->axis]) : 0.0, c = cos(angle), s = sin(angle);
        const TwoRows row = {{c, -s, -s * k->offset}, {s, c, c * k->offset}};
        memcpy(k->hinge_row, row, sizeof row);
        stretch_link(k, sigma);
        find_errors(k, delta);
    }
}

typedef struct {
    Vector3 turning;      /* force at the hinge that the link's turning may leave unbalanced */
    double force, torque; /* left at the corners by the solver */
    Vector3 point;        /* the reference point (x, y), and what the spin counts beside it */
} Balance;

typedef struct {
    double gain, power;
} Allowance;

/* A link that rests at all corners rests: friction on it has something in reserve. */
static inline bool rests(const CellLink link[3], const double sigma[2], const Balance *b, double delta, Allowance *found)
{
    const double least = fmin(fmin(sigma[0], sigma[1]), 1.0), ratio = fmax(sigma[0], sigma[1]) / fmin(sigma[0], sigma[1]);
    for (int i = 0; i < 3; ++i) {
        /* it may slide off in either sense, so its speed is that of the larger sigma */
        const double l = link[i].length, fastest = ratio * (link[i].fastest + link[i].off), reserve = 1.0 - fastest / norm_of(fastest, delta);
        if (link[i].fastest > AT_REST_AT_ALL * delta || reserve < NEARLY_HELD)
            continue;
        /* |a| on the other links and at the hinges, in terms of its largest value on this one */
        Vector3 on, hinge = {0.0};
        double power_error = 0.0, gap = 0.0;
        if (i == 1) {
            on[0] = 1.0 + 2.0 * link[0].length / l, on[1] = 1.0, on[2] = 1.0 + 2.0 * link[2].length / l;
            hinge[0] = hinge[2] = 1.0;
        } else {
            const int o = 2 - i;
            on[i] = hinge[i] = 1.0, on[1] = hinge[o] = 1.0 + 2.0 * link[1].length / l, on[o] = on[1] + 2.0 * link[o].length / l;
        }
        double left = b->force * on[1] + b->torque * 2.0 / l;
        for (int j = 0; j < 3; ++j) {
            left += b->turning[j] * hinge[j];
            power_error += link[j].power_error;
            if (j != i)
                left += on[j] * link[j].most * link[j].force_error, gap += link[j].gap;
        }
        const double room = reserve * least * KAPPA * l - left, given = 3.0 * fastest * l + gap;
        if (!(room > 0))
            continue;
        const double moved = given / room;
        found->gain = moved * (on[1] + 2.0 / l * (norm_of(b->point[0], b->point[1]) + b->point[2]));
        found->power = power_error + given + left * moved;
        return true;
    }
    return false;
}

/* The motion is where strong convexity holds it. */
static inline bool held(CellLink link[3], const Balance *b, Allowance *found)
{
    double force_error = 0.0, gap = 0.0, power_error = 0.0;
    TwoRows row;
    Matrix3 G = {{0.0}};
    for (int i = 0; i < 3; ++i) {
        CellLink *k = &link[i];
        const double h = 0.5 * k->turned;
        for (int j = 0; j < PIECES; ++j) {
            const double weight = 0.5 * k->error[j] * (k->node[j + 1] - k->node[j]) * (1.0 + h);
            rows_at(k, k->node[j], row), add_gram(G, weight, row);
            rows_at(k, k->node[j + 1], row), add_gram(G, weight, row);
        }
        plain_rows(k, row), add_gram(G, k->force_error * h * (1.0 + h) * k->most * k->most, row);
        force_error += k->force_error, gap += k->gap, power_error += k->power_error;
        k->allowed = FIRST_ALLOWED * fmax(k->end_spread[0], k->end_spread[1]);
    }
    TwoRows place = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}}, turn = {{0.0, 0.0, 1.0}, {0.0, 0.0, 0.0}};
    TwoRows point = {{1.0, 0.0, -b->point[1]}, {0.0, 1.0, b->point[0]}};
    for (int attempt = 0; attempt < ATTEMPTS; ++attempt) {
        Matrix3 H = {{0.0}}, L;
        for (int i = 0; i < 3; ++i)
            add_growth(&link[i], H);
        if (!cholesky(H, L))
            return false;
        double pull = sqrt(force_error * largest_ratio(L, G)) + b->force * reach_of(L, place) + b->torque * reach_of(L, turn);
        for (int i = 0; i < 3; ++i)
            plain_rows(&link[i], row), pull += b->turning[i] * reach_of(L, row);
        const double radius = ROUNDING_UP * 0.5 * (pull + sqrt(pull * pull + 4.0 * gap));
        bool within = true;
        for (int i = 0; i < 3; ++i) {
            CellLink *k = &link[i];
            plain_rows(k, row);
            const double most = k->most * reach_of(L, row), turned = 0.5 * k->turned * most;
            rows_at(k, 0.0, row);
            const double hinge = fmin(most, reach_of(L, row) + turned);
            rows_at(k, k->length, row);
            const double moved = ROUNDING_UP * radius * fmax(hinge, reach_of(L, row) + turned);
            within &= moved < k->allowed;
            k->allowed = fmax(MORE_ALLOWED * moved, within ? k->allowed : 0.0);
        }
        if (within) {
            found->gain = radius * (reach_of(L, point) + b->point[2] * reach_of(L, turn));
            found->power = power_error + gap + pull * radius;
            return true;
        }
    }
    return false;
}

/* Sigma forwards and backwards. Cells by rows: low, size (n, 3); motions (n, 8, 3); force on the outer links at the corners (n, 8, 2, 2); force and torque left
   there (n, 2); the reference point (n, 3). What the gain of the interpolated motion may lack and its power exceed: (n, 2). */
int colloc_enclosure(
    const double *length, const double *sigma, ptrdiff_t first, ptrdiff_t last, const double *low, const double *size, const double *motion,
    const double *force, const double *left, const double *point, double delta, double *allowance)
{
    for (ptrdiff_t c = first; c < last; ++c) {
        CellLink link[3];
        find_links(link, length, sigma, low + 3 * c, size + 3 * c, (const Vector3 *)(motion + 24 * c), delta);
        Balance b = {.force = left[2 * c], .torque = left[2 * c + 1]};
        memcpy(b.point, point + 3 * c, sizeof b.point);
        for (int i = 0; i < 3; i += 2) {
            const double *f = force + 32 * c + i;
            double largest = 0.0, change = 0.0;
            for (int j = 0; j < CORNERS; ++j) {
                const double *at = f + 4 * j, *other = f + 4 * across(j, link[i].axis);
                largest = fmax(largest, norm_of(at[0], at[1])), change = fmax(change, norm_of(other[0] - at[0], other[1] - at[1]));
            }
            b.turning[i] = link[i].turned * (link[i].turned / 8.0 * largest + 0.25 * change);
        }
        Allowance found = {INFINITY, INFINITY};
        if (!rests(link, sigma, &b, delta, &found) && !held(link, &b, &found))
            found.gain = found.power = INFINITY;
        allowance[2 * c] = found.gain, allowance[2 * c + 1] = found.power;
    }
    return 0;
}
