/* Sequential quadratic programming over gaits that are linear in their parameters, in slow motion on level ground: what `minimize` of
   colloc/numerics/sqp.py does with a program of colloc/reduced/program.py, in one call. */

#pragma once

#include "contacts.h"
#include "pose.h"
#include "quadratic.h"

#define NOWHERE 1e3 /* objective where the balance cannot be solved */
#define MOST_TRIALS 12
#define DAMPING 0.2 /* least curvature along a step, as a share of the model's (Powell, 1978) */
#define FEASIBLE 1e-10
#define VELOCITY_TOLERANCE 3e-14
#define FOLLOW_STEPS 4 /* of Newton's method to a worst instant; sampling and largest step as parts of a cell */
#define FOLLOW_SAMPLING 1e-3
#define FOLLOW_LARGEST 0.1
#define DEEPEST 32 /* of a formula */

enum { DISTANCE_OF, WORK_OF, ROTATION_OF, QUANTITIES };
enum { CONSTANT, VARIABLE, NEGATIVE, PLUS, MINUS, TIMES, OVER, POWER_OF };

/* Of colloc/reduced/compiled_search.py, which states the same fields in the same order. Rows are formulas of the totals, shape
   constraints, the square of the shape speed, and then that of the area if gaits are to be near `target` (n). */
typedef struct {
    const double *length, *mass, *law, *A, *b, *h, *matrix, *offset, *side, *side_rates, *square, *area, *formulas;
    const double *shape_numbers, *functions, *basis, *left, *width, *instants, *watched_low, *watched_high;
    const double *row_low, *row_high, *low, *high, *target, *shares;
    const long long *points, *shape_first, *which, *basis_first, *basis_column, *moving;
    double turn, delta, chord, repeats, radius, accuracy;
    long long n_link, n_time, n_interval, n_stage, n, n_formula, n_shape_row, n_function, n_moving, n_shape, n_side, antipodal, iterations;
} Search;

/* `colloc_period` and its adjoint, of period.h, with as many instants side by side as suit the processor. */
typedef int Period(
    CHAIN, MESH, const double *start_angles, const double *start_rates, double start_delta, const double *start, double tolerance, double *z,
    double *out, double *totals, long long *lost);
typedef int PeriodVjp(CHAIN, MESH, const double *z, const double *out, int count, const double *on, double *on_shape, double *on_pace);
static Period *widest_period(void);
static PeriodVjp *widest_period_vjp(void);

/* A gait and its motion. */
typedef struct {
    double *v, *angles, *rates, *pace, *z, *out, *functions, *rows, *outside;
    double totals[TOTALS], quantity[QUANTITIES], objective;
} Point;

static size_t point_size(const Search *s, size_t n_row)
{
    return (size_t)(s->n + (2 * (s->n_link - 1) + 1 + 3 + OUTPUTS) * s->n_time + s->n_function * s->n_shape_row) + 2 * n_row;
}

static void new_point(const Search *s, size_t n_row, Point *p, double *memory)
{
    const size_t of_shapes = (size_t)((s->n_link - 1) * s->n_time);
    p->v = memory, p->angles = p->v + s->n, p->rates = p->angles + of_shapes, p->pace = p->rates + of_shapes;
    p->z = p->pace + s->n_time, p->out = p->z + 3 * s->n_time, p->functions = p->out + OUTPUTS * s->n_time;
    p->rows = p->functions + s->n_function * s->n_shape_row, p->outside = p->rows + n_row;
}

