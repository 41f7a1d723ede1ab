/* Joint torques of a chain with given momenta: each bears friction on all links ahead of the joint, less mass times acceleration of
   these: colloc/dynamics/chain.py. All seen from the midpoint of link 0; forces are over the weight. */

#pragma once

#include "momenta.h"

/* Of a link: acceleration seen from the centre of mass while link 0 turns evenly, with the turning in `couple`; or a force and a
   couple about its midpoint. */
typedef struct {
    double x, y, couple;
} Wrench;

/* Half a link's contribution to the acceleration of its neighbours' midpoint. */
static inline void add_half_acceleration(Wrench *a, const Link *link, double w, double turn)
{
    a->x -= 0.5 * link->length * (link->sin * turn + link->cos * w * w);
    a->y += 0.5 * link->length * (link->cos * turn - link->sin * w * w);
}

/* And its change, where the link changes by d and its turning by `more`. */
static inline void add_half_change(Wrench *a, const Link *link, double w, double turn, const Change *d, double more)
{
    const double c = link->cos, s = link->sin, swing = 2.0 * w * d->w;
    a->x -= 0.5 * link->length * (s * more + c * swing + (c * turn - s * w * w) * d->phi);
    a->y += 0.5 * link->length * (c * more - s * swing - (s * turn + c * w * w) * d->phi);
}

static inline void centre_accelerations(const int n, const Link *link, Wrench *a)
{
    double x = 0.0, y = 0.0;
    for (int i = 0; i < n; ++i)
        x += link[i].mass * a[i].x, y += link[i].mass * a[i].y;
    for (int i = 0; i < n; ++i)
        a[i].x -= x, a[i].y -= y;
}

static inline void find_accelerations(const int n, const Link *link, const Sliding *k, const double *joint, ptrdiff_t stride, Wrench *a)
{
    a[0] = (Wrench){0.0, 0.0, 0.0};
    for (int i = 1; i < n; ++i) {
        a[i] = a[i - 1];
        a[i].couple += joint[(i - 1) * stride];
        add_half_acceleration(&a[i], &link[i - 1], k[i - 1].w, a[i - 1].couple);
        add_half_acceleration(&a[i], &link[i], k[i].w, a[i].couple);
    }
    centre_accelerations(n, link, a);
}

/* Changes where links change by d, or (d is 0) the acceleration of a joint by 1. */
static inline void acceleration_changes(
    const int n, const Link *link, const Sliding *k, const Wrench *a, const Change *d, const int joint, Wrench *da)
{
    da[0] = (Wrench){0.0, 0.0, 0.0};
    for (int i = 1; i < n; ++i) {
        da[i] = da[i - 1];
        da[i].couple += joint == i - 1;
        add_half_change(&da[i], &link[i - 1], k[i - 1].w, a[i - 1].couple, &d[i - 1], da[i - 1].couple);
        add_half_change(&da[i], &link[i], k[i].w, a[i].couple, &d[i], da[i].couple);
    }
    centre_accelerations(n, link, da);
}

/* What joints bear of links: friction in `on`, which becomes friction less mass times acceleration; `gained` without the Froude
   number, and the angular acceleration times it, that the whole body takes. */
typedef struct {
    double fx, fy, gained, alpha;
} Whole;

static inline Whole subtract_inertia(
    const int n, const Link *link, const Centre *c, const double *spin, double froude, const Wrench *a, Wrench *on)
{
    Whole of = {0.0, 0.0, 0.0, 0.0};
    double moment = 0.0;
    for (int i = 0; i < n; ++i) {
        const double x = link[i].x - c->x, y = link[i].y - c->y;
        of.fx += on[i].x, of.fy += on[i].y;
        moment += x * on[i].y - y * on[i].x + on[i].couple;
        of.gained += link[i].mass * (x * a[i].y - y * a[i].x) + spin[i] * a[i].couple;
    }
    of.alpha = (moment - froude * of.gained) / c->inertia;
    for (int i = 0; i < n; ++i) {
        on[i].x -= link[i].mass * (of.fx + froude * a[i].x - of.alpha * (link[i].y - c->y));
        on[i].y -= link[i].mass * (of.fy + froude * a[i].y + of.alpha * (link[i].x - c->x));
        on[i].couple -= spin[i] * (of.alpha + froude * a[i].couple);
    }
    return of;
}

/* The change of that: of friction, `friction`, in `on`, to what joints bear; `more` of the Froude number. */
static inline void inertia_changes(
    const int n, const Link *link, const Centre *c, const double *spin, double froude, const Wrench *a, const Wrench *friction,
    const Whole *of, const Change *d, const Wrench *da, double more, Wrench *on)
{
    double cx = 0.0, cy = 0.0, fx = 0.0, fy = 0.0, moment = 0.0, gained = 0.0, inertia = 0.0;
    for (int i = 0; i < n; ++i)
        cx += link[i].mass * d[i].x, cy += link[i].mass * d[i].y;
    for (int i = 0; i < n; ++i) {
        const double x = link[i].x - c->x, y = link[i].y - c->y, dx = d[i].x - cx, dy = d[i].y - cy;
        fx += on[i].x, fy += on[i].y;
        moment += dx * friction[i].y - dy * friction[i].x + x * on[i].y - y * on[i].x + on[i].couple;
        gained += link[i].mass * (dx * a[i].y - dy * a[i].x + x * da[i].y - y * da[i].x) + spin[i] * da[i].couple;
        inertia += 2.0 * link[i].mass * (x * dx + y * dy);
    }
    const double alpha = (moment - froude * gained - more * of->gained - of->alpha * inertia) / c->inertia;
    for (int i = 0; i < n; ++i) {
        const double x = link[i].x - c->x, y = link[i].y - c->y, dx = d[i].x - cx, dy = d[i].y - cy;
        on[i].x -= link[i].mass * (fx + froude * da[i].x + more * a[i].x - alpha * y - of->alpha * dy);
        on[i].y -= link[i].mass * (fy + froude * da[i].y + more * a[i].y + alpha * x + of->alpha * dx);
        on[i].couple -= spin[i] * (alpha + froude * da[i].couple + more * a[i].couple);
    }
}

