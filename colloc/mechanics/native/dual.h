/* Numbers that carry their derivatives with respect to vs and vn: colloc/numerics/expression.py, for one number. */

#pragma once

#include <math.h>

typedef struct {
    double v, s, n;
} Dual;

static inline Dual constant(double v)
{
    return (Dual){v, 0.0, 0.0};
}

static inline Dual scaled(Dual a, double value, double slope)
{
    return (Dual){value, slope * a.s, slope * a.n};
}

static inline Dual add(Dual a, Dual b)
{
    return (Dual){a.v + b.v, a.s + b.s, a.n + b.n};
}

static inline Dual sub(Dual a, Dual b)
{
    return (Dual){a.v - b.v, a.s - b.s, a.n - b.n};
}

static inline Dual mul(Dual a, Dual b)
{
    return (Dual){a.v * b.v, b.v * a.s + a.v * b.s, b.v * a.n + a.v * b.n};
}

static inline Dual quotient(Dual a, Dual b)
{
    const double value = a.v / b.v;
    return (Dual){value, (a.s - value * b.s) / b.v, (a.n - value * b.n) / b.v};
}

static inline Dual power(Dual a, double c)
{
    return scaled(a, pow(a.v, c), c == 0 ? 0.0 : c * pow(a.v, c - 1.0));
}

static inline Dual dual_sqrt(Dual a)
{
    const double root = sqrt(a.v);
    return scaled(a, root, 0.5 / root);
}

static inline Dual dual_exp(Dual a)
{
    const double value = exp(a.v);
    return scaled(a, value, value);
}

static inline Dual dual_log(Dual a)
{
    return scaled(a, log(a.v), 1.0 / a.v);
}

static inline Dual dual_tanh(Dual a)
{
    const double value = tanh(a.v);
    return scaled(a, value, 1.0 - value * value);
}

static inline Dual dual_fabs(Dual a)
{
    return scaled(a, fabs(a.v), a.v < 0 ? -1.0 : 1.0);
}