/* Value and slopes along the quantities of a formula: the number of its operations, then an operation and a number each. */
static const double *formula_value(const double *formula, const double quantity[QUANTITIES], double *value, double slope[QUANTITIES])
{
    double stack[DEEPEST][1 + QUANTITIES];
    int top = -1;
    const double *end = formula + 1 + 2 * (int)formula[0];
    for (const double *at = formula + 1; at < end; at += 2) {
        const int operation = (int)at[0];
        if (operation == CONSTANT || operation == VARIABLE) {
            memset(stack[++top], 0, sizeof stack[top]);
            stack[top][0] = operation == CONSTANT ? at[1] : quantity[(int)at[1]];
            if (operation == VARIABLE)
                stack[top][1 + (int)at[1]] = 1.0;
            continue;
        }
        if (operation == NEGATIVE) {
            for (int k = 0; k <= QUANTITIES; ++k)
                stack[top][k] = -stack[top][k];
            continue;
        }
        if (operation == POWER_OF) {
            const double x = stack[top][0];
            stack[top][0] = pow(x, at[1]);
            for (int k = 1; k <= QUANTITIES; ++k)
                stack[top][k] *= at[1] * pow(x, at[1] - 1.0);
            continue;
        }
        double *x = stack[top - 1], *y = stack[top];
        --top;
        for (int k = 1; k <= QUANTITIES; ++k)
            x[k] = operation == PLUS ? x[k] + y[k] :
                operation == MINUS   ? x[k] - y[k] :
                operation == TIMES   ? x[k] * y[0] + x[0] * y[k] :
                                       x[k] / y[0] - x[0] * y[k] / (y[0] * y[0]);
        x[0] = operation == PLUS ? x[0] + y[0] : operation == MINUS ? x[0] - y[0] : operation == TIMES ? x[0] * y[0] : x[0] / y[0];
    }
    *value = stack[0][0];
    memcpy(slope, stack[0] + 1, QUANTITIES * sizeof *slope);
    return end;
}

/* Totals of a whole period, and their slopes along those of the solved part. */
static void find_quantities(const Search *s, const double totals[TOTALS], double quantity[QUANTITIES], double slope[QUANTITIES][TOTALS])
{
    const double x = totals[SIDE_X], y = totals[SIDE_Y], half = s->antipodal ? 0.5 * totals[ROTATION] : atan2(y, x);
    double c, d;
    find_direction(half, &c, &d);
    const double along = x * c + y * d, sign = along < 0.0 ? -1.0 : 1.0; /* it may travel either way along its axis */
    quantity[DISTANCE_OF] = s->chord * sign * along;
    quantity[WORK_OF] = s->repeats * totals[WORK];
    quantity[ROTATION_OF] = totals[ROTATION] + s->turn;
    memset(slope, 0, QUANTITIES * sizeof slope[0]);
    slope[DISTANCE_OF][SIDE_X] = s->chord * sign * c, slope[DISTANCE_OF][SIDE_Y] = s->chord * sign * d;
    slope[DISTANCE_OF][ROTATION] = s->antipodal ? 0.5 * s->chord * sign * (y * c - x * d) : 0.0;
    slope[WORK_OF][WORK] = s->repeats, slope[ROTATION_OF][ROTATION] = 1.0;
}

static double quadratic_form(int n, const double *Q, const double *v)
{
    double sum = 0.0;
    for (int i = 0; i < n; ++i)
        sum += v[i] * dot(n, Q + i * n, v);
    return sum;
}

/* Square of the shape speed, and its slopes unless NULL. */
static double square_of_speed(const Search *s, const double *v, double *slope)
{
    const int n = (int)s->n, n_joint = (int)s->n_link - 1;
    if (!s->n_side) {
        for (int i = 0; slope && i < n; ++i)
            slope[i] = 2.0 * dot(n, s->square + i * n, v);
        return quadratic_form(n, s->square, v);
    }
    double mean = 0.0, rate[n_joint];
    if (slope)
        memset(slope, 0, (size_t)n * sizeof *slope);
    for (int k = 0; k < s->n_side; ++k) {
        for (int j = 0; j < n_joint; ++j)
            rate[j] = dot(n, s->side_rates + (k * n_joint + j) * n, v);
        const double speed = sqrt(dot(n_joint, rate, rate));
        mean += s->side[k] * speed;
        for (int j = 0; slope && j < n_joint; ++j)
            for (int i = 0; i < n; ++i)
                slope[i] += s->side[k] * rate[j] / speed * s->side_rates[(k * n_joint + j) * n + i];
    }
    for (int i = 0; slope && i < n; ++i)
        slope[i] *= 2.0 * mean;
    return mean * mean;
}

/* Functions of a Fourier series at an instant, or their derivatives: 1, cos 1, sin 1, cos 2, ... */
static void fourier_functions(int n_function, double t, bool derivative, double *function)
{
    function[0] = !derivative;
    for (int k = 1; 2 * k < n_function; ++k) {
        const double rate = 2 * 3.14159265358979323846 * k;
        double c, s;
        find_direction(rate * t, &c, &s);
        function[2 * k - 1] = derivative ? -rate * s : c;
        function[2 * k] = derivative ? rate * c : s;
    }
}

/* The shape, or the rates, of which a row is a function. */
static void row_shape(const Search *s, const double *table, long long which, const double *function, double *shape)
{
    for (int j = 0; j < s->n_link - 1; ++j)
        shape[j] = dot((int)s->n_function, table + j * s->n_function, function) + (which < s->n_shape ? s->offset[j] : 0.0);
}

