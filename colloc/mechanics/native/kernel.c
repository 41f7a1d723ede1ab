/* What the library offers: chains in balance, instant by instant, as colloc/mechanics/fixed_point.py finds them
   for batches in NumPy.

   Arrays are (rows, n_time), row by row; a call treats the instants from `first` to `last`, so that threads share a batch.
   An instant's answer depends on nothing but its own data. */

#include <stdlib.h>

#include "contacts.h"
#include "repeating.h"
#include "torques.h"

#ifdef COLLOC_SOURCES
#define TEXT_OF(name) #name
#define TEXT(name) TEXT_OF(name)
/* What these sources were when they were built: whoever has changed them since does not use the library. */
const char colloc_sources[] = TEXT(COLLOC_SOURCES);
#endif

/* A chain of n links at n_time instants, of which a call treats those from `first` to `last`. */
#define CHAIN \
    int n, const double *length, const double *mass, const double *law_numbers, ptrdiff_t n_time, ptrdiff_t first, ptrdiff_t last, \
        const double *angles, const double *rates, double delta
#define PLAYED \
    {.n = n, .length = length, .mass = mass, .law = law_of(law_numbers), .n_time = n_time, .angles = angles, .rates = rates, .delta = delta}

/* The largest rate, the unit of time of an instant; or delta, if it is larger: under a load the body creeps at that speed, though
   its joints rest. And delta in that unit. */
static inline double unit_of(const Played *b, ptrdiff_t t, const double *load, double *scaled_delta)
{
    double speed = load ? b->delta : 0.0;
    for (int j = 0; j < b->n - 1; ++j)
        speed = fmax(speed, fabs(b->rates[j * b->n_time + t]));
    speed = speed > 0 ? speed : 1.0;
    *scaled_delta = fmin(fmax(b->delta / speed, DRY), VISCOUS);
    return speed;
}

/* Unless `ready`, 1: no memory. */
static int done(Played *b, bool ready)
{
    free_room(b);
    return ready ? 0 : 1;
}

/* Velocity of the tail that balances instant t, from that of `start` (3, n_time) or from rest (NULL), and the state there. */
static void balance_instant(
    const Played *b, State *s, ptrdiff_t t, const double *load, const double *start, double tolerance, long long budget, int method,
    Vector3 tail)
{
    double own_delta;
    const double speed = unit_of(b, t, load, &own_delta);
    find_instant(b, t, speed, load);
    s->anchor = b->n / 2;
    s->iterations = 0;
    memset(s->velocity, 0, sizeof s->velocity);
    if (start) {
        for (int i = 0; i < 3; ++i)
            tail[i] = start[i * b->n_time + t] / speed;
        find_velocities_from_tail(b->n, s->link, s->now, tail);
        link_velocity(&s->link[s->anchor], &s->now[s->anchor], s->velocity);
    }
    solve(b->n, s, own_delta, tolerance, budget, method);
    find_velocities(b->n, s->link, s->now, s->anchor, s->velocity);
    tail_velocity(s->link, s->now, tail);
    for (int i = 0; i < 3; ++i)
        tail[i] *= speed, s->velocity[i] *= speed;
}

/* Velocities in balance, from `start` (3, n_time) or from rest (NULL), under `load` (2, n_time) or none. */
int colloc_balance(
    CHAIN, const double *load, const double *start, double tolerance, long long budget, int method, double *z, double *residual,
    long long *iterations, long long *anchor, double *anchor_velocity)
{
    Played played = PLAYED;
    const bool ready = new_room(&played);
    State s = {.law = played.law, .link = played.link, .now = played.k, .trial = played.k + n, .K = played.K};
    for (ptrdiff_t t = first; t < last && ready; ++t) {
        Vector3 tail;
        balance_instant(&played, &s, t, load, start, tolerance, budget, method, tail);
        for (int i = 0; i < 3; ++i) {
            z[i * n_time + t] = tail[i];
            anchor_velocity[i * n_time + t] = s.velocity[i];
        }
        residual[t] = s.residual;
        iterations[t] = s.iterations;
        anchor[t] = s.anchor;
    }
    return done(&played, ready);
}

/* Rows of `find_values`, (ROWS, n_time), for chains whose anchors move as given; and, unless `slopes` is NULL, the
   derivatives of the first of them with respect to joint angles and rates, and to the load if there is one,
   (DIFFERENTIATED_ROWS, 2 (n - 1) (+ 2), n_time). */
int colloc_motion(
    CHAIN, const double *load, const long long *anchor, const double *anchor_velocity, double *values, double *slopes)
{
    Played b = PLAYED;
    const bool ready = new_room(&b);
    const int n_joint = n - 1, columns = 2 * n_joint + (load ? 2 : 0);
    for (ptrdiff_t t = first; t < last && ready; ++t) {
        double own_delta, value[ROWS], change[DIFFERENTIATED_ROWS];
        const double speed = unit_of(&b, t, load, &own_delta);
        const int a = (int)anchor[t];
        Vector3 z, net, dz;
        for (int i = 0; i < 3; ++i)
            z[i] = anchor_velocity[i * n_time + t] / speed;
        find_instant(&b, t, speed, load);
        find_midpoints(n, b.link, a);
        evaluate(n, b.link, b.k, a, z, &b.law, own_delta);
        find_values(n, b.link, b.k, value);
        for (int row = 0; row < ROWS; ++row)
            values[row * n_time + t] = value[row] * speed;
        if (!slopes)
            continue;
        Matrix3 left;
        pull_back(n, b.link, b.k, &b.law, own_delta, true, b.K, left);
        for (int column = 0; column < columns; ++column) {
            const bool of_load = column >= 2 * n_joint, of_rate = column >= n_joint && !of_load;
            if (of_load)
                load_change(n, b.link, column - 2 * n_joint, b.d, net);
            else {
                find_changes(n, b.link, b.k, a, of_rate ? column - n_joint : column, of_rate, b.d);
                net_change(n, b.link, b.k, b.K, b.d, net);
            }
            solve3(left, net, 0.0, dz);
            follow(n, b.link, b.d, dz);
            value_changes(n, b.link, b.k, b.K, b.d, change);
            for (int row = 0; row < DIFFERENTIATED_ROWS; ++row)
                slopes[(row * columns + column) * n_time + t] = of_rate ? change[row] : change[row] * speed;
        }
    }
    return done(&b, ready);
}

