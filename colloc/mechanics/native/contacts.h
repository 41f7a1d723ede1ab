/* Limits of joints and speeds, and links that must not cross, as functions of a shape: colloc/transcription/shape_constraints.py and
   colloc/mechanics/contact.py. */

#pragma once

#include "chain.h"

enum { LINEAR, CROSSING, STRADDLING, LACKING };

/* Of a function: its kind, number of angles, number of other numbers, width of the smoothing; then, of each of its two values, the
   joints in order and the numbers. A linear one: the kind, then a slope for every joint. */
enum { KIND, ANGLES, NUMBERS, WIDTH, CONTENTS };

static double squared(double a)
{
    return a * a;
}

/* `_crossing_sum` */
static double crossing_sum(const double *angle, const double *number, double *slope)
{
    const double side = number[0], link = number[1], middle = number[2];
    const bool equal = squared(link - middle) <= squared(1e-12 * middle);
    double c, s;
    find_direction(angle[0], &c, &s);
    const double along = link * c, bend = link * link + middle * along;
    slope[0] = side * (equal ? 0.5 : bend / (bend + middle * (middle + along)));
    slope[1] = side;
    return side * (angle[1] + (equal ? 0.5 * angle[0] : atan2(link * s, middle + along))) - 3.14159265358979323846;
}

/* Places of the joints on the way to the farther end, and their sum. */
static void find_way(int n, const double *angle, const double *length, double *x, double *y, double sum[2])
{
    double turn = 0.0, c, s;
    sum[0] = sum[1] = 0.0;
    for (int i = 0; i < n; ++i) {
        find_direction(turn += angle[i], &c, &s);
        sum[0] += x[i] = length[i] * c, sum[1] += y[i] = length[i] * s;
    }
}

/* `_straddling` */
static double straddling(int n, const double *angle, const double *length, double smoothing, double *slope)
{
    double x[n], y[n], sum[2], ahead = 0.0;
    find_way(n, angle, length, x, y, sum);
    const double half = 0.5 * y[n - 1], mean = sum[1] - half, square = mean * mean + smoothing * smoothing;
    const double on_mean = -mean * (square + smoothing * smoothing) / (square * sqrt(square));
    const double on_half = half / sqrt(half * half + smoothing * smoothing) - on_mean;
    for (int i = n - 1; i >= 0; --i)
        ahead += x[i], slope[i] = on_mean * ahead + on_half * 0.5 * x[n - 1];
    return sqrt(half * half + smoothing * smoothing) - mean * mean / sqrt(square);
}

/* `_lacking` */
static double lacking(int n, const double *angle, const double *number, double *slope)
{
    const double w = number[0], length = number[1];
    double x[n], y[n], sum[2], ahead_x = 0.0, ahead_y = 0.0;
    find_way(n, angle, number + 2, x, y, sum);
    const double outside = fmin(-sum[0], 0.0) + fmax(-sum[0] - length, 0.0);
    for (int i = n - 1; i >= 0; --i)
        ahead_x += x[i], ahead_y += y[i], slope[i] = -(outside * ahead_y + sum[1] * ahead_x) / w;
    return (w * w - (outside * outside + sum[1] * sum[1])) / (2.0 * w);
}

static double contact_value(const double *f, const double *angle, const double *number, double *slope)
{
    const int n = (int)f[ANGLES];
    return f[KIND] == CROSSING ? crossing_sum(angle, number, slope) :
        f[KIND] == STRADDLING  ? straddling(n, angle, number, f[WIDTH], slope) :
                                 lacking(n, angle, number, slope);
}

/* A function at a shape of n joints, and its slopes unless NULL. The tangent plane of its minimum where the
   share of its first value is given, which is left there; a negative one is found. */
static double shape_function(int n, const double *f, const double *shape, double *share, double *slopes)
{
    double value = 0.0, pair[2], slope[2][n], angle[n];
    if (f[KIND] == LINEAR) {
        for (int j = 0; j < n; ++j) {
            value += f[1 + j] * shape[j];
            if (slopes)
                slopes[j] = f[1 + j];
        }
        return value;
    }
    const int count = (int)f[ANGLES], numbers = (int)f[NUMBERS];
    const double width = f[WIDTH], *side = f + CONTENTS;
    for (int k = 0; k < 2; ++k, side += count + numbers) {
        for (int i = 0; i < count; ++i)
            angle[i] = shape[(int)side[i]];
        pair[k] = contact_value(f, angle, side + count, slope[k]);
    }
    const double gap = pair[0] - pair[1], spread = sqrt(gap * gap + width * width), held = *share, other = 1.0 - held;
    if (held < 0) {
        value = 0.5 * (pair[0] + pair[1]) - 0.5 * (spread - width);
        *share = 0.5 - 0.5 * gap / spread;
    } else
        value = held * pair[0] + other * pair[1] + width * (0.5 - sqrt(held * other));
    if (!slopes)
        return value;
    for (int j = 0; j < n; ++j)
        slopes[j] = 0.0;
    side = f + CONTENTS;
    for (int k = 0; k < 2; ++k, side += count + numbers)
        for (int i = 0; i < count; ++i)
            slopes[(int)side[i]] += (k ? 1.0 - *share : *share) * slope[k][i];
    return value;
}