static double row_value(const Search *s, const double *table, long long row, const double *function, double *slopes)
{
    const int n_joint = (int)s->n_link - 1;
    double shape[n_joint], share = s->shares[row];
    row_shape(s, table, s->which[row], function, shape);
    return shape_function(n_joint, s->shape_numbers + s->shape_first[s->which[row]], shape, &share, slopes);
}

/* Functions of a row at its worst instant in its cell, by Newton's method from that of the gait at which rows were placed. */
static void follow_worst(const Search *s, const double *table, int number, double *function)
{
    const long long row = s->moving[number];
    const bool derivative = s->which[row] >= s->n_shape;
    const double left = s->left[number], width = s->width[number], step = FOLLOW_SAMPLING * width, most = FOLLOW_LARGEST * width;
    double t = s->instants[number], height[3], sign = 1.0;
    for (int count = 0; count < FOLLOW_STEPS; ++count) {
        for (int k = 0; k < 3; ++k) {
            fourier_functions((int)s->n_function, t + (k - 1) * step, derivative, function);
            height[k] = row_value(s, table, row, function, NULL);
        }
        if (!count)
            sign = height[1] - s->watched_low[number] < s->watched_high[number] - height[1] ? -1.0 : 1.0;
        const double bend = sign * (height[0] - 2.0 * height[1] + height[2]);
        const double move = bend < 0.0 ? 0.5 * sign * (height[0] - height[2]) / bend * step : 0.0, before = t;
        t = fmin(fmax(t + fmin(fmax(move, -most), most), left + step), left + width - step);
        if (!(fabs(t - before) >= FOLLOW_SAMPLING * step))
            break;
    }
    fourier_functions((int)s->n_function, t, derivative, function);
}

/* Room of a call, besides its points. */
typedef struct {
    double *table, *slopes, *gradient, *row_slopes, *on, *on_shape, *on_pace, *B, *change, *d, *on_rows, *wide;
    ActiveSet active;
} Work;

static void find_table(const Search *s, const double *v, double *table)
{
    for (long long i = 0; i < (s->n_link - 1) * s->n_function; ++i) {
        table[i] = 0.0;
        for (long long k = s->basis_first[i]; k < s->basis_first[i + 1]; ++k)
            table[i] += s->basis[k] * v[s->basis_column[k]];
    }
}

/* Evaluate a point whose v is given, its motion begun from another one. */
static void evaluate_point(
    const Search *s, Work *w, const double *angles, const double *rates, double from_delta, const double *z, Point *p)
{
    const int n = (int)s->n, n_joint = (int)s->n_link - 1;
    const ptrdiff_t n_time = s->n_time;
    const double *formula = s->formulas;
    double slope[QUANTITIES], by_totals[QUANTITIES][TOTALS], *row = p->rows;
    long long lost;
    for (ptrdiff_t t = 0; t < n_time; ++t) {
        double square = 0.0;
        for (int j = 0; j < n_joint; ++j) {
            const double rate = dot(n, s->matrix + (t * 2 * n_joint + n_joint + j) * n, p->v);
            p->angles[j * n_time + t] = dot(n, s->matrix + (t * 2 * n_joint + j) * n, p->v) + s->offset[j];
            p->rates[j * n_time + t] = rate, square += rate * rate;
        }
        p->pace[t] = s->n_side ? sqrt(square) : 1.0;
        for (int j = 0; j < n_joint && s->n_side; ++j)
            p->rates[j * n_time + t] /= p->pace[t];
    }
    const int no_memory = widest_period()(
        (int)s->n_link, s->length, s->mass, s->law, n_time, 0, n_time, p->angles, p->rates, s->delta, s->n_interval, (int)s->n_stage, s->A,
        s->b, s->h, s->points, s->turn, p->pace, angles, rates, from_delta, z, VELOCITY_TOLERANCE, p->z, p->out, p->totals,
        &lost);
    find_quantities(s, p->totals, p->quantity, by_totals);
    formula = formula_value(formula, p->quantity, &p->objective, slope);
    p->objective = -p->objective;
    for (int k = 1; k < s->n_formula; ++k)
        formula = formula_value(formula, p->quantity, row++, slope);
    find_table(s, p->v, w->table);
    if (s->n_moving)
        memcpy(p->functions, s->functions, (size_t)(s->n_function * s->n_shape_row) * sizeof *p->functions);
    for (int k = 0; k < s->n_moving; ++k)
        follow_worst(s, w->table, k, p->functions + s->moving[k] * s->n_function);
    const double *functions = s->n_moving ? p->functions : s->functions;
    for (long long k = 0; k < s->n_shape_row; ++k)
        *row++ = row_value(s, w->table, k, functions + k * s->n_function, NULL);
    *row++ = square_of_speed(s, p->v, NULL);
    if (s->target) {
        *row++ = quadratic_form(n, s->area, p->v);
        p->objective = 0.0;
        for (int i = 0; i < n; ++i)
            p->objective += 0.5 * (p->v[i] - s->target[i]) * (p->v[i] - s->target[i]);
    }
    lost += no_memory;
    if (lost || !isfinite(p->objective))
        p->objective = NOWHERE;
    for (int k = 0; k < row - p->rows; ++k) {
        if (!isfinite(p->rows[k]) || (lost && k < s->n_formula - 1))
            p->rows[k] = NOWHERE;
        p->outside[k] = fmax(fmax(s->row_low[k] - p->rows[k], p->rows[k] - s->row_high[k]), 0.0);
    }
}

