/* How far the balanced motion of three links may be from the interpolated one, cell by cell: research/guarantee/README.md. */

#pragma once

#include "growth.hpp"
#include "state.hpp"

#define LEAST_PIVOT 1e-9
#define NEARLY_HELD 1e-6
#define AT_REST_AT_ALL 100.0 /* of delta */
#define FIRST_ALLOWED 0.2
#define MORE_ALLOWED 1.5
#define ATTEMPTS 5

static inline bool cholesky(const Matrix3 H, Matrix3 L)
{
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j <= i; ++j) {
            Interval sum = H[i][j];
            for (int m = 0; m < j; ++m)
                sum -= L[i][m] * L[j][m];
            if (i == j && !(sum > LEAST_PIVOT))
                return false;
            L[i][j] = i == j ? root(sum) : sum / L[j][j];
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
        x[i] = x[i] / L[i][i];
    }
}

/* Largest |rows d| over d.H d <= 1. */
static inline Interval reach_of(const Matrix3 L, const TwoRows row)
{
    Vector3 x, y;
    Interval a, b, c;
    forward(L, row[0], x), forward(L, row[1], y);
    for (int i = 0; i < 3; ++i)
        a += square(x[i]), b += square(y[i]), c += x[i] * y[i];
    return root((a + b) * 0.5 + root(square(a - b) * 0.25 + square(c)));
}

static inline Interval frobenius(const Matrix3 A)
{
    Interval sum;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            sum += square(A[i][j]);
    return root(sum);
}

/* At least the largest d.G d over d.H d <= 1: the largest eigenvalue of K = L^-1 G L^-T, from its fourth power. */
static inline Interval largest_ratio(const Matrix3 L, const Matrix3 G)
{
    Matrix3 half, K, power;
    for (int i = 0; i < 3; ++i) {
        const Vector3 row = {G[i][0], G[i > 1 ? i : 1][i > 1 ? 1 : i], G[2][i]};
        forward(L, row, half[i]); /* rows of G L^-T */
    }
    for (int j = 0; j < 3; ++j) {
        const Vector3 column = {half[0][j], half[1][j], half[2][j]};
        forward(L, column, K[j]);
    }
    const double norm = frobenius(K).middle(), scale = norm > 0 ? norm : 1.0;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            K[i][j] = K[i][j] / scale;
    for (int twice = 0; twice < 2; ++twice) {
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j)
                power[i][j] = K[i][0] * K[0][j] + K[i][1] * K[1][j] + K[i][2] * K[2][j];
        memcpy(K, power, sizeof K);
    }
    return root(root(frobenius(K))) * scale;
}

/* Stretch the tangential velocities of a link: by the sigma of its sense of sliding, or by the larger if it slides both ways. */
static inline void stretch_link(CellLink *k, const double sigma[2])
{
    bool forwards = true, backwards = true;
    for (int j = 0; j < CORNERS; ++j)
        forwards &= k->hinge[j][0] > k->off, backwards &= k->hinge[j][0] < -k->off;
    const double high = fmax(sigma[0], sigma[1]), by = forwards ? sigma[0] : backwards ? sigma[1] : high;
    k->directed = sigma[0] != sigma[1];
    k->both_ways = k->directed && !forwards && !backwards;
    k->uneven = Interval(high) / fmin(sigma[0], sigma[1]);
    k->most = fmax(by, 1.0);
    k->off *= k->most;
    for (int j = 0; j < CORNERS; ++j)
        k->hinge[j][0] *= by;
    memcpy(k->plain_row, k->hinge_row, sizeof k->plain_row);
    for (int j = 0; j < 3; ++j)
        k->hinge_row[0][j] *= by;
}

/* The links over a cell, from the motions z (x, y, spin of the middle link) at its corners. */
static inline void find_links(CellLink link[3], const double length[3], const double sigma[2], const Cell *cell, double delta)
{
    for (int i = 0; i < 3; ++i) {
        CellLink *k = &link[i];
        k->length = length[i], k->sign = i ? 1.0 : -1.0, k->offset = (i > 1 ? 0.5 : -0.5) * length[1];
        k->axis = i > 1 ? 1 : i ? -1 : 0;
        Interval fastest, change, joint[CORNERS][2];
        for (int j = 0; j < CORNERS; ++j) {
            Hinge at;
            find_hinge(&at, i, length, cell->point[j], cell->motion[j]);
            memcpy(k->hinge[j], at.velocity, sizeof at.velocity), memcpy(joint[j], at.joint, sizeof at.joint);
            k->spin[j] = at.spin;
            fastest = most_of(fastest, norm_of(joint[j][0], joint[j][1]));
        }
        double centre = 0.0;
        k->turned = k->off = Interval();
        if (k->axis >= 0) {
            const double low = cell->point[0][k->axis], high = cell->point[7][k->axis];
            centre = 0.5 * (low + high);
            k->turned = most_of(Interval(high) - centre, Interval(centre) - low) * 2.0;
            k->off = k->turned * 0.25 * (k->turned * 0.5 * fastest + edge_change(joint, k->axis));
        }
        const Interval c = cosine_of(centre), s = sine_of(i ? -centre : centre);
        const TwoRows row = {{c, -s, -s * k->offset}, {s, c, c * k->offset}};
        memcpy(k->hinge_row, row, sizeof row);
        stretch_link(k, sigma);
        find_errors(k, delta);
    }
}

struct Balance {
    Vector3 turning;        /* force at the hinge that the link's turning may leave unbalanced */
    Interval force, torque; /* left at the corners by the solver */
    const double *point;    /* the reference point (x, y), and what the spin counts beside it */
};