/* Of chains with momenta `states` (3, n_time) and moments of inertia `spin` of the links: rows (MOMENTA_ROWS, n_time), and their
   derivatives (MOMENTA_ROWS, columns, n_time) with respect to the states alone, 3 columns, or to joint angles, rates and states,
   2 (n - 1) + 3. */
int colloc_momenta(
    CHAIN, const double *spin, double froude, const double *states, int columns, double *values, double *slopes)
{
    Played played = PLAYED;
    const bool ready = new_room(&played);
    if (ready)
        momenta_instants(&played, first, last, spin, froude, states, columns, values, slopes);
    return done(&played, ready);
}

/* Joint torques there at such joint accelerations (torques.h). */
int colloc_torques(
    CHAIN, const double *spin, double froude, const double *states, const double *accelerations, double *torques, double *slopes)
{
    Played played = PLAYED;
    Wrench *room = malloc(5 * (size_t)n * sizeof *room);
    const bool ready = new_room(&played) && room;
    if (ready)
        torques_at_instants(&played, first, last, spin, froude, states, accelerations, room, torques, slopes);
    free(room);
    return done(&played, ready);
}

/* Momenta that repeat (repeating.h), on `intervals` of s stages each, in order of the stages: from `states` (3, n_time) and
   their start (3), which become those that are found, with their rows (MOMENTA_ROWS, n_time). `held` says whether there are
   any. */
int colloc_repeating(
    CHAIN, const double *spin, double froude, ptrdiff_t intervals, int s, const double *A, const double *b, const double *image,
    double *states, double *start, double *values, int *held)
{
    Played played = PLAYED;
    Periods q = {.played = &played, .spin = spin, .froude = froude, .intervals = intervals, .s = s, .A = A, .b = b, .image = image};
    const bool ready = new_room(&played) && new_periods(&q);
    const size_t all = MOMENTA * (size_t)n_time;
    (void)first, (void)last;
    if (ready) {
        memcpy(q.x, states, all * sizeof *states);
        memcpy(q.x + all, start, MOMENTA * sizeof *start);
        *held = repeats(&q, q.x);
        memcpy(states, q.x, all * sizeof *states);
        memcpy(start, q.x + all, MOMENTA * sizeof *start);
        memcpy(values, q.values, MOMENTA_ROWS * (size_t)n_time * sizeof *values);
    }
    free_periods(&q);
    return done(&played, ready);
}

/* Functions of shapes (contacts.h), each instance of one, `which`, that begins at `first` in `numbers`, at a column of `shapes`
   (n_joint, n_column), `column`, with `shares` (n) as there: values (n), and their slopes (n_joint, n) unless NULL. */
int colloc_shape_functions(
    int n_joint, ptrdiff_t n, const double *numbers, const long long *first, const long long *which, const long long *column,
    ptrdiff_t n_column, const double *shapes, double *shares, double *values, double *slopes)
{
    double *shape = malloc(2 * (size_t)n_joint * sizeof *shape);
    for (ptrdiff_t i = 0; i < n && shape; ++i) {
        for (int j = 0; j < n_joint; ++j)
            shape[j] = shapes[j * n_column + column[i]];
        values[i] = shape_function(n_joint, numbers + first[which[i]], shape, shares + i, slopes ? shape + n_joint : NULL);
        for (int j = 0; slopes && j < n_joint; ++j)
            slopes[j * n + i] = shape[n_joint + j];
    }
    free(shape);
    return shape ? 0 : 1;
}

/* An instant that the lanes lost, from where they began: more slowly and surely. */
static bool rescue(const Played *b, State *s, ptrdiff_t t, const double *start, double tolerance, double tail[3])
{
    balance_instant(b, s, t, NULL, start, tolerance, 2000, AUTO, tail);
    return s->residual <= tolerance;
}

#include "pose.h"
#include "sqp.h"

/* `colloc_period_N` and `colloc_period_vjp_N` of period.h with N instants side by side, as many as the processor's registers hold. */
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__)
#pragma GCC push_options
#pragma GCC target("avx512f")
#define LANES 8
#include "lanes.h"
#pragma GCC pop_options
#undef LANES
#pragma GCC push_options
#pragma GCC target("avx2")
#define LANES 4
#include "lanes.h"
#pragma GCC pop_options
#undef LANES
#define WITH_WIDEST(name) (WIDEST == 8 ? name##_8 : WIDEST == 4 ? name##_4 : name##_2)
#define WIDEST (__builtin_cpu_supports("avx512f") ? 8 : __builtin_cpu_supports("avx2") ? 4 : 2)
#else
#define WITH_WIDEST(name) name##_2
#define WIDEST 2
#endif
#define LANES 2
#include "lanes.h"

static Period *widest_period(void)
{
    return WITH_WIDEST(colloc_period);
}

static PeriodVjp *widest_period_vjp(void)
{
    return WITH_WIDEST(colloc_period_vjp);
}

/* The N that suits this processor; the numbers are the same with any. */
int colloc_lanes(void)
{
    return WIDEST;
}