/* Gradient of the objective and slopes of the rows at an evaluated point. */
static void differentiate(const Search *s, Work *w, const Point *p)
{
    const int n = (int)s->n, n_joint = (int)s->n_link - 1, columns = 2 * n_joint, first = s->target ? 1 : 0;
    const int count = (int)s->n_formula - first;
    const ptrdiff_t n_time = s->n_time;
    const double *formula = s->formulas;
    double value, by_totals[QUANTITIES][TOTALS], quantity[QUANTITIES], slope[QUANTITIES], on_shape[n_joint];
    find_quantities(s, p->totals, quantity, by_totals);
    for (int k = 0; k < s->n_formula; ++k) {
        formula = formula_value(formula, quantity, &value, slope);
        for (int i = 0; i < TOTALS && k >= first; ++i) {
            double *on = w->on + (k - first) * TOTALS + i;
            *on = 0.0;
            for (int each = 0; each < QUANTITIES; ++each)
                *on += slope[each] * by_totals[each][i];
        }
    }
    const int no_memory = count &&
        widest_period_vjp()(
            (int)s->n_link, s->length, s->mass, s->law, n_time, 0, n_time, p->angles, p->rates, s->delta, s->n_interval, (int)s->n_stage,
            s->A, s->b, s->h, s->points, s->turn, p->pace, p->z, p->out, count, w->on, w->on_shape, w->on_pace);
    if (no_memory) /* no step from here */
        w->on_shape[0] = NAN;
    if (s->target)
        for (int i = 0; i < n; ++i)
            w->gradient[i] = p->v[i] - s->target[i];
    for (int k = 0; k < count; ++k) {
        double *to = k + first ? w->row_slopes + (k + first - 1) * n : w->gradient;
        memset(to, 0, (size_t)n * sizeof *to);
        for (ptrdiff_t t = 0; t < n_time; ++t) {
            double *on = w->on_shape + (k * n_time + t) * columns, along = 0.0;
            for (int j = 0; j < n_joint && s->n_side; ++j)
                along += on[n_joint + j] * p->rates[j * n_time + t];
            for (int j = 0; j < n_joint && s->n_side; ++j) {
                const double unit = p->rates[j * n_time + t];
                on[n_joint + j] = (on[n_joint + j] - along * unit) / p->pace[t] + w->on_pace[k * n_time + t] * unit;
            }
            for (int j = 0; j < columns; ++j)
                for (int i = 0; i < n; ++i)
                    to[i] += on[j] * s->matrix[(t * columns + j) * n + i];
        }
        if (!(k + first))
            for (int i = 0; i < n; ++i)
                to[i] = -to[i];
    }
    double *to = w->row_slopes + (s->n_formula - 1) * n;
    const double *functions = s->n_moving ? p->functions : s->functions;
    find_table(s, p->v, w->table);
    for (long long k = 0; k < s->n_shape_row; ++k, to += n) {
        const double *function = functions + k * s->n_function;
        row_value(s, w->table, k, function, on_shape);
        memset(to, 0, (size_t)n * sizeof *to);
        for (int j = 0; j < n_joint; ++j)
            for (int i = 0; i < s->n_function && on_shape[j] != 0.0; ++i) {
                const long long at = j * s->n_function + i;
                for (long long c = s->basis_first[at]; c < s->basis_first[at + 1]; ++c)
                    to[s->basis_column[c]] += on_shape[j] * function[i] * s->basis[c];
            }
    }
    square_of_speed(s, p->v, to);
    for (int i = 0; i < n && s->target; ++i)
        to[n + i] = 2.0 * dot(n, s->area + i * n, p->v);
}

