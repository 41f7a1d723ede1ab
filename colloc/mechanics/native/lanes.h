/* LANES instants side by side: `parts.h`, `chain.h` and `period.h` once more, of vectors that the compiler lays out for the processor.
   The same operations in the same order on every processor, so results do not depend on it. */

#define NAMED_WITH(name, lanes) name##_##lanes
#define NAMED_SO(name, lanes) NAMED_WITH(name, lanes)
#define NAMED(name) NAMED_SO(name, LANES)
#define Lanes NAMED(Lanes)
#define LaneBits NAMED(LaneBits)
#define Mask NAMED(Mask)
#define lane_select NAMED(lane_select)
#define lane_any NAMED(lane_any)
#define lane_fabs NAMED(lane_fabs)
#define lane_fmax NAMED(lane_fmax)
#define lane_sqrt NAMED(lane_sqrt)
#define lane_log NAMED(lane_log)
#define lane_cos NAMED(lane_cos)
#define lane_sin NAMED(lane_sin)
#define lane_load NAMED(lane_load)
#define lane_store NAMED(lane_store)
#define inverse3 NAMED(inverse3)
#define lane_largest NAMED(lane_largest)
#define Room NAMED(Room)
#define new_lanes NAMED(new_lanes)
#define lane_balance NAMED(lane_balance)
#define lane_instants NAMED(lane_instants)
#define predict_tail NAMED(predict_tail)
#define pull_to_shape NAMED(pull_to_shape)
#define colloc_period NAMED(colloc_period)
#define colloc_period_vjp NAMED(colloc_period_vjp)
#define colloc_balances NAMED(colloc_balances)
#define Vector3 NAMED(Vector3)
#define Matrix3 NAMED(Matrix3)
#define PartSliding NAMED(PartSliding)
#define Sliding NAMED(Sliding)
#define Link NAMED(Link)
#define Total NAMED(Total)
#define find_direction NAMED(find_direction)
#define logarithm NAMED(logarithm)
#define tangential NAMED(tangential)
#define stretch NAMED(stretch)
#define h_series NAMED(h_series)
#define find_roots_of_part NAMED(find_roots_of_part)
#define find_force_of_part NAMED(find_force_of_part)
#define dissipation_of_part NAMED(dissipation_of_part)
#define find_slopes_of_part NAMED(find_slopes_of_part)
#define new_slidings NAMED(new_slidings)
#define find_roots NAMED(find_roots)
#define find_force NAMED(find_force)
#define dissipation NAMED(dissipation)
#define find_slopes NAMED(find_slopes)
#define find_directions NAMED(find_directions)
#define outer_force NAMED(outer_force)
#define find_midpoints NAMED(find_midpoints)
#define pass_on NAMED(pass_on)
#define set_velocity NAMED(set_velocity)
#define find_velocities NAMED(find_velocities)
#define link_velocity NAMED(link_velocity)
#define tail_velocity NAMED(tail_velocity)
#define find_velocities_from_tail NAMED(find_velocities_from_tail)
#define load_power NAMED(load_power)
#define evaluate NAMED(evaluate)
#define pull_back NAMED(pull_back)

typedef double Lanes __attribute__((vector_size(8 * LANES)));
typedef unsigned long long LaneBits __attribute__((vector_size(8 * LANES)));
typedef long long Mask __attribute__((vector_size(8 * LANES)));

static inline Lanes lane_select(Mask condition, Lanes yes, Lanes no)
{
    return (Lanes)((condition & (Mask)yes) | (~condition & (Mask)no));
}

static inline bool lane_any(Mask condition)
{
    long long any = 0;
    for (int i = 0; i < LANES; ++i)
        any |= condition[i];
    return any != 0;
}

static inline Lanes lane_fabs(Lanes a)
{
    return (Lanes)((Mask)a & 0x7fffffffffffffffLL);
}

static inline Lanes lane_fmax(Lanes a, Lanes b)
{
    return lane_select(a > b, a, b);
}

#define LANE_BY_LANE(function) \
    static inline Lanes lane_##function(Lanes a) \
    { \
        for (int i = 0; i < LANES; ++i) \
            a[i] = (function)(a[i]); \
        return a; \
    }
LANE_BY_LANE(sqrt)
LANE_BY_LANE(log)
LANE_BY_LANE(cos)
LANE_BY_LANE(sin)

/* At times t to t + LANES of a row of n_time; beyond its end those of the last. */
static inline Lanes lane_load(const double *row, ptrdiff_t t, ptrdiff_t n_time)
{
    Lanes a = {0.0};
    if (t + LANES <= n_time)
        memcpy(&a, row + t, sizeof a);
    for (int i = 0; i < LANES && t + LANES > n_time; ++i)
        a[i] = row[t + i < n_time ? t + i : n_time - 1];
    return a;
}

static inline void lane_store(double *row, ptrdiff_t t, ptrdiff_t n_time, Lanes a)
{
    for (int i = 0; i < LANES && t + i < n_time; ++i)
        row[t + i] = a[i];
}

#undef ZERO
#undef SELECT
#undef ANY
#undef BITS
#undef NUMBER
#define Real Lanes
#define ZERO ((Lanes){0.0})
#define SELECT(condition, yes, no) lane_select(condition, ZERO + (yes), ZERO + (no))
#define ANY lane_any
#define Bits LaneBits
#define BITS(a) ((LaneBits)(a))
#define NUMBER(bits) ((Lanes)(bits))
#define fabs(a) lane_fabs(a)
#define sqrt(a) lane_sqrt(a)
#define log(a) lane_log(a)
#define cos(a) lane_cos(a)
#define sin(a) lane_sin(a)

#undef CHAIN_H
#include "chain.h"

#include "period.h"