/* Torques of the joints, `stride` apart, that bear `on`; or their changes, where links change by d and `on` by `more`. */
static inline void find_torques(
    const int n, const Link *link, const Wrench *on, const Change *d, const Wrench *more, double *torque, ptrdiff_t stride)
{
    Wrench sum = {0.0, 0.0, 0.0}, change = {0.0, 0.0, 0.0};
    for (int i = n - 1; i > 0; --i) {
        const double hx = 0.5 * link[i].length * link[i].cos, hy = 0.5 * link[i].length * link[i].sin;
        const double x = link[i].x, y = link[i].y, jx = x - hx, jy = y - hy;
        sum.x += on[i].x, sum.y += on[i].y, sum.couple += x * on[i].y - y * on[i].x + on[i].couple;
        torque[(i - 1) * stride] = -(sum.couple - jx * sum.y + jy * sum.x);
        if (!d)
            continue;
        change.x += more[i].x, change.y += more[i].y;
        change.couple += d[i].x * on[i].y - d[i].y * on[i].x + x * more[i].y - y * more[i].x + more[i].couple;
        const double djx = d[i].x + hy * d[i].phi, djy = d[i].y - hx * d[i].phi;
        torque[(i - 1) * stride] = -(change.couple - djx * sum.y + djy * sum.x - jx * change.y + jy * change.x);
    }
}

/* At momenta `states` (3, n_time) and joint accelerations (n - 1, n_time): torques (n - 1, n_time); and, unless `slopes` is NULL, their
   derivatives (n - 1, 3 n + 1, n_time) with respect to angles, rates, accelerations, states and the Froude number. */
static inline void torques_at_instants(
    Played *b, ptrdiff_t first, ptrdiff_t last, const double *spin, double froude, const double *states, const double *accelerations,
    Wrench *room, double *torques, double *slopes)
{
    const int n = b->n, n_joint = n - 1, columns = 3 * n_joint + 4;
    const ptrdiff_t n_time = b->n_time;
    const double delta = fmin(fmax(b->delta, DRY), VISCOUS);
    Wrench *const a = room, *const friction = room + n, *const on = room + 2 * n, *const da = room + 3 * n, *const more = room + 4 * n;
    for (ptrdiff_t t = first; t < last; ++t) {
        const Vector3 p = {states[t], states[n_time + t], states[2 * n_time + t]};
        double value[MOMENTA_ROWS];
        find_instant(b, t, 1.0, NULL);
        find_midpoints(n, b->link, 0);
        const Centre centre = find_centre(n, b->link, spin);
        const Total total = find_momentum_rates(n, b->link, b->k, &centre, spin, p, &b->law, delta, froude, value);
        find_accelerations(n, b->link, b->k, accelerations + t, n_time, a);
        for (int i = 0; i < n; ++i) {
            double f[2];
            outer_force(&b->link[i], &b->k[i], f);
            on[i] = friction[i] = (Wrench){f[0], f[1], b->k[i].couple};
        }
        const Whole of = subtract_inertia(n, b->link, &centre, spin, froude, a, on);
        find_torques(n, b->link, on, NULL, NULL, torques + t, n_time);
        if (!slopes)
            continue;
        for (int i = 0; i < n; ++i)
            find_slopes(&b->k[i], &b->law, &b->link[i], delta, false, b->K[i]);
        for (int column = 0; column < columns; ++column) {
            const int kind = column / n_joint, joint = column % n_joint, state = column - 3 * n_joint;
            Vector3 dp = {0.0, 0.0, 0.0};
            memset(b->d, 0, (size_t)n * sizeof *b->d);
            if (kind < 2)
                find_changes(n, b->link, b->k, 0, joint, kind == 1, b->d);
            else if (state >= 0 && state < 3)
                dp[state] = 1.0;
            if (kind < 2 || (state >= 0 && state < 3)) /* else the motion stays */
                momentum_rate_changes(n, b->link, b->k, b->K, &centre, spin, p, total.force, froude, b->d, dp, value);
            for (int i = 0; i < n; ++i) {
                Vector3 df;
                const double c = b->link[i].cos, s = b->link[i].sin, phi = b->d[i].phi;
                force_change(b->K[i], &b->d[i], df);
                more[i].x = df[0] * c - df[1] * s - phi * friction[i].y;
                more[i].y = df[0] * s + df[1] * c + phi * friction[i].x;
                more[i].couple = df[2];
            }
            acceleration_changes(n, b->link, b->k, a, b->d, state < 0 && kind == 2 ? joint : -1, da);
            inertia_changes(n, b->link, &centre, spin, froude, a, friction, &of, b->d, da, state == 3, more);
            find_torques(n, b->link, on, b->d, more, slopes + column * n_time + t, columns * n_time);
        }
    }
}