/* The step d from p, multipliers of the rows, and in `share` the share of the violations it removes: where rows contradict each
   other, a part. False if there is none. */
static bool quadratic_step(const Search *s, Work *w, const Point *p, int m, const double *low, const double *high, double *share)
{
    const int n = (int)s->n;
    double row_low[m], row_high[m], least[n + 1], most[n + 1], gradient[n + 1];
    if (!all_finite(n, w->gradient) || !all_finite(m * n, w->row_slopes) || !all_finite(n * n, w->B))
        return false;
    for (int k = 0; k < m; ++k)
        row_low[k] = s->row_low[k] - p->rows[k], row_high[k] = s->row_high[k] - p->rows[k];
    for (int i = 0; i < n; ++i)
        least[i] = low[i] - p->v[i], most[i] = high[i] - p->v[i], gradient[i] = w->gradient[i];
    Quadratic exact = {n, m, w->B, gradient, w->row_slopes, row_low, row_high, least, most};
    *share = 1.0;
    if (quadratic_minimum(&exact, &w->active, w->d, w->on_rows))
        return true;
    const int wide = n + 1;
    double *B = w->wide, *A = B + wide * wide;
    memset(B, 0, (size_t)(wide * wide) * sizeof *B);
    for (int i = 0; i < n; ++i)
        memcpy(B + i * wide, w->B + i * n, (size_t)n * sizeof *B);
    B[wide * wide - 1] = UNMET, gradient[n] = 0.0, least[n] = 0.0, most[n] = 1.0;
    for (int k = 0; k < m; ++k) {
        memcpy(A + k * wide, w->row_slopes + k * n, (size_t)n * sizeof *A);
        A[k * wide + n] = row_low[k] > 0.0 ? row_low[k] : row_high[k] < 0.0 ? row_high[k] : 0.0;
    }
    Quadratic relaxed = {wide, m, B, gradient, A, row_low, row_high, least, most};
    const bool done = quadratic_minimum(&relaxed, &w->active, w->d, w->on_rows);
    *share = 1.0 - w->d[n];
    return done;
}

/* Damped update of the model of the Lagrangian's second derivatives. */
static void update_curvature(int n, double *B, const double *step, const double *turn, double *Bs)
{
    for (int i = 0; i < n; ++i)
        Bs[i] = dot(n, B + i * n, step);
    const double sBs = dot(n, step, Bs), sy = dot(n, step, turn);
    if (!isfinite(sy) || sBs <= 0.0)
        return;
    const double share = sy < DAMPING * sBs ? (1.0 - DAMPING) * sBs / (sBs - sy) : 1.0;
    const double along = share * sy + (1.0 - share) * sBs;
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
            const double a = share * turn[i] + (1.0 - share) * Bs[i], b = share * turn[j] + (1.0 - share) * Bs[j];
            B[i * n + j] += a * b / along - Bs[i] * Bs[j] / sBs;
        }
}

/* From v (n) with a motion z (3, n_time) of the shapes `angles` and `rates` (n - 1, n_time) at another delta, and the model B (n, n): in
   the same arrays those at the end, `out` and the totals there, and the number of iterations, or -1: no memory. `fresh`: B is the
   identity. */
