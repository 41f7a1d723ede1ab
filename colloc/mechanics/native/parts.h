/* Friction on one link at its feet and pads: what colloc/mechanics/floor_contact.py states for arrays, under the law of Coulomb or
   the elliptic one, each part's own; in closed form on pads, with the names of colloc/mechanics/friction.py, where the formulas
   are explained. */

#include "law.h"

/* Rows of three numbers: a motion (two velocities and a rotation rate), forces and a torque. */
typedef Real Vector3[3];
typedef Vector3 Matrix3[3];

/* Velocities of a part and, of a pad, everything that its friction is expressed through; then the friction itself. */
typedef struct {
    Real vs, vn, w;
    Real stretched; /* vs, as it counts in the speed */
    Real a2, r0r1, S, Q, g, h; /* of a foot S alone, the speed r */
    Real fs, fn, couple;
} PartSliding;

static inline Real tangential(const Part *p, Real vs)
{
    return SELECT(vs > 0, p->mu_f, p->mu_b);
}

static inline Real stretch(const Part *p, Real vs)
{
    return SELECT(vs > 0, p->stretch_f, p->stretch_b);
}

/* (g - 1)/q: sum of q^j / (2 j + 3) below the limit of 0.1, where the closed form would cancel. */
static inline Real h_series(Real q)
{
    const Real q2 = q * q;
    Real even = ZERO + 1.0 / 31, odd = ZERO + 1.0 / 33; /* two sums, each half as long a chain of operations */
    even = even * q2 + 1.0 / 27, odd = odd * q2 + 1.0 / 29;
    even = even * q2 + 1.0 / 23, odd = odd * q2 + 1.0 / 25;
    even = even * q2 + 1.0 / 19, odd = odd * q2 + 1.0 / 21;
    even = even * q2 + 1.0 / 15, odd = odd * q2 + 1.0 / 17;
    even = even * q2 + 1.0 / 11, odd = odd * q2 + 1.0 / 13;
    even = even * q2 + 1.0 / 7, odd = odd * q2 + 1.0 / 9;
    even = even * q2 + 1.0 / 3, odd = odd * q2 + 1.0 / 5;
    return even + odd * q;
}

/* Fill in a2 to h from vs, vn, w. */
static inline void find_roots_of_part(PartSliding *k, const Part *p, Real delta)
{
    const double length = p->length;
    const Real vs = k->stretched = stretch(p, k->vs) * k->vs;
    if (!(length > 0)) {
        k->S = sqrt(vs * vs + k->vn * k->vn + delta * delta);
        return;
    }
    const Real a2 = vs * vs + delta * delta, half = 0.5 * length * k->w;
    const Real y0 = k->vn - half, y1 = k->vn + half;
    const Real r0 = sqrt(a2 + y0 * y0), r1 = sqrt(a2 + y1 * y1);
    const Real S = r0 + r1, r0r1 = r0 * r1, T = a2 + y0 * y1;
    k->a2 = a2, k->r0r1 = r0r1, k->S = S;
    /* a^2 / P; P = T + r0 r1 cancels where T < 0 */
    k->Q = SELECT(T < 0, r0r1 - T, a2) / SELECT(T < 0, 4.0 * half * half, r0r1 + T);
    const Real root_q = 2.0 * fabs(half) / S, q = root_q * root_q, one = 1.0 + root_q;
    k->h = h_series(q);
    if (ANY(q >= 0.1))
        k->h = SELECT(q >= 0.1, (0.5 * logarithm(one * one * k->Q * S * S / (2.0 * a2)) / root_q - 1.0) / q, k->h);
    k->g = 1.0 + q * k->h;
}

/* Friction on the part from a2 to h; its pressure multiplies it, here and below. */
static inline void find_force_of_part(PartSliding *k, const Part *p)
{
    const double length = p->length, l3 = length * length * length, mu_t = p->pressure * p->mu_t;
    const Real per_S = 1.0 / k->S, mu_s = p->pressure * tangential(p, k->vs);
    if (!(length > 0)) {
        k->fs = -mu_s * k->stretched / k->S, k->fn = -mu_t * k->vn / k->S, k->couple = ZERO;
        return;
    }
    k->fs = -mu_s * k->stretched * 2.0 * length * k->g * per_S;
    k->fn = -mu_t * 2.0 * k->vn * length * per_S;
    k->couple = -mu_t * k->w * l3 * per_S * (0.5 * k->Q - k->a2 * k->h * per_S * per_S);
}

/* Dissipation potential of the part: mu times the integral of r. */
static inline Real dissipation_of_part(const PartSliding *k, const Part *p)
{
    if (!(p->length > 0))
        return p->pressure * (p->mu_t * k->S);
    return p->pressure * (p->mu_t * p->length / k->S * (k->vn * k->vn + 0.25 * k->S * k->S + k->a2 * k->g));
}

/* Minus the derivative of (fs, fn, couple) with respect to (vs, vn, w); or, where `steep`, minus force over velocity with r frozen,
   the law of the paper's fixed point. */
