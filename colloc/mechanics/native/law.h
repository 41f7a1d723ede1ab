/* The feet and pads of a chain and their laws, and the numbers that a link is described by: one instant's, doubles, or those of
   several instants side by side, where `lanes.h` includes `parts.h` and `chain.h` again. */

#pragma once

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

/* Where a part is, seen from the link's midpoint; the direction it is turned to; its length, 0 of a foot; its weight, of a pad
   per length; and its law. */
typedef struct {
    double along, offset, cos, sin, length, pressure;
    double mu_t, mu_f, mu_b, stretch_f, stretch_b;
} Part;

typedef struct {
    int n_part;
    double largest;
    bool associated;
    const double *first; /* number of the first part of every link, and of all parts */
    const Part *part;
} Law;

/* Of `FloorContact.kernel_numbers` in colloc/mechanics/floor_contact.py. */
static Law law_of(const double *number)
{
    const int n_link = (int)number[0], n_part = (int)number[1];
    const Part *part = (const Part *)(number + 5 + n_link);
    Law law = {n_part, number[2], number[3] != 0, number + 4, part};
    return law;
}

static inline int first_part(const Law *law, int link)
{
    return (int)law->first[link];
}

static inline int last_part(const Law *law, int link)
{
    return (int)law->first[link + 1];
}

typedef double Real;
#define ZERO 0.0
#define SELECT(condition, yes, no) ((condition) ? (yes) : (no))
#define ANY(condition) (condition)

typedef unsigned long long Bits; /* of a number, and the number of bits */
static inline Bits bits_of(double a)
{
    Bits bits;
    memcpy(&bits, &a, sizeof bits);
    return bits;
}
static inline double number_of(Bits bits)
{
    double a;
    memcpy(&a, &bits, sizeof a);
    return a;
}
#define BITS(a) bits_of(a)
#define NUMBER(bits) number_of(bits)
