/* Several instants side by side: `parts.h` and `chain.h` once more, of vectors that the compiler lays out for the processor. The
   same operations in the same order on every processor, so results do not depend on it. */

#pragma once

#define LANES 4

typedef double Lanes __attribute__((vector_size(8 * LANES)));
typedef long long Mask __attribute__((vector_size(8 * LANES)));

#define inline inline __attribute__((always_inline))

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
            a[i] = function(a[i]); \
        return a; \
    }
LANE_BY_LANE(sqrt)
LANE_BY_LANE(log)
LANE_BY_LANE(cos)
LANE_BY_LANE(sin)

/* At times t to t + LANES of a row of n_time; beyond its end those of the last. */
static inline Lanes lane_load(const double *row, ptrdiff_t t, ptrdiff_t n_time)
{
    Lanes a;
    for (int i = 0; i < LANES; ++i)
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
#define Real Lanes
#define ZERO ((Lanes){0.0})
#define SELECT(condition, yes, no) lane_select(condition, ZERO + (yes), ZERO + (no))
#define ANY lane_any
#define fabs(a) lane_fabs(a)
#define sqrt(a) lane_sqrt(a)
#define log(a) lane_log(a)
#define cos(a) lane_cos(a)
#define sin(a) lane_sin(a)

#define Vector3 LaneVector3
#define Matrix3 LaneMatrix3
#define PartSliding LanePartSliding
#define Sliding LaneSliding
#define Link LaneLink
#define Total LaneTotal
#define tangential lane_tangential
#define stretch lane_stretch
#define h_series lane_h_series
#define find_roots_of_part lane_find_roots_of_part
#define find_force_of_part lane_find_force_of_part
#define dissipation_of_part lane_dissipation_of_part
#define find_slopes_of_part lane_find_slopes_of_part
#define new_slidings lane_new_slidings
#define find_roots lane_find_roots
#define find_force lane_find_force
#define dissipation lane_dissipation
#define find_slopes lane_find_slopes
#define find_directions lane_find_directions
#define outer_force lane_outer_force
#define find_midpoints lane_find_midpoints
#define pass_on lane_pass_on
#define set_velocity lane_set_velocity
#define find_velocities lane_find_velocities
#define link_velocity lane_link_velocity
#define tail_velocity lane_tail_velocity
#define find_velocities_from_tail lane_find_velocities_from_tail
#define load_power lane_load_power
#define evaluate lane_evaluate
#define pull_back lane_pull_back

#undef CHAIN_H
#include "chain.h"