long long colloc_minimize(
    const Search *s, double *v, const double *angles, const double *rates, double from_delta, double *z, double *B, int fresh, double *out,
    double *totals)
{
    const int n = (int)s->n, m = (int)(s->n_formula + s->n_shape_row + (s->target != NULL));
    const size_t squares = (size_t)(n * n), shapes = (size_t)((s->n_link - 1) * s->n_time), wide = (size_t)(n + 1) * (size_t)(n + 1 + m);
    const size_t sizes[] = {
        (size_t)((s->n_link - 1) * s->n_function), (size_t)(m * n), (size_t)n, (size_t)(m * n), (size_t)(s->n_formula * TOTALS),
        (size_t)s->n_formula * 2 * shapes, (size_t)(s->n_formula * s->n_time), (size_t)n + 1, (size_t)n + 1, (size_t)m, wide};
    size_t room = 0;
    for (size_t k = 0; k < sizeof sizes / sizeof *sizes; ++k)
        room += sizes[k];
    double *memory = malloc((room + 2 * point_size(s, (size_t)m) + active_set_size(n + 1) + 3 * (size_t)n + (size_t)m) * sizeof *memory), *at = memory;
    if (!memory)
        return -1;
    Work work = {.B = B}, *w = &work;
    double **const places[] = {
        &work.table, &work.slopes, &work.gradient, &work.row_slopes, &work.on, &work.on_shape, &work.on_pace, &work.change, &work.d,
        &work.on_rows, &work.wide};
    for (size_t k = 0; k < sizeof sizes / sizeof *sizes; ++k)
        *places[k] = at, at += sizes[k];
    Point points[2], *here = points, *there = points + 1;
    for (int k = 0; k < 2; ++k, at += point_size(s, (size_t)m))
        new_point(s, (size_t)m, points + k, at);
    new_active_set(&work.active, n + 1, at);
    at += active_set_size(n + 1);
    double *low = at, *high = low + n, *turn = high + n, *price = turn + n;
    memset(price, 0, (size_t)m * sizeof *price);
    for (int i = 0; i < n; ++i) {
        here->v[i] = fmin(fmax(v[i], s->low[i]), s->high[i]);
        low[i] = fmax(s->low[i], here->v[i] - s->radius), high[i] = fmin(s->high[i], here->v[i] + s->radius);
    }
    evaluate_point(s, w, angles, rates, from_delta, z, here);
    differentiate(s, w, here);
    long long count = 0;
    const double feasible = fmax(s->accuracy, FEASIBLE);
    while (count < s->iterations) {
        double share, violations = 0.0, outside = 0.0;
        bool moved = false;
        ++count;
        const bool step = quadratic_step(s, w, here, m, low, high, &share);
        if (step) {
            for (int k = 0; k < m; ++k) {
                price[k] = fmax(fabs(w->on_rows[k]), 0.5 * (price[k] + fabs(w->on_rows[k])));
                violations += price[k] * here->outside[k], outside += here->outside[k];
            }
            const double change = dot(n, w->gradient, w->d), model = change - share * violations;
            if (fabs(change) + violations < s->accuracy && outside < feasible)
                break;
            double size = 1.0;
            for (int trial = 0; trial < MOST_TRIALS && !moved; ++trial) {
                for (int i = 0; i < n; ++i)
                    there->v[i] = here->v[i] + size * w->d[i];
                evaluate_point(s, w, here->angles, here->rates, s->delta, here->z, there);
                const double rise = there->objective + dot(m, price, there->outside) - here->objective - violations;
                moved = rise <= 0.1 * size * model;
                if (!moved)
                    size *= fmin(fmax(0.5 * size * model / (size * model - rise), 0.1), 0.5);
            }
        }
        if (!moved) {
            if (fresh)
                break;
            fresh = true;
            memset(B, 0, squares * sizeof *B);
            for (int i = 0; i < n; ++i)
                B[i * n + i] = 1.0;
            continue;
        }
        fresh = false;
        for (int i = 0; i < n; ++i)
            turn[i] = w->gradient[i];
        memcpy(w->slopes, w->row_slopes, (size_t)(m * n) * sizeof *w->slopes);
        differentiate(s, w, there);
        for (int i = 0; i < n; ++i) {
            turn[i] = w->gradient[i] - turn[i];
            w->d[i] = there->v[i] - here->v[i];
        }
        for (int k = 0; k < m; ++k)
            for (int i = 0; i < n && w->on_rows[k] != 0.0; ++i)
                turn[i] += w->on_rows[k] * (w->row_slopes[k * n + i] - w->slopes[k * n + i]);
        update_curvature(n, B, w->d, turn, w->change);
        const double gain = fabs(there->objective - here->objective);
        Point *last = here;
        here = there, there = last, outside = 0.0;
        for (int k = 0; k < m; ++k)
            outside += here->outside[k];
        if (gain < s->accuracy && outside < feasible)
            break;
    }
    memcpy(v, here->v, (size_t)n * sizeof *v);
    memcpy(z, here->z, 3 * (size_t)s->n_time * sizeof *z), memcpy(out, here->out, OUTPUTS * (size_t)s->n_time * sizeof *out);
    memcpy(totals, here->totals, sizeof here->totals);
    free(memory);
    return count;
}
