/* Sine, cosine and logarithm in operations that round alike on every processor, of one number or of several side by side: the
   algorithms and coefficients of fdlibm (Sun Microsystems, 1993), within 1 ulp. The C library's choose their own by processor, and
   serve where these do not reach. */

#define HALF_PI_HIGH 1.57079632673412561417e+00 /* 33 bits, so that its multiples are exact */
#define HALF_PI_LOW 6.07710050650619224932e-11
#define FAR_ANGLE 1e5
#define TO_INTEGER 6755399441055744.0 /* 1.5 * 2^52: adding it rounds, and leaves the integer in the lowest bits */

static inline void find_direction(Real angle, Real *cosine, Real *sine)
{
    const Real shifted = angle * 0.63661977236758134308 + TO_INTEGER, turns = shifted - TO_INTEGER; /* quarter turns */
    const Real rest = angle - turns * HALF_PI_HIGH, low = turns * HALF_PI_LOW, y = rest - low, tail = (rest - y) - low;
    const Real z = y * y, z2 = z * z, zy = z * y, half = 0.5 * z, one = 1.0 - half;
    const Real sine_sum = 8.33333333332248946124e-03 +
        z * (-1.98412698298579493134e-04 + z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)));
    const Real cosine_sum = z * (4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * 2.48015872894767294178e-05)) +
        z2 * z2 * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11));
    const Real s = y - ((z * (0.5 * tail - zy * sine_sum) - tail) - zy * -1.66666666666666324348e-01);
    const Real c = one + (((1.0 - one) - half) + (z * cosine_sum - y * tail));
    const Bits quarter = BITS(shifted);
    *sine = SELECT((quarter & 1) != 0, c, s), *cosine = SELECT((quarter & 1) != 0, s, c);
    *sine = SELECT((quarter & 2) != 0, -*sine, *sine), *cosine = SELECT(((quarter + 1) & 2) != 0, -*cosine, *cosine);
    if (ANY(fabs(angle) > FAR_ANGLE))
        *sine = sin(angle), *cosine = cos(angle);
}

/* x = 2^k (1 + f), with 1 + f from sqrt(1/2) to sqrt(2). */
static inline Real logarithm(Real x)
{
    const Bits bits = BITS(x) + 0x95f6200000000ULL;
    const Real k = NUMBER((bits >> 52) | 0x4330000000000000ULL) - 4503599627371519.0; /* 2^52 + 1023 */
    const Real f = NUMBER((bits & 0xfffffffffffffULL) + 0x3fe6a09e00000000ULL) - 1.0;
    const Real s = f / (2.0 + f), z = s * s, w = z * z, half = 0.5 * f * f;
    const Real even = w * (3.999999999940941908e-01 + w * (2.222219843214978396e-01 + w * 1.531383769920937332e-01));
    const Real odd = z * (6.666666666666735130e-01 + w * (2.857142874366239149e-01 + w * (1.818357216161805012e-01 + w * 1.479819860511658591e-01)));
    const Real value = k * 6.93147180369123816490e-01 - ((half - (s * (half + (even + odd)) + k * 1.90821492927058770002e-10)) - f);
    if (ANY((x < DBL_MIN) | (x > DBL_MAX)))
        return log(x);
    return value + (x - x); /* not a number where x is none */
}
