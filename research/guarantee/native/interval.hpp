/* Numbers known to within bounds: every operation's result holds the exact result for all numbers that its operands hold. Arithmetic
   is rounded to nearest and then moved outwards by more than that may have lost; sin, cos and log may be off by four units in the
   last place (glibc states one). `a < b` says that it is so for all numbers that they hold. */

#pragma once

#include <math.h>

/* Set where something is undefined for a number held: what is stated of the cell then is void. */
static thread_local bool undefined;

static inline double above(double x)
{
    return x + (fabs(x) * 1.2e-16 + 1e-300);
}

static inline double below(double x)
{
    return x - (fabs(x) * 1.2e-16 + 1e-300);
}

static inline double larger(double a, double b)
{
    return a > b ? a : b;
}

static inline double smaller(double a, double b)
{
    return a < b ? a : b;
}

struct Interval {
    double lo, hi;
    Interval() : lo(0.0), hi(0.0) {}
    Interval(double exact) : lo(exact), hi(exact) {}
    Interval(double least, double most) : lo(least), hi(most) {}
    double middle() const { return 0.5 * (lo + hi); }
};

static inline Interval operator-(Interval a)
{
    return {-a.hi, -a.lo};
}

static inline Interval operator+(Interval a, Interval b)
{
    return {below(a.lo + b.lo), above(a.hi + b.hi)};
}

static inline Interval operator-(Interval a, Interval b)
{
    return {below(a.lo - b.hi), above(a.hi - b.lo)};
}

static inline Interval operator*(Interval a, Interval b)
{
    const double p = a.lo * b.lo, q = a.lo * b.hi, r = a.hi * b.lo, s = a.hi * b.hi;
    return {below(smaller(smaller(p, q), smaller(r, s))), above(larger(larger(p, q), larger(r, s)))};
}

static inline Interval operator/(Interval a, Interval b)
{
    if (!(b.lo > 1e-60 || b.hi < -1e-60)) {
        undefined = true;
        return {};
    }
    return a * Interval(below(1.0 / b.hi), above(1.0 / b.lo));
}

static inline Interval &operator+=(Interval &a, Interval b)
{
    return a = a + b;
}

static inline Interval &operator-=(Interval &a, Interval b)
{
    return a = a - b;
}

static inline Interval &operator*=(Interval &a, Interval b)
{
    return a = a * b;
}

static inline bool operator<(Interval a, Interval b)
{
    return a.hi < b.lo;
}

static inline bool operator>(Interval a, Interval b)
{
    return a.lo > b.hi;
}

static inline Interval most_of(Interval a, Interval b)
{
    return {larger(a.lo, b.lo), larger(a.hi, b.hi)};
}

static inline Interval least_of(Interval a, Interval b)
{
    return {smaller(a.lo, b.lo), smaller(a.hi, b.hi)};
}

static inline Interval size_of(Interval a)
{
    return {larger(larger(a.lo, -a.hi), 0.0), larger(-a.lo, a.hi)};
}

static inline Interval square(Interval a)
{
    const Interval size = size_of(a);
    return {larger(below(size.lo * size.lo), 0.0), above(size.hi * size.hi)};
}

/* Of what cannot be negative, though rounding may have moved it there. */
static inline Interval root(Interval a)
{
    if (!(a.hi >= 0.0)) {
        undefined = true;
        return {};
    }
    return {larger(below(sqrt(larger(a.lo, 0.0))), 0.0), above(sqrt(a.hi))};
}

static inline Interval norm_of(Interval x, Interval y)
{
    return root(square(x) + square(y));
}

static inline Interval widened(double least, double most)
{
    return {least - (fabs(least) * 1e-15 + 1e-300), most + (fabs(most) * 1e-15 + 1e-300)};
}

static inline Interval sine_of(double angle)
{
    return widened(sin(angle), sin(angle));
}

static inline Interval cosine_of(double angle)
{
    return widened(cos(angle), cos(angle));
}

static inline Interval log_of(Interval a)
{
    if (!(a.lo > 0.0)) {
        undefined = true;
        return {};
    }
    return widened(log(a.lo), log(a.hi));
}

/* asinh of y/v, v > 0: the logarithm of a number of at least 1, so that nothing cancels. */
static inline Interval arc_of(Interval y, Interval v)
{
    const Interval size = size_of(y / v), arc = log_of(size + root(square(size) + 1.0));
    return y.hi <= 0.0 ? -arc : y.lo >= 0.0 ? arc : Interval(-arc.hi, arc.hi);
}

typedef Interval Vector3[3];
typedef Vector3 TwoRows[2];
typedef Vector3 Matrix3[3];
