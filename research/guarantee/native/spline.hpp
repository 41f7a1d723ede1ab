/* Tensor products of cubic B-splines at a point: colloc/bounds/spline.py. */

#pragma once

#include "interval.hpp"

/* The four functions that live between the knots t[3] <= x <= t[4], and their slopes. No difference but of exact numbers. */
static inline void find_cubics(const double t[8], double x, Interval value[4], Interval slope[4])
{
    value[0] = 1.0;
    for (int degree = 1; degree < 4; ++degree) {
        Interval saved;
        if (degree == 3)
            for (int i = 0; i < 4; ++i) {
                const Interval left = i > 0 ? value[i - 1] / (Interval(t[i + 3]) - t[i]) : Interval();
                const Interval right = i < 3 ? value[i] / (Interval(t[i + 4]) - t[i + 1]) : Interval();
                slope[i] = (left - right) * 3.0;
            }
        for (int i = 0; i < degree; ++i) {
            const double after = t[4 + i], before = t[4 + i - degree];
            const Interval part = value[i] / (Interval(after) - before);
            value[i] = saved + (Interval(after) - x) * part;
            saved = (Interval(x) - before) * part;
        }
        value[degree] = saved;
    }
}

/* Real and imaginary part of one function and of its rate at rates (1, s), from n x n coefficients by rows (first angle by rows), real and
   imaginary parts in turn. */
static inline void find_value_and_rate(int n, const double *knots, const double *coefficients, const double point[3], const ptrdiff_t at[2],
                                       Interval value[2], Interval rate[2])
{
    Interval one[4], two[4], slope_one[4], slope_two[4];
    find_cubics(knots + at[0], point[0], one, slope_one);
    find_cubics(knots + at[1], point[1], two, slope_two);
    for (int i = 0; i < 4; ++i) {
        Interval row[2], slope[2];
        for (int j = 0; j < 4; ++j)
            for (int part = 0; part < 2; ++part) {
                const double c = coefficients[2 * ((at[0] + i) * n + at[1] + j) + part];
                row[part] += two[j] * c, slope[part] += slope_two[j] * c;
            }
        for (int part = 0; part < 2; ++part) {
            value[part] += one[i] * row[part];
            rate[part] += slope_one[i] * row[part] + one[i] * slope[part] * point[2];
        }
    }
}
