/* Units of a `Law` that is stated as formulas, from its fields `largest` and `degree`. */

#pragma once

/* The speed in whose units balances are solved: the law need not be homogeneous. */
static inline double speed_unit_of(double largest_rate)
{
    (void)largest_rate;
    return 1.0;
}

/* Friction on a body that moves at the largest rate, see `force_unit` in colloc/mechanics/damped_newton.py. */
static inline double unit_of_force(const Law *law, double delta, double largest_rate)
{
    const double degree = isnan(law->degree) ? 1.0 : law->degree;
    const double speed = isnan(law->degree) ? 1.0 : largest_rate;
    return law->largest * pow(speed, degree) * pow(hypot(1.0, delta / speed), degree - 1.0);
}