static inline void find_slopes_of_part(const PartSliding *k, const Part *p, Real delta, bool steep, Matrix3 K)
{
    const double length = p->length, l3 = length * length * length, mu_t = p->pressure * p->mu_t;
    const Real vs = k->stretched, vn = k->vn, w = k->w, S = k->S, per_S = 1.0 / S;
    const Real mu_s = p->pressure * tangential(p, k->vs), more = stretch(p, k->vs);
    memset(K, 0, sizeof(Matrix3));
    if (!(length > 0)) {
        const Real es = steep ? ZERO : vs / S, en = steep ? ZERO : vn / S, ed = steep ? ZERO + 1.0 : delta / S;
        K[0][0] = more * mu_s * (en * en + ed * ed) / S, K[0][1] = -mu_s * es * en / S;
        K[1][0] = -more * mu_t * es * en / S, K[1][1] = mu_t * (es * es + ed * ed) / S;
    } else if (steep) {
        const Real I0 = 2.0 * length * k->g / S, I1 = -2.0 * vn * w * l3 * k->h / (S * S * S);
        const Real I2 = l3 / S * (0.5 * k->Q + (2.0 * vn * vn - k->a2) * k->h / (S * S));
        K[0][0] = more * mu_s * I0;
        K[1][1] = mu_t * I0, K[1][2] = K[2][1] = mu_t * I1, K[2][2] = mu_t * I2;
    } else {
        const Real per_r = 1.0 / k->r0r1, E = k->a2 + vn * vn;
        const Real a2J0 = length * S * k->Q * per_r, a2J1 = -vn * w * l3 * k->Q * per_r * per_S;
        const Real a2J2 = 2.0 * l3 * k->a2 * k->h * per_S * per_S * per_S + l3 * (E * k->Q - 0.5 * k->a2) * per_S * per_r;
        const Real y_r3 = 2.0 * vn * length * per_S * per_r;
        const Real sy_r3 = w * l3 * per_S * (2.0 * k->h * per_S * per_S + (k->Q - 0.5) * per_r);
        const Real along = a2J0 * (delta * delta / k->a2) + vn * y_r3 + w * sy_r3;
        K[0][0] = more * mu_s * along, K[0][1] = -mu_s * vs * y_r3, K[0][2] = -mu_s * vs * sy_r3;
        K[1][0] = -more * mu_t * vs * y_r3, K[1][1] = mu_t * a2J0, K[1][2] = mu_t * a2J1;
        K[2][0] = -more * mu_t * vs * sy_r3, K[2][1] = mu_t * a2J1, K[2][2] = mu_t * a2J2;
    }
}

/* Velocities of the link, then the friction on it; and all parts of the body. */
typedef struct {
    Real vs, vn, w;
    Real fs, fn, couple;
    PartSliding *part;
} Sliding;

/* Of a chain of n links, so many times over; or NULL. */
static inline Sliding *new_slidings(const int n, const int copies, const Law *law)
{
    const size_t links = (size_t)(copies * n), parts = (size_t)(copies * law->n_part);
    Sliding *k = malloc(links * sizeof *k + parts * sizeof *k->part);
    for (size_t i = 0; k && i < links; ++i)
        k[i].part = (PartSliding *)(k + links) + i / (size_t)n * (size_t)law->n_part;
    return k;
}

/* Velocities of the link's parts, and what the friction on them is expressed through. */
static inline void find_roots(Sliding *k, const Law *law, const Link *link, Real delta)
{
    for (int i = first_part(law, link->number); i < last_part(law, link->number); ++i) {
        const Part *f = &law->part[i];
        PartSliding *own = &k->part[i];
        const Real vs = k->vs - f->offset * k->w, vn = k->vn + f->along * k->w;
        own->vs = f->cos * vs + f->sin * vn, own->vn = f->cos * vn - f->sin * vs, own->w = k->w;
        find_roots_of_part(own, f, delta);
    }
}

static inline void find_force(Sliding *k, const Law *law, const Link *link)
{
    k->fs = k->fn = k->couple = ZERO;
    for (int i = first_part(law, link->number); i < last_part(law, link->number); ++i) {
        const Part *f = &law->part[i];
        PartSliding *own = &k->part[i];
        find_force_of_part(own, f);
        const Real fs = f->cos * own->fs - f->sin * own->fn, fn = f->sin * own->fs + f->cos * own->fn;
        k->fs += fs;
        k->fn += fn;
        k->couple += own->couple + f->along * fn - f->offset * fs;
    }
}

static inline Real dissipation(const Sliding *k, const Law *law, const Link *link)
{
    Real total = ZERO;
    for (int i = first_part(law, link->number); i < last_part(law, link->number); ++i)
        total += dissipation_of_part(&k->part[i], &law->part[i]);
    return total;
}

/* Slopes, or where `steep` secants, of the link's friction: the sum over its parts of turn' K turn, turn being the velocity of a
   part in its own directions per (vs, vn, w). */
static inline void find_slopes(const Sliding *k, const Law *law, const Link *link, Real delta, bool steep, Matrix3 total)
{
    memset(total, 0, sizeof(Matrix3));
    for (int i = first_part(law, link->number); i < last_part(law, link->number); ++i) {
        const Part *f = &law->part[i];
        const double turn[3][3] = {
            {f->cos, f->sin, f->along * f->sin - f->offset * f->cos},
            {-f->sin, f->cos, f->along * f->cos + f->offset * f->sin},
            {0.0, 0.0, 1.0}};
        Matrix3 K;
        find_slopes_of_part(&k->part[i], f, delta, steep, K);
        for (int p = 0; p < 3; ++p)
            for (int j = 0; j < 3; ++j) {
                const Real moved = K[p][0] * turn[0][j] + K[p][1] * turn[1][j] + K[p][2] * turn[2][j];
                for (int row = 0; row < 3; ++row)
                    total[row][j] += turn[p][row] * moved;
            }
    }
}