struct Allowance {
    Interval gain, power;
};

/* A link that rests at all corners rests: friction on it has something in reserve. */
static inline bool rests(const CellLink link[3], const double sigma[2], const Balance *b, double delta, Allowance *found)
{
    const Interval one = 1.0, ratio = Interval(fmax(sigma[0], sigma[1])) / fmin(sigma[0], sigma[1]);
    const double least = fmin(fmin(sigma[0], sigma[1]), 1.0);
    for (int i = 0; i < 3; ++i) {
        if (!(link[i].fastest < AT_REST_AT_ALL * delta))
            continue;
        /* it may slide off in either sense, so its speed is that of the larger sigma */
        const Interval l = link[i].length, fastest = ratio * (link[i].fastest + link[i].off), reserve = one - fastest / norm_of(fastest, delta);
        if (!(reserve > NEARLY_HELD))
            continue;
        /* |a| on the other links and at the hinges, in terms of its largest value on this one */
        Vector3 on, hinge;
        Interval power_error, gap;
        if (i == 1) {
            on[0] = one + Interval(2.0 * link[0].length) / l, on[1] = one, on[2] = one + Interval(2.0 * link[2].length) / l;
            hinge[0] = hinge[2] = one;
        } else {
            const int o = 2 - i;
            on[i] = hinge[i] = one, on[1] = hinge[o] = one + Interval(2.0 * link[1].length) / l;
            on[o] = on[1] + Interval(2.0 * link[o].length) / l;
        }
        Interval left = b->force * on[1] + b->torque * 2.0 / l;
        for (int j = 0; j < 3; ++j) {
            left += b->turning[j] * hinge[j];
            power_error += link[j].power_error;
            if (j != i)
                left += on[j] * link[j].most * link[j].force_error, gap += link[j].gap;
        }
        const Interval room = reserve * least * KAPPA * l - left, given = fastest * l * 3.0 + gap;
        if (!(room > 1e-50))
            continue;
        const Interval moved = given / room;
        found->gain = moved * (on[1] + Interval(2.0) / l * (norm_of(b->point[0], b->point[1]) + b->point[2]));
        found->power = power_error + given + left * moved;
        return true;
    }
    return false;
}

/* The motion is where strong convexity holds it. */
static inline bool held(CellLink link[3], const Balance *b, Allowance *found)
{
    const Interval one = 1.0, none;
    Interval force_error, gap, power_error;
    TwoRows row;
    Matrix3 G;
    for (int i = 0; i < 3; ++i) {
        CellLink *k = &link[i];
        const Interval h = k->turned * 0.5;
        Moments sum;
        for (int j = 0; j < PIECES; ++j) {
            const Interval weight = k->error[j] * 0.5 * (Interval(k->node[j + 1]) - k->node[j]) * (one + h);
            add_point(&sum, weight, k->node[j]), add_point(&sum, weight, k->node[j + 1]);
        }
        add_grams(k, G, &sum);
        add_gram(G, k->force_error * h * (one + h) * square(k->most), k->plain_row);
        force_error += k->force_error, gap += k->gap, power_error += k->power_error;
        k->allowed = FIRST_ALLOWED * most_of(k->end_spread[0], k->end_spread[1]).hi;
    }
    const TwoRows place = {{one, none, none}, {none, one, none}}, turn = {{none, none, one}, {none, none, none}};
    const TwoRows point = {{one, none, -b->point[1]}, {none, one, b->point[0]}};
    for (int attempt = 0; attempt < ATTEMPTS; ++attempt) {
        Matrix3 H, L;
        for (int i = 0; i < 3; ++i)
            add_growth(&link[i], H);
        if (!cholesky(H, L))
            return false;
        Interval pull = root(force_error * largest_ratio(L, G)) + b->force * reach_of(L, place) + b->torque * reach_of(L, turn);
        for (int i = 0; i < 3; ++i)
            pull += b->turning[i] * reach_of(L, link[i].plain_row);
        const Interval radius = (pull + root(square(pull) + gap * 4.0)) * 0.5;
        bool within = true;
        for (int i = 0; i < 3; ++i) {
            CellLink *k = &link[i];
            const Interval most = k->most * reach_of(L, k->plain_row), turned = k->turned * 0.5 * most;
            rows_at(k, 0.0, row);
            const Interval hinge = least_of(most, reach_of(L, row) + turned);
            rows_at(k, k->length, row);
            const Interval moved = radius * most_of(hinge, reach_of(L, row) + turned);
            within &= moved < k->allowed;
            k->allowed = fmax(MORE_ALLOWED * moved.hi, within ? k->allowed : 0.0);
        }
        if (within) {
            found->gain = radius * (reach_of(L, point) + reach_of(L, turn) * b->point[2]);
            found->power = power_error + gap + pull * radius;
            return true;
        }
    }
    return false;
}

/* Of one cell by strong convexity. */
static inline Allowance allowance_by_convexity(const double length[3], const double sigma[2], const Cell *cell, const double point[3], double delta)
{
    CellLink link[3];
    Balance b;
    find_links(link, length, sigma, cell, delta);
    b.point = point;
    for (int j = 0; j < CORNERS; ++j)
        b.force = most_of(b.force, cell->state[j]->left_force), b.torque = most_of(b.torque, cell->state[j]->left_torque);
    for (int i = 0; i < 3; i += 2)
        b.turning[i] = link[i].turned * 0.25 * force_turned(cell, i, link[i].turned);
    Allowance found;
    const bool known = rests(link, sigma, &b, delta, &found) || held(link, &b, &found);
    return known ? found : Allowance{INFINITY, INFINITY};
}
